//! The same inputs on the same driver give the same bits: two runs, with one and with two driver threads and with as many
//! as the driver likes, write identical files. `LP_NUM_THREADS` is lavapipe's; on a driver that ignores it the files must
//! be identical all the same.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// Name and content of every file that a run writes.
type Files = BTreeMap<String, Vec<u8>>;

fn files(folder: &Path) -> Files {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    entries.map(|p| (p.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&p).unwrap())).collect()
}

fn render(arguments: &str, threads: Option<&str>) -> Files {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillray"));
    command.args(["render", "--quiet", "--out"]).arg(folder.path()).args(arguments.split_whitespace());
    match threads {
        Some(n) => command.env("LP_NUM_THREADS", n),
        None => command.env_remove("LP_NUM_THREADS"),
    };
    let output = command.output().unwrap();
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    files(folder.path())
}

fn differing<'a>(a: &'a Files, b: &Files) -> Vec<&'a str> {
    assert!(a.keys().eq(b.keys()), "{:?} and {:?}", a.keys(), b.keys());
    a.iter().filter(|(name, content)| b[*name] != **content).map(|(name, _)| name.as_str()).collect()
}

const FRAMES: &str = "--size 56x40 --frames 4 --motion orbit --format exr,png --aov depth,motion,density,age,changes";

#[test]
fn runs_with_any_number_of_driver_threads_write_identical_files() {
    let papers = "stable --set filter.fill=none --set filter.weights=equal";
    let hairball = "hairball?strands=300";
    let runs = [("spheres", "stable"), (hairball, "stable"), (hairball, papers), (hairball, "point-tracking")];
    for (scene, method) in runs {
        let arguments = format!("builtin:{scene} --method {method} {FRAMES}");
        let first = render(&arguments, Some("1"));
        assert_eq!(first.len(), 8, "{:?}", first.keys());
        for threads in [Some("1"), Some("2"), Some("2"), None] {
            assert_eq!(differing(&first, &render(&arguments, threads)), [""; 0], "{arguments}: 1 thread, {threads:?}");
        }
    }
}

#[test]
fn integrated_and_averaged_frames_are_identical_too() {
    for options in ["--method taa --spp 2", "--method stable+ti", "--method stable --set box_frames=3"] {
        let arguments = format!("builtin:spheres {options} {FRAMES}");
        let first = render(&arguments, Some("1"));
        assert_eq!(first.len(), 8, "{:?}", first.keys());
        assert_eq!(differing(&first, &render(&arguments, Some("2"))), [""; 0], "{options}");
    }
}

#[test]
fn another_seed_gives_other_files() {
    for method in ["stable", "point-tracking"] {
        let with = |seed| render(&format!("builtin:spheres --method {method} --seed {seed} {FRAMES}"), None);
        let (zero, one) = (with(0), with(1));
        let differing = differing(&zero, &one);
        assert!(zero.keys().filter(|n| n.ends_with(".exr")).all(|n| differing.contains(&n.as_str())), "{differing:?}");
    }
}
