//! A fractal height field of 175x199 vertices under a texture that is five times finer, after the terrain of
//! "Temporally Coherent Interactive Ray Tracing", section 5.

use super::noise::Fractal;
use super::shapes::grid;
use super::stage::Stage;
use crate::scene::{Image, Material, Scene, Wrap};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

const COLUMNS: u32 = 175;
const ROWS: u32 = 199;
/// Metres between neighbouring vertices.
const SPACING: f64 = 0.1;
/// Texels a side of the texture.
const TEXELS: u32 = 1024;

pub(super) fn build(seed: u32) -> Scene {
    let land = Land::new(seed);
    let mut stage = Stage::new("terrain", Vec3::new(0.38, 0.52, 0.72));
    let texture = stage.texture(land.texture(), Wrap::Clamp, false);
    let material = stage.material(Material {
        name: "land".to_owned(),
        base_color_texture: Some(texture),
        metallic: 0.0,
        roughness: 0.95,
        double_sided: true,
        ..Material::default()
    });
    let size = DVec2::new(f64::from(COLUMNS - 1), f64::from(ROWS - 1)) * SPACING;
    let mesh = grid("land", COLUMNS, ROWS, material, |i, j| {
        let uv = DVec2::new(f64::from(i) / f64::from(COLUMNS - 1), f64::from(j) / f64::from(ROWS - 1));
        let p = (uv - 0.5) * size;
        (DVec3::new(p.x, land.height(p), p.y), land.normal(p, SPACING), uv)
    });
    let mesh = stage.mesh(mesh);
    stage.place("land", mesh);
    stage.sun(DVec3::new(0.75, -0.55, -0.25), Vec3::new(1.0, 0.91, 0.76), 3.0);
    stage.camera(DVec3::new(0.0, 4.6, 11.5), DVec3::new(0.0, 0.2, 0.0), 0.80);
    stage.finish()
}

struct Land {
    ridges: Fractal,
    hills: Fractal,
    speckle: Fractal,
}

impl Land {
    fn new(seed: u32) -> Self {
        let noise = |stream: u32, octaves, gain| Fractal {
            seed: seed.wrapping_mul(64).wrapping_add(stream),
            octaves,
            gain,
            period: 1 << 16,
        };
        Self { ridges: noise(0, 7, 0.48), hills: noise(16, 3, 0.5), speckle: noise(32, 3, 0.7) }
    }

    /// Metres above the lowest water, at a place in metres from the centre.
    fn height(&self, p: DVec2) -> f64 {
        let ridge = 1.0 - self.ridges.at(p * 0.16).abs() * 1.8;
        let hills = self.hills.at(p * 0.09);
        // Mountains stand where the hills are, valleys are smooth.
        let weight = (0.5 + hills).clamp(0.05, 1.0);
        2.2 * ridge * weight + 1.1 * hills - 0.9
    }

    /// By central differences over one vertex spacing, so that normals follow the mesh and not what it cannot show.
    fn normal(&self, p: DVec2, h: f64) -> DVec3 {
        let slope = |d: DVec2| (self.height(p + d) - self.height(p - d)) / (2.0 * h);
        DVec3::new(-slope(DVec2::X * h), 1.0, -slope(DVec2::Y * h)).normalize()
    }

    fn texture(&self) -> Image {
        let n = TEXELS as usize;
        let texel = DVec2::new(f64::from(COLUMNS - 1), f64::from(ROWS - 1)) * SPACING / n as f64;
        let place = |i: usize| (DVec2::new((i % n) as f64, (i / n) as f64) + 0.5 - n as f64 * 0.5) * texel;
        let heights: Vec<f64> = (0..n * n).into_par_iter().map(|i| self.height(place(i))).collect();
        let texels = (0..n * n).into_par_iter().map(|i| {
            let (x, y) = (i % n, i / n);
            let (left, right) = (x.saturating_sub(3), (x + 3).min(n - 1));
            let (top, bottom) = (y.saturating_sub(3), (y + 3).min(n - 1));
            let across = (heights[y * n + right] - heights[y * n + left]) / ((right - left) as f64 * texel.x);
            let down = (heights[bottom * n + x] - heights[top * n + x]) / ((bottom - top) as f64 * texel.y);
            let steepness = (across * across + down * down).sqrt();
            let [r, g, b] = self.color(place(i), heights[i], steepness).to_array().map(|c| (c * 255.0).round() as u8);
            [r, g, b, 255]
        });
        Image { name: "land".to_owned(), width: TEXELS, height: TEXELS, texels: texels.collect() }
    }

    /// sRGB-encoded colour: sand, grass, rock and snow by height and slope, with borders that the noise breaks up.
    fn color(&self, p: DVec2, height: f64, steepness: f64) -> DVec3 {
        let grain = self.speckle.at(p * 6.0);
        let (height, steepness) = (height + 0.2 * grain, steepness + 0.15 * grain);
        let [sand, grass] = [DVec3::new(0.70, 0.62, 0.45), DVec3::new(0.34, 0.45, 0.20)];
        let [rock, snow] = [DVec3::new(0.45, 0.41, 0.38), DVec3::new(0.90, 0.92, 0.95)];
        let low = sand.lerp(grass, ramp(-0.7, -0.3, height));
        let stony = low.lerp(rock, ramp(0.75, 1.1, steepness));
        let color = stony.lerp(snow, ramp(0.95, 1.25, height) * ramp(1.6, 1.1, steepness));
        (color * (1.0 + 0.22 * grain)).clamp(DVec3::ZERO, DVec3::ONE)
    }
}

/// 0 at and before `from`, 1 at and after `to`, smooth between; `to` may be less than `from`.
fn ramp(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
