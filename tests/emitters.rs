//! Triangles that shine, as lights: pictures of what they light up against an integral over them.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod scene_support;

use glam::{Affine2, DAffine3, DQuat, DVec2, DVec3, Vec2, Vec3, Vec4};
use scene_support::{Build, Stage, ahead, direction, look, material, reds, trs};
use std::f64::consts::{FRAC_PI_2, PI};
use stillray::oracle::shade::brdf::Reflector;
use stillray::renderer::{FrameInputs, Method, Settings};
use stillray::scene::{Image, LightKind, Material, Pose, Scene, Texture, TextureRef, View, Wrap};
use stillray::settings::{Hold, Indirect, Modelling};

const FLOOR: f32 = 0.6;
const SIZE: [u32; 2] = [12, 12];
const FRAMES: u32 = 128;

fn floor() -> Build {
    let face_up = DQuat::from_rotation_x(-FRAC_PI_2);
    Build::new(0.0).square(material(Vec3::splat(FLOOR).extend(1.0), 0.0, 1.0), trs(DVec3::ZERO, face_up, 20.0))
}

fn shining(radiance: f32) -> Material {
    Material { emissive: Vec3::splat(radiance), base_color: Vec4::new(0.0, 0.0, 0.0, 1.0), ..Material::default() }
}

/// Straight down from below all that shines.
fn below() -> View {
    let rotation = DQuat::from_rotation_x(-FRAC_PI_2);
    View { position: DVec3::Y * 0.8, rotation, yfov: 2.0 * 0.1_f64.atan(), ..ahead() }
}

const DOWN: f64 = FRAC_PI_2;

fn square_lamp(radiance: f32, turn: f64) -> Scene {
    let at = trs(DVec3::new(0.3, 3.0, -0.2), DQuat::from_rotation_x(turn) * DQuat::from_rotation_z(0.4), 0.5);
    floor().square(shining(radiance), at).camera(&below())
}

fn ball_lamp() -> Scene {
    floor().ball(shining(8.0), trs(DVec3::new(0.4, 2.0, 0.3), DQuat::from_rotation_x(0.3), 0.5)).camera(&below())
}

/// Of very different power, so that a wrong chance of either shows.
fn two_lamps() -> Scene {
    let square = trs(DVec3::new(0.9, 3.0, -0.2), DQuat::from_rotation_x(DOWN), 0.2);
    let ball = trs(DVec3::new(-1.4, 1.6, 0.3), DQuat::IDENTITY, 0.3);
    floor().square(shining(90.0), square).ball(shining(2.0), ball).camera(&below())
}

/// The integral over all triangles that shine, of convex shapes of which none hides another, by the midpoint rule over this many parts
/// of each side of a triangle; `emission` is of a point's barycentric weights.
fn integral(scene: &Scene, pose: &Pose, point: DVec3, parts: u32, emission: impl Fn(f64, f64) -> f64) -> f64 {
    let white = Vec3::splat(FLOOR).as_dvec3();
    let reflector = Reflector { base_color: white, metallic: 0.0, roughness: 1.0, ..Reflector::default() };
    let view = (below().position - point).normalize();
    let mut sum = 0.0;
    for (instance, place) in scene.instances.iter().zip(&pose.instances) {
        let mesh = &scene.meshes[instance.mesh];
        for (triangle, material) in mesh.triangles.iter().zip(&mesh.triangle_materials) {
            let material = &scene.materials[*material as usize];
            let [a, b, c] = triangle.map(|i| place.transform_point3(mesh.positions[i as usize].as_dvec3()));
            let twice = (b - a).cross(c - a);
            if material.emissive.x == 0.0 || twice.length() == 0.0 {
                continue;
            }
            let step = 1.0 / f64::from(parts);
            for (i, j) in (0..parts).flat_map(|i| (0..parts - i).map(move |j| (i, j))) {
                let corner = [f64::from(i) * step, f64::from(j) * step];
                // Two small triangles a cell, but for the last cell of a row.
                for third in [1.0 / 3.0, 2.0 / 3.0].into_iter().take(if i + j + 1 < parts { 2 } else { 1 }) {
                    let [u, v] = corner.map(|x| x + third * step);
                    let to = a + (b - a) * u + (c - a) * v - point;
                    let facing = if material.double_sided { twice.dot(to).abs() } else { -twice.dot(to) };
                    if facing > 0.0 && to.y > 0.0 {
                        let distance = to.length();
                        let area = 0.5 * step * step * facing / distance;
                        let irradiance = f64::from(material.emissive.x) * emission(u, v) * area * (to.y / distance);
                        let reflected = reflector.reflect_light(DVec3::Y, view, to / distance).x / (to.y / distance);
                        sum += irradiance * reflected / distance.powi(2);
                    }
                }
            }
        }
    }
    sum
}

