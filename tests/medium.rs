//! Fog and mist: pictures against closed forms, and what is refused.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod scene_support;

use glam::{DQuat, DVec2, DVec3, Vec3};
use scene_support::{Build, Stage, ahead, direction, material, mean_of, reds, render, trs};
use std::f64::consts::{FRAC_PI_2, PI};
use stillray::oracle::medium::phase;
use stillray::renderer::{Method, Settings};
use stillray::scene::medium::{Medium, Mist, Region};
use stillray::scene::{LightKind, Material, Scene, builtin};
use stillray::settings::Modelling;

const SIZE: [u32; 2] = [16, 12];

fn settings(method: Method) -> Settings {
    Settings { size: SIZE, float_output: true, ..Settings::of(method) }
}

fn fog(scattering: f32, absorption: f32, anisotropy: f32) -> Medium {
    let [scattering, absorption] = [scattering, absorption].map(Vec3::splat);
    Medium { scattering, absorption, anisotropy, region: Region::Everywhere }
}

fn in_medium(scene: Scene, medium: Medium) -> Scene {
    Scene { medium: Some(medium), ..scene }
}

/// A wall that shows its colour as it is, so far ahead.
fn wall(environment: f32, distance: f64, shows: f32) -> Build {
    let m = Material { unlit: true, ..material(Vec3::splat(shows).extend(1.0), 0.0, 1.0) };
    Build::new(environment).square(m, trs(DVec3::NEG_Z * distance, DQuat::IDENTITY, 10.0 * distance))
}

/// Of a colour that is a half before and after: half a unit in the last place each, 2^-11 of it; and what exp may be off by.
const HALVES: f64 = 2.0 / 2048.0 + 1e-5;

/// Metres to the wall, at most and at least, within a pixel and its neighbours, which reconstruction reads.
fn depths(at: [u32; 2], distance: f64) -> [f64; 2] {
    let steps = (0..16).map(|i| DVec2::new(f64::from(i % 4), f64::from(i / 4)) - 1.0);
    let at = DVec2::new(at[0].into(), at[1].into());
    let lengths = steps.map(|s| distance * direction(&ahead(), SIZE, at + s).length());
    lengths.fold([f64::INFINITY, 0.0], |[low, high], d| [low.min(d), high.max(d)])
}

#[test]
fn fog_takes_away_what_beer_and_lambert_say() {
    for method in Method::ALL {
        for distance in [0.1, 1.0, 5.0, 20.0] {
            for extinction in [0.02, 0.3, 2.0] {
                let scene = in_medium(wall(0.0, distance, 1.0).camera(&ahead()), fog(0.0, extinction, 0.0));
                let pixels = render(scene, &settings(*method), ahead(), 2);
                let taken = |d: f64| (-f64::from(extinction) * d).exp();
                for (at, red) in reds(&pixels) {
                    let [near, far] = depths(at, distance);
                    let fits = |extinction: f64| {
                        let [low, high] = [far, near].map(|d| (-extinction * d).exp());
                        // Below 2^-14 a half has steps of 2^-24.
                        red >= low * (1.0 - HALVES) - 1e-7 && red <= high * (1.0 + HALVES) + 1e-7
                    };
                    assert!(fits(extinction.into()), "{} {distance} {extinction}: {red}", method.name());
                    // Negative control: a tenth more of it, where there is enough of it to tell.
                    let seen = f64::from(extinction) * distance;
                    assert!(!(0.1..5.0).contains(&seen) || !fits(1.2 * f64::from(extinction)), "{}", taken(distance));
                }
            }
        }
    }
}

/// A lamp at the camera lights a wall there and back through the fog; parallel light only comes back through it.
#[test]
fn direct_light_is_attenuated_on_its_way() {
    let (distance, extinction) = (6.0, 0.15);
    let chalk = || {
        let m = material(Vec3::splat(0.8).extend(1.0), 0.0, 1.0);
        Build::new(0.0).square(m, trs(DVec3::NEG_Z * distance, DQuat::IDENTITY, 60.0))
    };
    for (kind, ways) in [(LightKind::Point, 2.0), (LightKind::Directional, 1.0)] {
        let scene = chalk().light(kind, DVec3::ZERO, DVec3::NEG_Z, 40.0).camera(&ahead());
        let look = |medium| render(Scene { medium, ..scene.clone() }, &settings(Method::Supersample), ahead(), 1);
        let [foggy, clear] = [Some(fog(0.0, extinction, 0.0)), None].map(look);
        for ((at, left), (_, all)) in reds(&foggy).zip(reds(&clear)) {
            let [near, far] = depths(at, distance);
            let fits = |ways: f64| {
                let [low, high] = [far, near].map(|d| (-f64::from(extinction) * ways * d).exp());
                left >= all * low * (1.0 - HALVES) && left <= all * high * (1.0 + HALVES)
            };
            assert!(fits(ways), "{kind:?}: {left} of {all}");
            assert!(!fits(3.0 - ways), "negative control");
        }
    }
}

