//! Trees are built for whatever geometry there is, in bounded time and depth.
use glam::Vec3;
use std::time::Instant;
use stillray::accel::{BvhBuildParams, Geometry};
use stillray::progress::Quiet;
use stillray::scene::{Instance, Material, Mesh, Scene};

fn scene(positions: Vec<Vec3>) -> Scene {
    let n = positions.len() as u32 / 3;
    let mesh = Mesh {
        name: "m".into(),
        positions,
        triangles: (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        triangle_materials: vec![0; n as usize],
        ..Mesh::default()
    };
    Scene {
        meshes: vec![mesh],
        instances: vec![Instance { node: 0, mesh: 0 }],
        materials: vec![Material::default()],
        ..Scene::default()
    }
}
fn go(name: &str, p: Vec<Vec3>) {
    let s = scene(p);
    let t = Instant::now();
    let g = Geometry::build(&s, &BvhBuildParams::medium_build(), &Quiet).unwrap();
    println!(
        "{name}: {} tris, {} nodes, depth {} in {:?}",
        g.triangles.len(),
        g.nodes.len(),
        g.meshes[0].depth,
        t.elapsed()
    );
}
#[test]
fn explore() {
    let tri = |o: Vec3, s: f32| [o, o + Vec3::X * s, o + Vec3::Y * s];
    let mut seed = 1u32;
    let mut rnd = move || {
        seed = seed.wrapping_mul(747796405).wrapping_add(2891336453);
        let w = ((seed >> ((seed >> 28) + 4)) ^ seed).wrapping_mul(277803737);
        ((w >> 22) ^ w) as f32 / 4294967296.0
    };
    let n = 20_000;
    go("random", (0..n).flat_map(|_| tri(Vec3::new(rnd(), rnd(), rnd()), 0.01)).collect());
    go("same", (0..n).flat_map(|_| tri(Vec3::ONE, 0.01)).collect());
    go("same but first", (0..n).flat_map(|i| tri(if i == 0 { Vec3::ZERO } else { Vec3::ONE }, 0.01)).collect());
    go("hundred places", (0..n).flat_map(|i| tri(Vec3::ONE * (i % 100) as f32, 0.01)).collect());
    go("points", (0..n).flat_map(|i| tri(Vec3::ONE * (i % 100) as f32, 0.0)).collect());
    go("line", (0..n).flat_map(|i| tri(Vec3::X * i as f32, 1.0)).collect());
    go(
        "exponential",
        (0..n)
            .flat_map(|i| tri(Vec3::X * 2f32.powi((i % 150) as i32 - 110), 2f32.powi((i % 150) as i32 - 110)))
            .collect(),
    );
    go("concentric", (0..n).flat_map(|i| tri(Vec3::ZERO, 1.0 + i as f32)).collect());
    go(
        "fan",
        (0..n)
            .flat_map(|i| {
                [
                    Vec3::ZERO,
                    Vec3::new((i as f32).cos(), (i as f32).sin(), 0.0),
                    Vec3::new((i as f32 + 0.1).cos(), (i as f32 + 0.1).sin(), 0.0),
                ]
            })
            .collect(),
    );
    go("huge", (0..n).flat_map(|_| tri(Vec3::new(rnd(), rnd(), rnd()) * 1e13, 1e10)).collect());
    go("tiny", (0..n).flat_map(|_| tri(Vec3::new(rnd(), rnd(), rnd()) * 1e-30, 1e-35)).collect());
    go("empty", vec![]);
    let mut big = |k: usize| -> Vec<Vec3> { (0..3 * k).map(|_| Vec3::new(rnd(), rnd(), rnd())).collect() };
    go("big soup", big(n));
    go("big soup x4", big(4 * n));
    go(
        "grid",
        (0..n)
            .flat_map(|i| {
                let (x, y) = ((i % 100) as f32, (i / 100) as f32);
                [Vec3::new(x, y, 0.0), Vec3::new(x + 1.0, y, 0.0), Vec3::new(x, y + 1.0, 0.0)]
            })
            .collect(),
    );
    go(
        "nested at a corner",
        (0..n).flat_map(|i| [Vec3::ZERO, Vec3::new(i as f32, 0.0, 1.0), Vec3::new(0.0, i as f32, i as f32)]).collect(),
    );
    go("one", tri(Vec3::ONE, 1.0).to_vec());
}
