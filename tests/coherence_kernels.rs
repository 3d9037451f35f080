//! What secondary rays and marches through a medium cost (paper 2, section 5) is counted on the device as by the twin on the CPU.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod accel_support;
mod stage_support;
mod support;

use bytemuck::bytes_of;
use glam::{DVec3, Vec3};
use stage_support::{Draw, Gallery, Theatre};
use std::cell::{Cell, RefCell};
use stillray::oracle::camera::pixel_index;
use stillray::oracle::count::{Thread, count};
use stillray::oracle::medium::{Air, Seen};
use stillray::oracle::shade::light::light_at;
use stillray::oracle::traverse::{Cost, Intersection, Query, Surfaces, cost};
use stillray::scene::Medium;
use stillray::scene::medium::noise;
use stillray::shaders::{
    self, Counters, FRAME_PATHS_MIXED, FRAME_PATHS_SPREAD, Found, LIGHT_DIRECTIONAL, Light, MODEL_COUNT, NO_PATH,
    PATH_KIND, PathCounters, RAY_MARCH, RAY_REFLECTED, RAY_REFRACTED, Shaded, Traversals,
};
use stillray::stats::{RayCost, RayCosts};
use support::kernel::{Kernel, blank, data, values};
use support::random::Random;

const SIZE: [u32; 2] = [40, 28];
/// Samples, and rays among them.
const SAMPLES: u32 = 1500;
const RAYS: u32 = 900;

/// What may differ: a packet's triangles are told by a logarithm, which moves the rounding of each by one at most.
fn agree(device: &RayCost, twin: &RayCost) -> bool {
    let apart = device.packet_triangles.abs_diff(twin.packet_triangles);
    apart <= twin.packets && RayCost { packet_triangles: 0, ..*device } == RayCost { packet_triangles: 0, ..*twin }
}

/// What a ray costs where surfaces have holes; none if a hole is in doubt, where another rounding may find it closed.
fn cost_of(theatre: &Theatre, query: &Query, shadow: bool) -> Option<Cost> {
    let (stage, doubtful) = (theatre.stage(true), Cell::new(false));
    let exists = |hit: &Intersection| {
        if shadow { stage.shadow_hit(hit, &doubtful) } else { stage.alpha_hit(hit, &doubtful) }
    };
    let cost = cost(&stage.world, query, shadow, &Surfaces { exists: &exists, is_one_sided: &|_| false });
    (!doubtful.get()).then_some(cost)
}

/// A ray from somewhere in the theatre to anywhere, of either kind.
struct Ray {
    query: Query,
    kind: u32,
    cost: Cost,
}

fn rays(theatre: &Theatre, random: &mut Random) -> Vec<Ray> {
    let infinity = f32::INFINITY;
    let mut rays = Vec::new();
    while rays.len() < RAYS as usize {
        let origin = Vec3::new(random.between(-5.0, 5.0), random.between(-2.5, 3.5), random.between(-10.0, -3.0));
        let query = Query { origin, direction: Vec3::from(random.direction()), tmax: infinity };
        let kind = random.pick(&[RAY_REFLECTED, RAY_REFRACTED]);
        rays.extend(cost_of(theatre, &query, false).map(|cost| Ray { query, kind, cost }));
    }
    rays
}

/// How the rays of a step are listed: what is in the list, for each thread the ray it traces, and the counters that go with it.
struct Listed {
    list: Vec<u32>,
    threads: Vec<Option<u32>>,
    counters: PathCounters,
}

fn listed(flags: u32, rays: &[Ray], slots: &[u32]) -> Listed {
    let of = |kind| (0..RAYS).filter(move |i| rays[*i as usize].kind == kind);
    let (reflected, refracted): (Vec<u32>, Vec<u32>) = (of(RAY_REFLECTED).collect(), of(RAY_REFRACTED).collect());
    let mut list = vec![NO_PATH; SAMPLES as usize];
    let threads: Vec<Option<u32>> = match flags {
        // Each where its sample is.
        FRAME_PATHS_SPREAD => {
            slots.iter().for_each(|slot| list[*slot as usize] = *slot);
            (0..SAMPLES).map(|slot| slots.iter().position(|s| *s == slot).map(|i| i as u32)).collect()
        }
        FRAME_PATHS_MIXED => {
            list[..RAYS as usize].copy_from_slice(slots);
            (0..RAYS).map(Some).collect()
        }
        _ => {
            reflected.iter().zip(&mut list).for_each(|(i, entry)| *entry = slots[*i as usize]);
            refracted.iter().zip(list.iter_mut().rev()).for_each(|(i, entry)| *entry = slots[*i as usize]);
            reflected.iter().chain(&refracted).map(|i| Some(*i)).collect()
        }
    };
    let [reflected, refracted] = [reflected, refracted].map(|list| list.len() as u32);
    let counters = PathCounters { reflected, refracted, listed: threads.len() as u32, ..PathCounters::default() };
    Listed { list, threads, counters }
}