fn floor_points() -> impl Iterator<Item = DVec3> {
    let pixels = (0..SIZE[0] * SIZE[1]).map(|i| DVec2::new(f64::from(i % SIZE[0]) + 0.5, f64::from(i / SIZE[0]) + 0.5));
    pixels.map(|at| {
        let along = direction(&below(), SIZE, at);
        below().position + along * (below().position.y / -along.y)
    })
}

fn mean_integral(scene: &Scene, pose: &Pose, parts: u32, emission: impl Fn(f64, f64) -> f64 + Copy) -> f64 {
    let points: Vec<DVec3> = floor_points().collect();
    points.iter().map(|point| integral(scene, pose, *point, parts, emission)).sum::<f64>() / points.len() as f64
}

fn settings(method: Method) -> Settings {
    let base = Settings { size: SIZE, float_output: true, hold: Hold::Frame, emitters: 8, ..Settings::of(method) };
    Settings { spp: 16, density: 16.0, jitter: true, ..base }
}

/// Mean of the picture over frames that are drawn each by itself, with the standard deviation of that mean.
fn measured(scene: &Scene, pose: &Pose, settings: &Settings) -> [f64; 2] {
    let mut stage = Stage::new(scene.clone(), settings);
    let one = |stage: &mut Stage| {
        stage.session.frame(&FrameInputs { view: below(), pose, reset: false }).unwrap();
        let pixels = stage.session.color().unwrap();
        reds(&pixels).map(|(_, red)| red).sum::<f64>() / f64::from(SIZE[0] * SIZE[1])
    };
    let means: Vec<f64> = (0..FRAMES).map(|_| one(&mut stage)).collect();
    let mean = means.iter().sum::<f64>() / f64::from(FRAMES);
    let variance = means.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(FRAMES - 1);
    [mean, (variance / f64::from(FRAMES)).sqrt()]
}

/// Within five standard deviations, and so near that a fiftieth more would not be.
fn assert_agrees(name: &str, [found, deviation]: [f64; 2], expected: f64) {
    println!("{name}: {found:.6} +- {deviation:.6}, expected {expected:.6}");
    assert!(5.0 * deviation < 0.01 * expected, "{name}: the test is sharp enough: {deviation}");
    // Of f32, and of the fits of the lobe's albedo: 1e-4.
    let close = |expected: f64| (found - expected).abs() < 5.0 * deviation + 2e-4 * expected;
    assert!(close(expected), "{name}: {found} +- {deviation} against {expected}");
    assert!(!close(1.02 * expected), "{name}: negative control");
}

#[test]
fn what_shines_lights_up_the_floor_as_its_integral_says() {
    for (name, scene) in [("square", square_lamp(30.0, DOWN)), ("ball", ball_lamp()), ("both", two_lamps())] {
        let pose = scene.pose(0.0);
        // The square is smooth, and facets of the ball are small.
        let expected = mean_integral(&scene, &pose, if name == "ball" { 4 } else { 24 }, |_, _| 1.0);
        for (method, emitters) in [(Method::Supersample, 1), (Method::Supersample, 8), (Method::Stable, 8)] {
            let settings = Settings { emitters, ..settings(method) };
            let name = format!("{name}, {emitters} drawn, {}", method.name());
            assert_agrees(&name, measured(&scene, &pose, &settings), expected);
        }
    }
}

