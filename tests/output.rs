//! Pictures come back from their files as they went in, and the files are what other programs expect.

#![allow(clippy::unwrap_used, reason = "a panic in a test's helper is a failing test")]

use std::fs;
use std::path::Path;

use half::f16;
use stillray::headless::Pixels;
use stillray::renderer::Aov;
use stillray::report::openexr::Exr;

fn pixels(width: u32, height: u32, channels: usize, value: impl Fn(usize) -> f32) -> Pixels {
    let count = width as usize * height as usize * channels;
    Pixels { width, height, channels, data: (0..count).map(value).collect() }
}

fn round_trip(exr: &Exr) -> Exr {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    exr.write(&path).unwrap();
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "something beside the file is left");
    Exr::read(&path).unwrap()
}

fn with_all_layers() -> Exr {
    let mut exr = Exr::new(&pixels(37, 21, 4, |i| i as f32 * 0.37), false);
    exr.fps = Some(29.97);
    exr.push_aov(Aov::Motion, &pixels(37, 21, 2, |i| i as f32 - 500.25));
    exr.push_aov(Aov::Depth, &pixels(37, 21, 1, |i| if i == 3 { f32::INFINITY } else { 1.0 / (i + 1) as f32 }));
    exr.push_aov(Aov::Density, &pixels(37, 21, 3, |i| (i % 5) as f32));
    exr.push_aov(Aov::Age, &pixels(37, 21, 1, |i| i as f32));
    exr
}

#[test]
fn every_channel_comes_back_bit_for_bit() {
    let written = with_all_layers();
    let read = round_trip(&written);
    let names: Vec<&str> = read.channels.iter().map(|c| c.name.as_str()).collect();
    let sorted = "A B G R age.V density.B density.G density.R depth.Z motion.X motion.Y";
    assert_eq!(names.join(" "), sorted);
    assert_eq!(([read.width, read.height], read.fps), ([37, 21], Some(29.97)));
    for channel in &written.channels {
        let stored = |v: &f32| if channel.half { f16::from_f32(*v).to_f32().to_bits() } else { v.to_bits() };
        let expected: Vec<u32> = channel.data.iter().map(stored).collect();
        let found: Vec<u32> = read.channel(&channel.name).unwrap().iter().map(|v| v.to_bits()).collect();
        assert_eq!(found, expected, "{}", channel.name);
    }
}

#[test]
fn colour_is_half_unless_float_is_asked_for() {
    let color = pixels(3, 2, 3, |i| 0.1 + i as f32);
    let half = round_trip(&Exr::new(&color, false));
    let float = round_trip(&Exr::new(&color, true));
    assert!(half.channels.iter().all(|c| c.half) && float.channels.iter().all(|c| !c.half));
    assert_eq!(float.channel("G").unwrap()[1], 4.1);
    assert_ne!(half.channel("G").unwrap()[1], 4.1);
}

#[test]
fn light_too_bright_for_half_stays_finite() {
    let read = round_trip(&Exr::new(&pixels(1, 1, 3, |i| [1e6, -1e6, 65504.0][i]), false));
    let rgb: Vec<f32> = ["R", "G", "B"].iter().map(|n| read.channel(n).unwrap()[0]).collect();
    assert_eq!(rgb, [65504.0, -65504.0, 65504.0]);
}

#[test]
fn the_same_picture_gives_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = |exr: &Exr, name: &str| {
        exr.write(&dir.path().join(name)).unwrap();
        fs::read(dir.path().join(name)).unwrap()
    };
    let mut exr = with_all_layers();
    let first = bytes(&exr, "a.exr");
    assert_eq!(first, bytes(&exr, "b.exr"));
    exr.channels[0].data[0] += 1.0;
    assert_ne!(first, bytes(&exr, "c.exr"));
}

/// Reads the header by the letter of the format's specification, with nothing of the crate that wrote it.
fn header(bytes: &[u8]) -> Vec<(String, String, Vec<u8>)> {
    assert_eq!(bytes[..4], [0x76, 0x2f, 0x31, 0x01], "magic number");
    assert_eq!(bytes[4..8], [2, 0, 0, 0], "version 2, one part, scan lines, short names");
    let text = |at: &mut usize| {
        let end = *at + bytes[*at..].iter().position(|&b| b == 0).unwrap();
        let text = String::from_utf8(bytes[*at..end].to_vec()).unwrap();
        *at = end + 1;
        text
    };
    let (mut at, mut attributes) = (8, Vec::new());
    while bytes[at] != 0 {
        let (name, kind) = (text(&mut at), text(&mut at));
        let size = i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        attributes.push((name, kind, bytes[at + 4..at + 4 + size].to_vec()));
        at += 4 + size;
    }
    attributes
}

#[test]
fn the_header_says_what_other_programs_look_for() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    with_all_layers().write(&path).unwrap();
    let header = header(&fs::read(&path).unwrap());
    let get = |name: &str| header.iter().find(|a| a.0 == name).unwrap_or_else(|| panic!("no {name}")).clone();
    let floats =
        |b: &[u8]| -> Vec<f32> { b.chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect() };
    let ints =
        |b: &[u8]| -> Vec<i32> { b.chunks_exact(4).map(|c| i32::from_le_bytes(c.try_into().unwrap())).collect() };
    assert_eq!(ints(&get("dataWindow").2), [0, 0, 36, 20]);
    assert_eq!(ints(&get("displayWindow").2), [0, 0, 36, 20]);
    assert_eq!(get("compression").2, [3], "ZIP, 16 lines a block");
    assert_eq!(get("lineOrder").2, [0], "increasing");
    assert_eq!(floats(&get("chromaticities").2), [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290]);
    assert_eq!(floats(&get("pixelAspectRatio").2), [1.0]);
    assert_eq!(get("framesPerSecond").1, "rational");
    assert_eq!(ints(&get("framesPerSecond").2), [29970, 1000]);
    // Channel list: name, 0, pixel type (1 half, 2 float), flags, sampling 1, 1.
    let channels = get("channels");
    let position = |pattern: &[u8]| channels.2.windows(pattern.len()).position(|w| w == pattern);
    assert!(position(b"R\0\x01\0\0\0").is_some() && position(b"depth.Z\0\x02\0\0\0").is_some());
    assert!(position(b"depth.Z\0\x01\0\0\0").is_none());
}

#[test]
fn what_is_no_exr_is_an_error_with_its_path() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let message = |p: &Path| Exr::read(p).unwrap_err().to_string();
    assert!(message(&path).contains("a.exr"), "a missing file");
    fs::write(&path, b"no picture").unwrap();
    assert!(message(&path).contains("a.exr"), "another format");
    with_all_layers().write(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert!(message(&path).contains("a.exr"), "a truncated file");
}

#[test]
fn a_plane_of_another_size_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let mut exr = Exr::new(&pixels(4, 4, 3, |_| 0.0), false);
    exr.push_aov(Aov::Age, &pixels(4, 3, 1, |_| 0.0));
    assert!(exr.write(&dir.path().join("a.exr")).unwrap_err().to_string().contains("age.V"));
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}
