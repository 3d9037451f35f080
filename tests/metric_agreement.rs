//! Metrics agree with well-known implementations: `scikit-image` (SSIM), NVIDIA's `flip-evaluator`, `cpbd-py312`, NumPy.
//! Their values are in `metric_reference.json`, which `tools/metric_reference.py` has made of the same images.

#![allow(clippy::unwrap_used, reason = "a panic in a test's helper is a failing test")]

mod metric_support;

use std::fs;
use std::path::Path;

use metric_support::{frame, pattern};
use serde_json::Value;
use stillray::metric::cpbd::cpbd;
use stillray::metric::flip::{Flip, PIXELS_PER_DEGREE};
use stillray::metric::image::{Frame, planar};
use stillray::metric::sequence::{Errors, Metric, Options, Sequence, Step};
use stillray::metric::temporal::Unsteadiness;

fn table() -> Value {
    serde_json::from_str(include_str!("metric_reference.json")).unwrap()
}

fn measured(frames: &[Frame], reference: &Frame) -> stillray::metric::sequence::Report {
    let metrics = Metric::ALL.to_vec();
    let mut sequence = Sequence::new(Options { metrics, ..Options::default() }).unwrap();
    for frame in frames {
        sequence.push(&Step { name: "0", frame, reference, geometry: None, changes: None }).unwrap();
    }
    sequence.finish()
}

/// The frame and the reference of a row of the table.
fn images(row: &Value) -> (Frame, Frame) {
    let (grey, space) = (row["grey"].as_bool().unwrap(), row["space"].as_str().unwrap());
    let base = pattern::discs(if grey { 5 } else { 9 }, grey, pattern::SIZE);
    let codes = pattern::variant(row["variant"].as_str().unwrap(), &base);
    assert_eq!(Value::from(codes.iter().sum::<i32>()), row["code_sum"], "not the image that was measured");
    let make = |codes| frame(space, pattern::SIZE, &pattern::values(space, codes));
    (make(&codes), make(&base))
}

/// What is expected and what is allowed of it. NumPy keeps images in f32, and so do we; its sums and ours are in f64. So the
/// errors agree to the rounding of sRGB encoding: an ulp of 1 in f32 for each value, of errors that are near 0.1.
/// FLIP and SSIM are computed in f32 there. Their bounds, and CPBD's, are those that users are promised.
fn disagreements(row: &Value, got: &Errors) -> Vec<String> {
    let bounds = [
        ("rmse", got.rmse, 1e-6),
        ("rmse_linear", got.rmse_linear, 1e-6),
        ("psnr", got.psnr, 1e-3),
        ("relative_mse", got.relative_mse, 1e-6),
        ("ssim", got.ssim, 1e-3),
        ("flip", got.flip, 1e-3),
        ("cpbd", got.cpbd, 0.01),
        ("cpbd_reference", got.cpbd_reference, 0.01),
        ("energy_ratio", got.energy_ratio, 1e-6),
    ];
    let wrong = bounds.iter().filter(|(name, got, bound)| match (row[name].as_f64(), got) {
        // Linear values go up to 200: their error is relative.
        (Some(expected), Some(got)) => (expected - got).abs() > bound * expected.abs().max(1.0),
        (None, None) => false,
        _ => true,
    });
    let at = format!("{} {} {}", row["grey"], row["space"], row["variant"]);
    wrong.map(|(name, got, _)| format!("{at}: {name} is {got:?}, not {}", row[name])).collect()
}

#[test]
fn every_image_has_the_values_of_the_reference_implementations() {
    let table = table();
    let rows = table["images"].as_array().unwrap();
    assert_eq!(rows.len(), 2 * 4 * 6);
    let wrong: Vec<String> = rows
        .iter()
        .flat_map(|row| {
            let (frame, reference) = images(row);
            disagreements(row, &measured(&[frame], &reference).per_frame[0].errors)
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_comparison_notices_another_image() {
    let table = table();
    let rows = table["images"].as_array().unwrap();
    let noise = rows.iter().find(|r| r["variant"] == "noise").unwrap();
    let blur = rows.iter().find(|r| r["variant"] == "blur").unwrap();
    let (frame, reference) = images(blur);
    let wrong = disagreements(noise, &measured(&[frame], &reference).per_frame[0].errors);
    for name in ["rmse", "psnr", "relative_mse", "ssim", "flip", "cpbd"] {
        assert!(wrong.iter().any(|w| w.contains(&format!(": {name} is"))), "{name} is not compared");
    }
}

#[test]
fn the_error_map_of_flip_has_its_values_where_they_belong() {
    let flip = Flip::new(PIXELS_PER_DEGREE);
    for row in table()["images"].as_array().unwrap() {
        let (frame, reference) = images(row);
        let map = flip.compare(&frame, &reference);
        for ([x, y], expected) in
            [[0, 0], [20, 10], [33, 40], [79, 71]].iter().zip(row["flip_pixels"].as_array().unwrap())
        {
            let (got, expected) = (f64::from(map.data[y * 80 + x]), expected.as_f64().unwrap());
            assert!((got - expected).abs() < 1e-3, "{row}: {got} at {x}, {y}, not {expected}");
        }
    }
}

#[test]
fn unsteadiness_is_that_of_numpy() {
    for row in table()["sequences"].as_array().unwrap() {
        let space = row["space"].as_str().unwrap();
        let base = pattern::discs(9, false, pattern::SIZE);
        let make = |name| frame(space, pattern::SIZE, &pattern::values(space, &pattern::variant(name, &base)));
        let frames: Vec<Frame> = ["noise", "same", "blur", "noise"].into_iter().map(make).collect();
        let temporal = measured(&frames, &make("same")).temporal.unwrap();
        for (name, got) in [("display", temporal.display), ("linear", temporal.linear)] {
            let expected: Unsteadiness = serde_json::from_value(row[name].clone()).unwrap();
            let close = |a: Option<f64>, b: Option<f64>| (a.unwrap() - b.unwrap()).abs() < 1e-6 * b.unwrap().max(1.0);
            assert!(close(got.std, expected.std), "{space} {name}: {got:?}, not {expected:?}");
            assert!(
                close(got.second_difference, expected.second_difference),
                "{space} {name}: {got:?}, not {expected:?}"
            );
        }
    }
}

#[test]
fn cpbd_of_images_of_known_blur() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/metrics/cpbd_images");
    let Ok(text) = fs::read_to_string(folder.join("cpbd_reference.json")) else {
        println!("skipped, no ../shared/metrics");
        return;
    };
    let table: Value = serde_json::from_str(&text).unwrap();
    for row in table["images"].as_array().unwrap() {
        let image = image::open(folder.join(row["file"].as_str().unwrap())).unwrap().to_rgb32f();
        let frame = Frame::from_display([image.width(), image.height()], planar(3, &image)).unwrap();
        let (got, expected) = (cpbd(&frame).unwrap(), row["cpbd"].as_f64().unwrap());
        assert!((got - expected).abs() < 0.01, "{}: {got}, not {expected}", row["file"]);
    }
}
