//! What the tests of the acceleration structure share: seeded numbers, meshes, and a world put together from them.
#![allow(dead_code)] // each test crate uses its own part
#![allow(clippy::unwrap_used)] // helpers of tests, which may

pub mod rays;

use std::f64::consts::TAU;

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use stillray::accel::{BvhBuildParams, Geometry, Tlas, place};
use stillray::oracle::traverse::World;
use stillray::progress::Quiet;
use stillray::scene::{Instance, Material, Mesh, Scene};
use stillray::shaders;

/// PCG (O'Neill 2014), 32 bits out.
pub struct Rng(u64);

impl Rng {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word = ((self.0 >> ((self.0 >> 59) + 5)) ^ self.0).wrapping_mul(12_605_985_483_714_917_081);
        (word >> 32) as u32 ^ (word >> 11) as u32
    }

    /// 0..1
    pub fn unit(&mut self) -> f64 {
        f64::from(self.bits()) / 4_294_967_296.0
    }

    pub fn below(&mut self, n: usize) -> usize {
        self.bits() as usize % n
    }

    /// -1..1
    pub fn signed(&mut self) -> f64 {
        self.unit() * 2.0 - 1.0
    }

    pub fn cube(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    pub fn direction(&mut self) -> DVec3 {
        let (z, phi) = (self.signed(), self.unit() * TAU);
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * phi.cos(), r * phi.sin(), z)
    }

    /// Between the two, evenly in the logarithm.
    pub fn magnitude(&mut self, least: f64, most: f64) -> f64 {
        least * (most / least).powf(self.unit())
    }

    pub fn rotation(&mut self) -> DQuat {
        DQuat::from_axis_angle(self.direction(), self.unit() * TAU)
    }

    /// Rotated, scaled by 0.2..5 an axis with random signs, sheared a little and moved.
    pub fn transform(&mut self, spread: f64) -> DAffine3 {
        let sign = |rng: &mut Self| if rng.bits() & 1 == 0 { 1.0 } else { -1.0 };
        let scale = DVec3::from_array(std::array::from_fn(|_| self.magnitude(0.2, 5.0) * sign(self)));
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.3 * self.signed(), 1.0, 0.0), DVec3::Z);
        let matrix3 = DMat3::from_quat(self.rotation()) * shear * DMat3::from_diagonal(scale);
        DAffine3 { matrix3, translation: self.cube() * spread }
    }
}

pub fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
    let triangle_materials = vec![0; triangles.len()];
    Mesh { name: "test".to_owned(), positions, triangles, triangle_materials, ..Mesh::default() }
}

/// Separate triangles.
pub fn soup(corners: impl IntoIterator<Item = [Vec3; 3]>) -> Mesh {
    let positions: Vec<Vec3> = corners.into_iter().flatten().collect();
    let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    mesh(positions, triangles)
}

pub fn random_soup(rng: &mut Rng, count: usize, size: f64) -> Mesh {
    let corners: Vec<[Vec3; 3]> = (0..count)
        .map(|_| {
            let center = rng.cube();
            std::array::from_fn(|_| (center + rng.cube() * size).as_vec3())
        })
        .collect();
    soup(corners)
}

pub fn cube() -> Mesh {
    let positions = (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0);
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).collect();
    mesh(positions.collect(), triangles)
}

/// An icosahedron with each face split in four `levels` times, of radius 1.
pub fn icosphere(levels: u32) -> Mesh {
    let g = f32::midpoint(1.0, 5.0_f32.sqrt());
    let mut positions: Vec<Vec3> = [-1.0, 1.0]
        .into_iter()
        .flat_map(|s| [-g, g].map(|t| (s, t)))
        .flat_map(|(s, t)| [Vec3::new(s, t, 0.0), Vec3::new(0.0, s, t), Vec3::new(t, 0.0, s)])
        .map(Vec3::normalize)
        .collect();
    // The faces are the triples at edge length from each other.
    let edge = 1.06;
    let near = |a: usize, b: usize| positions[a].distance(positions[b]) < edge;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    triangles.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    for _ in 0..levels {
        triangles = split(&mut positions, &triangles);
    }
    for t in &mut triangles {
        let [a, b, c] = t.map(|i| positions[i as usize]);
        if (b - a).cross(c - a).dot(a) < 0.0 {
            t.swap(1, 2);
        }
    }
    mesh(positions, triangles)
}

fn split(positions: &mut Vec<Vec3>, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut middles = std::collections::HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            positions.push((positions[a as usize] + positions[b as usize]).normalize());
            positions.len() as u32 - 1
        })
    };
    let four = |&[a, b, c]: &[u32; 3]| {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    triangles.iter().flat_map(four).collect()
}

/// A sphere with each vertex moved along its radius by up to a factor, and so still closed.
pub fn crumpled(rng: &mut Rng, levels: u32, factor: f64) -> Mesh {
    let mut sphere = icosphere(levels);
    for p in &mut sphere.positions {
        *p *= rng.magnitude(1.0 / factor, factor) as f32;
    }
    sphere
}

pub fn scene(meshes: Vec<Mesh>, instances: &[usize]) -> Scene {
    let instances = instances.iter().map(|&mesh| Instance { node: 0, mesh }).collect();
    Scene { meshes, instances, materials: vec![Material::default()], ..Scene::default() }
}

pub fn geometry(meshes: Vec<Mesh>, instances: &[usize]) -> Geometry {
    Geometry::build(&scene(meshes, instances), &BvhBuildParams::medium_build(), &Quiet).unwrap()
}

/// Geometry with placed instances and their tree.
pub struct Built {
    pub geometry: Geometry,
    pub instances: Vec<shaders::Instance>,
    pub tlas: Tlas,
}

impl Built {
    /// The camera is at `camera`.
    pub fn new(meshes: Vec<Mesh>, placed: &[(usize, DAffine3)], camera: DVec3) -> Self {
        let geometry = geometry(meshes, &placed.iter().map(|p| p.0).collect::<Vec<_>>());
        let place_one = |&(mesh, transform): &(usize, DAffine3)| {
            place(&geometry, &geometry.meshes[mesh], (&transform, camera), (&transform, camera))
        };
        let mut instances: Vec<shaders::Instance> = placed.iter().map(place_one).collect();
        let mut tlas = Tlas::default();
        tlas.rebuild(&geometry, &mut instances);
        Self { geometry, instances, tlas }
    }

    pub fn one(mesh: Mesh) -> Self {
        Self::new(vec![mesh], &[(0, DAffine3::IDENTITY)], DVec3::ZERO)
    }

    pub fn world(&self) -> World<'_> {
        World { geometry: &self.geometry, tlas: &self.tlas, instances: &self.instances, time: 1.0 }
    }
}
