//! What rays cost (paper 2, section 5): the device counts what its twin on the CPU counts, and counting changes nothing else.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use std::cell::Cell;

use bytemuck::bytes_of;
use rayon::prelude::*;
use stillray::accel::{BvhBuildParams, Geometry, Tlas, place};
use stillray::method::constants::{self, Moment};
use stillray::method::storage::Storage;
use stillray::oracle::count::{Thread, count, different};
use stillray::oracle::generate::generate;
use stillray::oracle::shade::texture::Textures;
use stillray::oracle::shadow::shadow_query;
use stillray::oracle::stage::Stage;
use stillray::oracle::traverse::{Intersection, Query, Surfaces, World, closest, cost};
use stillray::oracle::verify::{query, verify};
use stillray::progress::Quiet;
use stillray::renderer::{FrameStats, Method, RayCosts, Settings};
use stillray::scene::atlas::{Atlas, material_records};
use stillray::scene::motion::Motion;
use stillray::scene::{Medium, Scene, View};
use stillray::settings::Grouping;
use stillray::shaders::{self, RAY_CAMERA, RAY_SHADOW, SKY_INSTANCE, Sample, Shader, Traversals};
use stillray::stats::RayCost;
use support::kernel::{Bound, Kernel, blank, data, values};
use support::rig::{Rig, bits, load};

const SIZE: [u32; 2] = [64, 48];
/// Without holes in surfaces, and without anything that is drawn at random but places in pixels.
const SCENES: [&str; 3] = ["builtin:cornell", "builtin:spheres", "builtin:hairball?strands=300"];

fn settings(method: Method) -> Settings {
    Settings { size: SIZE, spp: 4, density: 2.0, count: true, ..Settings::of(method) }
}

/// A frame of a scene on the host.
struct Seen {
    geometry: Geometry,
    tlas: Tlas,
    instances: Vec<shaders::Instance>,
    materials: Vec<shaders::Material>,
    textures: Textures,
    lights: Vec<shaders::Light>,
    frame: shaders::Frame,
}

impl Seen {
    fn new(scene: &Scene, settings: &Settings, view: View) -> Self {
        let pose = scene.pose(0.0);
        let geometry = Geometry::build(scene, &BvhBuildParams::medium_build(), &Quiet).unwrap();
        let placed = |(mesh, transform): (&u32, &glam::DAffine3)| {
            let at = (transform, view.position);
            place(&geometry, &geometry.meshes[*mesh as usize], at, at)
        };
        let mut instances: Vec<shaders::Instance> =
            geometry.instance_meshes.iter().zip(&pose.instances).map(placed).collect();
        let mut tlas = Tlas::default();
        tlas.rebuild(&geometry, &mut instances);
        let atlas = Atlas::pack(&scene.images, 4096, 64).unwrap();
        let light = |(light, pose)| constants::light(light, pose, view.position, glam::DVec3::ZERO);
        let moment = Moment {
            view,
            previous: view,
            frame: 0,
            reset: true,
            settled: false,
            lit_for: 0,
            lights: scene.lights.len() as u32,
            instances: instances.len() as u32,
        };
        Self {
            frame: constants::frame(settings, &Storage::new(settings, 0), &scene.environment, &moment),
            lights: scene.lights.iter().zip(&pose.lights).map(light).collect(),
            materials: material_records(scene, &atlas),
            textures: Textures::new(atlas),
            geometry,
            tlas,
            instances,
        }
    }

    fn world(&self) -> World<'_> {
        World { geometry: &self.geometry, tlas: &self.tlas, instances: &self.instances, time: 1.0 }
    }

    fn stage(&self) -> Stage<'_> {
        Stage {
            frame: &self.frame,
            world: self.world(),
            materials: &self.materials,
            textures: &self.textures,
            alpha: false,
            lens: [0.0; 2],
            afar: None,
            shining: None,
        }
    }

    fn nodes(&self) -> Bound<'static> {
        let mut nodes = self.tlas.nodes.clone();
        nodes.resize(self.geometry.tlas_capacity as usize, [0; 20]);
        nodes.extend_from_slice(&self.geometry.nodes);
        data(&nodes)
    }

    /// Runs a kernel that traces a list of rays; what each cost, and all together.
    fn trace(&self, shader: &'static Shader, queries: &[Query]) -> (Vec<[u32; 2]>, RayCosts) {
        let context = support::validated_context();
        let ray = |q: &Query| [q.origin.extend(q.tmax).to_array(), q.direction.extend(0.0).to_array()];
        let rays: Vec<[f32; 4]> = queries.iter().flat_map(ray).collect();
        let count = queries.len();
        let mut bound = vec![
            self.nodes(),
            data(&self.geometry.triangle_corners),
            data(&self.geometry.triangle_rest),
            data(&self.instances),
            data(&rays),
        ];
        // What was hit, then what it cost, then the sums.
        bound.push(blank::<u32>(count));
        if shader.name == shaders::closest_count::SHADER.name {
            bound.push(blank::<shaders::Hit>(count));
        }
        bound.extend([blank::<[u32; 2]>(count), data(&[Traversals::default()])]);
        let push = shaders::closest_count::Push { count: count as u32 };
        Kernel::new(&context, shader).run(&mut bound, bytes_of(&push), [count.next_multiple_of(64) as u32, 1, 1]);
        let sums: Traversals = values(&bound[bound.len() - 1])[0];
        support::assert_clean(&context);
        (values(&bound[bound.len() - 2]), RayCosts::of(&sums))
    }
}

