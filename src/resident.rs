//! A scene in device memory: what does not change from frame to frame.

use crate::accel::{BvhBuildParams, Geometry};
use crate::deforming::Deformable;
use crate::emitters;
use crate::gpu::image::Sampler;
use crate::gpu::{Buffer, Context, Image, ImageDesc, Range, Resource};
use crate::phase::SceneResources;
use crate::progress::Progress;
use crate::scene::atlas::{self, Atlas};
use crate::scene::medium::{self, Medium};
use crate::scene::requirements::{self, Feature, Requirements};
use crate::scene::{Environment, EnvironmentMap, Light, Scene};
use crate::{Error, Result};
use ash::vk;
use glam::Vec3;

/// Most lights of a scene: a shaded sample keeps one bit for each. Where there is a map of light from all around, one of the bits
/// is for that.
pub const MAX_LIGHTS: usize = 32;

/// A scene on a device. Renderers of the same context share it.
#[derive(Debug)]
pub struct ResidentScene {
    pub(crate) geometry: Geometry,
    pub(crate) lights: Vec<Light>,
    /// Triangles that shine.
    pub(crate) emitters: usize,
    pub(crate) environment: Environment,
    pub(crate) medium: Option<Medium>,
    /// Mean radiance from all around.
    pub(crate) ambient: Vec3,
    pub(crate) requirements: Requirements,
    pub(crate) deformables: Vec<Deformable>,
    nodes: Buffer,
    corners: Buffer,
    rest: Buffer,
    triangles: Buffer,
    vertices: Buffer,
    materials: Buffer,
    srgb: Buffer,
    environment_map: Buffer,
    medium_noise: Buffer,
    atlas: Image,
    sampler: Sampler,
}

const SMALLER_MAP: &str = "use an environment map with fewer texels, or a scene with fewer triangles that shine";
const FEWER_TRIANGLES: &str = "use a scene with fewer triangles (builtin:hairball takes ?strands=N)";

impl ResidentScene {
    /// Builds the acceleration structures and uploads everything.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if a buffer exceeds the device's limit, [`Error::OutOfMemory`], and [`Error::Setting`] for more
    /// than [`MAX_LIGHTS`] lights, or an environment map that is not whole, and for a medium out of range.
    pub fn new(context: &Context, scene: &Scene, progress: &dyn Progress) -> Result<Self> {
        check_lights(scene)?;
        scene.medium.as_ref().map_or(Ok(()), Medium::check)?;
        let geometry = Geometry::build(scene, &BvhBuildParams::medium_build(), progress)?;
        let upload = |purpose: &str, bytes: &[u8]| Buffer::with_data(context, purpose, bytes, FEWER_TRIANGLES);
        let limits = &context.fit().properties.limits;
        let pages = Atlas::pack(&scene.images, limits.max_image_dimension2_d, limits.max_image_array_layers)?;
        // The top level's nodes come first; every frame writes them.
        let mut nodes = vec![[0; 20]; geometry.tlas_capacity as usize];
        nodes.extend_from_slice(&geometry.nodes);
        let mut afar = EnvironmentMap::table(scene.environment_map.as_ref());
        let emitters = emitters::append(&mut afar, scene, &geometry, &scene.pose(0.0).instances);
        Ok(Self {
            lights: scene.lights.clone(),
            emitters,
            environment: scene.environment,
            medium: scene.medium,
            ambient: scene.environment.radiance
                + scene.environment_map.as_ref().map_or(Vec3::ZERO, medium::mean_radiance),
            requirements: requirements::inspect(scene),
            deformables: Deformable::of(scene)?,
            nodes: upload("BVH nodes", bytemuck::cast_slice(&nodes))?,
            corners: upload("triangle corners", bytemuck::cast_slice(&geometry.triangle_corners))?,
            rest: upload("triangle corners", bytemuck::cast_slice(&geometry.triangle_rest))?,
            triangles: upload("triangle indices", bytemuck::cast_slice(&geometry.triangles))?,
            vertices: upload("vertices", bytemuck::cast_slice(&geometry.vertices))?,
            materials: upload("materials", bytemuck::cast_slice(&atlas::material_records(scene, &pages)))?,
            srgb: upload("sRGB table", bytemuck::cast_slice(&atlas::srgb_table()))?,
            environment_map: Buffer::with_data(context, "environment map", bytemuck::cast_slice(&afar), SMALLER_MAP)?,
            medium_noise: upload("medium noise", bytemuck::cast_slice(&medium::noise(scene.medium.as_ref())))?,
            atlas: upload_atlas(context, &pages)?,
            sampler: Sampler::new(context)?,
            geometry,
        })
    }

