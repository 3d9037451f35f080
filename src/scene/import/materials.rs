//! Materials and their textures: only those that something in the scene uses are taken over.

use std::collections::HashMap;

use glam::{Affine2, Vec2, Vec3, Vec4};
use gltf::json;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::validation::Checked;
use json::texture::{MagFilter, WrappingMode};
use serde_json::{Map, Value};

use super::document::{Document, label, name_or};
use super::{dielectric, extras, images};
use crate::Result;
use crate::scene::{AlphaMode, Material, Scene, Texture, TextureRef, Wrap};

/// The materials taken over so far.
pub(super) struct Table<'a> {
    document: &'a Document,
    /// The scene's material for the file's, per which texture coordinates the primitive has.
    known: HashMap<(Option<usize>, [bool; 2]), u32>,
    materials: Vec<Material>,
    texture_of: HashMap<usize, usize>,
    textures: Vec<Texture>,
    image_of: HashMap<usize, usize>,
    /// Indices of images in the file, in the scene's order.
    images: Vec<usize>,
    notices: Vec<String>,
}

/// A use of a texture as the file has it.
struct Use<'a> {
    index: usize,
    tex_coord: u32,
    transform: Option<TextureTransform>,
    slot: &'a str,
}

impl<'a> Table<'a> {
    pub fn new(document: &'a Document) -> Self {
        Self {
            document,
            known: HashMap::new(),
            materials: Vec::new(),
            texture_of: HashMap::new(),
            textures: Vec::new(),
            image_of: HashMap::new(),
            images: Vec::new(),
            notices: Vec::new(),
        }
    }

    /// The scene's material for material `index` of the file (none: the default one) on a primitive that has the given
    /// sets of texture coordinates. Textures that lack theirs are left out, with a notice.
    pub fn get(&mut self, index: Option<usize>, uvs: [bool; 2], place: &str) -> Result<u32> {
        if let Some(&known) = self.known.get(&(index, uvs)) {
            return Ok(known);
        }
        let mut material = match index {
            None => Material::default(),
            Some(index) => self.import(index, place)?,
        };
        self.drop_unmapped(&mut material, uvs, place);
        let same_source = self.known.iter().filter(|((other, _), _)| *other == index);
        let found = same_source.map(|(_, &number)| number).find(|&n| self.materials[n as usize] == material);
        let number = found.unwrap_or_else(|| {
            self.materials.push(material);
            self.materials.len() as u32 - 1
        });
        self.known.insert((index, uvs), number);
        Ok(number)
    }

    /// A material that [`Table::get`] returned.
    pub fn material(&self, number: u32) -> &Material {
        &self.materials[number as usize]
    }

    /// Decodes the images and hands everything to the scene.
    pub fn finish(mut self, scene: &mut Scene) -> Result<()> {
        scene.images = images::decode(self.document, &self.images, &mut self.notices)?;
        scene.textures = self.textures;
        scene.materials = self.materials;
        scene.notices.append(&mut self.notices);
        Ok(())
    }

    fn drop_unmapped(&mut self, material: &mut Material, uvs: [bool; 2], place: &str) {
        let name = material.name.clone();
        for (slot, texture) in slots(material) {
            if let Some(set) = texture.as_ref().map(|t| t.uv_set).filter(|&set| !uvs[set as usize & 1]) {
                *texture = None;
                self.notices.push(format!(
                    "{place} has no TEXCOORD_{set}: the {slot} texture of material '{name}' is ignored there"
                ));
            }
        }
    }