fn bounced(
    theatre: &Theatre,
    draw: &Draw,
    kernel: &Kernel,
    gallery: &Gallery,
    rays: &[Ray],
    slots: &[u32],
    listed: &Listed,
) -> RayCosts {
    let mut origins = vec![[0u32; 4]; SAMPLES as usize];
    let mut directions = origins.clone();
    for (ray, slot) in rays.iter().zip(slots) {
        let bits = |v: Vec3, last: u32| [v.x.to_bits(), v.y.to_bits(), v.z.to_bits(), last];
        origins[*slot as usize] = bits(ray.query.origin, ray.kind << PATH_KIND);
        directions[*slot as usize] = bits(ray.query.direction, 0);
    }
    let geometry = &theatre.geometry;
    let mut bound = vec![
        data(&[theatre.frame]),
        data(&theatre.instances),
        theatre.nodes(),
        data(&geometry.triangle_corners),
        data(&geometry.triangle_rest),
        data(&origins),
        data(&directions),
        data(&listed.list),
        data(&[listed.counters]),
        blank::<Found>(SAMPLES as usize),
        data(&geometry.triangles),
        data(&theatre.materials),
        data(&geometry.vertices),
        gallery.bound(),
        Gallery::srgb(),
        blank::<f32>(1),
    ];
    bound.extend(draw.bound(SAMPLES as usize));
    bound.push(data(&[Traversals::default()]));
    let push = shaders::bounce::Push { step: 0 };
    kernel.run(&mut bound, bytes_of(&push), [SAMPLES.next_multiple_of(64), 1, 1]);
    RayCosts::of(&values::<Traversals>(&bound[18])[0])
}

#[test]
fn secondary_rays_cost_what_their_twins_cost_however_they_are_listed() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::bounce::modelling(MODEL_COUNT));
    let random = &mut Random::new(3);
    let mut theatre = Theatre::new(SIZE);
    let gallery = Gallery::new(&context, &theatre.atlas);
    theatre.frame.capacity = SAMPLES;
    // The shutter is not open: each ray has the frame's end for its time.
    let draw = Draw::random(random);
    let rays = rays(&theatre, random);
    let mut slots: Vec<u32> = (0..SAMPLES).collect();
    random.shuffle(&mut slots);
    slots.truncate(RAYS as usize);
    slots.sort_unstable();
    let mut held = Vec::new();
    for flags in [0, FRAME_PATHS_MIXED, FRAME_PATHS_SPREAD] {
        theatre.frame.flags = flags;
        let listed = listed(flags, &rays, &slots);
        let device = bounced(&theatre, &draw, &kernel, &gallery, &rays, &slots, &listed);
        let thread = |i: &Option<u32>| match i.map(|i| &rays[i as usize]) {
            Some(ray) => Thread { kind: ray.kind, rays: vec![ray.cost.clone()] },
            None => Thread { kind: RAY_REFLECTED, rays: Vec::new() },
        };
        let threads: Vec<Thread> = listed.threads.iter().map(thread).collect();
        let twin = count(&threads);
        println!("{flags}: {:?} {:?}", device.reflection, device.refraction);
        assert!(agree(&device.reflection, &twin.reflection), "{flags}: {:?} {:?}", device.reflection, twin.reflection);
        assert!(agree(&device.refraction, &twin.refraction), "{flags}: {:?} {:?}", device.refraction, twin.refraction);
        assert!(device.reflection.rays > 300 && device.refraction.rays > 300);
        assert_eq!((device.camera, device.shadow, device.march), Default::default());
        held.push(device.reflection.held + device.refraction.held);
        // Negative controls: a ray of the other kind, and two rays that swap packets.
        let mut other = threads.clone();
        let first = other.iter().position(|t| !t.rays.is_empty()).unwrap();
        other[first].kind ^= RAY_REFLECTED ^ RAY_REFRACTED;
        assert!(!agree(&device.reflection, &count(&other).reflection));
        let mut other = threads;
        other.rotate_left(8);
        let of = |costs: &RayCosts| costs.reflection.plus(&costs.refraction);
        assert!(!agree(&of(&device), &of(&count(&other))));
    }
    // Threads without a ray wait for those that have one.
    assert!(held[2] * 10 > held[1] * 11, "{held:?}");
    support::assert_clean(&context);
}