    pub(crate) fn resources(&self) -> SceneResources {
        SceneResources {
            nodes: Range::whole("nodes", &self.nodes),
            corners: Range::whole("corners", &self.corners),
            rest: Range::whole("rest", &self.rest),
            triangles: Range::whole("triangles", &self.triangles),
            vertices: Range::whole("vertices", &self.vertices),
            materials: Range::whole("materials", &self.materials),
            atlas: Resource::Sampled("atlas", self.atlas.view(), self.sampler.raw()),
            srgb: Range::whole("srgb", &self.srgb),
            environment_map: Range::whole("environment map", &self.environment_map),
            medium_noise: Range::whole("medium noise", &self.medium_noise),
        }
    }

    pub(crate) fn instance_count(&self) -> usize {
        self.geometry.instance_meshes.len()
    }

    /// Lights of a frame: those of the scene, and with `emitters` all triangles that shine, together.
    pub(crate) fn light_count(&self, emitters: u32) -> usize {
        self.lights.len() + usize::from(emitters > 0 && self.emitters > 0)
    }

    /// Whether a bit is left for what shines.
    ///
    /// # Errors
    /// [`Error::Setting`] if there is none.
    pub(crate) fn check_emitters(&self, emitters: u32) -> Result<()> {
        let most = MAX_LIGHTS - usize::from(self.requirements.cause(Feature::EnvironmentMap).is_some());
        if self.light_count(emitters) <= most {
            return Ok(());
        }
        let expected = format!("a scene with fewer than {most} lights besides what shines, or emitters = 0");
        Err(Error::Setting {
            name: "emitters",
            value: format!("{emitters} with {} lights", self.lights.len()),
            expected,
        })
    }

    /// Where the top level goes: the start of the node buffer.
    pub(crate) fn top_level(&self) -> Range {
        let size = 80 * u64::from(self.geometry.tlas_capacity);
        Range { name: "top level", size, ..Range::whole("nodes", &self.nodes) }
    }
}

fn check_lights(scene: &Scene) -> Result<()> {
    let wrong = |name, value: String, expected: String| Err(Error::Setting { name, value, expected });
    let (most, beside) = match &scene.environment_map {
        None => (MAX_LIGHTS, ""),
        Some(map) if !map.is_whole() => {
            let size = format!("{} x {} with {} texels", map.width, map.height, map.texels.len());
            return wrong(
                "environment_map",
                size,
                "as many texels as its sides say, and sides that are in range".to_owned(),
            );
        }
        Some(_) => (MAX_LIGHTS - 1, " beside its environment map"),
    };
    if scene.lights.len() > most {
        return wrong(
            "lights",
            scene.lights.len().to_string(),
            format!("a scene with at most {most} punctual lights{beside}"),
        );
    }
    Ok(())
}

fn upload_atlas(context: &Context, pages: &Atlas) -> Result<Image> {
    let desc = ImageDesc {
        format: vk::Format::R8G8B8A8_UNORM,
        extent: pages.size,
        layers: pages.layers,
        array: true,
        usage: vk::ImageUsageFlags::SAMPLED,
    };
    let image = Image::new(context, "textures", desc)?;
    image.upload(context, bytemuck::cast_slice(&pages.texels))?;
    Ok(image)
}