/// Single scattering of parallel light: sigma_s * phase * E * (1 - exp(-sigma_t d)) / sigma_t. To the sky all of it.
#[test]
fn fog_scatters_what_the_closed_form_says() {
    let sun = DVec3::new(0.3, -0.5, -0.8).normalize();
    let lux = 5.0;
    for (scattering, absorption, g) in [(0.2, 0.05, 0.0), (0.02, 0.0, 0.6), (1.5, 0.5, -0.4)] {
        for distance in [2.0, 30.0, f64::INFINITY] {
            let base = if distance.is_finite() { wall(0.0, distance, 0.0) } else { Build::new(0.0) };
            let scene = base.light(LightKind::Directional, DVec3::ZERO, sun, lux as f32).camera(&ahead());
            let pixels =
                render(in_medium(scene, fog(scattering, absorption, g)), &settings(Method::Supersample), ahead(), 1);
            let [s, t] = [scattering, scattering + absorption].map(f64::from);
            for (at, red) in reds(&pixels) {
                let closed = |d: f64, g: f64| {
                    let seen = direction(&ahead(), SIZE, DVec2::new(at[0].into(), at[1].into()) + 0.5).normalize();
                    s * phase(g, -sun.dot(seen)) * lux * (1.0 - (-t * d).exp()) / t
                };
                let [near, far] = if distance.is_finite() { depths(at, distance) } else { [distance; 2] };
                // Neighbouring pixels look up to 0.06 rad elsewhere, and the phase function changes by up to 3 g a radian.
                let bound = HALVES + 0.06 * 3.0 * f64::from(g).abs() + 0.01 * f64::from(u8::from(g != 0.0));
                // A pixel's middle may meet the wall before its farthest sample does: the last of 32 steps may be behind it, in the dark.
                let behind = if distance.is_finite() { 1.0 / 32.0 } else { 0.0 };
                let fits = |g: f64| {
                    let high = closed(far, g) * (1.0 + bound);
                    let low = closed(near, g) * (1.0 - bound) - behind * high;
                    (low..=high).contains(&red)
                };
                assert!(fits(g.into()), "{scattering} {absorption} {g} {distance}: {red}, {}", closed(far, g.into()));
                assert!(!fits(f64::from(g) + 0.4), "negative control");
            }
        }
    }
}

/// A wall beside the way of light leaves one half of a long way dark: shafts.
#[test]
fn what_is_in_shadow_scatters_nothing() {
    let sun = DVec3::NEG_X;
    // In the plane x = 6, beyond 6 metres ahead; 12 metres ahead the frame is 4 metres to either side.
    let shade = trs(DVec3::new(6.0, 0.0, -50.0 - 6.0), DQuat::from_rotation_y(FRAC_PI_2), 50.0);
    let scene = || {
        let m = material(Vec3::ONE.extend(1.0), 0.0, 1.0);
        wall(0.0, 12.0, 0.0).square(m, shade).light(LightKind::Directional, DVec3::ZERO, sun, 5.0).camera(&ahead())
    };
    let steps = 64;
    let settings = Settings { medium_steps: steps, spp: 1, ..settings(Method::Supersample) };
    let medium = fog(0.05, 0.0, 0.0);
    let look = |settings: &Settings| mean_of(in_medium(scene(), medium), settings, ahead(), 1);
    let [shaded, open] = [settings.clone(), Settings { shadow_rays: 0, ..settings }].map(|s| look(&s));
    let closed = |d: f64| 5.0 / (4.0 * PI) * (1.0 - (-0.05 * d).exp());
    for ((at, half), (_, whole)) in reds(&shaded).zip(reds(&open)) {
        let [near, far] = depths(at, 12.0);
        let [near_half, far_half] = depths(at, 6.0);
        // The border of light and shadow falls within one step, which holds 1/64 of all.
        let step = closed(far) / f64::from(steps) * 1.01;
        let inside = |x: f64, a: f64, b: f64, slack: f64| {
            x >= closed(a) * (1.0 - HALVES) - slack && x <= closed(b) * (1.0 + HALVES) + slack
        };
        assert!(inside(whole, near, far, 0.0), "{whole}");
        assert!(inside(half, near_half, far_half, step), "{half} {} {}", closed(near_half), closed(far_half));
        assert!(!inside(whole, near_half, far_half, step), "negative control");
    }
}

