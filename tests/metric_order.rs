//! Each metric puts sequences in the order in which they are better or worse, and sees what it says that it sees: pictures
//! that move by known vectors, with errors that stick to their surfaces, to the screen, or to nothing.

#![allow(clippy::unwrap_used, reason = "a panic in a test's helper is a failing test")]

mod metric_support;

use metric_support::pattern::{self, Codes, Random};
use stillray::metric::causes::Changes;
use stillray::metric::flicker::Flicker;
use stillray::metric::image::{Frame, Plane};
use stillray::metric::sequence::{Metric, Options, Report, Sequence, Step};
use stillray::metric::warp::Geometry;

const SIZE: [u32; 2] = [96, 80];
const WIDTH: usize = 96;
const HEIGHT: usize = 80;
const PIXELS: usize = WIDTH * HEIGHT;
const FRAMES: usize = 6;

/// A grey frame of display values.
fn grey(values: Vec<f32>) -> Frame {
    Frame::from_display(SIZE, [values.clone(), values.clone(), values]).unwrap()
}

/// A value a pixel, of its place and the time.
fn picture(of: impl Fn(f64, f64) -> f64) -> Vec<f32> {
    (0..PIXELS).map(|i| of((i % WIDTH) as f64, (i / WIDTH) as f64) as f32).collect()
}

/// Waves in every direction, 0.25..=0.75, no shorter than 7 pixels: a picture that is known between pixels, too.
fn waves(x: f64, y: f64) -> f64 {
    0.5 + 0.1 * (0.9 * x).sin() + 0.08 * (0.7 * y + 0.4 * x).sin() + 0.07 * (0.5 * y - 0.6 * x + 1.0).sin()
}

/// Noise in -1..=1 at whole places; the same place has the same noise.
fn hashed(x: f64, y: f64, seed: u32) -> f64 {
    let place =
        (x.round() as i64 as u32).wrapping_mul(0x9e37_79b1) ^ (y.round() as i64 as u32).wrapping_mul(0x85eb_ca6b);
    let mut random = Random { state: place ^ seed.wrapping_mul(0xc2b2_ae35) };
    // Neighbouring places begin with similar states.
    for _ in 0..4 {
        random.next(2);
    }
    f64::from(random.next(20_001) - 10_000) / 10_000.0
}

/// The same, no finer than 4 pixels.
fn cloudy(x: f64, y: f64, seed: u32) -> f64 {
    let (left, above) = ((x / 4.0).floor(), (y / 4.0).floor());
    let (fx, fy) = (x / 4.0 - left, y / 4.0 - above);
    let row = |y: f64| hashed(left, y, seed) * (1.0 - fx) + hashed(left + 1.0, y, seed) * fx;
    row(above) * (1.0 - fy) + row(above + 1.0) * fy
}

fn all_moving(velocity: [f64; 2]) -> Geometry {
    Geometry { motion: vec![velocity.map(|v| v as f32); PIXELS], ..Geometry::still(WIDTH, HEIGHT) }
}

/// Frames and references of each moment, with motion.
fn measure(moment: impl Fn(usize) -> (Frame, Frame), geometry: impl Fn(usize) -> Geometry) -> Report {
    let mut sequence = Sequence::new(Options::default()).unwrap();
    for t in 0..FRAMES {
        let (frame, reference) = moment(t);
        let geometry = geometry(t);
        let step = Step { name: "", frame: &frame, reference: &reference, geometry: Some(&geometry), changes: None };
        sequence.push(&step).unwrap();
    }
    sequence.finish()
}

/// Waves that move, with an error that is a function of where on the surface, where on the screen, and when.
fn moving(velocity: [f64; 2], error: impl Fn([f64; 2], [f64; 2], usize) -> f64) -> Report {
    let moment = |t: usize| {
        let on_surface = |x: f64, y: f64| [x - velocity[0] * t as f64, y - velocity[1] * t as f64];
        let reference = picture(|x, y| waves(on_surface(x, y)[0], on_surface(x, y)[1]));
        let frame = picture(|x, y| {
            let place = on_surface(x, y);
            waves(place[0], place[1]) + error(place, [x, y], t)
        });
        (grey(frame), grey(reference))
    };
    measure(moment, |_| all_moving(velocity))
}

fn flicker(report: &Report) -> &Flicker {
    report.flicker.as_ref().unwrap()
}

/// Values are in 0..=1 and stored, decoded and encoded in f32 a few times.
const ROUNDING: f64 = 1e-6;