/// Opaque from both sides.
const SOLID: Surfaces<'static> = Surfaces { exists: &|_| true, is_one_sided: &|_| false };

fn threads(world: &World<'_>, kind: u32, queries: &[Query]) -> Vec<Thread> {
    let one = |query: &Query| Thread { kind, rays: vec![cost(world, query, kind == RAY_SHADOW, &SOLID)] };
    queries.iter().map(one).collect()
}

/// What may differ: a packet's triangles are told by a logarithm, which moves the rounding of each by one at most.
fn agree(device: &RayCost, twin: &RayCost) -> bool {
    let apart = device.packet_triangles.abs_diff(twin.packet_triangles);
    apart <= twin.packets && RayCost { packet_triangles: 0, ..*device } == RayCost { packet_triangles: 0, ..*twin }
}

/// Only a reciprocal may round otherwise on another driver (tests/traverse_gpu.rs), and a box be missed by it: there a ray in a
/// thousand may differ. On lavapipe none does.
#[test]
fn every_ray_costs_on_the_device_what_it_costs_the_twin() {
    for name in SCENES {
        let scene = load(name);
        let settings = settings(Method::Supersample);
        let rig_view = scene.pose(0.0).cameras[0];
        let seen = Seen::new(&scene, &settings, rig_view);
        let (stage, world) = (seen.stage(), seen.world());
        let samples = generate(&seen.frame).samples;
        let camera: Vec<Query> = samples.iter().map(|s| query(&stage, *s)).collect();
        let to_light = |query: &Query| -> Option<Query> {
            let hit: Intersection = closest(&world, query)?;
            let found = shaders::Found { instance: hit.instance, primitive: hit.primitive, u: hit.u, v: hit.v };
            shadow_query(&stage, &seen.lights[0], &found, &Cell::new(false))
        };
        let shadow: Vec<Query> = camera.iter().filter_map(to_light).collect();
        let kernels =
            [(RAY_CAMERA, shaders::closest_count::SHADER, &camera), (RAY_SHADOW, shaders::any_count::SHADER, &shadow)];
        for (kind, shader, queries) in kernels {
            let (costs, sums) = seen.trace(shader, queries);
            let twins = threads(&world, kind, queries);
            let each = |t: &Thread| [t.rays[0].nodes, t.rays[0].tested.len() as u32];
            let differing = costs.iter().zip(&twins).filter(|(device, twin)| **device != each(twin)).count();
            println!("{name}, {}: {differing} of {} rays differ", shader.name, queries.len());
            assert!(queries.len() > 1000 && differing * 1000 <= queries.len(), "{name} {}", shader.name);
            let (of, other) = if kind == RAY_CAMERA { (sums.camera, sums.shadow) } else { (sums.shadow, sums.camera) };
            let all = count(&twins);
            let twin = if kind == RAY_CAMERA { all.camera } else { all.shadow };
            assert_eq!((other, of.rays), (RayCost::default(), twin.rays));
            assert!(differing > 0 || agree(&of, &twin), "{name}: {of:?} {twin:?}");
            // Negative controls: rays that end elsewhere cost something else, and so does another order.
            let turned = threads(&world, if kind == RAY_CAMERA { RAY_SHADOW } else { RAY_CAMERA }, queries);
            assert!(twins.iter().zip(&turned).filter(|(a, b)| each(a) != each(b)).count() * 50 > queries.len());
            let mut scattered = twins.clone();
            scattered.sort_by_key(|t| t.rays[0].tested.len() * 7919 % 101);
            assert!(!agree(&of, &if kind == RAY_CAMERA { count(&scattered).camera } else { count(&scattered).shadow }));
        }
    }
}

