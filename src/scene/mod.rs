//! What is rendered, on the CPU: no Vulkan in here.
//!
//! A [`Scene`] is immutable once loaded. What changes over time is evaluated into a [`Pose`], in f64, so that nothing
//! is lost before the camera-relative transforms are rounded once to f32.
//!
//! Units are glTF's: metres, radians, seconds, candela and lux; colours are scene-linear RGB with Rec. 709 primaries.

pub mod atlas;
pub mod builtin;
pub mod color;
pub mod deform;
pub mod environment;
pub mod fingerprint;
pub mod import;
pub mod medium;
pub mod motion;
pub mod pose;
pub mod requirements;
pub mod shot;
mod skeleton;
pub mod sky;

use std::ops::Range;

pub use environment::EnvironmentMap;
use glam::{Affine2, DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};
pub use medium::Medium;

/// A complete scene.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// File stem or built-in name.
    pub name: String,
    /// Geometry, shared by instances.
    pub meshes: Vec<Mesh>,
    /// What is placed where; the index of an instance is the 31-bit id that samples carry.
    pub instances: Vec<Instance>,
    /// The node hierarchy. Parents come before their children.
    pub nodes: Vec<Node>,
    /// Materials; never empty after loading (the default material stands in).
    pub materials: Vec<Material>,
    /// Textures: an image with a sampler.
    pub textures: Vec<Texture>,
    /// Decoded images.
    pub images: Vec<Image>,
    /// Punctual lights.
    pub lights: Vec<Light>,
    /// Cameras; never empty after loading (a framing camera stands in).
    pub cameras: Vec<Camera>,
    /// Animated node transforms and morph weights.
    pub animations: Vec<Animation>,
    /// Skeletons that bend meshes.
    pub skins: Vec<Skin>,
    /// The instances whose meshes change their shape, in the order of the instances; empty for a rigid scene. The mesh of
    /// each is its own: no other instance has it.
    pub deformers: Vec<Deformer>,
    /// Uniform light from infinity.
    pub environment: Environment,
    /// Light from infinity that differs by direction, added to the uniform one.
    pub environment_map: Option<EnvironmentMap>,
    /// What fills space and scatters light.
    pub medium: Option<Medium>,
    /// What was approximated or ignored, one line each, to be said once to the user.
    pub notices: Vec<String>,
}

/// A triangle mesh. All vertex arrays but `positions` are either empty or as long as `positions`.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// Object-space positions in metres, finite.
    pub positions: Vec<Vec3>,
    /// Unit normals; never empty after loading (flat normals stand in, with vertices split).
    pub normals: Vec<Vec3>,
    /// Unit tangents with the handedness in w; empty if no material of the mesh has a normal map.
    pub tangents: Vec<Vec4>,
    /// First and second texture coordinates.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colours.
    pub colors: Vec<Vec4>,
    /// Three vertex indices a triangle, all in range.
    pub triangles: Vec<[u32; 3]>,
    /// Material of each triangle, in range; as long as `triangles`.
    pub triangle_materials: Vec<u32>,
    /// What [`Deformation::weights`] weighs; empty for a mesh that does not morph.
    pub morph_targets: Vec<MorphTarget>,
    /// Joints that each vertex follows, indices into [`Skin::joints`]: up to four, or up to eight where the second set is
    /// not empty. Both are empty for a mesh without a skin.
    pub joints: [Vec<[u16; 4]>; 2],
    /// Weights of `joints`, 0..=1, those of a vertex adding up to 1.
    pub weights: [Vec<[f32; 4]>; 2],
    /// Ranges of vertices of a mesh that deforms, three a triangle in the order of its corners, which have their
    /// triangle's normal: it is found anew after each deformation.
    pub flat: Vec<Range<u32>>,
}

impl Mesh {
    /// Whether a deformation can change the shape.
    #[must_use]
    pub fn deforms(&self) -> bool {
        !self.morph_targets.is_empty() || !self.joints[0].is_empty()
    }
}

