//! A small scene in which everything happens that the kernels that trace and shade tell apart, on host and device.
#![allow(dead_code)] // each test binary uses a part of it
#![allow(clippy::unwrap_used)] // helpers of tests, which may

use std::f64::consts::FRAC_PI_2;

use super::accel_support::{cube, icosphere};
use super::support::kernel::{Bound, data};
use super::support::random::Random;
use glam::{Affine2, DAffine3, DMat3, DQuat, DVec3, Vec2, Vec3, Vec4};
use stillray::accel::{BvhBuildParams, Geometry, Tlas, mark_moving, place};
use stillray::emitters;
use stillray::gpu::image::Sampler;
use stillray::gpu::{Context, Image, ImageDesc};
use stillray::method::constants;
use stillray::oracle::emitter::Shining;
use stillray::oracle::environment::Afar;
use stillray::oracle::lens::lens_point;
use stillray::oracle::motion::{frame_time, light_at_time};
use stillray::oracle::seed::{
    PAIR_CHOICE, PAIR_EMITTER, PAIR_ENVIRONMENT, PAIR_LENS, PAIR_LIGHT, PAIR_TIME, new_seed, seed_bits, seed_pair,
};
use stillray::oracle::shade::light::light_point;
use stillray::oracle::shade::texture::Textures;
use stillray::oracle::stage::Stage;
use stillray::oracle::traverse::World;
use stillray::progress::Quiet;
use stillray::sampler as samplers;
use stillray::scene::atlas::{Atlas, material_records, srgb_table};
use stillray::scene::{
    self, AlphaMode, EnvironmentMap, Light, LightKind, LightPose, LightShape, Mesh, Scene, TextureRef,
};
use stillray::shaders::{
    self, FRAME_NEAREST, FRAME_TURNS, Frame, LIGHT_DISC, LIGHT_MESH, LIGHT_RECTANGLE, LIGHT_SHARP, NEW_INSTANCE, Sample,
};

/// Materials of the scene, by index.
pub const OPAQUE: usize = 0;
pub const ONE_SIDED: usize = 1;
pub const MASKED: usize = 2;
pub const BLENDED: usize = 3;
pub const UNLIT: usize = 4;

/// A scene in a frame, on the host.
pub struct Theatre {
    pub scene: Scene,
    pub geometry: Geometry,
    pub tlas: Tlas,
    pub instances: Vec<shaders::Instance>,
    pub materials: Vec<shaders::Material>,
    pub atlas: Atlas,
    pub textures: Textures,
    pub lights: Vec<shaders::Light>,
    pub frame: Frame,
    /// The point of the lens through which everything is seen.
    pub lens: [f32; 2],
    /// When everything is seen.
    pub time: f32,
    /// The table of the map of light from all around, and where all samples lie in it.
    pub environment: Vec<u32>,
    pub afar_at: [u32; 2],
    /// Where all samples lie on what shines: on a triangle, and which one.
    pub shining_at: ([f32; 2], u32, f32),
    pub transforms: Vec<DAffine3>,
}

/// How all samples of a list are drawn: alike, so that the twin knows one lens point and one point of each light.
pub struct Draw {
    pub sampler: samplers::Sampler,
    pub seed: u32,
}

impl Draw {
    pub fn random(random: &mut Random) -> Self {
        let strategy = random.pick(&samplers::Strategy::ALL);
        let sampler = samplers::Sampler::new(strategy, samplers::Tiling::Sudoku, 4, random.below(3));
        Self { sampler, seed: new_seed([random.below(5000), random.below(5000)], random.below(16)) }
    }

    /// What kernels that model a lens or areas bind besides: the seed of each of so many samples, and the sampler's table.
    pub fn bound(&self, samples: usize) -> [Bound<'static>; 2] {
        [data(&vec![self.seed; samples]), data(&self.sampler.table())]
    }
}

