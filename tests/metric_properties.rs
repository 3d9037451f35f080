//! What holds of metrics whatever the images.

#![allow(clippy::unwrap_used, reason = "a panic in a test's helper is a failing test")]

mod metric_support;

use proptest::prelude::*;
use stillray::metric::causes::Changes;
use stillray::metric::flip::{Flip, PIXELS_PER_DEGREE};
use stillray::metric::image::{Frame, Plane, Rgb};
use stillray::metric::psnr::psnr;
use stillray::metric::relative_mse::relative_mse;
use stillray::metric::rmse::mean_square;
use stillray::metric::sequence::{Metric, Options, Report, Sequence, Step};
use stillray::metric::ssim::ssim;
use stillray::metric::warp::Geometry;

const SIDE: usize = 16;
const SIZE: [u32; 2] = [16, 16];

fn values(low: f32, high: f32) -> impl Strategy<Value = Rgb> {
    let plane = || prop::collection::vec(low..=high, SIDE * SIDE);
    [plane(), plane(), plane()]
}

fn display() -> impl Strategy<Value = Frame> {
    values(0.0, 1.0).prop_map(|rgb| Frame::from_display(SIZE, rgb).unwrap())
}

/// Light over 40 stops, and some that is negative.
fn linear() -> impl Strategy<Value = Frame> {
    values(-21.0, 20.0).prop_map(|stops| {
        let light = |s: f32| if s < -20.0 { -0.5 } else { s.exp2() };
        Frame::from_linear(SIZE, stops.map(|plane| plane.into_iter().map(light).collect()), 0.0).unwrap()
    })
}

fn flip(frame: &Frame, reference: &Frame) -> Plane {
    Flip::new(PIXELS_PER_DEGREE).compare(frame, reference)
}

fn geometry() -> impl Strategy<Value = Geometry> {
    let motion = prop::collection::vec([-3.0_f32..3.0, -3.0_f32..3.0], SIDE * SIDE);
    let metres = prop_oneof![4 => 0.1_f32..9.0, 1 => Just(f32::INFINITY)];
    let depth = prop::collection::vec(metres, SIDE * SIDE);
    (motion, depth)
        .prop_map(|(motion, depth)| Geometry { motion, depth: Plane { width: SIDE, height: SIDE, data: depth } })
}

fn changes() -> impl Strategy<Value = Changes> {
    let plane = || prop::collection::vec(prop_oneof![9 => Just(0.0_f32), 1 => Just(2.0_f32)], SIDE * SIDE);
    [plane(), plane(), plane(), plane()].prop_map(|counts| Changes { width: SIDE, counts })
}

fn measured(moments: &[(Frame, Frame, Geometry, Changes)]) -> Report {
    let mut sequence = Sequence::new(Options { metrics: vec![Metric::Flicker], ..Options::default() }).unwrap();
    for (frame, reference, geometry, changes) in moments {
        let (geometry, changes) = (Some(geometry), Some(changes));
        sequence.push(&Step { name: "", frame, reference, geometry, changes }).unwrap();
    }
    sequence.finish()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn flip_stays_in_its_range(a in display(), b in display(), c in linear(), d in linear()) {
        for map in [flip(&a, &b), flip(&c, &d)] {
            prop_assert!(map.data.iter().all(|e| (0.0..=1.0).contains(e)), "{:?}", map);
            prop_assert!(map.mean() > 0.0);
        }
    }

    #[test]
    fn equal_images_have_no_error(a in display(), b in linear()) {
        for image in [&a, &b] {
            prop_assert_eq!(flip(image, image).data, vec![0.0; SIDE * SIDE]);
            prop_assert_eq!(mean_square(image.display(), image.display()), 0.0);
            prop_assert_eq!(relative_mse(image.linear(), image.linear()), 0.0);
            prop_assert_eq!(psnr(0.0), None);
            // A fraction whose halves are computed in different ways: a few roundings.
            prop_assert!((ssim(image, image).unwrap() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn what_is_symmetric_is(a in display(), b in display()) {
        prop_assert_eq!(flip(&a, &b), flip(&b, &a));
        prop_assert_eq!(mean_square(a.display(), b.display()), mean_square(b.display(), a.display()));
        prop_assert!((ssim(&a, &b).unwrap() - ssim(&b, &a).unwrap()).abs() < 1e-12);
        prop_assert!(ssim(&a, &b).unwrap() < 1.0 && ssim(&a, &b).unwrap() >= -1.0);
    }

    #[test]
    fn rmse_takes_no_detour(a in display(), b in display(), c in display()) {
        let rmse = |a: &Frame, b: &Frame| mean_square(a.display(), b.display()).sqrt();
        prop_assert!(rmse(&a, &c) <= rmse(&a, &b) + rmse(&b, &c) + 1e-12);
    }

    #[test]
    fn flicker_stays_in_its_range_and_its_causes_add_up(
        moments in prop::collection::vec((display(), display(), geometry(), changes()), 2..5)
    ) {
        // Chance depths may leave nothing to measure.
        if let Some(flicker) = measured(&moments).flicker {
            for lag in &flicker.lags {
                prop_assert!((0.0..=2.0).contains(&lag.flicker_error) && (0.0..=1.0).contains(&lag.valid));
                prop_assert!(lag.valid > 0.0);
                // The reverse triangle inequality.
                prop_assert!(lag.excess_flicker.abs() <= lag.flicker_error + 1e-12, "{:?}", lag);
            }
            let causes = flicker.causes.unwrap();
            if flicker.lags[0].lag == 1 {
                let whole = flicker.lags[0].flicker_error.powi(2);
                prop_assert!((causes.mean_square - whole).abs() <= 1e-12 * whole, "{:?}, not {whole}", causes);
            }
        }
    }

    #[test]
    fn frames_that_are_the_reference_do_not_flicker(
        moments in prop::collection::vec((display(), geometry(), changes()), 2..5)
    ) {
        let same: Vec<_> = moments.into_iter().map(|(f, g, c)| (f.clone(), f, g, c)).collect();
        if let Some(flicker) = measured(&same).flicker {
            prop_assert_eq!((flicker.flicker_error, flicker.excess_flicker), (0.0, 0.0));
        }
    }
}