/// Displacements of a mesh's vertices at a weight of 1. Each array is either empty or as long as [`Mesh::positions`].
#[derive(Debug, Clone, Default)]
pub struct MorphTarget {
    /// Added to positions, in metres.
    pub positions: Vec<Vec3>,
    /// Added to normals, before these are made unit vectors again.
    pub normals: Vec<Vec3>,
    /// Added to tangents, before these are made unit vectors again.
    pub tangents: Vec<Vec3>,
}

/// A skeleton that bends meshes.
#[derive(Debug, Clone, Default)]
pub struct Skin {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// The nodes that are joints.
    pub joints: Vec<usize>,
    /// From the space of the mesh to that of each joint, in the pose in which the mesh was bound; as long as `joints`.
    pub inverse_bind: Vec<DAffine3>,
}

/// An instance whose mesh changes its shape.
#[derive(Debug, Clone, Default)]
pub struct Deformer {
    /// Index into [`Scene::instances`].
    pub instance: usize,
    /// Index into [`Scene::skins`].
    pub skin: Option<usize>,
    /// Weights of the mesh's morph targets where no animation drives them: one a target, finite.
    pub weights: Vec<f64>,
}

/// A mesh placed by a node.
#[derive(Debug, Clone, Default)]
pub struct Instance {
    /// The node whose global transform places the mesh; where a skin bends it, only the skin's joints do.
    pub node: usize,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
}

/// A node of the hierarchy.
#[derive(Debug, Clone, Default)]
pub struct Node {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// Index of the parent, smaller than the node's own.
    pub parent: Option<usize>,
    /// Rest transform.
    pub local: LocalTransform,
}

/// A node's transform relative to its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LocalTransform {
    /// Translation, rotation and scale, which animation can drive.
    Trs {
        /// Metres.
        translation: DVec3,
        /// Unit quaternion.
        rotation: DQuat,
        /// Any finite factors, negative ones included.
        scale: DVec3,
    },
    /// A fixed matrix.
    Matrix(DAffine3),
}

impl Default for LocalTransform {
    fn default() -> Self {
        Self::Trs { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

/// Metallic-roughness material of glTF 2.0.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// Linear RGBA factor, 0..=1.
    pub base_color: Vec4,
    /// sRGB-encoded colour with linear alpha.
    pub base_color_texture: Option<TextureRef>,
    /// 0 (dielectric) ..= 1 (metal).
    pub metallic: f32,
    /// Perceptual roughness, 0..=1.
    pub roughness: f32,
    /// Roughness in green, metalness in blue; linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normal map; linear.
    pub normal_texture: Option<TextureRef>,
    /// Scales the normal map's x and y.
    pub normal_scale: f32,
    /// Ambient occlusion in red; linear.
    pub occlusion_texture: Option<TextureRef>,
    /// 0 (no occlusion) ..= 1 (as in the texture).
    pub occlusion_strength: f32,
    /// Emitted radiance: factor times `KHR_materials_emissive_strength`.
    pub emissive: Vec3,
    /// sRGB-encoded.
    pub emissive_texture: Option<TextureRef>,
    /// What alpha means.
    pub alpha: AlphaMode,
    /// Whether back faces are seen (with the normal flipped).
    pub double_sided: bool,
    /// `KHR_materials_unlit`: the base colour is the radiance.
    pub unlit: bool,
    /// `KHR_materials_ior`: index of refraction against air, 1 or more, or 0, which reflects everything.
    pub ior: f32,
    /// `KHR_materials_transmission`: part of what enters it, where it is not metal, that passes through, 0..=1.
    pub transmission: f32,
    /// Scales it in red; linear.
    pub transmission_texture: Option<TextureRef>,
    /// `KHR_materials_volume`: what transmits is a body that refracts and absorbs this much (1/metre, at least 0); otherwise it is
    /// a thin wall.
    pub volume: Option<Vec3>,
    /// Exponent of Phong's lobe (paper 2, section 3.3), 1 to 10⁶, which takes the place of the roughness's; 0: none.
    pub exponent: f32,
}

impl Material {
    /// Whether light passes through it somewhere.
    #[must_use]
    pub fn transmits(&self) -> bool {
        self.transmission > 0.0 && self.metallic < 1.0
    }
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: "default".to_owned(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            ior: 1.5,
            transmission: 0.0,
            transmission_texture: None,
            volume: None,
            exponent: 0.0,
        }
    }
}

/// What the alpha channel of the base colour means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Alpha below the cutoff is not there, the rest is opaque.
    Mask {
        /// Alpha at and above which the surface is there.
        cutoff: f32,
    },
    /// Alpha is coverage. Rendered as stochastic transparency: see `glsl/include/alpha.glsl`.
    Blend,
}

