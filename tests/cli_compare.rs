//! `stillray compare`: what it prints and writes, of folders that it did not make itself, and what it refuses. Nothing here
//! needs a device.

#![allow(clippy::unwrap_used, reason = "a panic in a test's helper is a failing test")]

mod metric_support;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use metric_support::pattern;
use serde_json::Value;
use stillray::report::openexr::{Channel, Exr};
use stillray::report::png::Picture;

const SIZE: [u32; 2] = [72, 64];

fn compare(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillray"));
    command.current_dir(folder).arg("compare").args(arguments.split(' ')).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn run(folder: &Path, arguments: &str) -> String {
    let output = compare(folder, arguments);
    assert!(output.status.success(), "{arguments}: {:?}\n{}", output.status, text(&output.stderr));
    assert_eq!(text(&output.stderr), "", "{arguments}");
    text(&output.stdout)
}

fn refused(folder: &Path, arguments: &str, word: &str) {
    let output = compare(folder, arguments);
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(1), "{arguments}: {err}");
    let one_line = err.starts_with("error: ") && err.lines().count() == 1 && out.is_empty();
    assert!(one_line && err.contains(word), "{arguments}: no '{word}' in {err}{out}");
}

fn names(folder: &Path) -> String {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names.join(" ")
}

/// Discs that move to the right by a pixel a frame, some of them with noise.
fn codes(index: u32, noisy: bool) -> pattern::Codes {
    let moved = (0..index).fold(pattern::discs(3, false, SIZE), |image, _| pattern::shifted(&image, SIZE[0]));
    if noisy { pattern::noise(&moved, index, 20) } else { moved }
}

/// Layers that a file has besides colour.
#[derive(Clone, Copy)]
enum Layers {
    None,
    Motion,
    Changes,
}

fn write_exr(path: &Path, codes: &[i32], layers: Layers) {
    let plane = |c: usize| codes.iter().skip(c).step_by(3).map(|v| *v as f32 / 256.0).collect::<Vec<f32>>();
    let channel = |name: &str, data| Channel { name: name.to_owned(), half: false, data };
    let mut channels = vec![channel("R", plane(0)), channel("G", plane(1)), channel("B", plane(2))];
    let even: &[(&str, f32)] = match layers {
        Layers::None => &[],
        Layers::Motion => &[("motion.X", 1.0), ("motion.Y", 0.0), ("depth.Z", 3.0)],
        Layers::Changes => &[("changes.R", 1.0), ("changes.G", 0.0), ("changes.B", 0.0), ("changes.A", 2.0)],
    };
    channels.extend(even.iter().map(|(name, value)| channel(name, vec![*value; codes.len() / 3])));
    Exr { width: SIZE[0], height: SIZE[1], fps: None, channels }.write(path).unwrap();
}

/// Four frames and their reference, in `frames` and `reference`.
fn exr_folders(dir: &Path, frames: Layers, reference: Layers) {
    for (name, noisy, layers) in [("frames", true, frames), ("reference", false, reference)] {
        fs::create_dir(dir.join(name)).unwrap();
        (0..4).for_each(|i| write_exr(&dir.join(format!("{name}/{name}.{i}.exr")), &codes(i, noisy), layers));
    }
}

