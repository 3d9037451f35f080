//! Paper 2, section 5: what rays cost as something makes them less coherent, counted along a way of the camera (figures 17 to 20).
//!
//! The paper counts triangles that packets of 16 rays are tested against, so that rays of a packet which go the same way cost
//! less between them. That is [`crate::stats::RayCost::triangles_per_packet`] here, beside what each ray costs for itself, which
//! no packet changes.

use super::figures::Figures;
use crate::Result;
use crate::headless::LoadedScene;
use crate::progress::Quiet;
use crate::report::plot::Plot;
use crate::report::statistics::ratio;
use crate::scene::motion::Motion;
use crate::scene::shot::Shot;
use crate::scene::{LightShape, LocalTransform, Scene};
use crate::settings::{Method, Settings};
use crate::stats::{RayCost, RayCosts};
use crate::trade::studio::Studio;
use glam::{DQuat, DVec3, Vec3};
use std::fmt::Write;

/// In place of the paper's pool table.
pub const SCENE: &str = "builtin:billiards";
/// Materials that have Phong's lobe, by how their names begin.
const GLOSSY: &str = "ball";
/// And one that is of glass.
const GLASS: &str = "ball 8";
/// Of a way of 200 frames, as many as the paper's has: at different places of the balls, too, which roll there and back in 48.
const FRAMES: [u32; 4] = [10, 70, 130, 190];
/// Where nothing else is said: metres, metres, and the exponent of the paper's video; the shutter is not open.
const APERTURE: f64 = 0.01;
const LUMINAIRE: f64 = 0.4;
const EXPONENT: f64 = 2048.0;

/// A figure: what is varied in it, all else being the same.
struct Sweep {
    figure: u32,
    /// Name and unit of what is varied.
    across: &'static str,
    logarithmic: bool,
    values: &'static [f64],
    set: fn(&mut Scene, f64),
    /// How the camera moves.
    motion: Motion,
    /// Frames that are rendered before each that is counted, without a cut between them: what moves is blurred since the last.
    before: u32,
    /// The rays that are drawn, as [`RayCosts::kinds`] calls them.
    kinds: &'static [&'static str],
    claims: &'static [Claim],
}

/// What the paper says of a figure.
struct Claim {
    words: &'static str,
    /// When it holds here.
    wanted: &'static str,
    /// What is measured, and whether the claim holds.
    judge: fn(&[Point]) -> (String, bool),
}