/// A whole frame: camera rays of new samples, and a shadow ray a light from what they found.
#[test]
fn a_frame_costs_what_its_twin_costs() {
    for name in SCENES {
        let rig = Rig::new(load(name));
        let settings = settings(Method::Supersample);
        let mut session = rig.session(&settings);
        let stats = rig.frame(&mut session, Motion::Static, 0);
        let costs = stats.costs.unwrap();
        let seen = Seen::new(&rig.scene, &settings, rig.view(Motion::Static, 0.0));
        let stage = seen.stage();
        let is_one_sided = |primitive| stage.is_one_sided(primitive);
        let walls = Surfaces { exists: &|_| true, is_one_sided: &is_one_sided };
        let samples = generate(&seen.frame).samples;
        let camera = |s: &Sample| Thread {
            kind: RAY_CAMERA,
            rays: vec![cost(&seen.world(), &query(&stage, *s), false, &walls)],
        };
        let doubtful = Cell::new(false);
        let shadow = |s: &Sample| {
            let found = verify(&stage, *s).found;
            let visible = found.instance != SKY_INSTANCE;
            let queries =
                seen.lights.iter().filter_map(|l| shadow_query(&stage, l, &found, &doubtful).filter(|_| visible));
            let rays = queries.map(|query| cost(&seen.world(), &query, true, &SOLID)).collect();
            Thread { kind: RAY_SHADOW, rays }
        };
        let surfaces = |s: &&Sample| verify(&stage, **s).found.instance != SKY_INSTANCE;
        let none = Thread { kind: RAY_SHADOW, rays: Vec::new() };
        let camera = count(&samples.iter().map(camera).collect::<Vec<_>>()).camera;
        let shadows: Vec<Thread> =
            samples.iter().map(|s| if surfaces(&s) { shadow(s) } else { none.clone() }).collect();
        let shadow = count(&shadows).shadow;
        println!("{name}: {costs:?}");
        assert!(agree(&costs.camera, &camera), "{name}: {:?} {camera:?}", costs.camera);
        // The origin of a shadow ray is a normalised sum of products, which a compiler may fuse: a ray in a thousand may go by
        // another box or triangle. On lavapipe none does.
        let near = |a: u64, b: u64| a.abs_diff(b) * 1000 <= b;
        assert_eq!(costs.shadow.rays, shadow.rays);
        assert!(near(costs.shadow.nodes, shadow.nodes) && near(costs.shadow.triangles, shadow.triangles), "{name}");
        assert!(near(costs.shadow.held, shadow.held) && near(costs.shadow.packets, shadow.packets), "{name}");
        println!("{name}: shadows of device and twin agree: {}", agree(&costs.shadow, &shadow));
        // What the device estimates of packets, against what they have: the mean of many sets is nearer than each.
        let exact: u64 = shadows.chunks(16).map(different).sum();
        let deviation = 0.02 / (shadow.packets as f64).sqrt();
        let off = costs.shadow.packet_triangles as f64 / exact as f64 - 1.0;
        // Five deviations; half of one on the few of a packet where that is no whole number.
        assert!(off.abs() < 5.0 * deviation + 0.5 * shadow.packets as f64 / exact as f64, "{name}: {off}");
        rig.assert_clean();
    }
}

/// Fog that hides nothing.
fn thin_fog(mut scene: Scene, steps: u32) -> (Scene, Settings) {
    scene.medium = Some(Medium::fog(1e-6));
    (scene, Settings { medium_steps: steps, ..settings(Method::Stable) })
}

#[test]
fn counting_changes_nothing_else_and_counts_the_rays_of_every_frame() {
    for (name, methods) in [
        ("builtin:ashtray", &[Method::Stable, Method::Supersample][..]),
        ("builtin:mist", &[Method::Stable]),
        ("builtin:cornell", &[Method::PointTracking, Method::Stable]),
    ] {
        let rig = Rig::new(load(name));
        for method in methods {
            let counting = settings(*method);
            let [mut with, mut without] =
                [true, false].map(|count| rig.session(&Settings { count, ..counting.clone() }));
            for i in 0..3 {
                let [counted, plain] = [&mut with, &mut without].map(|s| rig.frame(s, Motion::Pan, i));
                assert_eq!(FrameStats { costs: None, ..counted }, plain, "{name}");
                assert_eq!(bits(&with.color().unwrap()), bits(&without.color().unwrap()), "{name}, {}", method.name());
                let costs = counted.costs.unwrap();
                let rays = [
                    costs.camera.rays,
                    costs.shadow.rays + costs.march.rays,
                    costs.reflection.rays,
                    costs.refraction.rays,
                ];
                let told = [plain.rays, plain.shadow_rays, plain.reflection_rays, plain.refraction_rays].map(u64::from);
                assert_eq!(rays, told, "{name}, {}, frame {i}", method.name());
                for (kind, cost) in costs.kinds().into_iter().filter(|(_, cost)| cost.rays > 0) {
                    assert!((0.05..=1.0).contains(&cost.utilisation()), "{name}, {kind}: {cost:?}");
                    // A packet has at most what its rays have, but for what is estimated, and at least what one of them has.
                    assert!(cost.packet_triangles as f64 <= 1.02 * cost.triangles as f64, "{name}, {kind}: {cost:?}");
                    assert!(cost.nodes >= cost.rays && cost.packets > 0, "{name}, {kind}: {cost:?}");
                }
            }
        }
        rig.assert_clean();
    }
}