#[test]
fn no_fog_is_no_medium_and_extremes_are_finite() {
    let cornell = || builtin::load("cornell", 0).unwrap();
    let view = cornell().pose(0.0).cameras[0];
    let settings = Settings { size: [32, 24], ..settings(Method::Stable) };
    let frames = |medium: Option<Medium>, modelling: Modelling| {
        let scene = Scene { medium, ..cornell() };
        render(scene, &Settings { modelling, ..settings.clone() }, view, 2).data
    };
    let clear = frames(None, Modelling::Required);
    assert!(clear == frames(Some(fog(0.0, 0.0, 0.5)), Modelling::Required));
    assert!(clear == frames(Some(fog(0.0, 0.0, 0.5)), Modelling::All), "modelled all the same");
    // Before a wall the thinnest fog is far below what a half tells; to infinity it is fog all the same.
    let walled = |medium: Option<Medium>| {
        render(Scene { medium, ..wall(0.5, 4.0, 0.3).camera(&ahead()) }, &settings, ahead(), 1).data
    };
    assert!(walled(None) == walled(Some(fog(1e-30, 1e-30, 0.5))));
    assert!(walled(None) != walled(Some(fog(1e-2, 1e-2, 0.5))), "negative control");
    assert!(frames(Some(fog(1e-30, 1e-30, 0.5)), Modelling::Required).iter().all(|x| x.is_finite()));
    let thick = frames(Some(fog(1e6, 0.0, 0.999)), Modelling::Required);
    assert!(thick.iter().all(|x| x.is_finite()) && thick != clear);
    assert!(frames(Some(fog(1e9, 1e9, -0.999)), Modelling::Required).iter().all(|x| x.is_finite()));
}

/// In even light nothing is brighter than it, and white fog that absorbs nothing is as bright.
#[test]
fn no_energy_is_made() {
    for density in [1e-3, 0.1, 3.0, 1e6] {
        for (scattering, absorption) in [(density, 0.0), (density, density)] {
            let scene = in_medium(wall(0.5, 4.0, 0.5).camera(&ahead()), fog(scattering, absorption, 0.0));
            let pixels = render(scene, &settings(Method::Supersample), ahead(), 1);
            for (_, red) in reds(&pixels) {
                assert!(red <= 0.5 * (1.0 + HALVES), "{red}");
                assert!(absorption > 0.0 || red >= 0.5 * (1.0 - HALVES), "{red}");
            }
        }
    }
}

#[test]
fn a_frozen_scene_does_not_scintillate_and_mist_drifts() {
    let scene = builtin::load("mist", 0).unwrap();
    let view = scene.pose(0.0).cameras[0];
    for method in [Method::Stable, Method::Supersample, Method::PointTracking] {
        let settings = Settings { size: [40, 30], ..settings(method) };
        let mut stage = Stage::new(scene.clone(), &settings);
        let frames: Vec<Vec<f32>> = (0..6).map(|_| stage.frame(view).data).collect();
        assert!(frames[3] == frames[4] && frames[4] == frames[5], "{}", method.name());
        let mut later = stage.scene.pose(4.0);
        later.cameras = stage.scene.pose(0.0).cameras;
        let inputs = stillray::FrameInputs { view, pose: &later, reset: false };
        stage.session.frame(&inputs).unwrap();
        assert!(stage.session.color().unwrap().data != frames[5], "it drifts");
    }
}

/// Draws of many frames come to what many steps see.
#[test]
fn the_reference_converges() {
    let scene = builtin::load("mist", 0).unwrap();
    let view = scene.pose(0.0).cameras[0];
    let mean = |steps: u32, frames: u32| {
        let settings = Settings { size: [32, 24], medium_steps: steps, spp: 4, ..settings(Method::Reference) };
        let pixels = render(scene.clone(), &settings, view, frames);
        reds(&pixels).map(|(_, red)| red).collect::<Vec<_>>()
    };
    let fine = mean(256, 4);
    let off = |other: &[f64]| {
        let squares: f64 = fine.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum();
        (squares / fine.len() as f64).sqrt()
    };
    let [once, often] = [off(&mean(8, 1)), off(&mean(8, 16))];
    println!("root mean square off 256 steps: 8 steps once {once:.5}, 16 times {often:.5}");
    assert!(often < 0.6 * once, "{often} {once}");
}

#[test]
fn what_is_out_of_range_is_refused() {
    let good = Mist { low: DVec3::ZERO, high: DVec3::ONE, amplitude: 0.1, size: 1.0, drift: DVec3::ZERO };
    let mist = |mist: Mist| Medium { region: Region::Mist(mist), ..fog(1.0, 1.0, 0.0) };
    let refused = |medium: Medium| medium.check().err().map(|e| e.to_string());
    assert_eq!(refused(mist(good)), None);
    for (medium, words) in [
        (fog(-1.0, 0.0, 0.0), "medium.scattering"),
        (fog(f32::NAN, 0.0, 0.0), "medium.scattering"),
        (fog(0.0, 2e9, 0.0), "medium.absorption"),
        (fog(0.0, 0.0, 1.0), "medium.anisotropy"),
        (fog(0.0, 0.0, f32::NAN), "medium.anisotropy"),
        (mist(Mist { high: DVec3::new(1.0, 0.0, 1.0), ..good }), "medium.box"),
        (mist(Mist { low: DVec3::splat(-2e9), ..good }), "medium.box"),
        (mist(Mist { amplitude: -1.0, ..good }), "medium.noise.amplitude"),
        (mist(Mist { size: 0.0, ..good }), "medium.noise.size"),
        (mist(Mist { drift: DVec3::INFINITY, ..good }), "medium.noise.drift"),
    ] {
        assert!(refused(medium).is_some_and(|message| message.contains(words)), "{words}");
    }
}
