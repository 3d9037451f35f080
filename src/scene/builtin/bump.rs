//! A glossy plane under a normal map of fractal noise: shading detail without any geometry.

use super::noise::Fractal;
use super::shapes::{empty, push_quad};
use super::stage::Stage;
use crate::scene::{Image, Material, Scene, Wrap};
use glam::{DVec2, DVec3, Vec3, Vec4};

/// Texels a side of the normal map.
const SIZE: u32 = 512;
/// Lattice cells a side of the coarsest octave.
const CELLS: u32 = 8;

pub(super) fn build(seed: u32) -> Scene {
    let mut stage = Stage::new("bump", Vec3::new(0.18, 0.22, 0.30));
    let normals = stage.texture(normal_map(seed), Wrap::Repeat, false);
    let material = stage.material(Material {
        name: "bumps".to_owned(),
        base_color: Vec4::new(0.16, 0.34, 0.42, 1.0),
        metallic: 0.0,
        roughness: 0.28,
        normal_texture: Some(normals),
        double_sided: true,
        ..Material::default()
    });
    let mut mesh = empty("plane");
    push_quad(&mut mesh, DVec3::new(-2.0, 0.0, 2.0), DVec3::X * 4.0, DVec3::Z * -4.0, material);
    mesh.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); mesh.positions.len()];
    let mesh = stage.mesh(mesh);
    stage.place("plane", mesh);
    stage.point_light(DVec3::new(-1.2, 1.6, -1.4), Vec3::new(1.0, 0.93, 0.82), 22.0);
    stage.camera(DVec3::new(0.0, 2.2, 3.6), DVec3::new(0.0, -0.1, 0.0), 0.66);
    stage.finish()
}

/// Slopes of the noise by central differences across the tiling border, as unit normals in 8 bits a channel.
fn normal_map(seed: u32) -> Image {
    let noise = Fractal { seed, octaves: 6, gain: 0.55, period: CELLS };
    let cells = f64::from(CELLS) / f64::from(SIZE);
    let n = SIZE as usize;
    let heights: Vec<f64> = (0..n * n).map(|i| noise.at(DVec2::new((i % n) as f64, (i / n) as f64) * cells)).collect();
    let height = |x: usize, y: usize| heights[(y % n) * n + x % n];
    let texel = |i: usize| {
        let (x, y) = (i % n, i / n);
        // A bump is 0.12 cells high. Rows run down while the map's green axis points up.
        let slope = 0.12 / (2.0 * cells);
        let right = (height(x + 1, y) - height(x + n - 1, y)) * slope;
        let up = (height(x, y + n - 1) - height(x, y + 1)) * slope;
        let normal = DVec3::new(-right, -up, 1.0).normalize();
        let [r, g, b] = (normal * 127.5 + 127.5).round().to_array().map(|c| c as u8);
        [r, g, b, 255]
    };
    Image { name: "bumps".to_owned(), width: SIZE, height: SIZE, texels: (0..n * n).map(texel).collect() }
}
