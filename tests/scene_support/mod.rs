//! Small scenes built by hand, and frames of them.
#![allow(dead_code)] // each test binary uses a part of it
#![allow(clippy::unwrap_used)] // helpers of tests, which may

use glam::{DQuat, DVec2, DVec3, Vec3, Vec4};
use stillray::gpu::ContextOptions;
use stillray::headless::{Device, LoadedScene, Pixels, Session};
use stillray::progress::Quiet;
use stillray::renderer::{FrameInputs, Settings};
use stillray::scene::{
    Camera, Environment, Instance, Lens, Light, LightKind, LightShape, LocalTransform, Material, Mesh, Node, Scene,
    View,
};

pub fn trs(translation: DVec3, rotation: DQuat, scale: f64) -> LocalTransform {
    LocalTransform::Trs { translation, rotation, scale: DVec3::splat(scale) }
}

pub fn material(base_color: Vec4, metallic: f32, roughness: f32) -> Material {
    Material { base_color, metallic, roughness, ..Material::default() }
}

/// A scene with a node for everything that is put into it.
pub struct Build(pub Scene);

impl Build {
    pub fn new(environment: f32) -> Self {
        let environment = Environment { radiance: Vec3::splat(environment) };
        Self(Scene { name: "analytic".to_owned(), environment, ..Scene::default() })
    }

    pub fn node(&mut self, local: LocalTransform) -> usize {
        self.0.nodes.push(Node { name: String::new(), parent: None, local });
        self.0.nodes.len() - 1
    }

    pub fn mesh(
        mut self,
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        m: Material,
        at: LocalTransform,
    ) -> Self {
        self.0.materials.push(m);
        let triangle_materials = vec![self.0.materials.len() as u32 - 1; triangles.len()];
        let node = self.node(at);
        self.0.instances.push(Instance { node, mesh: self.0.meshes.len() });
        self.0.meshes.push(Mesh { positions, normals, triangles, triangle_materials, ..Mesh::default() });
        self
    }

    /// The square |x|, |y| <= 1 at z = 0 that faces +z.
    pub fn square(self, m: Material, at: LocalTransform) -> Self {
        let positions = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
        self.mesh(positions.to_vec(), vec![Vec3::Z; 4], vec![[0, 1, 2], [0, 2, 3]], m, at)
    }

    /// A ball of radius 1 with smooth normals: rings of longitude and latitude.
    pub fn ball(self, m: Material, at: LocalTransform) -> Self {
        let (rings, sides) = (12, 20);
        let point = |i: u32, k: u32| {
            let (a, b) =
                (std::f32::consts::PI * i as f32 / rings as f32, std::f32::consts::TAU * k as f32 / sides as f32);
            Vec3::new(a.sin() * b.cos(), a.cos(), a.sin() * b.sin())
        };
        let positions: Vec<Vec3> = (0..=rings).flat_map(|i| (0..=sides).map(move |k| point(i, k))).collect();
        let at_index = |i: u32, k: u32| i * (sides + 1) + k;
        let quads = (0..rings).flat_map(|i| (0..sides).map(move |k| (i, k)));
        let triangles = quads.flat_map(|(i, k)| {
            let [a, b, c, d] = [at_index(i, k), at_index(i, k + 1), at_index(i + 1, k + 1), at_index(i + 1, k)];
            [[a, b, c], [a, c, d]]
        });
        let triangles = triangles.collect();
        self.mesh(positions.clone(), positions, triangles, m, at)
    }

    pub fn light(mut self, kind: LightKind, position: DVec3, toward: DVec3, intensity: f32) -> Self {
        let node = self.node(trs(position, DQuat::from_rotation_arc(DVec3::NEG_Z, toward.normalize()), 1.0));
        self.0.lights.push(Light {
            name: String::new(),
            node,
            kind,
            color: Vec3::ONE,
            intensity,
            range: None,
            shape: LightShape::Sharp,
        });
        self
    }

    pub fn camera(mut self, view: &View) -> Scene {
        let node = self.node(trs(view.position, view.rotation, 1.0));
        self.0.cameras.push(Camera {
            name: String::new(),
            node,
            yfov: view.yfov,
            lens: view.lens,
            shutter: view.shutter,
        });
        self.0
    }
}

/// From `eye` to `target`, with +y up.
pub fn look(eye: DVec3, target: DVec3, yfov: f64) -> View {
    let back = (eye - target).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let rotation = DQuat::from_mat3(&glam::DMat3::from_cols(right, back.cross(right), back));
    View { position: eye, rotation: rotation.normalize(), yfov, lens: Lens::PINHOLE, shutter: 0.0 }
}

/// Along -z from the origin, with 1/4 of a metre a metre away filling half the frame's height.
pub fn ahead() -> View {
    View {
        position: DVec3::ZERO,
        rotation: DQuat::IDENTITY,
        yfov: 2.0 * 0.25_f64.atan(),
        lens: Lens::PINHOLE,
        shutter: 0.0,
    }
}

/// World-space direction through a point of the frame, of length 1 along the viewing direction.
pub fn direction(view: &View, size: [u32; 2], at: DVec2) -> DVec3 {
    let tangent = (view.yfov * 0.5).tan();
    let [w, h] = size.map(f64::from);
    let ndc = DVec2::new(at.x / w * 2.0 - 1.0, 1.0 - at.y / h * 2.0);
    view.rotation * DVec3::new(ndc.x * tangent * w / h, ndc.y * tangent, -1.0)
}

pub struct Stage {
    _device: Device,
    pub session: Session,
    pub scene: Scene,
}

impl Stage {
    pub fn new(scene: Scene, settings: &Settings) -> Self {
        let device = Device::with_options(&ContextOptions { device: None, validation: false }).unwrap();
        let loaded = LoadedScene::new(&device, &scene, &Quiet).unwrap();
        let session = Session::new(&device, &loaded, settings).unwrap();
        Self { _device: device, session, scene }
    }

    pub fn frame(&mut self, view: View) -> Pixels {
        self.frame_at(view, 0.0)
    }

    /// With the scene's animations after so many seconds.
    pub fn frame_at(&mut self, view: View, seconds: f64) -> Pixels {
        let pose = self.scene.pose(seconds);
        self.session.frame(&FrameInputs { view, pose: &pose, reset: false }).unwrap();
        self.session.color().unwrap()
    }
}

/// Frames of one scene from one view; the last one.
pub fn render(scene: Scene, settings: &Settings, view: View, frames: u32) -> Pixels {
    let mut stage = Stage::new(scene, settings);
    (0..frames).map(|_| stage.frame(view)).last().unwrap()
}

/// Red of each pixel with its place.
pub fn reds(pixels: &Pixels) -> impl Iterator<Item = ([u32; 2], f64)> + '_ {
    let place = |i: usize| [i as u32 % pixels.width, i as u32 / pixels.width];
    pixels.data.chunks(pixels.channels).enumerate().map(move |(i, p)| (place(i), f64::from(p[0])))
}

/// Frames of a method, averaged.
pub fn mean_of(scene: Scene, settings: &Settings, view: View, frames: u32) -> Pixels {
    let mut stage = Stage::new(scene, settings);
    let mut sum = stage.frame(view);
    for _ in 1..frames {
        sum.data.iter_mut().zip(stage.frame(view).data).for_each(|(sum, new)| *sum += new);
    }
    sum.data.iter_mut().for_each(|x| *x /= frames as f32);
    sum
}