#[test]
fn flicker_error_is_nought_for_what_sticks_to_its_surface() {
    // Slow beside the size of the clouds.
    let velocity = [1.0, -1.0];
    let none = moving(velocity, |_, _, _| 0.0);
    assert_eq!((flicker(&none).flicker_error, flicker(&none).excess_flicker), (0.0, 0.0));
    let stuck = moving(velocity, |[x, y], _, _| 0.1 * hashed(x, y, 1));
    assert!(flicker(&stuck).flicker_error < ROUNDING, "{stuck:?}");
    assert!(stuck.mean.rmse.unwrap() > 0.05, "the error is there all the same");
    let dirt = moving(velocity, |_, [x, y], _| 0.1 * cloudy(x, y, 1));
    let cloud = moving(velocity, |_, [x, y], t| 0.1 * cloudy(x, y, t as u32));
    let noise = moving(velocity, |_, [x, y], t| 0.1 * hashed(x, y, t as u32));
    // Dirt on the lens is the same after a frame, but not on the surface.
    let errors = [&stuck, &dirt, &cloud, &noise].map(|r| flicker(r).flicker_error);
    assert!(errors.is_sorted_by(|a, b| *b > 1.1 * *a + 0.001), "{errors:?}");
    // What is measured at fixed places of the screen has another order: there dirt is what does not change.
    let fixed = [&stuck, &dirt].map(|r| r.temporal.unwrap().display.std.unwrap());
    assert!(fixed[1] < ROUNDING && fixed[0] > 0.03, "{fixed:?}");
}

#[test]
fn without_motion_only_what_changes_flickers() {
    let frozen = moving([0.0; 2], |_, [x, y], _| 0.1 * hashed(x, y, 1));
    let noise = moving([0.0; 2], |_, [x, y], t| 0.1 * hashed(x, y, t as u32));
    assert!(flicker(&frozen).flicker_error < ROUNDING);
    assert!(flicker(&noise).flicker_error > 0.05);
    assert!((frozen.mean.rmse.unwrap() / noise.mean.rmse.unwrap() - 1.0).abs() < 0.05, "by error they are equal");
}

#[test]
fn independent_noise_has_the_flicker_that_is_computed() {
    let amplitude = 0.1;
    let report = moving([2.0, 1.0], |_, [x, y], t| amplitude * hashed(x, y, t as u32));
    // Even noise in ±a has a deviation of a / √3; a difference of two, √2 times that.
    let expected = amplitude * (2.0_f64 / 3.0).sqrt();
    for lag in &flicker(&report).lags {
        // The mean of n squares of such differences, each with a relative deviation of √1.4, itself has √(1.4 / n); the root
        // has half of that. n > 3 frames of 85 x 74 pixels, of which two share each noise value: four times √2 of it is 0.03.
        assert!((lag.flicker_error / expected - 1.0).abs() < 0.03, "{lag:?}, not {expected}");
        // It adds to the reference's own change as squares do.
        let quadratic = (lag.reference.powi(2) + expected.powi(2)).sqrt() - lag.reference;
        assert!((lag.excess_flicker / quadratic - 1.0).abs() < 0.05, "{lag:?}, not {quadratic}");
    }
}

#[test]
fn excess_flicker_forgives_where_the_reference_changes_and_flicker_error_does_not() {
    // A light that goes up and down, and frames with noise in it.
    let lit = |t: usize, size: f64| if t.is_multiple_of(2) { 1.0 - size } else { 1.0 };
    let report = |size: f64| {
        let moment = |t: usize| {
            let reference = picture(|x, y| waves(x, y) * lit(t, size));
            let frame = picture(|x, y| waves(x, y) * lit(t, size) + 0.05 * hashed(x, y, t as u32));
            (grey(frame), grey(reference))
        };
        measure(moment, |_| Geometry::still(WIDTH, HEIGHT))
    };
    let (steady, blinking) = (report(0.0), report(0.3));
    let (steady, blinking) = (flicker(&steady).lags[0], flicker(&blinking).lags[0]);
    assert!((steady.flicker_error / blinking.flicker_error - 1.0).abs() < 0.01, "{steady:?}, {blinking:?}");
    assert!(blinking.excess_flicker < 0.3 * steady.excess_flicker, "{steady:?}, {blinking:?}");
}

#[test]
fn frames_that_keep_a_light_off_are_steady_and_wrong() {
    let moment = |t: usize| (grey(picture(waves)), grey(picture(|x, y| waves(x, y) * if t < 3 { 1.0 } else { 0.8 })));
    let report = measure(moment, |_| Geometry::still(WIDTH, HEIGHT));
    assert!(flicker(&report).excess_flicker < -0.01 && flicker(&report).flicker_error > 0.01, "{report:?}");
}