const SWEEPS: [Sweep; 4] = [
    Sweep {
        figure: 17,
        across: "aperture, m",
        logarithmic: false,
        values: &[0.0, 0.02, 0.04, 0.06, 0.08, 0.1],
        set: open_lens,
        motion: Motion::Orbit,
        before: 0,
        kinds: &["camera", "shadow", "reflection", "refraction"],
        claims: &[
            Claim {
                words: "\"an approximately linear increase in the number of triangles intersected for each ray type\"",
                wanted: "each rises, R² ≥ 0.9",
                judge: |points| {
                    let kinds = ["camera", "shadow", "reflection", "refraction"];
                    let fit = |kind| (rise(points, kind), linearity(points, kind));
                    let words = kinds.map(|kind| format!("{kind} ×{:.2} (R² {:.2})", fit(kind).0, fit(kind).1));
                    (words.join(", "), kinds.iter().all(|kind| fit(kind).0 > 1.0 && fit(kind).1 >= 0.9))
                },
            },
            Claim {
                words: "\"shadow rays are not as strongly influenced\"",
                wanted: "rise less than all others",
                judge: |points| {
                    let [shadow, camera, reflection, refraction] =
                        ["shadow", "camera", "reflection", "refraction"].map(|kind| rise(points, kind));
                    let least = camera.min(reflection).min(refraction);
                    (format!("×{shadow:.2} against ×{camera:.2}, ×{reflection:.2}, ×{refraction:.2}"), shadow < least)
                },
            },
        ],
    },
    Sweep {
        figure: 18,
        across: "luminaire's side, m",
        logarithmic: false,
        values: &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2],
        set: widen_lights,
        motion: Motion::Orbit,
        before: 0,
        kinds: &["shadow"],
        claims: &[
            Claim {
                words: "\"the number of primitives intersected by shadow rays does not increase wildly\"",
                wanted: "rises less than twofold",
                judge: |points| (format!("×{:.2}", rise(points, "shadow")), rise(points, "shadow") < 2.0),
            },
            Claim {
                words: "\"larger luminaires only affect shadow rays\"",
                wanted: "all others cost exactly the same",
                judge: |points| {
                    let others = |p: &Point| RayCosts { shadow: RayCost::default(), ..p.costs }.kinds().map(cost_alone);
                    let same = points.windows(2).all(|pair| others(&pair[0]) == others(&pair[1]));
                    (if same { "the same" } else { "not the same" }.to_owned(), same)
                },
            },
        ],
    },
    Sweep {
        figure: 19,
        across: "Phong exponent",
        logarithmic: true,
        values: &[32.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0],
        set: sharpen_lobes,
        motion: Motion::Orbit,
        before: 0,
        kinds: &["reflection"],
        claims: &[Claim {
            words: "\"coherence does not change as greatly as we would expect\"",
            wanted: "from 4096 to 32 less than twofold",
            judge: |points| {
                let fall = 1.0 / rise(points, "reflection");
                (format!("×{fall:.2}"), fall < 2.0)
            },
        }],
    },
    Sweep {
        figure: 20,
        across: "shutter, of a frame",
        logarithmic: false,
        values: &[0.0, 0.25, 0.5, 0.75, 1.0],
        set: open_shutter,
        // What the balls do, and not the camera.
        motion: Motion::Static,
        before: 1,
        kinds: &["camera", "shadow", "reflection", "refraction"],
        claims: &[
            Claim {
                words: "\"able to extend its influence past primary rays to both shadow rays and reflection rays\"",
                wanted: "all three rise",
                judge: |points| {
                    let kinds = ["camera", "shadow", "reflection"];
                    let words = kinds.map(|kind| format!("{kind} ×{:.2}", rise(points, kind)));
                    (words.join(", "), kinds.iter().all(|kind| rise(points, kind) > 1.0))
                },
            },
            Claim {
                words: "\"for these rays the impact of motion blur is approximately a factor of two\"",
                wanted: "shadow and reflection rise by 1.5 to 2.5",
                judge: |points| {
                    let rises = ["shadow", "reflection"].map(|kind| rise(points, kind));
                    (format!("×{:.2}, ×{:.2}", rises[0], rises[1]), rises.iter().all(|rise| (1.5..=2.5).contains(rise)))
                },
            },
        ],
    },
];

/// What was counted in all frames at one value.
#[derive(Debug, Clone, Copy)]
struct Point {
    value: f64,
    costs: RayCosts,
}

/// Draws the figures, of [`SCENE`]: for each a plot, what was counted, and the paper's words about it.
///
/// # Errors
/// Those of rendering, and of files.
pub fn coherence(figures: &Figures<'_>) -> Result<Option<String>> {
    let mut text = String::new();
    for sweep in &SWEEPS {
        let Some(points) = measure(figures, sweep)? else { return Ok(None) };
        let file = figures.file(&sweep.figure.to_string(), "svg");
        plot(sweep, &points).write(&figures.folder.join(&file))?;
        let _ = write!(text, "Figure {}: {}\n\n{}\n\n", sweep.figure, sweep.across, figures.link(&file));
        let _ = write!(text, "{}\n{}\n", table(sweep, &points), judged(sweep, &points));
    }
    text.push_str(&format!(
        "16 samples a pixel, so that a camera packet is a pixel's; {} frames of a way of 200. Where it is not varied, the aperture is \
         {APERTURE} m, the luminaire's side {LUMINAIRE} m, and the exponent {EXPONENT}.\n",
        FRAMES.len()
    ));
    Ok(Some(text))
}