/// A square of half size 1 in the plane z = 0, seen from +z, in 2 x 2 x `steps`² triangles.
pub fn quad(material: usize, steps: u32) -> Mesh {
    let at = |i: u32| i as f32 / steps as f32;
    let grid = || (0..=steps).flat_map(move |y| (0..=steps).map(move |x| (at(x), at(y))));
    let corner = |x: u32, y: u32| y * (steps + 1) + x;
    let cell = |x, y| {
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        [[a, b, c], [a, c, d]]
    };
    let triangles: Vec<[u32; 3]> = (0..steps).flat_map(|y| (0..steps).flat_map(move |x| cell(x, y))).collect();
    Mesh {
        name: "quad".to_owned(),
        positions: grid().map(|(x, y)| Vec3::new(2.0 * x - 1.0, 2.0 * y - 1.0, 0.0)).collect(),
        normals: grid().map(|_| Vec3::Z).collect(),
        tangents: grid().map(|_| Vec4::new(1.0, 0.0, 0.0, 1.0)).collect(),
        uvs: [grid().map(|(x, y)| Vec2::new(x, y)).collect(), grid().map(|(x, y)| Vec2::new(y, x) * 3.0).collect()],
        colors: grid().map(|(x, y)| Vec4::new(1.0, x, y, 1.0)).collect(),
        triangle_materials: vec![material as u32; triangles.len()],
        triangles,
        ..Mesh::default()
    }
}

pub fn ball(material: usize) -> Mesh {
    let mut ball = icosphere(2);
    ball.normals.clone_from(&ball.positions);
    ball.tangents = ball.normals.iter().map(|n| n.any_orthonormal_vector().extend(-1.0)).collect();
    let uvs: Vec<Vec2> = ball.positions.iter().map(|p| Vec2::new(p.x + p.z, p.y)).collect();
    ball.uvs = [uvs.clone(), uvs];
    ball.triangle_materials.fill(material as u32);
    ball
}

fn image(random: &mut Random, side: u32) -> scene::Image {
    let texels = (0..side * side).map(|_| random.bits().to_le_bytes()).collect();
    scene::Image { name: "noise".to_owned(), width: side, height: side, texels }
}

fn materials() -> Vec<scene::Material> {
    let plain = scene::Material { metallic: 0.2, roughness: 0.6, ..scene::Material::default() };
    let texture = |texture: usize, uv_set: u32| Some(TextureRef { texture, uv_set, transform: Affine2::IDENTITY });
    vec![
        scene::Material { double_sided: true, occlusion_texture: texture(0, 0), ..plain.clone() },
        scene::Material {
            normal_texture: texture(1, 0),
            normal_scale: 0.3,
            metallic_roughness_texture: texture(0, 1),
            metallic: 1.0,
            ..plain.clone()
        },
        scene::Material {
            base_color_texture: texture(0, 0),
            alpha: AlphaMode::Mask { cutoff: 0.5 },
            double_sided: true,
            emissive: Vec3::new(0.0, 0.5, 2.0),
            emissive_texture: texture(1, 1),
            ..plain.clone()
        },
        scene::Material {
            base_color: Vec4::new(0.9, 0.5, 0.2, 0.5),
            alpha: AlphaMode::Blend,
            double_sided: true,
            ..plain.clone()
        },
        scene::Material { unlit: true, base_color: Vec4::new(0.1, 0.7, 0.3, 1.0), ..plain },
    ]
}

fn light(kind: LightKind) -> Light {
    let color = Vec3::new(1.0, 0.8, 0.6);
    Light { name: String::new(), node: 0, kind, color, intensity: 20.0, range: None, shape: LightShape::Sharp }
}