#[test]
fn motion_between_pixels_is_followed() {
    let velocity = [1.3, 0.6];
    let right = moving(velocity, |_, _, _| 0.0);
    // Bilinear reading of a wave of wave number q is off by q²/8 of its height at most on each axis, here 0.2 * 0.1.
    assert!(flicker(&right).lags.iter().all(|l| l.reference < 0.02), "{:?}", flicker(&right));
    let moment = |t: usize| {
        let reference = picture(|x, y| waves(x - velocity[0] * t as f64, y - velocity[1] * t as f64));
        (grey(reference.clone()), grey(reference))
    };
    for wrong in [[0.0, 0.0], [-1.3, -0.6], [1.3, -0.6], [2.3, 0.6]] {
        let wrong = measure(moment, |_| all_moving(wrong));
        for (right, wrong) in flicker(&right).lags.iter().zip(&flicker(&wrong).lags) {
            assert!(wrong.reference > 2.0 * right.reference, "{right:?}, {wrong:?}");
        }
    }
}

#[test]
fn what_is_outside_the_frame_is_left_out() {
    let report = moving([3.0, -1.0], |_, _, _| 0.0);
    for lag in &flicker(&report).lags {
        let (gone_x, gone_y) = (3 * lag.lag, lag.lag);
        let valid = ((WIDTH - gone_x) * (HEIGHT - gone_y)) as f64 / PIXELS as f64;
        assert!((lag.valid - valid).abs() < 1e-12, "{lag:?}, not {valid}");
        assert!(lag.reference < ROUNDING, "{lag:?}");
    }
}

/// A square that moves by 2 pixels a frame over a wall, both textured; `seen` is whether depth tells them apart.
fn square_before_wall(seen: bool) -> Report {
    let inside = |x: f64, y: f64, t: usize| {
        let left = 20.0 + 2.0 * t as f64;
        (left..left + 30.0).contains(&x) && (20.0..50.0).contains(&y)
    };
    let moment = |t: usize| {
        let shade = |x: f64, y: f64| {
            let square = inside(x, y, t);
            if square { hashed(x - 2.0 * t as f64, y, 7) * 0.2 + 0.7 } else { hashed(x, y, 8) * 0.2 + 0.3 }
        };
        (grey(picture(shade)), grey(picture(shade)))
    };
    let geometry = |t: usize| {
        let places = |i: usize| inside((i % WIDTH) as f64, (i / WIDTH) as f64, t);
        let depth = |i: usize| {
            if !seen {
                0.0
            } else if places(i) {
                2.0
            } else {
                5.0 + 0.01 * (i % WIDTH) as f32
            }
        };
        Geometry {
            motion: (0..PIXELS).map(|i| if places(i) { [2.0, 0.0] } else { [0.0, 0.0] }).collect(),
            depth: Plane { width: WIDTH, height: HEIGHT, data: (0..PIXELS).map(depth).collect() },
        }
    };
    measure(moment, geometry)
}

#[test]
fn what_was_hidden_is_left_out() {
    let report = square_before_wall(true);
    for lag in &flicker(&report).lags {
        assert!(lag.reference < ROUNDING, "{lag:?}");
        // Two columns of thirty pixels come out from behind the square in each frame. They stay out for longer lags.
        let hidden = (2 * lag.lag * 30) as f64 / PIXELS as f64;
        assert!((lag.valid - (1.0 - hidden)).abs() < 1e-12, "{lag:?}, not {hidden} hidden");
    }
    let blind = square_before_wall(false);
    assert!(flicker(&blind).lags[0].reference > 0.01, "without depth, what was uncovered counts as change");
}

#[test]
fn a_camera_that_moves_forward_hides_nothing_and_a_surface_that_does_so_alone_is_left_out() {
    let report = |own: f32| {
        let geometry = |t: usize| {
            let depth = |i: usize| {
                // A slanted wall that comes closer by 0.1 a frame, and a fifth of the picture that does so on its own.
                let wall = 5.0 + 0.02 * (i % WIDTH) as f32 + 0.01 * (i / WIDTH) as f32 - 0.1 * t as f32;
                if i / WIDTH < HEIGHT / 5 { wall - own * t as f32 } else { wall }
            };
            let depth = Plane { width: WIDTH, height: HEIGHT, data: (0..PIXELS).map(depth).collect() };
            Geometry { motion: vec![[0.25, -0.5]; PIXELS], depth }
        };
        let reference = || grey(picture(waves));
        flicker(&measure(|_| (reference(), reference()), geometry)).lags[0].valid
    };
    // One row and one column lie outside.
    let inside = ((WIDTH - 1) * (HEIGHT - 1)) as f64 / PIXELS as f64;
    assert!((report(0.0) - inside).abs() < 1e-12, "{}", report(0.0));
    assert!(report(0.3) < 0.85 * inside, "{}", report(0.3));
}

