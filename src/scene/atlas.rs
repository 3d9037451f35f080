//! All images of a scene in the layers of one texture array, and the materials that refer to them.
//!
//! One binding serves any number of images of any size, without descriptor indexing. Wrapping and filtering are the
//! shader's work (`glsl/include/texture.glsl`), so images need no borders and touch each other.

use super::{AlphaMode, Image, Material, Scene, TextureRef, Wrap};
use crate::shaders::{self, TextureSlot};
use crate::{Error, Result};
use guillotiere::{AtlasAllocator, Rectangle, size2};

/// Images packed into layers.
#[derive(Debug, Clone, PartialEq)]
pub struct Atlas {
    /// Width and height of a layer in texels, powers of two.
    pub size: [u32; 2],
    /// Number of layers, at least 1.
    pub layers: u32,
    /// RGBA, layer by layer, each row by row from the top: `layers * size[0] * size[1]` texels. Texels of no image are 0.
    pub texels: Vec<[u8; 4]>,
    /// Where each image went.
    pub places: Vec<Place>,
}

/// Where an image is in an [`Atlas`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Layer.
    pub layer: u32,
    /// Column of the image's first texel.
    pub x: u32,
    /// Row of the image's first texel.
    pub y: u32,
}

/// Layers of 2048 texels a side hold most scenes' images with little waste; larger ones only for larger images.
const USUAL_SIDE: u32 = 2048;
const ADVICE: &str = "scale the scene's images down";

impl Atlas {
    /// Packs `images` into layers of at most `max_dimension` texels a side, at most `max_layers` of them.
    ///
    /// A layer is as small as holds the largest image, and for a few small images no larger than they need together.
    ///
    /// # Errors
    ///
    /// [`Error::TooLarge`] for an image larger than a layer can be, and for images that together need too many layers.
    pub fn pack(images: &[Image], max_dimension: u32, max_layers: u32) -> Result<Self> {
        // Texel origins and sizes are 16 bits each in the material records.
        let limit = largest_power_of_two(max_dimension.min(1 << 15));
        if let Some(image) = images.iter().find(|i| i.width.max(i.height) > limit) {
            return Err(too_large(
                format!("image '{}' of {} x {} texels", image.name, image.width, image.height),
                u64::from(image.width.max(image.height)) * 4,
                u64::from(limit) * 4,
                "maxImageDimension2D",
            ));
        }
        let size = layer_size(images, limit);
        let (places, layers) = place(images, size);
        if layers > max_layers {
            let layer_bytes = u64::from(size[0]) * u64::from(size[1]) * 4;
            let (needed, limit) = (u64::from(layers) * layer_bytes, u64::from(max_layers) * layer_bytes);
            return Err(too_large("the texture atlas".to_owned(), needed, limit, "maxImageArrayLayers"));
        }
        let mut atlas = Self { size, layers, texels: Vec::new(), places };
        atlas.texels = vec![[0; 4]; layers as usize * size[0] as usize * size[1] as usize];
        for (i, image) in images.iter().enumerate() {
            atlas.copy(image, atlas.places[i]);
        }
        Ok(atlas)
    }

    /// The texel at column `x` and row `y` of a layer.
    pub fn texel(&self, layer: u32, x: u32, y: u32) -> [u8; 4] {
        self.texels[self.index(layer, x, y)]
    }

    fn index(&self, layer: u32, x: u32, y: u32) -> usize {
        (layer as usize * self.size[1] as usize + y as usize) * self.size[0] as usize + x as usize
    }

    fn copy(&mut self, image: &Image, place: Place) {
        let width = image.width as usize;
        for (y, row) in image.texels.chunks_exact(width).enumerate() {
            let start = self.index(place.layer, place.x, place.y + y as u32);
            self.texels[start..start + width].copy_from_slice(row);
        }
    }
}

fn too_large(what: String, needed: u64, limit: u64, limit_name: &'static str) -> Error {
    Error::TooLarge { what, needed, limit, limit_name, advice: ADVICE.to_owned() }
}

fn largest_power_of_two(n: u32) -> u32 {
    1 << n.max(1).ilog2()
}

/// As large as the largest image and, if all fit into one layer of the usual size, as all together are about to need.
fn layer_size(images: &[Image], limit: u32) -> [u32; 2] {
    let side = |of: fn(&Image) -> u32| images.iter().map(of).max().unwrap_or(1).max(1).next_power_of_two();
    let mut size = [side(|i| i.width), side(|i| i.height)];
    let area: u64 = images.iter().map(|i| u64::from(i.width) * u64::from(i.height)).sum();
    let usual = USUAL_SIDE.min(limit);
    while area > u64::from(size[0]) * u64::from(size[1]) && size[0].min(size[1]) < usual {
        let shorter = usize::from(size[1] < size[0]);
        size[shorter] *= 2;
    }
    size
}