    fn import(&mut self, index: usize, place: &str) -> Result<Material> {
        let document = self.document;
        let missing = || document.bad(format!("{place} uses material {index}, which does not exist: export it again"));
        let source = document.root.materials.get(index).ok_or_else(missing)?;
        let place = &label("material", index, source.name.as_deref());
        let pbr = &source.pbr_metallic_roughness;
        let extensions = source.extensions.as_ref();
        let strength = extensions.and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |s| s.emissive_strength.0);
        let emissive = Vec3::from(source.emissive_factor.0) * strength;
        let color = Vec4::from(pbr.base_color_factor.0);
        let mut material = Material {
            name: name_or("material", index, source.name.as_deref()),
            base_color: color.clamp(Vec4::ZERO, Vec4::ONE),
            metallic: pbr.metallic_factor.0.clamp(0.0, 1.0),
            roughness: pbr.roughness_factor.0.clamp(0.0, 1.0),
            emissive: emissive.max(Vec3::ZERO),
            alpha: alpha_mode(document, source, place)?,
            double_sided: source.double_sided,
            unlit: extensions.is_some_and(|e| e.unlit.is_some()),
            ..Material::default()
        };
        if let Some(extensions) = extensions {
            dielectric::import(document, extensions, place, &mut material)?;
        }
        material.exponent = extras::exponent(document, index)?;
        if let Some(normal) = &source.normal_texture {
            material.normal_scale = normal.scale;
        }
        if let Some(occlusion) = &source.occlusion_texture {
            material.occlusion_strength = occlusion.strength.0.clamp(0.0, 1.0);
        }
        let finite = color.is_finite() && emissive.is_finite() && material.normal_scale.is_finite();
        if !finite {
            return Err(document.bad(format!("{place} has a factor that is not finite: repair it")));
        }
        let changed = material.base_color != color
            || material.metallic != pbr.metallic_factor.0
            || material.roughness != pbr.roughness_factor.0
            || material.emissive != emissive;
        if changed {
            self.notices.push(format!("{place} has factors outside their ranges, which are clamped"));
        }
        self.import_textures(source, place, &mut material)?;
        Ok(material)
    }

    fn import_textures(&mut self, source: &json::Material, place: &str, material: &mut Material) -> Result<()> {
        let pbr = &source.pbr_metallic_roughness;
        let plain = [
            (&mut material.base_color_texture, &pbr.base_color_texture, "base colour"),
            (&mut material.metallic_roughness_texture, &pbr.metallic_roughness_texture, "metallic-roughness"),
            (&mut material.emissive_texture, &source.emissive_texture, "emissive"),
        ];
        for (out, info, slot) in plain {
            if let Some(info) = info {
                let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
                let used = Use { index: info.index.value(), tex_coord: info.tex_coord, transform, slot };
                *out = Some(self.texture_ref(&used, place)?);
            }
        }
        let transmission = source.extensions.as_ref().and_then(|e| e.transmission.as_ref());
        if let Some(info) = transmission.and_then(|t| t.transmission_texture.as_ref()) {
            let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
            let used = Use { index: info.index.value(), tex_coord: info.tex_coord, transform, slot: "transmission" };
            material.transmission_texture = Some(self.texture_ref(&used, place)?);
        }
        if let Some(info) = &source.normal_texture {
            let transform = self.transform(info.extensions.as_ref().map(|e| &e.others), place)?;
            let used = Use { index: info.index.value(), tex_coord: info.tex_coord, transform, slot: "normal" };
            material.normal_texture = Some(self.texture_ref(&used, place)?);
        }
        if let Some(info) = &source.occlusion_texture {
            let transform = self.transform(info.extensions.as_ref().map(|e| &e.others), place)?;
            let used = Use { index: info.index.value(), tex_coord: info.tex_coord, transform, slot: "occlusion" };
            material.occlusion_texture = Some(self.texture_ref(&used, place)?);
        }
        Ok(())
    }

    /// The crate knows the transform of plain textures only.
    fn transform(&self, others: Option<&Map<String, Value>>, place: &str) -> Result<Option<TextureTransform>> {
        let Some(value) = others.and_then(|others| others.get("KHR_texture_transform")) else { return Ok(None) };
        let parsed = serde_json::from_value(value.clone());
        parsed.map(Some).map_err(|error| {
            self.document
                .bad(format!("{place} has a KHR_texture_transform that is not valid ({error}): export it again"))
        })
    }

    fn texture_ref(&mut self, used: &Use, place: &str) -> Result<TextureRef> {
        let transform = used.transform.clone().unwrap_or_default();
        let uv_set = transform.tex_coord.unwrap_or(used.tex_coord);
        if uv_set > 1 {
            let feature = format!("TEXCOORD_{uv_set} (for its {} texture)", used.slot);
            return Err(self.document.unsupported(place, feature, "use the first two sets of texture coordinates"));
        }
        let place = format!("{place}, {} texture", used.slot);
        let (offset, scale) = (Vec2::from(transform.offset.0), Vec2::from(transform.scale.0));
        // The extension's rotation is counter-clockwise in a space whose v points down: clockwise for the formula.
        let matrix = Affine2::from_scale_angle_translation(Vec2::ONE, -transform.rotation.0, offset)
            * Affine2::from_scale(scale);
        if !matrix.is_finite() {
            return Err(self.document.bad(format!("{place} has a transform that is not finite: repair it")));
        }
        Ok(TextureRef { texture: self.texture(used.index, &place)?, uv_set, transform: matrix })
    }

    fn texture(&mut self, index: usize, place: &str) -> Result<usize> {
        if let Some(&known) = self.texture_of.get(&index) {
            return Ok(known);
        }
        let document = self.document;
        let missing = || document.bad(format!("{place} is texture {index}, which does not exist: export it again"));
        let texture = document.root.textures.get(index).ok_or_else(missing)?;
        let place = label("texture", index, texture.name.as_deref());
        let source = texture.source.value();
        if source == u32::MAX as usize {
            // The crate's mark for a texture without a source.
            return Err(match texture.extensions.as_ref().and_then(|e| e.others.keys().next()) {
                Some(extension) => document.unsupported(place, extension, "convert it to PNG or JPEG"),
                None => document.bad(format!("{place} has no source: export the file again")),
            });
        }
        let sampler = match texture.sampler {
            None => json::texture::Sampler::default(),
            Some(sampler) => document.root.samplers.get(sampler.value()).cloned().ok_or_else(|| {
                document.bad(format!("{place} uses sampler {sampler}, which does not exist: export it again"))
            })?,
        };
        let next = self.images.len();
        let image = *self.image_of.entry(source).or_insert(next);
        if image == next {
            self.images.push(source);
        }
        let wrap =
            |mode| wrap(mode).ok_or_else(|| document.bad(format!("{place} has an unknown wrap mode: export it again")));
        let nearest = matches!(sampler.mag_filter, Some(Checked::Valid(MagFilter::Nearest)));
        self.textures.push(Texture { image, wrap_u: wrap(sampler.wrap_s)?, wrap_v: wrap(sampler.wrap_t)?, nearest });
        self.texture_of.insert(index, self.textures.len() - 1);
        Ok(self.textures.len() - 1)
    }
}