fn measure(figures: &Figures<'_>, sweep: &Sweep) -> Result<Option<Vec<Point>>> {
    let what = format!("figure {}: {} by {}", sweep.figure, figures.scene, sweep.across);
    figures.progress.begin(&what, (sweep.values.len() * FRAMES.len()) as u64);
    let mut points = Vec::new();
    for &value in sweep.values {
        let mut scene = set(figures.studio.scene);
        (sweep.set)(&mut scene, value);
        let Some(costs) = count(figures, &scene, sweep)? else { return Ok(None) };
        points.push(Point { value, costs });
    }
    figures.progress.finish();
    Ok(Some(points))
}

/// What rays cost in all [`FRAMES`] of a scene.
fn count(figures: &Figures<'_>, scene: &Scene, sweep: &Sweep) -> Result<Option<RayCosts>> {
    let device = figures.studio.device;
    let (loaded, shot) = (LoadedScene::new(device, scene, &Quiet)?, Shot::new(scene, None, sweep.motion)?);
    let studio = Studio { loaded: &loaded, scene, shot: &shot, ..figures.studio };
    let settings = Settings { size: figures.size, spp: 16, count: true, ..Settings::of(Method::Supersample) };
    let mut take = studio.take(&settings, sweep.motion)?;
    let mut costs = RayCosts::default();
    for frame in FRAMES {
        if (figures.stop)() {
            return Ok(None);
        }
        let first = frame.saturating_sub(sweep.before);
        for index in first..frame {
            take.render(index, index == first)?;
        }
        costs = costs.plus(&take.render(frame, frame == first)?.costs.unwrap_or_default());
        figures.progress.advance(1);
    }
    Ok(Some(costs))
}

/// The scene as it is where nothing is varied.
fn set(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    open_lens(&mut scene, APERTURE);
    widen_lights(&mut scene, LUMINAIRE);
    sharpen_lobes(&mut scene, EXPONENT);
    open_shutter(&mut scene, 0.0);
    for material in scene.materials.iter_mut().filter(|m| m.name == GLASS) {
        (material.exponent, material.roughness, material.transmission) = (0.0, 0.0, 1.0);
        material.volume = Some(Vec3::ZERO);
    }
    scene
}

fn open_shutter(scene: &mut Scene, shutter: f64) {
    scene.cameras.iter_mut().for_each(|camera| camera.shutter = shutter);
}

/// Each camera focuses on the origin.
fn open_lens(scene: &mut Scene, aperture: f64) {
    let eyes = scene.pose(0.0).cameras;
    for (camera, eye) in scene.cameras.iter_mut().zip(eyes) {
        let ahead = eye.rotation * DVec3::NEG_Z;
        (camera.lens.aperture, camera.lens.focus) = (aperture, ahead.dot(-eye.position).max(f64::MIN_POSITIVE));
    }
}

/// Each light becomes a square that looks at the origin.
fn widen_lights(scene: &mut Scene, side: f64) {
    for light in &mut scene.lights {
        light.shape = LightShape::Rectangle([side as f32; 2]);
        if let LocalTransform::Trs { translation, rotation, .. } = &mut scene.nodes[light.node].local {
            *rotation = DQuat::from_rotation_arc(DVec3::NEG_Z, -translation.normalize_or(DVec3::Z));
        }
    }
}

fn sharpen_lobes(scene: &mut Scene, exponent: f64) {
    let glossy = |name: &str| name != GLASS && name.starts_with(GLOSSY);
    scene.materials.iter_mut().filter(|m| glossy(&m.name)).for_each(|m| m.exponent = exponent as f32);
}

fn of_kind(costs: &RayCosts, kind: &str) -> RayCost {
    costs.kinds().into_iter().find(|(name, _)| *name == kind).map_or_else(RayCost::default, |(_, cost)| cost)
}

/// What rays cost for themselves: nothing of packets, which a neighbour of another kind may slow down.
fn cost_alone((_, cost): (&str, RayCost)) -> [u64; 3] {
    [cost.rays, cost.nodes, cost.triangles]
}