/// Places every image, the largest first, in the first layer that has room; returns the number of layers as well.
fn place(images: &[Image], size: [u32; 2]) -> (Vec<Place>, u32) {
    let mut order: Vec<usize> = (0..images.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(images[i].height.max(images[i].width)), i));
    let mut layers: Vec<AtlasAllocator> = Vec::new();
    let mut places = vec![Place { layer: 0, x: 0, y: 0 }; images.len()];
    for i in order {
        let wanted = size2(images[i].width as i32, images[i].height as i32);
        let found = layers.iter_mut().enumerate().find_map(|(l, a)| Some((l, a.allocate(wanted)?.rectangle)));
        let (layer, rectangle) = found.unwrap_or_else(|| {
            let mut fresh = AtlasAllocator::new(size2(size[0] as i32, size[1] as i32));
            // An empty layer holds every image, since none is larger than a layer; at its origin if it is asked oddly.
            let rectangle = fresh.allocate(wanted).map_or_else(Rectangle::zero, |a| a.rectangle);
            layers.push(fresh);
            (layers.len() - 1, rectangle)
        });
        places[i] = Place { layer: layer as u32, x: rectangle.min.x as u32, y: rectangle.min.y as u32 };
    }
    (places, layers.len().max(1) as u32)
}

/// Linear values of the 256 sRGB codes (IEC 61966-2-1), each rounded once: what the shader looks up before it filters.
pub fn srgb_table() -> Vec<f32> {
    (0..256).map(|code| super::color::srgb_to_linear(f64::from(code) / 255.0) as f32).collect()
}

/// The materials of a scene as the shaders read them, in the scene's order.
pub fn material_records(scene: &Scene, atlas: &Atlas) -> Vec<shaders::Material> {
    scene.materials.iter().map(|m| material_record(m, scene, atlas)).collect()
}

fn material_record(material: &Material, scene: &Scene, atlas: &Atlas) -> shaders::Material {
    let slot = |texture: &Option<TextureRef>| texture.as_ref().map_or_else(Default::default, |t| slot(t, scene, atlas));
    let (alpha_flags, alpha_cutoff) = match material.alpha {
        AlphaMode::Opaque => (0, 0.0),
        AlphaMode::Mask { cutoff } => (shaders::MATERIAL_MASK, cutoff),
        AlphaMode::Blend => (shaders::MATERIAL_BLEND, 0.0),
    };
    let flag = |on: bool, bit: u32| if on { bit } else { 0 };
    shaders::Material {
        base_color: material.base_color.to_array(),
        emissive: material.emissive.to_array(),
        metallic: material.metallic,
        roughness: material.roughness,
        normal_scale: material.normal_scale,
        occlusion_strength: material.occlusion_strength,
        alpha_cutoff,
        flags: alpha_flags
            | flag(material.double_sided, shaders::MATERIAL_DOUBLE_SIDED)
            | flag(material.unlit, shaders::MATERIAL_UNLIT)
            | flag(material.transmits(), shaders::MATERIAL_TRANSMITS)
            | flag(material.volume.is_some(), shaders::MATERIAL_SOLID),
        index: material.ior,
        exponent: material.exponent,
        absorption: material.volume.unwrap_or_default().to_array(),
        transmission: material.transmission,
        transmission_texture: slot(&material.transmission_texture),
        dielectric: reflectance(material.ior),
        base_color_texture: slot(&material.base_color_texture),
        metallic_roughness_texture: slot(&material.metallic_roughness_texture),
        normal_texture: slot(&material.normal_texture),
        occlusion_texture: slot(&material.occlusion_texture),
        emissive_texture: slot(&material.emissive_texture),
    }
}

/// Reflectance at normal incidence of what has an index of refraction against air (KHR_materials_ior).
fn reflectance(ior: f32) -> f32 {
    let ior = f64::from(ior);
    ((ior - 1.0) / (ior + 1.0)).powi(2) as f32
}