/// The integral itself, against a ball's closed form: pi L r^2 / d^2 times the cosine.
#[test]
fn the_integral_of_a_ball_is_what_is_known_of_it() {
    let scene = ball_lamp();
    let reflector =
        Reflector { base_color: DVec3::splat(FLOOR.into()), metallic: 0.0, roughness: 1.0, ..Reflector::default() };
    let to = DVec3::new(0.4, 2.0, 0.3);
    let found = integral(&scene, &scene.pose(0.0), DVec3::ZERO, 4, |_, _| 1.0);
    let sides = 20.0_f64;
    // Inscribed in the ball, in rings of twenty sides and twelve rings: its outline has that much less area at most.
    let inscribed = (PI / sides).cos().powi(2) * (PI / 24.0).cos().powi(2);
    let view = (below().position).normalize();
    let reflected = reflector.reflect_light(DVec3::Y, view, to.normalize()).x;
    let expected = reflected * 8.0 * PI * 0.25 / to.length_squared();
    println!("{found:.6} of {expected:.6}");
    // The reflectance differs over the ball by less than the part that its outline lacks.
    assert!(found < 1.005 * expected && found > (inscribed - 0.005) * expected, "{found} {expected}");
}

#[test]
fn one_sided_lamps_shine_to_their_front_and_others_to_both_sides() {
    let up = square_lamp(30.0, -DOWN);
    let pose = up.pose(0.0);
    assert_eq!(measured(&up, &pose, &settings(Method::Supersample)), [0.0; 2], "all of it goes up");
    let mut both = up;
    both.materials[1].double_sided = true;
    let expected = mean_integral(&both, &pose, 24, |_, _| 1.0);
    assert_agrees("two sides", measured(&both, &pose, &settings(Method::Supersample)), expected);
}

/// Bright on one half, black on the other, as a texture has it.
#[test]
fn what_shines_by_a_texture_shines_where_it_is_bright() {
    let mut scene = square_lamp(30.0, DOWN);
    let texels = [[255, 255, 255, 255], [0, 0, 0, 255]];
    let texels: Vec<[u8; 4]> = (0..64).map(|i| texels[usize::from(i % 8 >= 4)]).collect();
    scene.images.push(Image { name: "half".to_owned(), width: 8, height: 8, texels });
    scene.textures.push(Texture { image: 0, wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, nearest: true });
    scene.materials[1].emissive_texture = Some(TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY });
    let uvs: Vec<Vec2> = scene.meshes[1].positions.iter().map(|p| (p.truncate() + 1.0) / 2.0).collect();
    scene.meshes[1].uvs = [uvs, Vec::new()];
    let pose = scene.pose(0.0);
    // The left half as a square of its own.
    let mut half = square_lamp(30.0, DOWN);
    half.meshes[1].positions.iter_mut().for_each(|p| p.x = (p.x - 1.0) / 2.0);
    let expected = mean_integral(&half, &pose, 24, |_, _| 1.0);
    assert_agrees("half", measured(&scene, &pose, &settings(Method::Supersample)), expected);
}

/// Chances are those of the start, areas those of now.
#[test]
fn a_lamp_that_grows_and_moves_gives_that_much_more_light() {
    let scene = two_lamps();
    let mut pose = scene.pose(0.0);
    let grown = DAffine3::from_scale_rotation_translation(
        DVec3::new(0.9, 0.5, 1.0),
        DQuat::from_rotation_x(DOWN + 0.2),
        DVec3::new(0.5, 2.6, 0.3),
    );
    pose.instances[1] = grown;
    let expected = mean_integral(&scene, &pose, 24, |_, _| 1.0);
    let before = mean_integral(&scene, &scene.pose(0.0), 24, |_, _| 1.0);
    assert!(expected > 3.0 * before);
    assert_agrees("grown", measured(&scene, &pose, &settings(Method::Supersample)), expected);
}

