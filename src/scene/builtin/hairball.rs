//! Thin curved tubes wound around a ball, after Laine's hairball: nothing but silhouettes, the hardest case for
//! stability. Material and light follow section 6 of "Interactive Stable Ray Tracing": glossy dielectric, one point
//! light.

use super::Parameter;
use super::random::Random;
use super::shapes::{empty, push_bare_vertex, push_triangle};
use super::stage::Stage;
use crate::scene::{Material, Mesh, Scene};
use glam::{DQuat, DVec3, Vec3, Vec4};
use std::f64::consts::TAU;

/// 20,000 strands make the original's 2.88 million triangles.
pub(super) const STRANDS: Parameter = Parameter { name: "strands", min: 1, max: 20_000, default: 1_200 };

const RINGS: usize = 24;
const SIDES: usize = 3;
/// Metres; the ball's radius is one. About 1.3 pixels across in a frame of 512 lines.
const TUBE_RADIUS: f64 = 0.0032;

pub(super) fn build(strands: u32, seed: u32) -> Scene {
    let mut stage = Stage::new("hairball", Vec3::new(0.20, 0.30, 0.46));
    let hair = stage.material(Material {
        name: "hair".to_owned(),
        base_color: Vec4::new(0.62, 0.40, 0.22, 1.0),
        metallic: 0.0,
        roughness: 0.35,
        ..Material::default()
    });
    let mut mesh = empty("hairball");
    for strand in 0..strands {
        let path = Path::new(&mut Random::new(seed, strand));
        push_tube(&mut mesh, &path, hair);
    }
    let mesh = stage.mesh(mesh);
    stage.place("hairball", mesh);
    stage.point_light(DVec3::new(3.0, 4.0, 3.5), Vec3::new(1.0, 0.96, 0.9), 260.0);
    stage.camera(DVec3::new(0.0, 0.35, 4.2), DVec3::ZERO, 0.56);
    stage.finish()
}

/// A curve that winds around the ball at a radius that grows and wavers.
struct Path {
    frame: DQuat,
    turn: f64,
    radius: [f64; 2],
    waves: [Wave; 3],
}

/// A sine along the strand, whose argument runs over 0..1.
struct Wave {
    amplitude: f64,
    frequency: f64,
    phase: f64,
}

impl Wave {
    fn new(random: &mut Random, amplitude: f64) -> Self {
        let amplitude = random.range(0.3, 1.0) * amplitude;
        Self { amplitude, frequency: random.range(2.0, 7.0), phase: random.range(0.0, TAU) }
    }

    fn at(&self, s: f64) -> f64 {
        self.amplitude * (self.frequency * s + self.phase).sin()
    }
}

impl Path {
    fn new(random: &mut Random) -> Self {
        let frame = random.rotation();
        // The square root fills the ball evenly from the inside out; the ends stay near the surface as loose hairs.
        let inner = random.range(0.0, 1.0).sqrt() * 0.85 + 0.05;
        let outer = random.range(0.80, 0.97);
        Self {
            frame,
            turn: random.range(1.8, 3.6),
            radius: [inner, outer],
            waves: [Wave::new(random, 0.35), Wave::new(random, 0.30), Wave::new(random, 0.06)],
        }
    }

    fn position(&self, s: f64) -> DVec3 {
        let angle = self.turn * s + self.waves[0].at(s);
        let tilt = self.waves[1].at(s);
        let blend = s * s * (3.0 - 2.0 * s);
        let radius = self.radius[0] + (self.radius[1] - self.radius[0]) * blend + self.waves[2].at(s);
        let direction = DVec3::new(tilt.cos() * angle.cos(), tilt.cos() * angle.sin(), tilt.sin());
        self.frame * (direction * radius)
    }

    /// Central difference: the path is smooth, and a tube needs its direction to a few digits only.
    fn tangent(&self, s: f64) -> DVec3 {
        (self.position(s + 1e-4) - self.position(s - 1e-4)).normalize_or(DVec3::X)
    }
}

/// A closed tube: rings joined by quads, a tip at each end. `6 * RINGS` triangles.
fn push_tube(mesh: &mut Mesh, path: &Path, material: u32) {
    let step = 1.0 / (RINGS + 1) as f64;
    let start = path.tangent(0.0);
    let tip = push_bare_vertex(mesh, path.position(0.0).as_vec3(), -start.as_vec3());
    let mut side = start.any_orthonormal_vector();
    for ring in 1..=RINGS {
        let s = ring as f64 * step;
        let tangent = path.tangent(s);
        // Carry the frame along by projection, so that the tube does not twist.
        side = (side - tangent * side.dot(tangent)).normalize_or(tangent.any_orthonormal_vector());
        let other = tangent.cross(side);
        for k in 0..SIDES {
            let angle = k as f64 / SIDES as f64 * TAU;
            let normal = side * angle.cos() + other * angle.sin();
            push_bare_vertex(mesh, (path.position(s) + normal * TUBE_RADIUS).as_vec3(), normal.as_vec3());
        }
    }
    let end = push_bare_vertex(mesh, path.position(1.0).as_vec3(), path.tangent(1.0).as_vec3());
    let vertex = |ring: usize, k: usize| tip + 1 + (ring * SIDES + k % SIDES) as u32;
    for k in 0..SIDES {
        push_triangle(mesh, [tip, vertex(0, k + 1), vertex(0, k)], material);
        push_triangle(mesh, [end, vertex(RINGS - 1, k), vertex(RINGS - 1, k + 1)], material);
        for ring in 1..RINGS {
            let [a, b, c, d] = [vertex(ring - 1, k), vertex(ring - 1, k + 1), vertex(ring, k + 1), vertex(ring, k)];
            push_triangle(mesh, [a, b, c], material);
            push_triangle(mesh, [a, c, d], material);
        }
    }
}