/// Triangles a packet, as a line over what is varied.
fn line(points: &[Point], kind: &str) -> Vec<[f64; 2]> {
    points.iter().map(|p| [p.value, of_kind(&p.costs, kind).triangles_per_packet()]).collect()
}

/// The last triangles a packet over the first.
fn rise(points: &[Point], kind: &str) -> f64 {
    let line = line(points, kind);
    let end = |point: Option<&[f64; 2]>| point.map_or(0.0, |p| p[1]);
    ratio(end(line.last()), end(line.first()))
}

/// The coefficient of determination R² of a straight line through triangles a packet: 1 where they lie on it.
fn linearity(points: &[Point], kind: &str) -> f64 {
    let line = line(points, kind);
    let mean = |i: usize| line.iter().map(|p| p[i]).sum::<f64>() / line.len().max(1) as f64;
    let (x, y) = (mean(0), mean(1));
    let moment = |i: usize, j: usize| line.iter().map(|p| (p[i] - [x, y][i]) * (p[j] - [x, y][j])).sum::<f64>();
    ratio(moment(0, 1) * moment(0, 1), moment(0, 0) * moment(1, 1))
}

fn plot(sweep: &Sweep, points: &[Point]) -> Plot {
    Plot {
        across: sweep.across.to_owned(),
        up: "triangles a packet of 16".to_owned(),
        logarithmic: sweep.logarithmic,
        lines: sweep.kinds.iter().map(|kind| ((*kind).to_owned(), line(points, kind))).collect(),
    }
}