#[test]
fn the_sky_is_a_surface_and_not_the_ground() {
    // The horizon rises by a pixel a frame, as the camera tilts down: all moves up, and ground enters from below.
    let depth = |t: usize| {
        let at = |i: usize| if i / WIDTH < 40 - t { f32::INFINITY } else { 9.0 };
        Plane { width: WIDTH, height: HEIGHT, data: (0..PIXELS).map(at).collect() }
    };
    let geometry = |t: usize| Geometry { motion: vec![[0.0, -1.0]; PIXELS], depth: depth(t) };
    let reference = |t: usize| grey(picture(|x, y| waves(x, y + t as f64)));
    let right = measure(|t| (reference(t), reference(t)), geometry);
    assert!((flicker(&right).lags[0].valid - 79.0 / 80.0).abs() < 1e-12, "{right:?}");
    // Without that motion, the row that was sky and is ground now is left out.
    let still = measure(|t| (reference(t), reference(t)), |t| Geometry { depth: depth(t), ..all_moving([0.0; 2]) });
    assert!((flicker(&still).lags[0].valid - 79.0 / 80.0).abs() < 1e-12, "{still:?}");
    assert!(flicker(&still).lags[0].reference > 10.0 * flicker(&right).lags[0].reference);
}

/// Discs that move by two pixels a frame, seen through a filter.
fn discs(filter: impl Fn(&Codes, usize) -> Codes) -> Report {
    let base = pattern::discs(3, false, SIZE);
    let at = |t: usize| (0..2 * t).fold(base.clone(), |image, _| pattern::shifted(&image, SIZE[0]));
    let make = |codes: &Codes| {
        metric_support::frame("display", SIZE, &codes.iter().map(|c| *c as f32 / 255.0).collect::<Vec<_>>())
    };
    measure(|t| (make(&filter(&at(t), t)), make(&at(t))), |_| all_moving([2.0, 0.0]))
}

#[test]
fn errors_grow_with_what_is_wrong() {
    let noise = |amount: i32| discs(move |image, t| pattern::noise(image, t as u32, amount));
    let blur = |times: usize| discs(move |image, _| (0..times).fold(image.clone(), |i, _| pattern::blur(&i, SIZE)));
    let identical = discs(|image, _| image.clone());
    let late = discs(|image, _| (0..2).fold(image.clone(), |i, _| pattern::shifted(&i, SIZE[0])));
    let noises = [&identical, &noise(10), &noise(30)].map(|r| r.mean);
    let blurs = [&identical, &blur(1), &blur(3)].map(|r| r.mean);
    let lates = [&identical, &late].map(|r| r.mean);
    for group in [&noises[..], &blurs, &lates] {
        let rising = |of: fn(&stillray::metric::sequence::Errors) -> Option<f64>| {
            group.iter().map(|m| of(m).unwrap()).collect::<Vec<_>>().is_sorted_by(|a, b| a < b)
        };
        assert!(rising(|m| m.flip) && rising(|m| m.rmse) && rising(|m| m.rmse_linear), "{group:?}");
        assert!(rising(|m| m.relative_mse) && rising(|m| m.ssim.map(|s| -s)), "{group:?}");
        // The first one is infinite.
        assert!(group[0].psnr.is_none() && group[1..].is_sorted_by(|a, b| a.psnr > b.psnr), "{group:?}");
    }
    assert!(blurs.is_sorted_by(|a, b| a.cpbd > b.cpbd), "{blurs:?}");
    assert_eq!(blurs[2].cpbd_reference, blurs[0].cpbd);
    assert!(noises[2].cpbd.unwrap() > blurs[1].cpbd.unwrap(), "noise passes for sharpness, as is documented");
    assert!((blurs[2].energy_ratio.unwrap() - 1.0).abs() < 0.05);
}

#[test]
fn blur_and_a_frame_of_delay_do_not_flicker() {
    let identical = discs(|image, _| image.clone());
    let blurred = discs(|image, _| pattern::blur(image, SIZE));
    let late = discs(|image, _| (0..2).fold(image.clone(), |i, _| pattern::shifted(&i, SIZE[0])));
    let noisy = discs(|image, t| pattern::noise(image, t as u32, 10));
    // What leaves the picture at the right comes in at the left, where pixels are not valid; the filter's border reaches a
    // pixel further.
    let noisy = flicker(&noisy).flicker_error;
    for steady in [&identical, &blurred, &late] {
        assert!(flicker(steady).flicker_error < 0.1 * noisy, "{:?}", flicker(steady));
        assert!(flicker(steady).excess_flicker < 0.1 * noisy, "{:?}", flicker(steady));
    }
    assert!(late.mean.rmse > blurred.mean.rmse, "though a frame of delay is the greater error");
}