fn slot(texture: &TextureRef, scene: &Scene, atlas: &Atlas) -> TextureSlot {
    let sampler = scene.textures[texture.texture];
    let (place, image) = (atlas.places[sampler.image], &scene.images[sampler.image]);
    let (linear, offset) = (texture.transform.matrix2, texture.transform.translation);
    let wrap = |w: Wrap| match w {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    };
    TextureSlot {
        transform: [linear.x_axis.x, linear.y_axis.x, linear.x_axis.y, linear.y_axis.y],
        offset: offset.to_array(),
        texel_origin: place.x | place.y << 16,
        texel_size: image.width | image.height << 16,
        page: place.layer,
        flags: wrap(sampler.wrap_u)
            | wrap(sampler.wrap_v) << 2
            | u32::from(sampler.nearest) << 4
            | u32::from(texture.uv_set == 1) << 5,
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Texture;
    use glam::{Affine2, Vec2};
    use proptest::prelude::*;

    /// An image whose texels say which image they are of, and where.
    fn image(id: usize, width: u32, height: u32) -> Image {
        let texel = |i: u32| [1 + id as u8, (i % width) as u8, (i / width) as u8, (i >> 8) as u8];
        Image { name: format!("{id}"), width, height, texels: (0..width * height).map(texel).collect() }
    }

    /// Whether every texel of every image is at its place, and no two images share a texel of the atlas.
    fn is_packed(atlas: &Atlas, images: &[Image]) -> bool {
        let mut used = vec![false; atlas.texels.len()];
        images.iter().zip(&atlas.places).all(|(image, place)| {
            place.x + image.width <= atlas.size[0]
                && place.y + image.height <= atlas.size[1]
                && (0..image.width * image.height).all(|i| {
                    let at = atlas.index(place.layer, place.x + i % image.width, place.y + i / image.width);
                    let fresh = !std::mem::replace(&mut used[at], true);
                    fresh && atlas.texels[at] == image.texels[i as usize]
                })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn every_texel_is_found_and_nothing_overlaps(sizes in prop::collection::vec((1u32..80, 1u32..80), 0..40)) {
            let images: Vec<Image> = sizes.iter().enumerate().map(|(i, s)| image(i, s.0, s.1)).collect();
            let atlas = Atlas::pack(&images, 128, 64).unwrap();
            prop_assert!(is_packed(&atlas, &images));
            prop_assert!(atlas.size.iter().all(|s| s.is_power_of_two() && *s <= 128));
        }
    }

    #[test]
    fn the_check_of_packing_can_fail() {
        let images = [image(0, 5, 5), image(1, 6, 3)];
        let mut atlas = Atlas::pack(&images, 64, 1).unwrap();
        assert!(is_packed(&atlas, &images));
        let whole = atlas.clone();
        atlas.places[1] = atlas.places[0];
        assert!(!is_packed(&atlas, &images));
        atlas = whole;
        let i = atlas.index(0, atlas.places[0].x + 2, atlas.places[0].y);
        atlas.texels[i][3] ^= 1;
        assert!(!is_packed(&atlas, &images));
    }

    #[test]
    fn small_scenes_get_small_atlases() {
        let none = Atlas::pack(&[], 4096, 8).unwrap();
        assert_eq!((none.size, none.layers, none.texels.len()), ([1, 1], 1, 1));
        assert_eq!(Atlas::pack(&[image(0, 2, 2)], 4096, 8).unwrap().size, [2, 2]);
        let one = Atlas::pack(&[image(0, 100, 20)], 4096, 8).unwrap();
        assert_eq!((one.size, one.layers), ([128, 32], 1));
    }

    #[test]
    fn what_does_not_fit_is_refused_by_name() {
        let message = Atlas::pack(&[image(7, 65, 3)], 64, 8).unwrap_err().to_string();
        assert!(message.contains("'7' of 65 x 3") && message.contains("maxImageDimension2D"), "{message}");
        let many: Vec<Image> = (0..3).map(|i| image(i, 64, 64)).collect();
        let message = Atlas::pack(&many, 64, 2).unwrap_err().to_string();
        assert!(message.contains("maxImageArrayLayers"), "{message}");
        assert!(Atlas::pack(&many, 64, 3).is_ok());
    }

    #[test]
    fn the_table_ends_at_zero_and_one_and_grows() {
        let table = srgb_table();
        assert_eq!((table.len(), table[0], table[255]), (256, 0.0, 1.0));
        assert!(table.windows(2).all(|w| w[0] < w[1]));
    }

    #[test]
    fn records_carry_place_wrap_filter_and_transform() {
        let mut scene = Scene { images: vec![image(0, 8, 4), image(1, 3, 5)], ..Scene::default() };
        scene.textures.push(Texture { image: 1, wrap_u: Wrap::Clamp, wrap_v: Wrap::Mirror, nearest: true });
        let transform = Affine2::from_scale_angle_translation(Vec2::new(2.0, 3.0), 0.5, Vec2::new(0.25, -1.0));
        let base_color_texture = Some(TextureRef { texture: 0, uv_set: 1, transform });
        let alpha = AlphaMode::Mask { cutoff: 0.25 };
        scene.materials.push(Material { base_color_texture, alpha, unlit: true, ..Material::default() });
        let atlas = Atlas::pack(&scene.images, 64, 4).unwrap();
        let record = material_records(&scene, &atlas)[0];
        let slot = record.base_color_texture;
        assert_eq!(slot.texel_size, 3 | 5 << 16);
        assert_eq!(slot.texel_origin, atlas.places[1].x | atlas.places[1].y << 16);
        assert_eq!(slot.flags, 2 | 1 << 2 | 1 << 4 | 1 << 5);
        let [a, b, c, d] = slot.transform;
        let uv = transform.transform_point2(Vec2::new(0.3, 0.7));
        let by_record = Vec2::new(a * 0.3 + b * 0.7, c * 0.3 + d * 0.7) + Vec2::from(slot.offset);
        assert!(uv.distance(by_record) < 1e-6);
        assert_eq!(record.flags, shaders::MATERIAL_MASK | shaders::MATERIAL_UNLIT);
        assert_eq!(record.alpha_cutoff, 0.25);
        assert_eq!(record.normal_texture, TextureSlot::default());
    }
}
