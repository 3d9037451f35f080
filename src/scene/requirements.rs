//! What a scene holds and which features it uses, each with the first thing that uses it: what is not in the list need
//! not be modelled.

use std::collections::BTreeMap;
use std::fmt;

use glam::{DAffine3, DVec3};
use serde::{Deserialize, Serialize};

use super::medium::{Medium, Region};
use super::{AlphaMode, Camera, ChannelValues, Light, LightKind, LightShape, Material, Scene, TextureRef, Wrap};

/// What inspecting a scene found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Requirements {
    /// How much of everything there is.
    pub contents: Contents,
    /// The features that the scene uses, in the order of [`Feature`], each once.
    pub features: Vec<Requirement>,
}

/// How much of everything a scene holds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Contents {
    /// Meshes, each counted once.
    pub meshes: usize,
    /// Triangles of the meshes, each counted once.
    pub triangles: usize,
    /// Vertices of the meshes, each counted once.
    pub vertices: usize,
    /// Meshes placed.
    pub instances: usize,
    /// Triangles placed: those of a mesh count once for each of its instances.
    pub instanced_triangles: usize,
    /// Nodes of the hierarchy.
    pub nodes: usize,
    /// Materials.
    pub materials: usize,
    /// Textures.
    pub textures: usize,
    /// Texels of all images.
    pub texels: usize,
    /// Punctual lights.
    pub lights: usize,
    /// Cameras.
    pub cameras: usize,
    /// Animations.
    pub animations: usize,
    /// Seconds that the longest animation takes; 0 if nothing is animated.
    pub duration: f64,
}

/// What of a scene decides which settings make a difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Traits {
    /// Lights that get shadow rays: punctual ones, and a map of light from all around.
    pub lights: u32,
    /// Whether there are textures.
    pub textures: bool,
    /// Whether more than the place in the pixel is sampled: a lens, a shutter's time, lights that have an extent, or a map of
    /// light from all around.
    #[serde(default = "yes")]
    pub distributed: bool,
    /// Whether light passes through something.
    #[serde(default = "yes")]
    pub transmits: bool,
    /// Whether there is fog or mist.
    #[serde(default = "yes")]
    pub medium: bool,
}

/// What a file of before says of what it did not know.
fn yes() -> bool {
    true
}

impl Traits {
    /// Those of a scene.
    pub fn of(scene: &Scene) -> Self {
        let open = |camera: &Camera| camera.lens.is_open() || camera.shutter > 0.0;
        let wide = |light: &Light| light.shape != LightShape::Sharp;
        Self {
            lights: scene.lights.len() as u32 + u32::from(scene.environment_map.is_some()),
            textures: !scene.textures.is_empty(),
            distributed: scene.cameras.iter().any(open)
                || scene.lights.iter().any(wide)
                || scene.environment_map.is_some()
                || scene.materials.iter().any(|m| m.transmits() || m.exponent > 0.0),
            transmits: scene.materials.iter().any(Material::transmits),
            medium: scene.medium.is_some_and(|medium| medium.is_seen()),
        }
    }
}

impl Default for Traits {
    /// Of a scene of which nothing is known: everything can make a difference.
    fn default() -> Self {
        Self { lights: u32::MAX, textures: true, distributed: true, transmits: true, medium: true }
    }
}

/// A feature with its cause.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Requirement {
    /// What has to be modelled.
    pub feature: Feature,
    /// The first thing that uses it, by kind and name.
    pub cause: String,
}