#[test]
fn every_pixel_marches_as_many_steps_as_it_is_told() {
    for steps in [1, 12] {
        let (scene, settings) = thin_fog(load("builtin:cornell"), steps);
        let rig = Rig::new(scene);
        let mut session = rig.session(&settings);
        let costs = rig.frame(&mut session, Motion::Static, 0).costs.unwrap();
        // The box is all around: each pixel has something to march to, and nothing ends a march early.
        assert_eq!(costs.march_steps, u64::from(SIZE[0] * SIZE[1] * steps));
        assert!(costs.march.rays > 0 && costs.march.rays <= costs.march_steps);
        rig.assert_clean();
    }
}

#[test]
fn secondary_rays_are_the_same_however_they_are_grouped() {
    let rig = Rig::new(load("builtin:ashtray"));
    let run = |grouping: Grouping, count: bool| {
        let mut session = rig.session(&Settings { path_grouping: grouping, count, ..settings(Method::Stable) });
        let frames: Vec<FrameStats> = (0..3).map(|i| rig.frame(&mut session, Motion::Pan, i)).collect();
        (bits(&session.color().unwrap()), frames)
    };
    let (picture, frames) = run(Grouping::Kind, true);
    assert!(frames.iter().all(|f| f.reflection_rays > 100 && f.refraction_rays > 100));
    let apart = |a: u64, b: u64| a.abs_diff(b) as f64 / b as f64;
    for (grouping, name) in Grouping::ALL {
        let (again, others) = run(grouping, true);
        assert_eq!(picture, again, "{name}");
        assert_eq!(picture, run(grouping, false).0, "{name}, not counted");
        for (a, b) in frames.iter().zip(&others) {
            assert_eq!(FrameStats { costs: None, ..*a }, FrameStats { costs: None, ..*b }, "{name}");
            for ((kind, a), (_, b)) in a.costs.unwrap().kinds().into_iter().zip(b.costs.unwrap().kinds()) {
                assert_eq!((a.rays, a.nodes, a.triangles), (b.rays, b.nodes, b.triangles), "{name}, {kind}");
            }
            let secondary = |f: &FrameStats| f.costs.unwrap().reflection.plus(&f.costs.unwrap().refraction);
            let [dense, other] = [secondary(a), secondary(b)];
            println!("{name}: {:.4} busy, {:.2} triangles/packet", other.utilisation(), other.triangles_per_packet());
            match grouping {
                // Which samples are together depends on the order in which workgroups come.
                Grouping::Kind => assert!(apart(dense.held, other.held) < 0.05, "{dense:?} {other:?}"),
                Grouping::Mixed => {}
                // Threads without a ray wait too.
                Grouping::None => assert!(other.utilisation() < 0.8 * dense.utilisation(), "{dense:?} {other:?}"),
            }
        }
    }
    rig.assert_clean();
}

#[test]
fn counts_are_the_same_run_after_run() {
    let rig = Rig::new(load("builtin:ashtray"));
    let run = |grouping| {
        let mut session = rig.session(&Settings { path_grouping: grouping, ..settings(Method::Stable) });
        (0..3).map(|i| rig.frame(&mut session, Motion::Orbit, i).costs.unwrap()).collect::<Vec<_>>()
    };
    // Without lists everything is.
    assert_eq!(run(Grouping::None), run(Grouping::None));
    let packetless = |c: RayCost| RayCost { held: 0, packets: 0, packet_triangles: 0, ..c };
    let certain = |costs: Vec<RayCosts>| -> Vec<_> {
        costs.into_iter().map(|c| (c.camera, c.kinds().map(|(_, cost)| packetless(cost)))).collect()
    };
    assert_eq!(certain(run(Grouping::Kind)), certain(run(Grouping::Kind)));
}

