//! The built-in scenes are what they say: sizes, finiteness, invariants of `Scene`, determinism, refusals.

use glam::{DQuat, DVec3, Vec3};
use stillray::scene::builtin::{NAMES, load, strands_coverage};
use stillray::scene::{LocalTransform, Mesh, Scene, View};

fn triangles(scene: &Scene) -> usize {
    scene.instances.iter().map(|i| scene.meshes[i.mesh].triangles.len()).sum()
}

/// What is wrong with a scene by the promises of its types, if anything.
fn flaw(scene: &Scene) -> Option<String> {
    let bad = |what: &str| Some(format!("{}: {what}", scene.name));
    if scene.cameras.first().is_none_or(|c| c.name != "main" || !(c.yfov > 0.0 && c.yfov < 3.0)) {
        return bad("no camera named main");
    }
    if scene.nodes.iter().enumerate().any(|(i, n)| n.parent.is_some_and(|p| p >= i)) {
        return bad("a parent after its child");
    }
    let nodes = scene.instances.iter().map(|i| i.node).chain(scene.lights.iter().map(|l| l.node));
    if nodes.chain(scene.cameras.iter().map(|c| c.node)).any(|n| n >= scene.nodes.len()) {
        return bad("a node out of range");
    }
    if scene.images.iter().any(|i| i.texels.len() != (i.width * i.height) as usize || i.texels.is_empty()) {
        return bad("an image of the wrong size");
    }
    scene.meshes.iter().find_map(|m| mesh_flaw(m, scene)).and_then(|f| bad(&f))
}

fn mesh_flaw(mesh: &Mesh, scene: &Scene) -> Option<String> {
    let count = mesh.positions.len();
    let bad = |what: &str| Some(format!("{}: {what}", mesh.name));
    let unit = |v: Vec3| (v.length() - 1.0).abs() < 1e-5;
    if mesh.normals.len() != count || mesh.uvs[0].len() != count || !mesh.normals.iter().all(|n| unit(*n)) {
        return bad("normals or texture coordinates");
    }
    if !mesh.positions.iter().all(|p| p.is_finite()) || !mesh.uvs[0].iter().all(|p| p.is_finite()) {
        return bad("not finite");
    }
    if mesh.triangles.iter().flatten().any(|i| *i as usize >= count) {
        return bad("an index out of range");
    }
    if mesh.triangle_materials.len() != mesh.triangles.len() {
        return bad("a material a triangle");
    }
    if mesh.triangle_materials.iter().any(|m| *m as usize >= scene.materials.len()) {
        return bad("a material out of range");
    }
    let mapped = mesh.triangle_materials.iter().any(|m| scene.materials[*m as usize].normal_texture.is_some());
    if mapped != (mesh.tangents.len() == count && count > 0) {
        return bad("tangents");
    }
    None
}

#[test]
fn every_scene_keeps_the_promises_of_its_types() {
    for (name, _) in NAMES {
        assert_eq!(flaw(&load(name, 1).unwrap()), None);
    }
}

#[test]
fn the_check_of_promises_can_fail() {
    let broken = |change: fn(&mut Scene)| {
        let mut scene = load("cornell", 1).unwrap();
        change(&mut scene);
        flaw(&scene).is_some()
    };
    assert!(broken(|s| s.meshes[0].positions[3].y = f32::NAN));
    assert!(broken(|s| s.meshes[0].triangles[1][2] = 9_999));
    assert!(broken(|s| s.meshes[1].normals[0] *= 0.5));
    assert!(broken(|s| s.cameras.clear()));
    assert!(!broken(|_| ()));
}

#[test]
fn triangle_counts_are_as_documented() {
    let count = |name: &str| triangles(&load(name, 1).unwrap());
    assert_eq!(count("hairball"), 172_800);
    assert_eq!(count("hairball?strands=20000"), 2_880_000);
    assert_eq!(count("hairball?strands=7"), 7 * 144);
    assert_eq!(count("terrain"), 174 * 198 * 2);
    assert_eq!(count("cornell"), 36);
    assert_eq!(count("strands"), 96);
    assert_eq!(count("strands?count=3"), 6);
    assert_eq!(count("text"), 2);
    assert_eq!(count("bump"), 2);
    // Ten balls of 2 * 64 * 31 triangles, the beads of 2 * 32 * 15, and the floor.
    assert_eq!(count("spheres"), 10 * 3_968 + 36 * 960 + 2);
    assert_eq!(count("spheres?beads=0"), 10 * 3_968 + 2);
    // A lathe's outline of 30 points, a marble, bubbles of 2 * 32 * 15, two rolls of 16 points, cloth and sheet.
    let tray = 2 * 128 * (4 * 7 + 1 - 1) + 2 * 64 * 31 + 2 * (2 * 48 * (2 * 7 + 1 - 1)) + 2 + 2;
    assert_eq!(count("ashtray?bubbles=0"), tray);
    assert_eq!(count("ashtray"), tray + 11 * 960);
    // The paper's 16,000 of sixteen balls, cloth and carpet, and eight boxes.
    assert_eq!(count("billiards"), 16_000 + 4 + 8 * 12);
}