/// Before a mirror that is followed by rays: they find the lamp, and it is not counted once more.
#[test]
fn what_rays_find_is_not_counted_twice() {
    let room = |metallic: f32, roughness: f32| {
        let wall = material(Vec4::new(0.7, 0.7, 0.7, 1.0), metallic, roughness);
        let face_up = DQuat::from_rotation_x(-FRAC_PI_2);
        let lamp = trs(DVec3::new(0.0, 2.0, -3.0), DQuat::from_rotation_x(0.3), 1.0);
        let view = look(DVec3::new(0.0, 1.5, 4.0), DVec3::new(0.0, 0.0, 0.5), 0.15);
        (Build::new(0.0).square(wall, trs(DVec3::ZERO, face_up, 8.0)).square(shining(5.0), lamp).camera(&view), view)
    };
    let mean = |(scene, view): (Scene, View), gloss: f32, emitters: u32| {
        let settings = Settings { gloss, emitters, ..settings(Method::Supersample) };
        let mut stage = Stage::new(scene, &settings);
        let all = SIZE[0] * SIZE[1];
        let one = |stage: &mut Stage| reds(&stage.frame(view)).map(|(_, x)| x).sum::<f64>() / f64::from(all);
        let means: Vec<f64> = (0..FRAMES).map(|_| one(&mut stage)).collect();
        let mean = means.iter().sum::<f64>() / f64::from(FRAMES);
        let variance = means.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(FRAMES - 1);
        [mean, (variance / f64::from(FRAMES)).sqrt()]
    };
    // A mirror has no diffuse part: the same to the bit.
    assert_eq!(mean(room(1.0, 0.0), 1.0, 8), mean(room(1.0, 0.0), 1.0, 0));
    assert!(mean(room(1.0, 0.0), 1.0, 0)[0] > 0.5, "the lamp is seen in it");
    // Of a rough floor both ways to the lamp's light are the same in the mean, but for what is scattered more than once between
    // facets, which only rays bring: below a hundredth at this roughness, even of metal.
    for (metallic, roughness) in [(0.0, 0.4), (1.0, 0.2)] {
        let room = || room(metallic, roughness);
        let [[lobe, a], [light, b]] = [mean(room(), 1.0, 8), mean(room(), 0.0, 1)];
        println!("by rays {lobe:.5} +- {a:.5}, by points of the lamp {light:.5} +- {b:.5}");
        let close = |x: f64| (x - light).abs() < 5.0 * a.hypot(b) + 0.01 * light;
        assert!(close(lobe) && !close(1.05 * lobe), "{lobe} {light}");
    }
    // Negative control: a lamp that is counted twice is half as bright again at least.
    let diffuse = mean(room(0.0, 0.4), 1.0, 0)[0];
    assert!(mean(room(0.0, 0.4), 1.0, 8)[0] > 1.1 * diffuse, "the diffuse part is lit by the lamp only");
}

/// A floor under a lamp and beside a wall: direct light by diffuse paths or by points of the lamp, and light by way of the wall.
#[test]
fn diffuse_paths_do_not_bring_once_more_what_is_a_light() {
    // Of an index of 1, so that hardly any light is reflected by a lobe, which points of the lamp show and diffuse paths do not: what is
    // left of Schlick's Fresnel, (1 - cos)^5, is 1/21 of even light on a smooth surface, and less on a rough one, beside 0.8.
    let matt = || Material { ior: 1.0, ..material(Vec4::new(0.8, 0.8, 0.8, 1.0), 0.0, 1.0) };
    let face_up = DQuat::from_rotation_x(-FRAC_PI_2);
    let lamp = trs(DVec3::new(0.3, 2.5, 0.0), DQuat::from_rotation_x(DOWN), 1.5);
    let wall = trs(DVec3::new(-1.5, 0.0, 0.0), DQuat::from_rotation_y(FRAC_PI_2), 4.0);
    let room = Build::new(0.0).square(matt(), trs(DVec3::ZERO, face_up, 20.0));
    let scene = room.square(matt(), wall).square(shining(5.0), lamp).camera(&below());
    let light = |depth: u32, emitters: u32| {
        let base = Settings { emitters, ..settings(Method::Supersample) };
        measured(&scene, &scene.pose(0.0), &Settings { indirect: Indirect { depth, ..base.indirect }, ..base })
    };
    let [[direct, a], [all, b]] = [0, 1].map(|depth| light(depth, 8));
    println!("lamp {direct:.5}, with the wall's light {all:.5}");
    assert!(all > direct + 50.0 * a.hypot(b), "the wall's light is seen");
    for (depth, drawn, a) in [(1, direct, a), (2, all, b)] {
        let [found, b] = light(depth, 0);
        println!("{depth} rays: drawn {drawn:.5} +- {a:.5}, found {found:.5} +- {b:.5}");
        let close = |x: f64| (x - drawn).abs() < 5.0 * a.hypot(b) + drawn / 21.0 / 0.8;
        assert!(close(found), "{found} {drawn}");
        // Twice the lamp is more than that in both.
        assert!(!close(found + 0.5 * direct), "negative control");
    }
}