/// Where the objects stand: in front of a camera at the origin that looks along -z.
fn placements() -> Vec<(Mesh, DAffine3)> {
    let at = |x, y, z| DAffine3::from_translation(DVec3::new(x, y, z));
    let turned = |axis: DVec3, angle| DAffine3::from_quat(DQuat::from_axis_angle(axis.normalize(), angle));
    let scaled = |x, y, z| DAffine3::from_scale(DVec3::new(x, y, z));
    let sheared = |m: DMat3| DAffine3 { matrix3: m, translation: DVec3::ZERO };
    let shear = sheared(DMat3::from_cols(DVec3::X, DVec3::new(0.5, 1.0, 0.2), DVec3::new(0.0, -0.3, 1.0)));
    let facing = |angle| turned(DVec3::Y, angle);
    vec![
        (quad(OPAQUE, 4), at(0.0, -2.0, -8.0) * turned(DVec3::X, -FRAC_PI_2) * scaled(8.0, 6.0, 1.0)),
        (ball(ONE_SIDED), at(-2.0, 0.0, -7.0) * turned(DVec3::ONE, 0.7) * shear),
        (ball(OPAQUE), at(2.2, 0.2, -8.0) * shear * scaled(-1.2, 0.7, 1.0)),
        // One-sided, seen from the front, from behind, and mirrored.
        (quad(ONE_SIDED, 2), at(-3.5, 1.8, -9.0) * facing(0.3)),
        (quad(ONE_SIDED, 2), at(0.0, 1.8, -9.0) * facing(3.0)),
        (quad(ONE_SIDED, 2), at(3.2, 2.2, -9.0) * facing(-0.2) * scaled(-1.0, 1.0, 1.0)),
        (quad(MASKED, 1), at(-0.6, 0.3, -5.0) * facing(0.5) * scaled(0.9, 0.9, 1.0)),
        (quad(BLENDED, 1), at(1.2, -0.2, -4.5) * facing(-0.4) * shear * scaled(0.8, -0.8, 1.0)),
        (ball(UNLIT), at(0.4, -1.2, -6.0) * scaled(0.5, 0.5, 0.5)),
    ]
}

impl Theatre {
    pub fn new(size: [u32; 2]) -> Self {
        Self::with(size, placements(), DVec3::ZERO)
    }

    /// The same from another place.
    pub fn seen_from(size: [u32; 2], camera: DVec3) -> Self {
        Self::with(size, placements(), camera)
    }