/// What a scene may need modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Feature {
    /// Surfaces whose colour depends on light.
    LitSurfaces,
    /// Surfaces that show their base colour as it is.
    UnlitSurfaces,
    /// Surfaces that emit light.
    EmissiveSurfaces,
    /// Surfaces cut out by an alpha threshold.
    AlphaMask,
    /// Surfaces whose alpha is coverage.
    AlphaBlend,
    /// Surfaces without a back face.
    SingleSided,
    /// Surfaces with two faces.
    DoubleSided,
    /// Linear RGBA a vertex.
    VertexColors,
    /// Base-colour textures.
    BaseColorTexture,
    /// Metallic-roughness textures.
    MetallicRoughnessTexture,
    /// Normal maps, and with them tangents.
    NormalTexture,
    /// Ambient-occlusion textures.
    OcclusionTexture,
    /// Emissive textures.
    EmissiveTexture,
    /// Transforms of texture coordinates.
    TextureTransform,
    /// A second set of texture coordinates.
    SecondUvSet,
    /// Textures that are not interpolated.
    NearestFilter,
    /// Surfaces that light passes through.
    Transmission,
    /// Textures that say where it does.
    TransmissionTexture,
    /// Surfaces that reflect by Phong's lobe.
    PhongLobe,
    /// Textures that are mirrored outside 0..1.
    MirrorWrap,
    /// Textures that end outside 0..1.
    ClampWrap,
    /// Lights that shine in all directions from a point.
    PointLights,
    /// Lights that shine in a cone.
    SpotLights,
    /// Parallel light from infinity.
    DirectionalLights,
    /// Lights that have an extent.
    AreaLights,
    /// Lights that end at some distance.
    LightRange,
    /// Uniform light from all around.
    Environment,
    /// Light from all around that differs by direction.
    EnvironmentMap,
    /// Meshes that are placed more than once.
    Instancing,
    /// Instances that are mirrored, whose triangles wind the other way.
    MirroredInstances,
    /// Instances scaled by different factors along different axes, or sheared.
    NonUniformScale,
    /// Instances that animation moves.
    MovingInstances,
    /// Lights that animation moves.
    MovingLights,
    /// Cameras that animation moves.
    MovingCameras,
    /// Cameras with an aperture, before and behind whose plane in focus things blur.
    Lens,
    /// Cameras whose shutter is open for a while, in which what moves blurs.
    MotionBlur,
    /// Meshes that a skeleton bends.
    SkinnedMeshes,
    /// Meshes with morph targets.
    MorphedMeshes,
    /// Fog or mist.
    Medium,
}

impl fmt::Display for Feature {
    /// The name in words, such as `base color texture`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, letter) in format!("{self:?}").chars().enumerate() {
            if index > 0 && letter.is_uppercase() {
                f.write_str(" ")?;
            }
            write!(f, "{}", letter.to_ascii_lowercase())?;
        }
        Ok(())
    }
}

impl Requirements {
    /// Whether the scene uses a feature.
    #[must_use]
    pub fn has(&self, feature: Feature) -> bool {
        self.cause(feature).is_some()
    }

    /// The first thing that uses a feature, by kind and name.
    #[must_use]
    pub fn cause(&self, feature: Feature) -> Option<&str> {
        self.features.iter().find(|r| r.feature == feature).map(|r| r.cause.as_str())
    }
}

/// Inspects a scene. Materials that no placed triangle has, and textures of no such material, do not count.
#[must_use]
pub fn inspect(scene: &Scene) -> Requirements {
    let mut found = Found(BTreeMap::new());
    found.materials(scene);
    found.lights(scene);
    found.instances(scene);
    found.motion(scene);
    found.cameras(scene);
    found.deformation(scene);
    let features = found.0.into_iter().map(|(feature, cause)| Requirement { feature, cause }).collect();
    Requirements { contents: contents(scene), features }
}

fn contents(scene: &Scene) -> Contents {
    Contents {
        meshes: scene.meshes.len(),
        triangles: scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum(),
        vertices: scene.meshes.iter().map(|mesh| mesh.positions.len()).sum(),
        instances: scene.instances.len(),
        instanced_triangles: scene.instances.iter().map(|i| scene.meshes[i.mesh].triangles.len()).sum(),
        nodes: scene.nodes.len(),
        materials: scene.materials.len(),
        textures: scene.textures.len(),
        texels: scene.images.iter().map(|image| image.texels.len()).sum(),
        lights: scene.lights.len(),
        cameras: scene.cameras.len(),
        animations: scene.animations.len(),
        duration: scene.duration(),
    }
}

struct Found(BTreeMap<Feature, String>);