#[test]
fn what_is_not_asked_for_changes_nothing() {
    for scene in [two_lamps(), ball_lamp()] {
        for method in [Method::Supersample, Method::Stable] {
            let pixels = |emitters: u32, modelling: Modelling| {
                let settings = Settings { emitters, modelling, ..settings(method) };
                let mut stage = Stage::new(scene.clone(), &settings);
                (0..3).map(|_| stage.frame(below()).data).collect::<Vec<_>>()
            };
            assert!(pixels(8, Modelling::Required) == pixels(8, Modelling::All));
            assert!(pixels(0, Modelling::Required) == pixels(0, Modelling::All));
            assert!(pixels(0, Modelling::Required).concat().iter().step_by(4).all(|x| *x == 0.0), "black");
        }
    }
    // Nothing shines: nothing is added.
    let dark = || floor().light(LightKind::Point, DVec3::Y * 2.0, DVec3::NEG_Y, 5.0).camera(&below());
    let pixels = |emitters| Stage::new(dark(), &Settings { emitters, ..settings(Method::Stable) }).frame(below()).data;
    assert!(pixels(8) == pixels(0));
}

#[test]
fn extremes_stay_numbers() {
    for (radiance, scale) in [(1e-30_f32, 1.0), (1e30, 1.0), (3e38, 1e3), (1.0, 1e-12), (1.0, 1e9), (1e30, 1e-12)] {
        let lamp = trs(DVec3::new(0.0, 0.9, 0.0), DQuat::from_rotation_x(DOWN), scale);
        // One lamp away from the floor, and one that lies in it.
        let flat = trs(DVec3::ZERO, DQuat::from_rotation_x(-DOWN), 0.05);
        let scene = floor().square(shining(radiance), lamp).square(shining(radiance), flat).camera(&below());
        for method in [Method::Supersample, Method::Stable] {
            let pixels = Stage::new(scene.clone(), &settings(method)).frame(below());
            assert!(pixels.data.iter().all(|x| x.is_finite() && *x >= 0.0), "{radiance} {scale}");
        }
    }
}

#[test]
fn there_is_a_bit_for_what_shines_or_a_message() {
    let lamps = |count: u32| {
        let light = |build: Build, _| build.light(LightKind::Point, DVec3::Y, DVec3::NEG_Y, 1.0);
        (0..count).fold(floor().square(shining(1.0), trs(DVec3::Y, DQuat::IDENTITY, 1.0)), light).camera(&below())
    };
    let fails = |count: u32, emitters: u32| {
        let device = stillray::headless::Device::with_options(&stillray::gpu::ContextOptions {
            device: None,
            validation: false,
        });
        let device = device.unwrap();
        let quiet = &stillray::progress::Quiet;
        let loaded = stillray::headless::LoadedScene::new(&device, &lamps(count), quiet).unwrap();
        let settings = Settings { emitters, ..settings(Method::Stable) };
        stillray::headless::Session::new(&device, &loaded, &settings).err().map(|e| e.to_string())
    };
    assert_eq!(fails(31, 8), None);
    assert_eq!(fails(32, 0), None);
    let message = fails(32, 8).unwrap();
    assert!(message.contains("emitters") && message.contains("fewer than 32 lights"), "{message}");
}