    /// The camera stands in a closed room of opaque walls, and everything else is outside. `hole` opens it.
    pub fn walled(size: [u32; 2], hole: bool) -> Self {
        let mut room = cube();
        if hole {
            room.triangles.remove(3);
        }
        room.triangle_materials = vec![OPAQUE as u32; room.triangles.len()];
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.4);
        let room =
            (room, DAffine3::from_scale_rotation_translation(DVec3::new(1.0, -1.3, 1.5), turn, DVec3::splat(0.1)));
        Self::with(size, placements().into_iter().chain([room]).collect(), DVec3::ZERO)
    }

    fn with(size: [u32; 2], placed: Vec<(Mesh, DAffine3)>, camera: DVec3) -> Self {
        let random = &mut Random::new(11);
        let (meshes, transforms): (Vec<Mesh>, Vec<DAffine3>) = placed.into_iter().unzip();
        let textures = (0..2).map(|image| scene::Texture {
            image,
            wrap_u: scene::Wrap::Repeat,
            wrap_v: scene::Wrap::Mirror,
            nearest: image == 0,
        });
        let scene = Scene {
            instances: (0..meshes.len()).map(|mesh| scene::Instance { node: 0, mesh }).collect(),
            meshes,
            materials: materials(),
            images: vec![image(random, 8), image(random, 16)],
            textures: textures.collect(),
            ..Scene::default()
        };
        let geometry = Geometry::build(&scene, &BvhBuildParams::medium_build(), &Quiet).unwrap();
        let before = |m: &DAffine3| DAffine3::from_translation(DVec3::new(0.05, -0.02, 0.1)) * *m;
        let mut instances: Vec<shaders::Instance> = transforms
            .iter()
            .zip(&geometry.meshes)
            .map(|(m, mesh)| place(&geometry, mesh, (m, camera), (&before(m), DVec3::ZERO)))
            .collect();
        let mut tlas = Tlas::default();
        tlas.rebuild(&geometry, &mut instances);
        let atlas = Atlas::pack(&scene.images, 64, 4).unwrap();
        let lights = lights();
        let frame = Frame {
            right: [1.0, 0.0, 0.0, 0.6 * size[0] as f32 / size[1] as f32],
            up: [0.0, 1.0, 0.0, 0.6],
            forward: [0.0, 0.0, -1.0, 1.2 / size[1] as f32],
            previous_right: [0.999_8, 0.0, 0.02, 0.6 * size[0] as f32 / size[1] as f32],
            previous_up: [0.0, 1.0, 0.0, 0.6],
            previous_forward: [0.02, 0.0, -0.999_8, 1.2 / size[1] as f32],
            environment: [0.3, 0.4, 0.6, 0.0],
            size,
            light_count: lights.len() as u32,
            shadow_rays: 32,
            instance_count: instances.len() as u32,
            ..Frame::default()
        };
        let materials = material_records(&scene, &atlas);
        let textures = Textures::new(Atlas::pack(&scene.images, 64, 4).unwrap());
        let environment = EnvironmentMap::table(None);
        Self {
            scene,
            geometry,
            tlas,
            instances,
            materials,
            atlas,
            textures,
            lights,
            frame,
            lens: [0.0; 2],
            time: 1.0,
            environment,
            afar_at: [0; 2],
            shining_at: ([0.0; 2], 0, 0.0),
            transforms,
        }
    }

    /// Under a map: noise of which half is black, and a sun of one texel.
    pub fn under_a_map(mut self, random: &mut Random) -> Self {
        let (width, height) = (random.pick(&[1, 5, 16, 64]), random.pick(&[1, 3, 8, 33]));
        let texel = |random: &mut Random| {
            if random.chance(0.5) { [0.0; 3] } else { [0; 3].map(|_| random.between(0.0, 2.0)) }
        };
        let mut texels: Vec<[f32; 3]> = (0..width * height).map(|_| texel(random)).collect();
        texels[random.below(width * height) as usize] = [300.0, 250.0, 200.0];
        let turn = f64::from(random.between(-7.0, 7.0));
        let map = EnvironmentMap { name: "noise".to_owned(), width, height, texels, scale: 0.5, turn };
        self.environment = EnvironmentMap::table(Some(&map));
        self
    }

    /// What shines is one of the lights, of which so many points are drawn.
    pub fn shining(mut self, draws: u32) -> Self {
        self.frame.emitters = draws;
        emitters::append(&mut self.environment, &self.scene, &self.geometry, &self.transforms);
        self.lights.push(shaders::Light { shape: LIGHT_MESH, ..shaders::Light::default() });
        self.frame.light_count += 1;
        self
    }

    /// The same through an open lens, under lights that have an extent.
    pub fn wide(size: [u32; 2], random: &mut Random) -> Self {
        let mut theatre = Self::new(size);
        let blades = random.pick(&[0.0, 5.0]);
        theatre.frame.lens = [random.between(0.02, 0.3), random.between(0.0, 0.3), blades, 0.0];
        // The focus has changed, the aperture not: the twin knows one lens point only.
        theatre.frame.previous_lens = [theatre.frame.lens[0], 0.1, blades, 0.0];
        theatre.frame.variation = random.below(3);
        for (i, light) in theatre.lights.iter_mut().enumerate() {
            light.shape = [LIGHT_RECTANGLE, LIGHT_DISC, LIGHT_SHARP][i % 3];
            light.right = [0.3, 0.1, -0.2];
            light.up = [-0.1, 0.2, 0.25];
        }
        theatre
    }

    /// The same while the shutter is open, with everything on the move, and the camera turning.
    pub fn moving(size: [u32; 2], random: &mut Random) -> Self {
        let mut theatre = Self::wide(size, random);
        theatre.frame.shutter = random.pick(&[0.5, 1.0]);
        theatre.frame.flags |= FRAME_TURNS;
        let shutter = f64::from(theatre.frame.shutter);
        theatre.instances.iter_mut().for_each(|instance| mark_moving(instance, shutter));
        theatre.tlas.rebuild_over(&theatre.geometry, &mut theatre.instances, shutter);
        theatre
    }

    /// What the twins are told of a theatre whose samples are drawn so: the lens point, and lights that are points.
    pub fn drawn(mut self, draw: &Draw) -> Self {
        let pair = |pair| seed_pair(&draw.sampler, self.frame.variation, draw.seed, pair);
        let [lens, at] = [pair(PAIR_LENS), pair(PAIR_LIGHT)];
        self.lens = lens_point(self.frame.lens, lens);
        self.time = frame_time(self.frame.shutter, pair(PAIR_TIME)[0]);
        let bits = |pair| seed_bits(&draw.sampler, self.frame.variation, draw.seed, pair);
        self.afar_at = bits(PAIR_ENVIRONMENT);
        self.shining_at = (at, bits(PAIR_CHOICE)[1], pair(PAIR_EMITTER)[0]);
        let still = |light: shaders::Light| shaders::Light { moved: [0.0; 3], ..light };
        let time = self.time;
        self.lights.iter_mut().for_each(|light| *light = still(light_point(&light_at_time(light, time), at)));
        self
    }

    /// Textures are filtered where the scene has it so, and with `nearest` nowhere.
    pub fn filtered(size: [u32; 2], nearest: bool) -> Self {
        let mut theatre = Self::new(size);
        theatre.materials.iter_mut().for_each(|m| m.base_color_texture.flags &= !16);
        if nearest {
            theatre.frame.flags |= FRAME_NEAREST;
            theatre.textures = Textures::nearest(Atlas::pack(&theatre.scene.images, 64, 4).unwrap());
        }
        theatre
    }

    pub fn stage(&self, alpha: bool) -> Stage<'_> {
        let world = World { geometry: &self.geometry, tlas: &self.tlas, instances: &self.instances, time: self.time };
        Stage {
            frame: &self.frame,
            world,
            materials: &self.materials,
            textures: &self.textures,
            alpha,
            lens: self.lens,
            afar: Some(Afar { table: &self.environment, at: self.afar_at }),
            shining: Some(Shining {
                table: &self.environment,
                at: self.shining_at.0,
                draw: self.shining_at.1,
                pick: self.shining_at.2,
                count: self.frame.emitters,
            }),
        }
    }

    /// Nodes as the device has them: the top level first.
    pub fn nodes(&self) -> Bound<'static> {
        let mut nodes = self.tlas.nodes.clone();
        nodes.resize(self.geometry.tlas_capacity as usize, [0; 20]);
        nodes.extend_from_slice(&self.geometry.nodes);
        data(&nodes)
    }

    /// A triangle slot of an instance.
    pub fn random_triangle(&self, random: &mut Random) -> (u32, u32) {
        let instance = random.below(self.instances.len() as u32);
        let mesh = &self.geometry.meshes[self.geometry.instance_meshes[instance as usize] as usize];
        (instance, mesh.first_triangle + random.below(mesh.triangle_count))
    }

    /// A new sample anywhere in the frame.
    pub fn new_sample(&self, random: &mut Random) -> Sample {
        let [x, y] = self.frame.size.map(|n| random.between(0.0, n as f32));
        Sample { position: [x, y, 0.0], instance: NEW_INSTANCE }
    }
}