/// A use of a texture by a material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureRef {
    /// Index into [`Scene::textures`].
    pub texture: usize,
    /// 0 or 1: which of [`Mesh::uvs`].
    pub uv_set: u32,
    /// `KHR_texture_transform`, identity by default: `uv' = transform * uv`.
    pub transform: Affine2,
}

/// An image with a sampler.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Texture {
    /// Index into [`Scene::images`].
    pub image: usize,
    /// How u outside 0..1 is mapped.
    pub wrap_u: Wrap,
    /// How v outside 0..1 is mapped.
    pub wrap_v: Wrap,
    /// Nearest instead of bilinear filtering.
    pub nearest: bool,
}

/// glTF's wrap modes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// Tile.
    #[default]
    Repeat,
    /// Tile, every other one mirrored.
    Mirror,
    /// Extend the border texel.
    Clamp,
}

/// A decoded 8-bit RGBA image. Whether RGB is sRGB-encoded depends on the slot that uses it.
#[derive(Debug, Clone, Default)]
pub struct Image {
    /// Name or path in the file.
    pub name: String,
    /// Texels across, at least 1.
    pub width: u32,
    /// Texels down, at least 1.
    pub height: u32,
    /// `width * height` texels, row by row from the top.
    pub texels: Vec<[u8; 4]>,
}

/// A punctual light (`KHR_lights_punctual`), shining from its node along the node's -Z.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// The node that places it.
    pub node: usize,
    /// Kind and its parameters.
    pub kind: LightKind,
    /// Linear RGB, times `intensity`.
    pub color: Vec3,
    /// Candela for point and spot lights, lux for directional ones.
    pub intensity: f32,
    /// Metres beyond which the light fades to nothing, if given.
    pub range: Option<f32>,
    /// Its extent.
    pub shape: LightShape,
}

/// The extent of a light, across its node's X and Y: of point and spot lights a surface that looks along the node's -Z, in
/// metres; of directional ones a part of the sky, in radians. A point light with an extent shines as its surface does, evenly
/// (Lambert), with its intensity along the normal; so an extent of nothing is a point light that shines to one side.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum LightShape {
    /// None: its shadows have sharp edges.
    #[default]
    Sharp,
    /// A rectangle of this width and height.
    Rectangle([f32; 2]),
    /// An ellipse of this width and height.
    Disc([f32; 2]),
}

/// Kinds of punctual lights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// In all directions from a point.
    Point,
    /// In a cone from a point.
    Spot {
        /// Radians from the axis where the falloff starts.
        inner: f32,
        /// Radians from the axis where nothing is left.
        outer: f32,
    },
    /// Parallel light from infinity.
    Directional,
}

/// A perspective camera, looking along its node's -Z with +Y up.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// The node that places it.
    pub node: usize,
    /// Vertical field of view in radians, in (0, π).
    pub yfov: f64,
    /// Its lens.
    pub lens: Lens,
    /// The part of the time from one frame to the next for which its shutter is open, at the end of it: 0, nothing blurs, to 1.
    pub shutter: f64,
}