impl Found {
    /// Notes a feature unless it has a cause already.
    fn note(&mut self, used: bool, feature: Feature, cause: impl FnOnce() -> String) {
        if used {
            self.0.entry(feature).or_insert_with(cause);
        }
    }

    fn materials(&mut self, scene: &Scene) {
        let mut used = vec![false; scene.materials.len()];
        for instance in &scene.instances {
            let mesh = &scene.meshes[instance.mesh];
            mesh.triangle_materials.iter().for_each(|&material| used[material as usize] = true);
            self.note(!mesh.colors.is_empty(), Feature::VertexColors, || format!("mesh '{}'", mesh.name));
        }
        for (material, _) in scene.materials.iter().zip(used).filter(|(_, used)| *used) {
            self.material(scene, material);
        }
    }

    fn material(&mut self, scene: &Scene, material: &Material) {
        let cause = || format!("material '{}'", material.name);
        self.note(!material.unlit, Feature::LitSurfaces, cause);
        self.note(material.unlit, Feature::UnlitSurfaces, cause);
        self.note(material.emissive.max_element() > 0.0, Feature::EmissiveSurfaces, cause);
        self.note(matches!(material.alpha, AlphaMode::Mask { .. }), Feature::AlphaMask, cause);
        self.note(material.alpha == AlphaMode::Blend, Feature::AlphaBlend, cause);
        self.note(!material.double_sided, Feature::SingleSided, cause);
        self.note(material.double_sided, Feature::DoubleSided, cause);
        self.note(material.transmits(), Feature::Transmission, cause);
        self.note(material.exponent > 0.0, Feature::PhongLobe, cause);
        let slots = [
            (&material.transmission_texture, Feature::TransmissionTexture),
            (&material.base_color_texture, Feature::BaseColorTexture),
            (&material.metallic_roughness_texture, Feature::MetallicRoughnessTexture),
            (&material.normal_texture, Feature::NormalTexture),
            (&material.occlusion_texture, Feature::OcclusionTexture),
            (&material.emissive_texture, Feature::EmissiveTexture),
        ];
        for (texture, feature) in slots {
            if let Some(texture) = texture {
                self.note(true, feature, cause);
                self.texture(scene, texture, cause);
            }
        }
    }

    fn texture(&mut self, scene: &Scene, used: &TextureRef, cause: impl Fn() -> String + Copy) {
        let texture = &scene.textures[used.texture];
        let wraps = |wrap| texture.wrap_u == wrap || texture.wrap_v == wrap;
        self.note(used.transform != glam::Affine2::IDENTITY, Feature::TextureTransform, cause);
        self.note(used.uv_set == 1, Feature::SecondUvSet, cause);
        self.note(texture.nearest, Feature::NearestFilter, cause);
        self.note(wraps(Wrap::Mirror), Feature::MirrorWrap, cause);
        self.note(wraps(Wrap::Clamp), Feature::ClampWrap, cause);
    }

    fn lights(&mut self, scene: &Scene) {
        let shines = |light: &&Light| light.intensity > 0.0 && light.color.max_element() > 0.0;
        for light in scene.lights.iter().filter(shines) {
            let cause = || format!("light '{}'", light.name);
            let feature = match light.kind {
                LightKind::Point => Feature::PointLights,
                LightKind::Spot { .. } => Feature::SpotLights,
                LightKind::Directional => Feature::DirectionalLights,
            };
            self.note(true, feature, cause);
            self.note(light.range.is_some(), Feature::LightRange, cause);
            self.note(light.shape != LightShape::Sharp, Feature::AreaLights, cause);
        }
        let radiance = scene.environment.radiance;
        self.note(radiance.max_element() > 0.0, Feature::Environment, || format!("radiance {radiance}"));
        if let Some(map) = &scene.environment_map {
            let cause = || format!("map '{}', {} x {}", map.name, map.width, map.height);
            self.note(true, Feature::EnvironmentMap, cause);
        }
        if let Some(medium) = scene.medium.filter(Medium::is_seen) {
            let what = if medium.region == Region::Everywhere { "fog" } else { "mist" };
            let taken = medium.scattering + medium.absorption;
            self.note(true, Feature::Medium, || format!("{what} of {} a metre", taken.max_element()));
        }
    }