fn png_folders(dir: &Path) {
    for (name, noisy) in [("frames", true), ("reference", false)] {
        fs::create_dir(dir.join(name)).unwrap();
        for i in 0..4 {
            let rgb = codes(i, noisy).into_iter().map(|v| v as u8).collect();
            let picture = Picture { width: SIZE[0], height: SIZE[1], rgb };
            picture.write(&dir.join(format!("{name}/{name}_{i:05}.png"))).unwrap();
        }
    }
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn exr_frames_with_motion_and_changes() {
    let dir = tempfile::tempdir().unwrap();
    exr_folders(dir.path(), Layers::Changes, Layers::Motion);
    let table = run(dir.path(), "frames reference --json r.json --maps maps");
    for words in ["4 frames of 72x64, frames against reference", "HDR-FLIP", "flicker error", "lag 3", "new samples"] {
        assert!(table.contains(words), "no {words} in\n{table}");
    }
    assert!(table.contains("1.00 pixels a frame in the mean and 1.00 at most"), "{table}");
    let report = json(&dir.path().join("r.json"));
    assert_eq!((&report["schema"], &report["kind"], &report["frames"]), (&1.into(), &"exr".into(), &4.into()));
    assert_eq!(report["motion"]["source"], "layers motion and depth of the reference");
    let metrics = report["settings"]["metrics"].as_array().unwrap();
    // By the names that --metrics takes.
    assert!(metrics.len() == 8 && metrics.contains(&"relative-mse".into()), "{metrics:?}");
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{value}"));
    for name in "flip rmse rmse_linear psnr relative_mse ssim cpbd cpbd_reference energy_ratio".split(' ') {
        let rows = report["per_frame"].as_array().unwrap();
        assert!(rows.iter().all(|row| number(&row[name]).is_finite()), "{name}");
        assert!(number(&report["mean"][name]).is_finite(), "{name}");
    }
    assert!(number(&report["temporal"]["linear"]["second_difference"]) > 0.0);
    let flicker = &report["flicker"];
    assert!(number(&flicker["flicker_error"]) > 0.01 && number(&flicker["lags"][0]["reference"]) < 1e-6);
    // A pixel a frame leaves the frame at the left.
    assert!((number(&flicker["lags"][2]["valid"]) - 69.0 / 72.0).abs() < 1e-9);
    // Two causes everywhere: each gets half.
    let causes = &flicker["causes"];
    assert_eq!(causes["new_sample"], causes["light_changed"]);
    assert_eq!((number(&causes["unattributed"]), number(&causes["evicted_sample"])), (0.0, 0.0));
    assert!(report["per_frame"][0]["flicker_error"].is_null() && report["per_frame"][1]["flicker_error"].is_f64());

    let maps = dir.path().join("maps");
    let flips = "flip_0000.exr flip_0000.png flip_0001.exr flip_0001.png flip_0002.exr flip_0002.png flip_0003.exr \
                 flip_0003.png";
    assert_eq!(names(&maps), format!("flicker.exr flicker.png {flips}"));
    let map = Exr::read(&maps.join("flip_0001.exr")).unwrap();
    let mean = map.channel("Y").unwrap().iter().map(|v| f64::from(*v)).sum::<f64>() / (72.0 * 64.0);
    assert!((mean - number(&report["per_frame"][1]["flip"])).abs() < 1e-9, "the map is that of the number");
    let flicker = Exr::read(&maps.join("flicker.exr")).unwrap();
    // Three, two and one frame have one of their lags.
    assert_eq!(flicker.channel("valid.V").unwrap().iter().fold(0.0, |a: f32, b| a.max(*b)), 6.0);
    assert_eq!(image::open(maps.join("flicker.png")).unwrap().width(), 72);
}

#[test]
fn png_frames_are_taken_as_still_and_it_is_said() {
    let dir = tempfile::tempdir().unwrap();
    png_folders(dir.path());
    let table = run(dir.path(), "frames reference --json r.json");
    assert!(table.contains("LDR-FLIP") && table.contains("motion: none assumed, as PNG files have none"), "{table}");
    let report = json(&dir.path().join("r.json"));
    assert_eq!(report["motion"]["source"], "assumed static: PNG files have no motion");
    let lag = &report["flicker"]["lags"][0];
    assert!(lag["reference"].as_f64().unwrap() > 0.01 && lag["valid"] == 1.0, "{lag}");
    assert_eq!(run(dir.path(), "frames reference --quiet"), "");
    let same = run(dir.path(), "reference reference --metrics rmse,flip");
    assert!(same.contains("RMSE, display      0.00000") && same.contains("  inf ") && !same.contains("SSIM"), "{same}");
    let output = compare(dir.path(), "frames reference --exposure 1");
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("--exposure"));
}