/// The texture slots of a material, by name.
fn slots(material: &mut Material) -> [(&'static str, &mut Option<TextureRef>); 6] {
    [
        ("base colour", &mut material.base_color_texture),
        ("metallic-roughness", &mut material.metallic_roughness_texture),
        ("normal", &mut material.normal_texture),
        ("occlusion", &mut material.occlusion_texture),
        ("emissive", &mut material.emissive_texture),
        ("transmission", &mut material.transmission_texture),
    ]
}

fn wrap(mode: Checked<WrappingMode>) -> Option<Wrap> {
    match mode {
        Checked::Valid(WrappingMode::Repeat) => Some(Wrap::Repeat),
        Checked::Valid(WrappingMode::MirroredRepeat) => Some(Wrap::Mirror),
        Checked::Valid(WrappingMode::ClampToEdge) => Some(Wrap::Clamp),
        Checked::Invalid => None,
    }
}

fn alpha_mode(document: &Document, source: &json::Material, place: &str) -> Result<AlphaMode> {
    let cutoff = source.alpha_cutoff.unwrap_or_default().0;
    match source.alpha_mode {
        Checked::Valid(json::material::AlphaMode::Opaque) => Ok(AlphaMode::Opaque),
        Checked::Valid(json::material::AlphaMode::Blend) => Ok(AlphaMode::Blend),
        Checked::Valid(json::material::AlphaMode::Mask) if cutoff.is_finite() => Ok(AlphaMode::Mask { cutoff }),
        _ => Err(document.bad(format!("{place} has an alpha mode or cutoff that is not valid: export it again"))),
    }
}