    fn instances(&mut self, scene: &Scene) {
        let mut placed = vec![false; scene.meshes.len()];
        for (instance, transform) in scene.instances.iter().zip(&scene.pose(0.0).instances) {
            let cause = || format!("node '{}'", scene.nodes[instance.node].name);
            let again = std::mem::replace(&mut placed[instance.mesh], true);
            self.note(again, Feature::Instancing, cause);
            self.note(transform.matrix3.determinant() < 0.0, Feature::MirroredInstances, cause);
            self.note(!is_similarity(transform), Feature::NonUniformScale, cause);
        }
    }

    fn cameras(&mut self, scene: &Scene) {
        for camera in &scene.cameras {
            self.note(camera.lens.is_open(), Feature::Lens, || format!("camera '{}'", camera.name));
            // Whether anything moves is not asked: a host moves cameras, and poses, as it likes.
            self.note(camera.shutter > 0.0, Feature::MotionBlur, || format!("camera '{}'", camera.name));
        }
    }

    fn motion(&mut self, scene: &Scene) {
        let mut moving = vec![false; scene.nodes.len()];
        for channel in scene.animations.iter().flat_map(|animation| &animation.channels) {
            moving[channel.node] |= !matches!(channel.values, ChannelValues::Weights(_));
        }
        for (index, node) in scene.nodes.iter().enumerate() {
            moving[index] |= node.parent.is_some_and(|parent| moving[parent]);
        }
        let cause = |node: usize| format!("node '{}'", scene.nodes[node].name);
        let skinned = scene.deformers.iter().filter_map(|d| Some((d.instance, &scene.skins[d.skin?].joints)));
        let skinned: BTreeMap<usize, &Vec<usize>> = skinned.collect();
        for (index, instance) in scene.instances.iter().enumerate() {
            // A skin's joints move its mesh, whatever the node does.
            let mut movers = skinned.get(&index).map_or(std::slice::from_ref(&instance.node), |joints| joints).iter();
            self.note(movers.any(|&node| moving[node]), Feature::MovingInstances, || cause(instance.node));
        }
        for node in scene.lights.iter().map(|light| light.node) {
            self.note(moving[node], Feature::MovingLights, || cause(node));
        }
        for node in scene.cameras.iter().map(|camera| camera.node) {
            self.note(moving[node], Feature::MovingCameras, || cause(node));
        }
    }

    fn deformation(&mut self, scene: &Scene) {
        for deformer in &scene.deformers {
            let cause = || format!("node '{}'", scene.nodes[scene.instances[deformer.instance].node].name);
            self.note(deformer.skin.is_some(), Feature::SkinnedMeshes, cause);
            self.note(!deformer.weights.is_empty(), Feature::MorphedMeshes, cause);
        }
    }
}

/// Whether a transform scales all directions alike. Files hold f32 factors, and matrices that were multiplied out in
/// f32: a dozen roundings, of 2^-24 each, are not meant.
fn is_similarity(transform: &DAffine3) -> bool {
    const ROUNDING: f64 = 12.0 / (1 << 24) as f64;
    let axes = [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis];
    let [x, y, z] = axes.map(DVec3::length);
    let largest = x.max(y).max(z);
    let skew = axes[0].dot(axes[1]).abs().max(axes[1].dot(axes[2]).abs()).max(axes[2].dot(axes[0]).abs());
    largest - x.min(y).min(z) <= ROUNDING * largest && skew <= ROUNDING * largest * largest
}

#[cfg(test)]
mod tests {
    use glam::{Affine2, DMat3, DQuat, Vec2, Vec3, Vec4};

    use super::*;
    use crate::scene::{EnvironmentMap, Instance, LocalTransform, Mesh, Node, Texture};