/// What each pixel's march sends to lights, by the twin: in the order of the threads of 8 x 8 pixels.
fn marches(theatre: &Theatre, medium: &shaders::Medium, noise: &[f32], depth: f64) -> Vec<Thread> {
    let air = Air { medium, noise };
    let [width, height] = SIZE;
    let march = |x: u32, y: u32| {
        let thread = RefCell::new(Thread { kind: RAY_MARCH, rays: Vec::new() });
        if x < width && y < height {
            let [u, v] = [(f64::from(x) + 0.5) / f64::from(width), (f64::from(y) + 0.5) / f64::from(height)];
            let [w, h] = [theatre.frame.right[3], theatre.frame.up[3]].map(f64::from);
            let direction = DVec3::new((2.0 * u - 1.0) * w, (1.0 - 2.0 * v) * h, -1.0).normalize();
            let seen = [Seen { depth, color: DVec3::ONE }];
            let reaches = |point: DVec3, light: &Light| {
                let point = point.as_vec3();
                if light_at(light, point.to_array()).irradiance.max_element() > 0.0 {
                    let far = light.kind == LIGHT_DIRECTIONAL;
                    let towards = if far { -Vec3::from(light.direction) } else { Vec3::from(light.position) - point };
                    let tmax = if far { f32::INFINITY } else { 1.0 };
                    let query = Query { origin: point, direction: towards, tmax };
                    thread.borrow_mut().rays.push(cost_of(theatre, &query, true).unwrap_or_default());
                }
                true
            };
            air.march(&theatre.frame, (pixel_index([x, y], SIZE) as u32, direction), &theatre.lights, &seen, reaches);
        }
        thread.into_inner()
    };
    let tiles = (0..height.div_ceil(8)).flat_map(|y| (0..width.div_ceil(8)).map(move |x| (8 * x, 8 * y)));
    let threads = tiles.flat_map(|(x, y)| (0..64).map(move |i| (x + i % 8, y + i / 8)));
    threads.map(|(x, y)| march(x, y)).collect()
}

#[test]
fn marches_cost_what_their_twins_cost() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::medium::modelling(MODEL_COUNT));
    let theatre = Theatre::new(SIZE);
    let gallery = Gallery::new(&context, &theatre.atlas);
    let fog = Medium::fog(1e-4);
    let (steps, pixels, depth) = (9, SIZE[0] * SIZE[1], 11.0);
    let medium = shaders::Medium { steps, ..fog.record(DVec3::ZERO, DVec3::ZERO, Vec3::ZERO) };
    let noise = noise(Some(&fog));
    let samples = vec![Shaded { depth: depth as f32, ..Shaded::default() }; pixels as usize];
    let offsets: Vec<u32> = (0..=pixels).collect();
    let geometry = &theatre.geometry;
    let mut bound = vec![
        data(&[theatre.frame]),
        data(&theatre.instances),
        data(&[Counters::default()]),
        theatre.nodes(),
        data(&geometry.triangle_corners),
        data(&geometry.triangle_rest),
        data(&theatre.lights),
        data(&[medium]),
        data(&noise),
        data(&samples),
        data(&offsets),
        data(&offsets),
        data(&geometry.triangles),
        data(&theatre.materials),
        data(&geometry.vertices),
        gallery.bound(),
        Gallery::srgb(),
        data(&[Traversals::default()]),
    ];
    kernel.run(&mut bound, &[], [SIZE[0], SIZE[1], 1]);
    let device = RayCosts::of(&values::<Traversals>(&bound[17])[0]);
    let twin = count(&marches(&theatre, &medium, &noise, depth)).march;
    println!("{:?} {twin:?}", device.march);
    assert_eq!(device.march_steps, u64::from(steps * pixels));
    assert_eq!((device.march.rays, device.march.packets), (twin.rays, twin.packets));
    assert_eq!(u64::from(values::<Counters>(&bound[2])[0].shadow_rays), twin.rays);
    // A point of a march is off by some 2^-22 of its distance, by which a ray goes past a box or an edge of a triangle, or through a
    // hole, in far fewer than one ray in a thousand.
    let near = |a: u64, b: u64| a.abs_diff(b) * 1000 <= b;
    assert!(near(device.march.nodes, twin.nodes) && near(device.march.triangles, twin.triangles));
    assert!(near(device.march.held, twin.held));
    // Negative control: what is looked at is a little nearer.
    let other = count(&marches(&theatre, &medium, &noise, 0.95 * depth)).march;
    assert!(!near(device.march.nodes, other.nodes) || !near(device.march.triangles, other.triangles));
    assert_eq!((device.camera, device.shadow, device.reflection, device.refraction), Default::default());
    support::assert_clean(&context);
}