type Measure = (&'static str, fn(&RayCost) -> f64);

const MEASURES: [Measure; 4] = [
    ("triangles/packet", RayCost::triangles_per_packet),
    ("triangles/ray", RayCost::triangles_per_ray),
    ("nodes/ray", RayCost::nodes_per_ray),
    ("busy threads", RayCost::utilisation),
];

fn table(sweep: &Sweep, points: &[Point]) -> String {
    let mut text = format!("| {} |", sweep.across);
    points.iter().for_each(|p| _ = write!(text, " {} |", p.value));
    text.push_str(" last/first |\n| --- |");
    text.push_str(&" ---: |".repeat(points.len() + 1));
    for kind in sweep.kinds {
        for (name, of) in MEASURES {
            let values: Vec<f64> = points.iter().map(|p| of(&of_kind(&p.costs, kind))).collect();
            let _ = write!(text, "\n| {kind}, {name} |");
            values.iter().for_each(|value| _ = write!(text, " {value:.2} |"));
            let ends = [values.last(), values.first()].map(|v| v.copied().unwrap_or_default());
            let _ = write!(text, " {:.2} |", ratio(ends[0], ends[1]));
        }
    }
    text + "\n"
}

fn judged(sweep: &Sweep, points: &[Point]) -> String {
    let mut text = String::from("| paper 2 | wanted | measured | holds |\n| --- | --- | --- | --- |\n");
    for Claim { words, wanted, judge } in sweep.claims {
        let (measured, holds) = judge(points);
        let holds = if holds { "yes" } else { "**no**" };
        let _ = writeln!(text, "| {words} | {wanted} | {measured} | {holds} |");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    /// Triangles a packet of every kind, by value.
    fn points(of: impl Fn(usize, f64) -> u64) -> Vec<Point> {
        let point = |value: f64| {
            let cost = |kind| RayCost {
                rays: 16,
                nodes: 50,
                triangles: 20,
                held: 64,
                packets: 1,
                packet_triangles: of(kind, value),
            };
            let costs = RayCosts {
                camera: cost(0),
                shadow: cost(1),
                reflection: cost(2),
                refraction: cost(3),
                ..RayCosts::default()
            };
            Point { value, costs }
        };
        [0.0, 1.0, 2.0, 3.0].map(point).to_vec()
    }

    fn verdicts(figure: usize, points: &[Point]) -> Vec<bool> {
        SWEEPS[figure].claims.iter().map(|claim| (claim.judge)(points).1).collect()
    }

    #[test]
    fn claims_hold_or_do_not() {
        let straight = |kind: usize, value: f64| 100 + value as u64 * if kind == 1 { 10 } else { 50 };
        assert_eq!(verdicts(0, &points(straight)), [true, true]);
        assert_eq!(rise(&points(straight), "camera"), 2.5);
        assert!((linearity(&points(straight), "camera") - 1.0).abs() < 1e-12);
        // A step is no line, and what falls does not rise.
        let step = |_: usize, value: f64| if value == 3.0 { 900 } else { 100 };
        assert_eq!(verdicts(0, &points(step)), [false, false]);
        assert_eq!(verdicts(0, &points(|_, value| 400 - value as u64 * 50)), [false, false]);

        let shadows =
            |most: u64| move |kind: usize, value: f64| if kind == 1 { 100 + value as u64 * most / 3 } else { 100 };
        assert_eq!(verdicts(1, &points(shadows(60))), [true, true]);
        assert_eq!(verdicts(1, &points(shadows(120))), [false, true]);
        let mut disturbed = points(shadows(60));
        disturbed[2].costs.reflection.nodes += 1;
        assert_eq!(verdicts(1, &disturbed), [true, false]);

        assert_eq!(verdicts(2, &points(|_, value| 400 - value as u64 * 50)), [true]);
        assert_eq!(verdicts(2, &points(|_, value| 400 - value as u64 * 80)), [false]);

        let blurred = |most: u64| points(move |_, value| 300 + value as u64 * most / 3);
        assert_eq!(verdicts(3, &blurred(300)), [true, true]);
        assert_eq!(verdicts(3, &blurred(90)), [true, false]);
        assert_eq!(verdicts(3, &blurred(600)), [true, false]);
        assert_eq!(
            verdicts(3, &points(|kind, value| 300 + value as u64 * if kind == 2 { 0 } else { 100 })),
            [false, false]
        );
    }

    #[test]
    fn what_is_varied_is_there_to_vary() {
        let plain = builtin::load(SCENE.trim_start_matches("builtin:"), 0).unwrap();
        let scene = set(&plain);
        assert!(scene.cameras.iter().all(|c| c.lens.aperture == APERTURE && c.lens.focus > 0.5));
        assert!(scene.materials.iter().filter(|m| f64::from(m.exponent) == EXPONENT).count() > 3);
        assert_eq!(scene.materials.iter().filter(|m| m.transmits()).count(), 1);
        for (light, pose) in scene.lights.iter().zip(scene.pose(0.0).lights) {
            assert_eq!(light.shape, LightShape::Rectangle([LUMINAIRE as f32; 2]));
            // It looks at the origin.
            assert!((pose.direction + pose.position.normalize()).length() < 1e-12);
        }
        for sweep in &SWEEPS {
            let mut other = scene.clone();
            (sweep.set)(&mut other, sweep.values[1]);
            let seen = |s: &Scene| format!("{:?} {:?} {:?}", s.cameras, s.lights, s.materials);
            assert_ne!(seen(&scene), seen(&other), "figure {}", sweep.figure);
            assert!(sweep.values.is_sorted());
        }
    }

    #[test]
    fn tables_have_a_row_a_measure() {
        let points = points(|kind, value| 100 + 50 * kind as u64 + value as u64);
        for sweep in &SWEEPS {
            let text = table(sweep, &points);
            assert_eq!(text.lines().count(), 2 + 4 * sweep.kinds.len());
            assert!(text.lines().all(|line| line.matches('|').count() == 2 + points.len() + 1), "{text}");
            assert_eq!(judged(sweep, &points).lines().count(), 2 + sweep.claims.len());
            assert!(plot(sweep, &points).svg().matches("<polyline").count() == sweep.kinds.len());
        }
        assert!(
            table(&SWEEPS[1], &points)
                .contains("| shadow, triangles/packet | 150.00 | 151.00 | 152.00 | 153.00 | 1.02 |")
        );
    }
}
