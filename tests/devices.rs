//! Devices are chosen by index or name, and the pipeline cache on disk is used and never trusted.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use stillray::Error;
use stillray::headless::Device;

#[test]
fn a_device_is_opened_by_index_and_by_part_of_its_name() {
    let all = Device::list().unwrap();
    let fitting = all.iter().find(|d| d.rejected.is_empty()).expect("a device that fits");
    let opened = |selector: &str| Device::open(Some(selector)).unwrap().report().clone();
    assert_eq!(opened(&fitting.index.to_string()).name, fitting.name);
    let part: String = fitting.name.chars().take(5).collect::<String>().to_uppercase();
    assert!(opened(&part).name.to_uppercase().contains(&part));
    assert!(Device::open(None).unwrap().report().rejected.is_empty());
}

#[test]
fn an_unknown_device_is_answered_with_all_that_there_are() {
    let all = Device::list().unwrap();
    for selector in ["no such device", "1000"] {
        let error = Device::open(Some(selector)).unwrap_err();
        assert!(matches!(error, Error::NoDevice { .. }));
        let text = error.to_string();
        assert!(text.contains(selector), "{text}");
        for device in &all {
            let reason = if device.rejected.is_empty() { "not the one asked for" } else { device.rejected[0].as_str() };
            assert!(text.contains(&format!("{}: {reason}", device.name)), "{text}");
        }
    }
    let output = render(tempfile::tempdir().unwrap().path(), &["--device", "no such device"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), said.lines().count()), (Some(1), 1), "{said}");
    assert!(said.contains(&all[0].name), "{said}");
}

// --- The pipeline cache ---

/// Renders a frame with the cache below `folder`.
fn render(folder: &Path, more: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillray"));
    command.env("XDG_CACHE_HOME", folder.join("cache")).args([
        "render",
        "builtin:cornell",
        "--size",
        "16x12",
        "--quiet",
    ]);
    command.arg("--out").arg(folder.join("frames")).args(more).output().unwrap()
}

fn picture(folder: &Path) -> Vec<u8> {
    let output = render(folder, &[]);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    fs::read(folder.join("frames/frame_0000.png")).unwrap()
}

/// The files of the cache.
fn cached(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder.join("cache/stillray")).unwrap().map(|e| e.unwrap().path()).collect()
}

/// The cache's only file, which has to be a header of Vulkan's with a checksum behind.
fn cache_file(folder: &Path) -> (PathBuf, Vec<u8>) {
    let [path] = cached(folder).try_into().expect("one file");
    let data = fs::read(&path).unwrap();
    assert!(data.len() >= 32 + 8 && data[4..8] == [1, 0, 0, 0], "a cache of version one: {data:?}");
    (path, data)
}

#[test]
fn the_pipeline_cache_is_written_and_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let first = picture(folder.path());
    let (path, data) = cache_file(folder.path());
    let uuid: String = data[16..32].iter().map(|b| format!("{b:02x}")).collect();
    assert_eq!(path.file_name().unwrap().to_str().unwrap(), format!("{uuid}.bin"));
    assert!(picture(folder.path()) == first, "with the cache");
    assert_eq!(cache_file(folder.path()).0, path);
}

#[test]
fn a_cache_that_is_damaged_or_foreign_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let first = picture(folder.path());
    let (path, whole) = cache_file(folder.path());
    let mut foreign = whole.clone();
    foreign[8] ^= 0xff;
    let mut longer = whole.clone();
    longer.extend([0xee; 100]);
    for damaged in
        [foreign, longer, whole[..20].to_vec(), Vec::new(), b"not a cache at all, but long enough to be one".to_vec()]
    {
        fs::write(&path, &damaged).unwrap();
        assert!(picture(folder.path()) == first);
        let (_, now) = cache_file(folder.path());
        assert!(now != damaged && now[..32] == whole[..32], "written anew");
    }
}

#[test]
fn where_there_can_be_no_cache_there_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("cache/stillray");
    fs::create_dir(folder.path().join("cache")).unwrap();
    fs::write(&place, "a file where the folder would be").unwrap();
    let first = picture(folder.path());
    assert!(place.is_file());
    fs::remove_file(&place).unwrap();
    assert!(picture(folder.path()) == first);
    cache_file(folder.path());
}
