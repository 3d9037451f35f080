//! Trees are built over whatever geometry there is: complete, of bounded depth, and without taking quadratic time.

mod accel_support;

use accel_support::{Built, Rng, geometry, mesh, soup};
use glam::{DAffine3, DVec3, Vec3};
use stillray::accel::{BvhBuildParams, Geometry, MAX_COORDINATE};
use stillray::oracle::traverse::{Query, closest};
use stillray::progress::{Progress, Quiet};
use stillray::scene::{Mesh, Scene};
use stillray::shaders;

const COUNT: usize = 20_000;

fn triangle(at: Vec3, size: f32) -> [Vec3; 3] {
    [at, at + Vec3::X * size, at + Vec3::Y * size]
}

/// Arrangements on which clustering by neighbours ties or nests all along, and extreme ones.
fn arrangements() -> Vec<(&'static str, Mesh)> {
    let mut rng = Rng::new(1);
    let rng = &mut rng;
    let mut all: Vec<(&str, Mesh)> = Vec::new();
    let mut add = |name: &'static str, corners: &mut dyn FnMut(usize) -> [Vec3; 3]| {
        all.push((name, soup((0..COUNT).map(corners))));
    };
    let power = |i: usize| 2f32.powi((i % 150) as i32 - 110);
    add("all the same", &mut |_| triangle(Vec3::ONE, 0.01));
    add("all the same but one", &mut |i| triangle(if i == 0 { Vec3::ZERO } else { Vec3::ONE }, 0.01));
    add("stacked in a hundred places", &mut |i| triangle(Vec3::splat((i % 100) as f32), 0.01));
    add("points", &mut |i| triangle(Vec3::splat((i % 100) as f32), 0.0));
    add("all in one point", &mut |_| triangle(Vec3::ONE, 0.0));
    add("in a row", &mut |i| triangle(Vec3::X * i as f32, 1.0));
    add("inside each other", &mut |i| triangle(Vec3::ZERO, 1.0 + i as f32));
    add("around a corner", &mut |i| [Vec3::ZERO, Vec3::new(i as f32, 0.0, 1.0), Vec3::new(0.0, i as f32, i as f32)]);
    add("growing by powers of two", &mut |i| triangle(Vec3::X * power(i), power(i)));
    add("slivers", &mut |i| [Vec3::ZERO, Vec3::X, Vec3::new(0.5, 1e-30 * i as f32, 0.0)]);
    add("huge", &mut |_| triangle(rng.cube().as_vec3() * 1e13, 1e10));
    add("tiny", &mut |_| triangle(rng.cube().as_vec3() * 1e-30, 1e-35));
    add("large ones through each other", &mut |_| std::array::from_fn(|_| rng.cube().as_vec3()));
    all
}

#[test]
fn trees_over_degenerate_geometry_are_complete_and_shallow() {
    for (name, mesh) in arrangements() {
        let geometry = geometry(vec![mesh], &[0]);
        let record = &geometry.meshes[0];
        assert_eq!(record.triangle_count as usize, COUNT, "{name}");
        assert!(record.depth + 2 < shaders::TRAVERSAL_STACK, "{name}: depth {}", record.depth);
        let mut sources = geometry.source_triangles.clone();
        sources.sort_unstable();
        assert!(sources.iter().enumerate().all(|(i, &s)| i == s as usize), "{name}");
        let mut reached = vec![0; COUNT];
        walk(&geometry, 0, 1, &mut |slot, depth| {
            assert!(depth <= record.depth, "{name}");
            reached[slot as usize] += 1;
        });
        assert!(reached.iter().all(|&n| n == 1), "{name}");
    }
}

fn walk(geometry: &Geometry, index: u32, depth: u32, visit: &mut dyn FnMut(u32, u32)) {
    let node = &geometry.nodes[index as usize];
    let imask = node[3] >> 24;
    let mut inner = 0;
    for child in 0..8 {
        let meta = (node[6 + child / 4] >> (8 * (child % 4))) & 0xff;
        if imask >> child & 1 == 1 {
            walk(geometry, node[4] + inner, depth + 1, visit);
            inner += 1;
        } else if meta != 0 {
            let first = node[5] + (meta & 0x1f);
            (first..first + (meta >> 5).count_ones()).for_each(|slot| visit(slot, depth));
        }
    }
}