#[test]
fn without_motion_nothing_is_guessed() {
    let dir = tempfile::tempdir().unwrap();
    exr_folders(dir.path(), Layers::None, Layers::None);
    let table = run(dir.path(), "frames reference --json r.json");
    assert!(table.contains("flicker was not measured: the reference has no layers motion and depth"), "{table}");
    assert!(json(&dir.path().join("r.json"))["flicker"].is_null());
    refused(dir.path(), "frames reference --metrics flicker", "--static");
    let table = run(dir.path(), "frames reference --metrics flicker --static --json r.json");
    assert!(table.contains("motion: none assumed (--static)"), "{table}");
    let report = json(&dir.path().join("r.json"));
    assert_eq!(report["motion"]["source"], "assumed static: --static");
    assert!(report["flicker"]["flicker_error"].as_f64().unwrap() > 0.01 && report["mean"]["flip"].is_null());
    // Brighter frames have greater errors on a display, and the same ones in light.
    let error = |exposure: &str, name: &str| {
        run(dir.path(), &format!("frames reference --metrics rmse --json e.json --exposure {exposure}"));
        json(&dir.path().join("e.json"))["mean"][name].as_f64().unwrap()
    };
    assert!(error("-2", "rmse") < 0.9 * error("0", "rmse"));
    assert_eq!(error("-2", "rmse_linear"), error("0", "rmse_linear"));
}

#[test]
fn flicker_is_not_measured_across_missing_frames() {
    let dir = tempfile::tempdir().unwrap();
    exr_folders(dir.path(), Layers::None, Layers::Motion);
    for name in ["frames", "reference"] {
        fs::rename(dir.path().join(format!("{name}/{name}.3.exr")), dir.path().join(format!("{name}/{name}.5.exr")))
            .unwrap();
    }
    let output = compare(dir.path(), "frames reference --metrics flicker --json r.json");
    assert!(text(&output.stderr).starts_with("note: numbers of frames are missing"), "{}", text(&output.stderr));
    let report = json(&dir.path().join("r.json"));
    assert_eq!((&report["motion"]["cuts"], report["flicker"]["lags"].as_array().unwrap().len()), (&1.into(), 2));
    assert!(report["per_frame"][3]["flicker_error"].is_null());
}

#[test]
fn what_cannot_be_compared_fails_with_its_name_and_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    exr_folders(dir.path(), Layers::None, Layers::Motion);
    let path = |name: &str| dir.path().join(name);
    refused(dir.path(), "gone reference", "gone");
    refused(dir.path(), "frames reference --json gone/r.json", "gone/r.json");
    refused(dir.path(), "frames reference --maps frames/frames.0.exr", "frames.0.exr");
    fs::create_dir(path("empty")).unwrap();
    refused(dir.path(), "empty reference", "has no .exr or .png file");
    let bad = |name: &str| path(&format!("frames/frames.{name}.exr"));
    fs::rename(bad("2"), path("kept")).unwrap();
    refused(dir.path(), "frames reference", "has no file for frame 2");
    fs::write(bad("2"), "no picture").unwrap();
    refused(dir.path(), "frames reference --json r.json", "frames.2.exr");
    write_exr(&bad("2"), &codes(2, true), Layers::None);
    let mut exr = Exr::read(&bad("2")).unwrap();
    exr.channels[1].data[100] = f32::NAN;
    exr.write(&bad("2")).unwrap();
    refused(dir.path(), "frames reference", "frames.2.exr: 1 pixels are infinite or not a number");
    let small = |name: &str| Channel { name: name.to_owned(), half: true, data: vec![0.5; 6] };
    Exr { width: 3, height: 2, fps: None, channels: vec![small("Y")] }.write(&bad("2")).unwrap();
    refused(dir.path(), "frames reference", "3x2 pixels, but reference/reference.2.exr has 72x64");
    Exr { width: 3, height: 2, fps: None, channels: vec![small("depth.Z")] }.write(&bad("2")).unwrap();
    refused(dir.path(), "frames reference", "neither R, G and B nor Y among its channels (depth.Z)");
    fs::copy(path("kept"), bad("2")).unwrap();
    write_exr(&path("reference/reference.2.exr"), &codes(2, false), Layers::None);
    refused(
        dir.path(),
        "frames reference",
        "reference.2.exr: has no layers motion and depth, but the frames before have",
    );
    fs::write(path("frames/9.png"), "").unwrap();
    refused(dir.path(), "frames reference", "has both .exr and .png files");
    assert_eq!(names(dir.path()), "empty frames kept reference", "nothing is left of what failed");
}