#[test]
fn a_cut_is_no_flicker() {
    let picture_of = |t: usize| grey(picture(|x, y| if t < 3 { waves(x, y) } else { 1.0 - waves(x, y) }));
    let measured = |cut: bool| {
        let still = Geometry::still(WIDTH, HEIGHT);
        let options = Options { metrics: vec![Metric::Flicker], ..Options::default() };
        let mut sequence = Sequence::new(options).unwrap();
        for t in 0..6 {
            let frame = picture_of(t);
            if cut && t == 3 {
                sequence.cut();
            }
            let geometry = Some(&still);
            sequence.push(&Step { name: "", frame: &frame, reference: &frame, geometry, changes: None }).unwrap();
        }
        sequence.finish().flicker.unwrap()
    };
    assert_eq!(measured(true).lags.iter().map(|l| l.reference).fold(0.0, f64::max), 0.0);
    assert!(measured(false).lags[0].reference > 0.01);
}

#[test]
fn causes_get_what_happened_at_their_places() {
    let still = Geometry::still(WIDTH, HEIGHT);
    let mut sequence = Sequence::new(Options { metrics: vec![Metric::Flicker], ..Options::default() }).unwrap();
    let reference = grey(picture(waves));
    // Errors that change in four columns: over one where samples are new, one where they are evicted and relit, one beside
    // a change of visibility, and one without a cause.
    let columns = [10, 30, 50, 70];
    for t in 0..4 {
        let wrong = |x: f64| if columns.contains(&(x as usize)) && t % 2 == 1 { 0.1 } else { 0.0 };
        let frame = grey(picture(|x, y| waves(x, y) + wrong(x)));
        let happened = |column: usize| (0..PIXELS).map(|i| f32::from(u8::from(i % WIDTH == column))).collect();
        let counts = [happened(10), happened(30), happened(51), happened(30)];
        let changes = Some(Changes { width: WIDTH, counts });
        let step =
            Step { name: "", frame: &frame, reference: &reference, geometry: Some(&still), changes: changes.as_ref() };
        sequence.push(&step).unwrap();
    }
    let flicker = sequence.finish().flicker.unwrap();
    let causes = flicker.causes.unwrap();
    let whole = flicker.lags[0].flicker_error.powi(2);
    assert!((causes.mean_square - whole).abs() < 1e-12 * whole, "{causes:?}");
    let share = |part: f64, of: f64| (part / causes.mean_square - of).abs() < 1e-4;
    assert!(share(causes.new_sample, 0.25) && share(causes.visibility_changed, 0.25), "{causes:?}");
    assert!(share(causes.evicted_sample, 0.125) && share(causes.light_changed, 0.125), "{causes:?}");
    assert!(share(causes.unattributed, 0.25), "{causes:?}");
}

#[test]
fn what_does_not_belong_together_is_refused_and_changes_nothing() {
    let mut sequence = Sequence::new(Options::default()).unwrap();
    let good = grey(picture(waves));
    let small = Frame::from_display([1, 1], [vec![0.0], vec![0.0], vec![0.0]]).unwrap();
    let linear = Frame::from_linear(SIZE, [0; 3].map(|_| vec![0.0; PIXELS]), 0.0).unwrap();
    let short = Geometry { motion: vec![[0.0; 2]], ..Geometry::still(WIDTH, HEIGHT) };
    let step = |frame, reference, geometry| Step { name: "7", frame, reference, geometry, changes: None };
    sequence.push(&step(&good, &good, None)).unwrap();
    for wrong in [step(&small, &small, None), step(&good, &linear, None), step(&good, &good, Some(&short))] {
        assert!(sequence.push(&wrong).unwrap_err().to_string().starts_with("frame 7: "));
    }
    let report = sequence.finish();
    assert_eq!((report.frames, report.flicker, report.size), (1, None, [WIDTH, HEIGHT]));
    let nan = Frame::from_linear([1, 1], [vec![f32::NAN], vec![0.0], vec![0.0]], 0.0);
    assert_eq!(nan.unwrap_err().to_string(), "1 pixels are infinite or not a number");
    assert!(Sequence::new(Options { pixels_per_degree: 0.0, ..Options::default() }).is_err());
}