#[test]
fn terrain_has_the_paper_s_vertices() {
    assert_eq!(load("terrain", 1).unwrap().meshes[0].positions.len(), 175 * 199);
}

#[test]
fn the_seed_decides_and_the_same_seed_repeats() {
    let positions = |name: &str, seed| load(name, seed).unwrap().meshes[0].positions.clone();
    for name in ["hairball?strands=50", "strands", "terrain"] {
        assert_eq!(positions(name, 5), positions(name, 5));
        assert_ne!(positions(name, 5), positions(name, 6), "{name}");
    }
    let texels = |seed| load("bump", seed).unwrap().images[0].texels.clone();
    assert_eq!(texels(5), texels(5));
    assert_ne!(texels(5), texels(6));
}

#[test]
fn refusals_name_the_parameter_the_value_and_what_is_allowed() {
    let message = |name: &str| load(name, 1).unwrap_err().to_string();
    for (name, parts) in [
        ("teapot", &["teapot", "hairball", "strands", "cornell"][..]),
        ("", &["hairball"]),
        ("hairball?strands=0", &["strands = 0", "1 to 20000"]),
        ("hairball?strands=20001", &["strands = 20001", "1 to 20000"]),
        ("hairball?strands=many", &["strands = many", "1 to 20000"]),
        ("hairball?strands", &["strands", "1 to 20000"]),
        ("hairball?hairs=5", &["hairs=5", "strands"]),
        ("cornell?size=5", &["size=5", "none"]),
        ("spheres?beads=-1", &["beads = -1", "0 to 4096"]),
    ] {
        let message = message(name);
        assert!(parts.iter().all(|p| message.contains(p)), "{name}: {message}");
        assert!(!message.contains('\n'));
    }
}

#[test]
fn meshes_of_solids_are_closed() {
    // Every edge of a closed mesh, by position, is walked once in each direction.
    let open_edges = |mesh: &Mesh| {
        let mut edges = std::collections::HashMap::new();
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let key = |i: u32| mesh.positions[i as usize].to_array().map(|c| (c + 0.0).to_bits());
                *edges.entry((key(a), key(b))).or_insert(0) += 1;
                *edges.entry((key(b), key(a))).or_insert(0) -= 1;
            }
        }
        edges.values().filter(|n| **n != 0).count()
    };
    let hair = load("hairball?strands=20", 3).unwrap();
    assert_eq!(open_edges(&hair.meshes[0]), 0);
    let spheres = load("spheres", 3).unwrap();
    assert!(spheres.meshes.iter().skip(1).all(|m| open_edges(m) == 0));
    let cornell = load("cornell", 3).unwrap();
    assert_eq!(open_edges(&cornell.meshes[1]), 0);
    assert_ne!(open_edges(&cornell.meshes[0]), 0, "the room is open in front: the check can fail");
}

#[test]
fn normals_agree_with_the_winding() {
    for (name, _) in NAMES {
        let scene = load(name, 1).unwrap();
        for mesh in &scene.meshes {
            let against = mesh.triangles.iter().filter(|t| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
                let sum: Vec3 = t.iter().map(|i| mesh.normals[*i as usize]).sum();
                (b - a).cross(c - a).dot(sum.as_dvec3()) <= 0.0
            });
            // A strand that turns sharply within a tube's width may fold a facet over.
            assert!(against.count() <= mesh.triangles.len() / 1000, "{name}/{}", mesh.name);
        }
    }
}

fn view_of(scene: &Scene) -> View {
    let camera = &scene.cameras[0];
    match scene.nodes[camera.node].local {
        LocalTransform::Trs { translation, rotation, .. } => {
            View { position: translation, rotation, yfov: camera.yfov, lens: camera.lens, shutter: camera.shutter }
        }
        LocalTransform::Matrix(_) => panic!("cameras of built-in scenes are placed by TRS"),
    }
}