/// A thin lens (paper 2, section 3.1; Cook, Porter and Carpenter 1984).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Diameter of the aperture in metres, finite, at least 0; 0 is a pinhole, for which all is in focus.
    pub aperture: f64,
    /// Distance in metres, along the viewing direction, of the plane that is in focus: above 0, infinity included.
    pub focus: f64,
    /// Straight edges of the aperture, 3 to 16; 0: it is round.
    pub blades: u32,
}

impl Lens {
    /// Everything is in focus.
    pub const PINHOLE: Self = Self { aperture: 0.0, focus: f64::INFINITY, blades: 0 };

    /// Whether something can be out of focus.
    pub fn is_open(&self) -> bool {
        self.aperture > 0.0
    }
}

impl Default for Lens {
    fn default() -> Self {
        Self::PINHOLE
    }
}

/// Where a frame is seen from. The field of view is what animation of a zoom changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// World-space position in metres.
    pub position: DVec3,
    /// Unit quaternion that turns -Z into the viewing direction and +Y into up.
    pub rotation: DQuat,
    /// Vertical field of view in radians, in (0, π).
    pub yfov: f64,
    /// The lens that it is seen through.
    pub lens: Lens,
    /// The part of the time since the last frame for which the shutter has been open when this frame ends, 0..=1: what moves is
    /// seen all along (paper 2, section 3.4), on straight lines from where it was in the last frame.
    pub shutter: f64,
}

/// Animated transforms of some nodes, looped by their longest channel.
#[derive(Debug, Clone, Default)]
pub struct Animation {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// What moves.
    pub channels: Vec<Channel>,
}

/// One animated property of one node.
#[derive(Debug, Clone)]
pub struct Channel {
    /// The node; for weights the one that places the mesh.
    pub node: usize,
    /// Key times in seconds, strictly increasing, at least one.
    pub times: Vec<f64>,
    /// How to interpolate between keys.
    pub interpolation: Interpolation,
    /// Key values: one a key, or (in-tangent, value, out-tangent) a key for cubic splines.
    pub values: ChannelValues,
}

/// glTF's interpolation modes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// Holds each key.
    Step,
    /// Linear, spherical for rotations.
    Linear,
    /// Cubic Hermite spline.
    CubicSpline,
}

/// The values of an animated property.
#[derive(Debug, Clone)]
pub enum ChannelValues {
    /// Metres.
    Translation(Vec<DVec3>),
    /// Unit quaternions; those of cubic splines, values and tangents, may have any length, the values not zero.
    Rotation(Vec<DQuat>),
    /// Factors.
    Scale(Vec<DVec3>),
    /// Weights of morph targets, of all targets one after the other for each value.
    Weights(Vec<f64>),
}

/// Uniform radiance from all directions: what a ray that hits nothing sees, and the ambient light on surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Environment {
    /// Scene-linear RGB radiance.
    pub radiance: Vec3,
}

/// Everything that moves, at one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Pose {
    /// Object-to-world transform of each of [`Scene::instances`]. That of a skinned one follows a joint of the skin.
    pub instances: Vec<DAffine3>,
    /// The shape of each of [`Scene::deformers`].
    pub deformations: Vec<Deformation>,
    /// Each of [`Scene::lights`], placed.
    pub lights: Vec<LightPose>,
    /// Each of [`Scene::cameras`], placed.
    pub cameras: Vec<View>,
    /// How far the noise of [`Scene::medium`] has drifted, metres; zero without one.
    pub drift: DVec3,
}

/// The shape of a mesh at one moment: morphed first, then bent. See [`deform::deform`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Deformation {
    /// Index into [`Scene::instances`].
    pub instance: usize,
    /// What each of [`Skin::joints`] does to the mesh, in the space that the instance's transform places; empty without a
    /// skin.
    pub joints: Vec<DAffine3>,
    /// The weight of each of [`Mesh::morph_targets`].
    pub weights: Vec<f64>,
}

/// A light's place at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightPose {
    /// World-space position in metres (meaningless for directional lights).
    pub position: DVec3,
    /// Unit vector along which the light shines.
    pub direction: DVec3,
    /// Unit vectors along its width and its height.
    pub axes: [DVec3; 2],
}