fn lights() -> Vec<shaders::Light> {
    let down = DVec3::new(0.3, -1.0, -0.4).normalize();
    let spot = LightKind::Spot { inner: 0.3, outer: 0.9 };
    let placed = [
        (LightKind::Directional, DVec3::ZERO, down),
        (LightKind::Point, DVec3::new(1.0, 3.0, -5.0), down),
        (spot, DVec3::new(-3.0, 4.0, -4.0), DVec3::new(0.4, -0.8, -0.6).normalize()),
        // Inside a ball, and lower than the floor, past its edge.
        (LightKind::Point, DVec3::new(2.2, 0.2, -8.0), down),
        (LightKind::Point, DVec3::new(11.0, -2.4, -8.0), down),
    ];
    let one = |(kind, position, direction)| {
        let before = position - DVec3::new(0.2, -0.1, 0.3);
        constants::light(
            &light(kind),
            &LightPose { position, direction, axes: [DVec3::X, DVec3::Y] },
            DVec3::ZERO,
            before,
        )
    };
    placed.into_iter().map(one).collect()
}

/// The atlas on the device.
pub struct Gallery {
    image: Image,
    sampler: Sampler,
}

impl Gallery {
    pub fn new(context: &Context, atlas: &Atlas) -> Self {
        let desc = ImageDesc {
            format: ash::vk::Format::R8G8B8A8_UNORM,
            extent: atlas.size,
            layers: atlas.layers,
            array: true,
            usage: ash::vk::ImageUsageFlags::SAMPLED,
        };
        let image = Image::new(context, "textures", desc).unwrap();
        image.upload(context, bytemuck::cast_slice(&atlas.texels)).unwrap();
        Self { image, sampler: Sampler::new(context).unwrap() }
    }

    pub fn bound(&self) -> Bound<'_> {
        Bound::Texture(&self.image, &self.sampler)
    }

    pub fn srgb() -> Bound<'static> {
        data(&srgb_table())
    }
}