    /// One triangle with a material.
    fn scene_with(material: Material) -> Scene {
        let mesh = Mesh {
            name: "mesh".to_owned(),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            triangles: vec![[0, 1, 2]],
            triangle_materials: vec![0],
            ..Mesh::default()
        };
        Scene {
            meshes: vec![mesh],
            instances: vec![Instance { node: 0, mesh: 0 }],
            nodes: vec![Node { name: "node".to_owned(), ..Node::default() }],
            materials: vec![material, Material { alpha: AlphaMode::Blend, ..Material::default() }],
            textures: vec![Texture { image: 0, wrap_u: Wrap::Clamp, wrap_v: Wrap::Mirror, nearest: true }],
            ..Scene::default()
        }
    }

    fn features(scene: &Scene) -> Vec<Feature> {
        inspect(scene).features.iter().map(|r| r.feature).collect()
    }

    #[test]
    fn a_plain_scene_requires_next_to_nothing() {
        let scene = scene_with(Material::default());
        assert_eq!(
            features(&scene),
            [Feature::LitSurfaces, Feature::SingleSided],
            "the unused material does not count"
        );
        assert_eq!(inspect(&scene).contents.instanced_triangles, 1);
        assert_eq!(Feature::SingleSided.to_string(), "single sided");
        let json = serde_json::to_value(inspect(&scene)).unwrap();
        assert_eq!(json["features"][0]["feature"], "lit-surfaces");
    }

    #[test]
    fn textures_bring_their_samplers_with_them() {
        let transform = Affine2::from_translation(Vec2::X);
        let texture = TextureRef { texture: 0, uv_set: 1, transform };
        let scene = scene_with(Material { normal_texture: Some(texture), ..Material::default() });
        let found = inspect(&scene);
        for feature in [
            Feature::NormalTexture,
            Feature::TextureTransform,
            Feature::SecondUvSet,
            Feature::NearestFilter,
            Feature::MirrorWrap,
            Feature::ClampWrap,
        ] {
            assert_eq!(found.cause(feature), Some("material 'default'"), "{feature:?}");
        }
        assert!(!found.has(Feature::BaseColorTexture));
    }

    #[test]
    fn mirrored_and_stretched_instances_are_told_apart() {
        let placed = |scale| {
            let mut scene = scene_with(Material::default());
            let rotation = DQuat::from_rotation_x(0.3);
            scene.nodes[0].local = LocalTransform::Trs { translation: DVec3::ONE, rotation, scale };
            let found = inspect(&scene);
            (found.has(Feature::MirroredInstances), found.has(Feature::NonUniformScale))
        };
        assert_eq!(placed(DVec3::splat(1e-9)), (false, false));
        assert_eq!(placed(DVec3::new(2.0, 2.0, 2.001)), (false, true));
        assert_eq!(placed(DVec3::new(2.0, -2.0, 2.0)), (true, false));
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.6, 0.8, 0.0), DVec3::Z);
        assert!(!is_similarity(&DAffine3::from_mat3(shear)));
    }

    #[test]
    fn a_black_light_requires_nothing() {
        let mut scene = scene_with(Material::default());
        let light = Light {
            name: "lamp".to_owned(),
            node: 0,
            kind: LightKind::Point,
            color: Vec3::ONE,
            intensity: 0.0,
            range: Some(1.0),
            shape: LightShape::Sharp,
        };
        scene.lights.push(light.clone());
        assert!(!inspect(&scene).has(Feature::PointLights));
        scene.lights.push(Light { intensity: 1.0, ..light });
        assert_eq!(inspect(&scene).cause(Feature::LightRange), Some("light 'lamp'"));
        assert_eq!((Traits::of(&scene).lights, Traits::of(&scene).distributed), (2, false));
        scene.environment_map =
            Some(EnvironmentMap { name: "sky.exr".to_owned(), width: 4, height: 2, ..Default::default() });
        assert_eq!(inspect(&scene).cause(Feature::EnvironmentMap), Some("map 'sky.exr', 4 x 2"));
        assert_eq!(
            (Traits::of(&scene).lights, Traits::of(&scene).distributed),
            (3, true),
            "its shadows can be left out"
        );
        scene.meshes[0].colors = vec![Vec4::ONE; 3];
        assert_eq!(inspect(&scene).cause(Feature::VertexColors), Some("mesh 'mesh'"));
    }
}
