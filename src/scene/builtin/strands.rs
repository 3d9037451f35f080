//! Flat strands thinner than a pixel whose exact coverage is known: the analytic test of reconstruction.

use super::Parameter;
use super::random::Random;
use super::shapes::{empty, push_quad};
use super::stage::Stage;
use crate::scene::{Material, Scene, View};
use glam::{DVec2, DVec3, Vec3};
use std::f64::consts::TAU;

/// Strands in the star. With at most 64 they keep apart from each other at their inner ends.
pub(super) const COUNT: Parameter = Parameter { name: "count", min: 1, max: 64, default: 48 };

const YFOV: f64 = 0.5;
const DISTANCE: f64 = 4.0;
/// Pixels a side of the frame in which widths are nominal.
const NOMINAL: f64 = 256.0;
/// Ends of the strands, in half frames from the centre.
const ENDS: [f64; 2] = [0.22, 0.96];

/// A star of strands in the plane z = 0, each at its own angle, from 0.3 pixels wide to one, that do not overlap.
pub(super) fn build(count: u32, seed: u32) -> Scene {
    let mut stage = Stage::new("strands", Vec3::ZERO);
    let name = "strand".to_owned();
    let strand =
        stage.material(Material { name, metallic: 0.0, unlit: true, double_sided: true, ..Material::default() });
    let mut mesh = empty("strands");
    let mut random = Random::new(seed, 0);
    let half_frame = DISTANCE * (YFOV / 2.0).tan();
    let pixel = 2.0 * half_frame / NOMINAL;
    for i in 0..count {
        // At 64 strands the inner ends are 2.7 pixels apart; turned by up to a fifth of that they stay separate.
        let angle = (f64::from(i) + random.range(-0.2, 0.2)) / f64::from(count) * TAU;
        let width = pixel * random.range(0.3, 1.0);
        let along = DVec3::new(angle.cos(), angle.sin(), 0.0);
        let across = DVec3::new(-along.y, along.x, 0.0) * width;
        let start = along * (ENDS[0] * half_frame) - across * 0.5;
        push_quad(&mut mesh, start, along * ((ENDS[1] - ENDS[0]) * half_frame), across, strand);
    }
    let mesh = stage.mesh(mesh);
    stage.place("strands", mesh);
    stage.camera(DVec3::new(0.0, 0.0, DISTANCE), DVec3::ZERO, YFOV);
    stage.finish()
}

/// Exact coverage of each pixel by the triangles of `scene`, 0..=1, row by row from the top left, for `size` pixels
/// (width, height) seen from `view`.
///
/// The triangles are projected and clipped to the pixels in f64. Areas are added, so they must not hide each other, as
/// is so for `builtin:strands` from everywhere; instances must be where they were modelled. With strands white and
/// everything else black, this is the radiance that a box filter over each pixel has to give.
pub fn strands_coverage(scene: &Scene, view: &View, size: [u32; 2]) -> Vec<f32> {
    let mut coverage = vec![0.0; size[0] as usize * size[1] as usize];
    for mesh in &scene.meshes {
        for triangle in &mesh.triangles {
            let corners = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
            add_polygon(&project(&corners, view, size), size, &mut coverage);
        }
    }
    coverage.into_iter().map(|c| c.min(1.0) as f32).collect()
}

/// The part of a polygon that lies in front of the camera, in pixels from the top left.
fn project(corners: &[DVec3], view: &View, size: [u32; 2]) -> Vec<DVec2> {
    let to_view = view.rotation.inverse();
    let local: Vec<DVec3> = corners.iter().map(|c| to_view * (*c - view.position)).collect();
    // What is nearer than a millionth of the farthest corner's distance would cover no pixel that can be seen past it.
    let near = 1e-6 * local.iter().map(|c| c.length()).fold(0.0, f64::max);
    let scale = f64::from(size[1]) * 0.5 / (view.yfov * 0.5).tan();
    let centre = DVec2::new(f64::from(size[0]), f64::from(size[1])) * 0.5;
    let cut = clip(&local, |c| -c.z - near);
    cut.iter().map(|c| centre + DVec2::new(c.x, -c.y) * (scale / -c.z)).collect()
}

/// Adds the area of a convex polygon, of either winding, to the pixels that it touches.
fn add_polygon(polygon: &[DVec2], size: [u32; 2], coverage: &mut [f64]) {
    let range = |axis: usize, polygon: &[DVec2]| {
        let low = polygon.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        let high = polygon.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
        let limit = f64::from(size[axis]);
        low.floor().clamp(0.0, limit) as u32..high.ceil().clamp(0.0, limit) as u32
    };
    for y in range(1, polygon) {
        let row = slab(polygon, 1, f64::from(y));
        for x in range(0, &row) {
            coverage[(y * size[0] + x) as usize] += area(&slab(&row, 0, f64::from(x)));
        }
    }
}

/// The part of a polygon between `low` and `low + 1` along an axis.
fn slab(polygon: &[DVec2], axis: usize, low: f64) -> Vec<DVec2> {
    clip(&clip(polygon, |p| p[axis] - low), |p| low + 1.0 - p[axis])
}

/// Sutherland and Hodgman: the part of a convex polygon where the affine function `inside` is not negative.
fn clip<P>(polygon: &[P], inside: impl Fn(&P) -> f64) -> Vec<P>
where
    P: Copy + std::ops::Sub<Output = P> + std::ops::Add<Output = P> + std::ops::Mul<f64, Output = P>,
{
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (inside(&a), inside(&b));
        if da >= 0.0 {
            kept.push(a);
        }
        if (da < 0.0) != (db < 0.0) {
            kept.push(a + (b - a) * (da / (da - db)));
        }
    }
    kept
}

/// The shoelace formula about the first corner, whatever the winding.
fn area(polygon: &[DVec2]) -> f64 {
    let Some((&first, rest)) = polygon.split_first() else { return 0.0 };
    rest.windows(2).map(|w| (w[0] - first).perp_dot(w[1] - first)).sum::<f64>().abs() * 0.5
}