#[test]
fn empty_things_are_fine() {
    let nothing = Built::new(Vec::new(), &[], DVec3::ZERO);
    let empty = Built::new(vec![Mesh::default()], &[(0, DAffine3::IDENTITY)], DVec3::ZERO);
    for built in [nothing, empty] {
        assert_eq!((built.tlas.nodes.len(), built.tlas.left_out), (1, 0));
        let query = Query { origin: Vec3::ZERO, direction: Vec3::X, tmax: f32::INFINITY };
        assert_eq!(closest(&built.world(), &query), None);
    }
}

#[test]
fn unusable_rays_hit_nothing() {
    let built = Built::one(accel_support::cube());
    let hit = |origin, direction| closest(&built.world(), &Query { origin, direction, tmax: f32::INFINITY });
    assert!(hit(Vec3::ZERO, Vec3::X).is_some());
    for bad in [Vec3::ZERO, Vec3::splat(f32::INFINITY), Vec3::splat(1e-30), Vec3::splat(1e30), Vec3::NAN] {
        assert_eq!(hit(Vec3::ZERO, bad), None);
        assert!(bad == Vec3::ZERO || bad == Vec3::splat(1e-30) || hit(bad, Vec3::X).is_none());
    }
}

#[test]
fn singular_and_distant_instances_are_left_out_and_counted() {
    let scale = |x, y, z| DAffine3::from_scale(DVec3::new(x, y, z));
    let placed = [
        (0, scale(1.0, 0.0, 1.0)),
        (0, DAffine3::from_translation(DVec3::X * 1e15)),
        (0, scale(1.0, f64::NAN, 1.0)),
        (1, DAffine3::IDENTITY),
        (0, scale(0.5, -2.0, 1.0)),
    ];
    let built = Built::new(vec![accel_support::cube(), Mesh::default()], &placed, DVec3::ZERO);
    assert_eq!(built.tlas.left_out, 3);
    let query = Query { origin: Vec3::ZERO, direction: Vec3::X, tmax: f32::INFINITY };
    let hit = closest(&built.world(), &query).unwrap();
    assert_eq!((hit.instance, hit.t), (4, 0.5));
}

#[test]
fn broken_meshes_are_refused_in_words() {
    let refused = |mesh: Mesh| {
        let scene = Scene { name: "s".to_owned(), meshes: vec![mesh], ..Scene::default() };
        Geometry::build(&scene, &BvhBuildParams::medium_build(), &Quiet).unwrap_err().to_string()
    };
    let corner = |x: f32| mesh(vec![Vec3::ZERO, Vec3::Y, Vec3::X * x], vec![[0, 1, 2]]);
    assert!(refused(mesh(vec![Vec3::ZERO; 3], vec![[0, 1, 3]])).contains("names a vertex"));
    assert!(refused(Mesh { triangle_materials: vec![], ..corner(1.0) }).contains("material"));
    assert!(refused(corner(MAX_COORDINATE * 2.0)).contains("beyond"));
    assert!(refused(corner(f32::NAN)).contains("not finite"));
}

/// The tree is the same whatever the number of threads, so a frame is.
#[test]
fn trees_do_not_depend_on_the_number_of_threads() {
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut rng = Rng::new(8);
        let meshes =
            vec![accel_support::random_soup(&mut rng, 60_000, 0.02), accel_support::crumpled(&mut rng, 3, 2.0)];
        pool.install(|| geometry(meshes, &[0, 1]))
    };
    let (one, four) = (build(1), build(4));
    assert!(one.nodes == four.nodes && one.source_triangles == four.source_triangles);
}

/// Progress ends at the number of triangles.
#[test]
fn progress_adds_up() {
    #[derive(Default)]
    struct Counting(std::sync::atomic::AtomicU64, std::sync::atomic::AtomicU64);
    impl Progress for Counting {
        fn begin(&self, _stage: &str, steps: u64) {
            self.0.store(steps, std::sync::atomic::Ordering::Relaxed);
        }
        fn advance(&self, steps: u64) {
            self.1.fetch_add(steps, std::sync::atomic::Ordering::Relaxed);
        }
        fn finish(&self) {}
    }
    let counting = Counting::default();
    let scene = accel_support::scene(vec![accel_support::icosphere(3), accel_support::cube()], &[0, 1]);
    Geometry::build(&scene, &BvhBuildParams::medium_build(), &counting).unwrap();
    assert_eq!((counting.0.into_inner(), counting.1.into_inner()), (1292, 1292));
}