/// Whether a shader has an instruction of this number (SPIR-V 1.6, section 3.49).
fn has(shader: &Shader, opcode: u32) -> bool {
    let words = shader.words();
    let mut at = 5;
    while at < words.len() {
        if words[at] & 0xffff == opcode {
            return true;
        }
        at += (words[at] >> 16).max(1) as usize;
    }
    false
}

/// Kernels are compiled once more for counting, and those that do not count bind nothing for it.
#[test]
fn who_does_not_count_has_nothing_of_it() {
    let counting: Vec<&str> =
        shaders::ALL.iter().filter(|s| s.bindings.iter().any(|b| b.name == "traversals")).map(|s| s.name).collect();
    assert!(shaders::ALL.iter().all(|s| counting.contains(&s.name) == s.name.contains("count")), "{counting:?}");
    let of = |stem: &str| {
        let own = |name: &&&str| {
            name.starts_with(stem)
                && (stem != "shadow"
                    || !["shadow_bounce", "shadow_diffuse"].iter().any(|other| name.starts_with(other)))
        };
        counting.iter().filter(own).count()
    };
    let stems = ["verify", "bounce", "shadow", "shadow_bounce", "shadow_diffuse", "medium", "closest", "any"];
    assert_eq!(stems.map(of), [1; 8]);
    assert_eq!(counting.len(), 8, "{counting:?}");
    // Counting waits at barriers and sets bits of shared words; what only traces has neither.
    const BARRIER: u32 = 224;
    const ATOMIC_OR: u32 = 241;
    for stem in ["verify", "bounce", "medium", "closest", "any"] {
        let own = |s: &&&Shader| s.name == stem || s.name.starts_with(&format!("{stem}_"));
        for shader in shaders::ALL.iter().filter(own) {
            let counts = counting.contains(&shader.name);
            assert_eq!([has(shader, BARRIER), has(shader, ATOMIC_OR)], [counts; 2], "{}", shader.name);
        }
    }
    let settings = |count| Settings { count, ..settings(Method::Stable) };
    let rig = Rig::new(load("builtin:cornell"));
    let buffers = |count| {
        let session = rig.session(&settings(count));
        let plan = stillray::method::plan::describe(session.renderer().plan());
        (plan.contains("traversals"), session.renderer().storage().traversals)
    };
    assert_eq!(buffers(false), (false, 0));
    assert_eq!(buffers(true), (true, size_of::<Traversals>() as u64));
}

#[test]
fn more_rays_than_a_word_counts_are_counted() {
    let mut traversals = Traversals::default();
    traversals.kinds[RAY_SHADOW as usize].nodes = [5, 2];
    assert_eq!(RayCosts::of(&traversals).shadow.nodes, (2 << 32) + 5);
    // The device carries into the high word: sums that begin just below it.
    let seen = Seen::new(
        &load("builtin:cornell"),
        &settings(Method::Supersample),
        load("builtin:cornell").pose(0.0).cameras[0],
    );
    let stage = seen.stage();
    let queries: Vec<Query> = generate(&seen.frame).samples.par_iter().map(|s| query(&stage, *s)).collect();
    let (_, sums) = seen.trace(shaders::closest_count::SHADER, &queries);
    let context = support::validated_context();
    let ray = |q: &Query| [q.origin.extend(q.tmax).to_array(), q.direction.extend(0.0).to_array()];
    let rays: Vec<[f32; 4]> = queries.iter().flat_map(ray).collect();
    traversals = Traversals::default();
    traversals.kinds[RAY_CAMERA as usize].nodes = [u32::MAX - 10, 7];
    let mut bound = vec![
        seen.nodes(),
        data(&seen.geometry.triangle_corners),
        data(&seen.geometry.triangle_rest),
        data(&seen.instances),
        data(&rays),
        blank::<u32>(queries.len()),
        blank::<shaders::Hit>(queries.len()),
        blank::<[u32; 2]>(queries.len()),
        data(&[traversals]),
    ];
    let push = shaders::closest_count::Push { count: queries.len() as u32 };
    let kernel = Kernel::new(&context, shaders::closest_count::SHADER);
    kernel.run(&mut bound, bytes_of(&push), [queries.len().next_multiple_of(64) as u32, 1, 1]);
    let after: Traversals = values(&bound[8])[0];
    let begun = (7 << 32) + u64::from(u32::MAX - 10);
    assert_eq!(RayCosts::of(&after).camera.nodes, begun + sums.camera.nodes);
    support::assert_clean(&context);
}