/// Coverage by counting `n` x `n` points a pixel that lie inside a triangle, seen from `view`.
fn counted_coverage(scene: &Scene, view: &View, size: [u32; 2], n: u32) -> Vec<f64> {
    let mesh = &scene.meshes[0];
    let tan = (view.yfov * 0.5).tan();
    let hits = |x: f64, y: f64| {
        let [w, h] = size.map(f64::from);
        let direction = view.rotation * DVec3::new((x * 2.0 - w) / h * tan, (1.0 - y * 2.0 / h) * tan, -1.0);
        let t = -view.position.z / direction.z;
        let p = view.position + direction * t;
        let inside = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
            let side = |a: DVec3, b: DVec3| (b - a).cross(p - a).z;
            side(a, b) >= 0.0 && side(b, c) >= 0.0 && side(c, a) >= 0.0
        };
        t > 0.0 && mesh.triangles.iter().any(inside)
    };
    let point = |i: u32, k: u32| f64::from(i) + (f64::from(k) + 0.5) / f64::from(n);
    let pixel = |i: u32| {
        let (x, y) = (i % size[0], i / size[0]);
        let count = (0..n * n).filter(|k| hits(point(x, k % n), point(y, k / n))).count();
        count as f64 / f64::from(n * n)
    };
    (0..size[0] * size[1]).map(pixel).collect()
}

/// The largest difference between the analytic coverage and the count, and the bound that the count must keep.
fn coverage_difference(scene: &Scene, change: f64) -> (f64, f64) {
    let main = view_of(scene);
    let turn = DQuat::from_rotation_y(0.3) * DQuat::from_rotation_x(-0.2);
    let view = View { position: turn * main.position * 0.8, rotation: turn, ..main };
    let (size, n) = ([64, 48], 32);
    let shifted = View { yfov: view.yfov * (1.0 + change), ..view };
    let exact = strands_coverage(scene, &shifted, size);
    let counted = counted_coverage(scene, &view, size, n);
    let difference = exact.iter().zip(&counted).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
    // Where a straight side crosses one of the n * n cells of a pixel, the point in the cell's middle misjudges at most
    // half of the cell. A side crosses at most 2n cells of a pixel, and a strand (wider than a cell here) has at most
    // three sides in one pixel.
    (difference, 3.0 * 2.0 * f64::from(n) * 0.5 / f64::from(n * n))
}

#[test]
fn strands_coverage_agrees_with_counting_points() {
    let scene = load("strands?count=9", 2).unwrap();
    let (difference, bound) = coverage_difference(&scene, 0.0);
    assert!(difference <= bound, "{difference} > {bound}");
    let (wrong, _) = coverage_difference(&scene, 0.05);
    assert!(wrong > bound, "the comparison cannot fail: {wrong}");
}

#[test]
fn strands_coverage_adds_up_to_their_areas() {
    // Seen head on, the plane's area maps to pixels by one factor; all strands are inside the frame.
    let scene = load("strands", 2).unwrap();
    let view = view_of(&scene);
    let size = [256, 256];
    let sum: f64 = strands_coverage(&scene, &view, size).iter().map(|c| f64::from(*c)).sum();
    let mesh = &scene.meshes[0];
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
        (b - a).cross(c - a).length() * 0.5
    };
    let scale = 128.0 / (view.position.z * (view.yfov * 0.5).tan());
    let expected: f64 = mesh.triangles.iter().map(|t| area(t) * scale * scale).sum();
    // Each of at most 65,536 values is rounded to f32 once, by 2^-24 of at most 1.
    let bound = 65_536.0 * 2f64.powi(-24);
    assert!((sum - expected).abs() < bound, "{sum} is not {expected}");
}

#[test]
fn strands_keep_apart_and_are_thinner_than_a_pixel() {
    for seed in 0..4 {
        let scene = load("strands?count=64", seed).unwrap();
        let view = view_of(&scene);
        let pixel = 2.0 * view.position.z * (view.yfov * 0.5).tan() / 256.0;
        let mesh = &scene.meshes[0];
        let width = |q: usize| mesh.positions[q * 4].distance(mesh.positions[q * 4 + 3]) as f64 / pixel;
        assert!((0..64).all(|q| (0.299..1.001).contains(&width(q))));
        // Neighbours are nearest at their inner ends, where the frame's rim of 0.22 * 128 pixels holds 64 of them.
        let start = |q: usize| mesh.positions[q * 4].midpoint(mesh.positions[q * 4 + 3]);
        let gap = |q: usize| start(q).distance(start((q + 1) % 64)) as f64 / pixel;
        assert!((0..64).all(|q| gap(q) > 1.5), "seed {seed}");
    }
}

#[test]
fn strands_behind_the_camera_cover_nothing() {
    let scene = load("strands", 2).unwrap();
    let view = view_of(&scene);
    let away = View { rotation: DQuat::from_rotation_y(std::f64::consts::PI), ..view };
    assert!(strands_coverage(&scene, &away, [64, 64]).iter().all(|c| *c == 0.0));
    let inside = View { position: DVec3::new(0.0, 0.0, 0.0), ..view };
    assert!(strands_coverage(&scene, &inside, [64, 64]).iter().all(|c| c.is_finite()));
}
