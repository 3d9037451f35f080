//! Triangles that shine, as a table from which one is drawn: by what it emits where everything is at the start, but for a part of
//! the draws that all share alike, so that whatever grows, turns or has bright texels between those looked at is drawn, too.

use crate::accel::Geometry;
use crate::scene::color::srgb_to_linear;
use crate::scene::{Material, Mesh, Scene, TextureRef, Wrap};
use crate::shaders::{EMITTER_COUNT, EMITTER_TABLE, EMITTER_TWO_SIDED};
use glam::{DAffine3, Vec2, Vec3};

/// The part of all draws that goes to all triangles alike.
const ALIKE: f64 = 1.0 / 16.0;
/// Points of a triangle at which its texture is looked at, along each of the square's sides that is mapped to it.
const POINTS: u32 = 8;

/// A triangle that shines.
struct Emitter {
    instance: u32,
    slot: u32,
    two_sided: bool,
    power: f64,
}

/// Adds the table of what shines to that of an environment map, and its place to the header; how many triangles shine. `placed` is
/// where the instances are at the start.
pub fn append(table: &mut Vec<u32>, scene: &Scene, geometry: &Geometry, placed: &[DAffine3]) -> usize {
    let emitters = emitters(scene, geometry, placed);
    table[EMITTER_TABLE as usize] = table.len() as u32;
    table[EMITTER_COUNT as usize] = emitters.len() as u32;
    let aliases = Aliases::new(&chances(&emitters));
    for (row, emitter) in emitters.iter().enumerate() {
        let side = if emitter.two_sided { EMITTER_TWO_SIDED } else { 0 };
        let one_over = (1.0 / aliases.chance[row]) as f32;
        table.extend([
            emitter.instance | side,
            emitter.slot,
            aliases.stays[row],
            aliases.other[row],
            one_over.to_bits(),
        ]);
    }
    emitters.len()
}

fn emitters(scene: &Scene, geometry: &Geometry, placed: &[DAffine3]) -> Vec<Emitter> {
    let mut found = Vec::new();
    for (instance, (&mesh, place)) in geometry.instance_meshes.iter().zip(placed).enumerate() {
        let record = &geometry.meshes[mesh as usize];
        for slot in record.first_triangle..record.first_triangle + record.triangle_count {
            let material = &scene.materials[geometry.triangles[slot as usize].material as usize];
            if material.emissive.max_element() > 0.0 && !material.unlit {
                let mesh = &scene.meshes[mesh as usize];
                let triangle = mesh.triangles[geometry.source_triangles[slot as usize] as usize];
                let power = area(place, geometry.corners(slot)) * brightness(scene, mesh, triangle, material);
                found.push(Emitter { instance: instance as u32, slot, two_sided: material.double_sided, power });
            }
        }
    }
    found
}

/// Square metres in the world.
fn area(place: &DAffine3, corners: [Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|corner| place.transform_point3(corner.as_dvec3()));
    0.5 * (b - a).cross(c - a).length()
}

/// Relative luminance of Rec. 709.
fn luminance(color: Vec3) -> f64 {
    color.as_dvec3().dot(glam::DVec3::new(0.2126, 0.7152, 0.0722))
}

/// The mean luminance that a triangle emits, about.
fn brightness(scene: &Scene, mesh: &Mesh, triangle: [u32; 3], material: &Material) -> f64 {
    let Some(texture) = &material.emissive_texture else { return luminance(material.emissive) };
    let corner = |i: u32| mesh.uvs[texture.uv_set as usize & 1].get(i as usize).copied().unwrap_or(Vec2::ZERO);
    let [a, b, c] = triangle.map(corner);
    let middle = |i: u32| (i as f32 + 0.5) / POINTS as f32;
    let points = (0..POINTS * POINTS).map(|i| {
        let root = middle(i % POINTS).sqrt();
        let (u, v) = (1.0 - root, middle(i / POINTS) * root);
        luminance(material.emissive * texel(scene, texture, a + (b - a) * u + (c - a) * v))
    });
    points.sum::<f64>() / f64::from(POINTS * POINTS)
}

/// The nearest texel, decoded.
fn texel(scene: &Scene, texture: &TextureRef, at: Vec2) -> Vec3 {
    let sampler = scene.textures[texture.texture];
    let image = &scene.images[sampler.image];
    let at = texture.transform.transform_point2(at);
    let index = |x: f32, size: u32, wrap: Wrap| {
        let x = match wrap {
            Wrap::Repeat => x.rem_euclid(1.0),
            Wrap::Mirror => 1.0 - (x.rem_euclid(2.0) - 1.0).abs(),
            Wrap::Clamp => x,
        };
        // Converting saturates, also what is not a number.
        ((x * size as f32) as u32).min(size - 1)
    };
    let (x, y) = (index(at.x, image.width, sampler.wrap_u), index(at.y, image.height, sampler.wrap_v));
    let [r, g, b, _] = image.texels[(y * image.width + x) as usize];
    Vec3::from([r, g, b].map(|code| srgb_to_linear(f64::from(code) / 255.0) as f32))
}

/// The chance of each to be drawn; they add up to 1. What has no power to speak of, or one that is not a number, is drawn as seldom
/// as others are.
fn chances(emitters: &[Emitter]) -> Vec<f64> {
    let count = emitters.len() as f64;
    let power = |e: &Emitter| if e.power.is_finite() { e.power } else { 0.0 };
    let most = emitters.iter().map(power).fold(0.0, f64::max);
    // Scaled first: a sum of the largest powers may not be a number.
    let part = |e: &Emitter| if most > 0.0 { power(e) / most } else { 1.0 };
    let total: f64 = emitters.iter().map(part).sum();
    emitters.iter().map(|e| ALIKE / count + (1.0 - ALIKE) * part(e) / total).collect()
}

/// Walker's table (Vose 1991, A Linear Algorithm for Generating Random Numbers with a Given Distribution).
struct Aliases {
    /// Chance that a draw of a row stays there, 2^32 to one.
    stays: Vec<u32>,
    /// The row that it goes to otherwise.
    other: Vec<u32>,
    /// With which chance each row is drawn in the end, after rounding.
    chance: Vec<f64>,
}

const ONE: f64 = 4_294_967_296.0;

impl Aliases {
    fn new(chances: &[f64]) -> Self {
        let count = chances.len();
        let mut left: Vec<f64> = chances.iter().map(|chance| chance * count as f64).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..count).partition(|&row| left[row] < 1.0);
        let mut stays = vec![u32::MAX; count];
        let mut other: Vec<u32> = (0..count as u32).collect();
        while let (Some(row), Some(&giver)) = (small.pop(), large.last()) {
            stays[row] = (left[row] * ONE) as u32;
            other[row] = giver as u32;
            left[giver] -= 1.0 - left[row];
            if left[giver] < 1.0 {
                large.pop();
                small.push(giver);
            }
        }
        let mut chance = vec![0.0; count];
        for row in 0..count {
            let stay = f64::from(stays[row]) / ONE;
            chance[row] += stay / count as f64;
            chance[other[row] as usize] += (1.0 - stay) / count as f64;
        }
        Self { stays, other, chance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn emitter(power: f64) -> Emitter {
        Emitter { instance: 0, slot: 0, two_sided: false, power }
    }

    proptest! {
        /// Rounded to 2^-32 of a row's share, and never nothing.
        #[test]
        fn rows_are_drawn_by_their_power(powers in prop::collection::vec(0.0_f64..10.0, 1..50)) {
            let emitters: Vec<Emitter> = powers.iter().map(|p| emitter(*p)).collect();
            let wanted = chances(&emitters);
            let drawn = Aliases::new(&wanted).chance;
            prop_assert!((drawn.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            for (wanted, drawn) in wanted.iter().zip(&drawn) {
                prop_assert!((wanted - drawn).abs() < 60.0 / ONE && *drawn > 0.0, "{wanted} {drawn}");
            }
        }
    }

    #[test]
    fn what_has_no_power_or_one_without_measure_is_drawn_seldom() {
        for powers in [vec![0.0, 0.0], vec![f64::INFINITY, 1.0], vec![1e300, 1e308, f64::NAN], vec![]] {
            let emitters: Vec<Emitter> = powers.iter().map(|p| emitter(*p)).collect();
            let chances = chances(&emitters);
            assert!(chances.iter().all(|c| *c > 0.0 && c.is_finite()), "{powers:?}: {chances:?}");
            assert!(powers.is_empty() || (chances.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
