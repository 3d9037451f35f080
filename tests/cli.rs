//! The program answers wrong words with one line and exit code 2, failures with one line and exit code 1, and leaves
//! nothing behind. Nothing here needs a device.

#![allow(clippy::unwrap_used, reason = "a panic in a test's helper is a failing test")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn stillray(arguments: &[&str]) -> Output {
    stillray_in(Path::new("."), arguments)
}

fn stillray_in(folder: &Path, arguments: &[&str]) -> Output {
    // A backtrace would be several lines: with this in the environment, one that is possible would be seen.
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillray"));
    command.current_dir(folder).env("RUST_BACKTRACE", "1").args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Fails with this code, one line on standard error that contains `word`, and nothing on standard output.
fn check_refusal(output: &Output, code: i32, word: &str) -> Result<(), String> {
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    let one_line = err.ends_with('\n') && err.lines().count() == 1 && err.starts_with("error: ");
    if output.status.code() == Some(code) && one_line && err.contains(word) && out.is_empty() {
        return Ok(());
    }
    Err(format!("exit {:?} instead of {code} with '{word}'\nstdout: {out}\nstderr: {err}", output.status.code()))
}

#[test]
fn help_and_version_are_no_errors() {
    for arguments in [
        &["--help"][..],
        &["-h"],
        &["help"],
        &["render", "--help"],
        &["bench", "-h"],
        &["compare", "--help"],
        &["info", "--help"],
        &["settings", "-h"],
        &["samplers", "--help"],
        &["trade", "check", "--help"],
    ] {
        let output = stillray(arguments);
        assert!(output.status.success() && output.stderr.is_empty(), "{arguments:?}");
        assert!(text(&output.stdout).contains("Usage: stillray"), "{arguments:?}");
    }
    let version = text(&stillray(&["--version"]).stdout);
    assert_eq!(version, format!("stillray {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn every_option_of_render_is_in_its_help() {
    let help = text(&stillray(&["render", "--help"]).stdout);
    let options = "method density tolerance spp jitter passes size frames fps motion camera out format aov float exposure \
                   seed device json quiet preview settings set";
    for option in options.split_whitespace() {
        assert!(help.contains(&format!("--{option}")), "--{option}");
    }
    for motion in ["static", "rotate", "pan", "zoom", "orbit", "dolly"] {
        assert!(help.contains(motion), "{motion}");
    }
}

#[test]
fn wrong_words_are_usage_errors_that_name_the_option() {
    let cases: &[(&[&str], &str)] = &[
        (&[], "no command"),
        (&["paint"], "paint"),
        (&["render", "--sp", "1"], "--spp"),
        (&["render", "--method", "fancy"], "--method"),
        (&["render", "--density", "0.06"], "--density"),
        (&["render", "--density", "-1"], "--density"),
        (&["render", "--density", "nan"], "--density"),
        (&["render", "--density"], "--density"),
        (&["render", "--tolerance", "16.5"], "--tolerance"),
        (&["render", "--spp", "0"], "--spp"),
        (&["render", "--spp", "17"], "--spp"),
        (&["render", "--size", "640"], "--size"),
        (&["render", "--size", "0x480"], "--size"),
        (&["render", "--size", "16385x1"], "--size"),
        (&["render", "--frames", "0"], "--frames"),
        (&["render", "--fps", "0"], "--fps"),
        (&["render", "--motion", "wobble"], "--motion"),
        (&["render", "--format", "gif"], "--format"),
        (&["render", "--format", "png,"], "--format"),
        (&["render", "--aov", "beauty", "--format", "exr"], "--aov"),
        (&["render", "--aov", "depth", "--format", "png"], "--aov"),
        (&["render", "--float"], "--float"),
        (&["render", "--exposure", "99"], "--exposure"),
        (&["render", "--seed", "-1"], "--seed"),
        (&["render", "--method", "supersample", "--density", "2"], "--density"),
        (&["render", "--method", "reference", "--tolerance", "2"], "--tolerance"),
        (&["render", "--spp", "2"], "--spp"),
        (&["render", "--jitter"], "--jitter"),
        (&["render", "--passes", "2"], "--passes"),
        (&["render", "a.gltf", "b.gltf"], "b.gltf"),
        (&["render", "builtin:teapot"], "teapot"),
        (&["render", "builtin:cornell", "--camera", "left"], "'main'"),
        (&["render", "builtin:cornell", "--camera", "-1,2:3"], "--camera"),
        (&["bench", "--methods", "stable:17"], "--methods"),
        (&["bench", "--methods", "magic:1"], "--methods"),
        (&["bench", "--methods", "stable:1,stable:1"], "--methods"),
        (&["bench", "--frames", "0"], "--frames"),
        (&["render", "--set", "densty=2"], "'density'"),
        (&["render", "--set", "density=17"], "from 0.0625 to 16"),
        (&["render", "--set", "density"], "NAME=VALUE"),
        (&["render", "--set", "spp=2"], "--set spp"),
        (&["render", "--set", "method=supersample", "--density", "2"], "--density"),
        (&["bench", "--methods", "stable:1", "--set", "spp=2"], "--set spp"),
        (&["bench", "--methods", "stable:1", "--set", "tolerance=-1"], "from 0.0625 to 16"),
        (&["bench", "--methods", "absent.toml"], "absent.toml"),
        (&["settings", "--set", "spp=two"], "a whole number"),
        (&["compare"], "DIR"),
        (&["compare", "a"], "REFERENCE_DIR"),
        (&["compare", "a", "b", "--metrics", "beauty"], "--metrics"),
        (&["compare", "a", "b", "--exposure", "99"], "--exposure"),
        (&["compare", "a", "b", "--ppd", "0"], "--ppd"),
        (&["info", "--size", "x"], "--size"),
        (&["info", "builtin:cornell", "--model", "some"], "--model"),
        (&["render", "--aperture", "-0.1"], "from 0 to 1000"),
        (&["render", "--focus", "0"], "--focus"),
        (&["render", "--blades", "2"], "from 3 to 16"),
        (&["render", "--shutter", "-0.1"], "from 0 to 1"),
        (&["render", "--shutter", "1.1"], "from 0 to 1"),
        (&["render", "--shutter", "NaN"], "from 0 to 1"),
        (&["trade", "builtin:cornell", "--aperture", "0.1"], "--aperture"),
        (&["trade", "builtin:cornell", "--shutter", "0.5"], "--shutter"),
        (&["trade", "builtin:cornell", "--environment", "sky.exr"], "--environment"),
        (&["render", "--environment-scale", "-1"], "from 0 to"),
        (&["render", "--environment-turn", "361"], "from -360 to 360"),
        (&["render", "--environment-turn", "20"], "--environment"),
        (&["trade", "builtin:cornell", "--sky", "3"], "--sky"),
        (&["render", "--sky", "1.6"], "from 1.7 to 10"),
        (&["render", "--sky", "3", "--sun", "10,91"], "from 0 to 90"),
        (&["render", "--sky", "3", "--pollution", "0.2"], "from 0 to 0.1"),
        (&["render", "--pollution", "0.01"], "--sky"),
        (&["render", "--sun", "10,20"], "--sky"),
        (&["render", "--sky", "3", "--environment", "sky.exr"], "cannot be used with"),
        (&["render", "builtin:penumbra?light=801"], "from 0 to 800"),
        (&["info", "builtin:teapot"], "teapot"),
    ];
    let wrong: Vec<String> = cases
        .iter()
        .filter_map(|(arguments, word)| {
            check_refusal(&stillray(arguments), 2, word).err().map(|e| format!("{arguments:?}: {e}"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_settings_file_is_printed_read_and_refused_with_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    let printed = stillray(&["settings", "--set", "density=2.5"]);
    assert!(printed.status.success() && text(&printed.stdout).contains("density = 2.5\n"));
    file("a.toml", &text(&printed.stdout));
    let again = stillray_in(dir.path(), &["settings", "--settings", "a.toml"]);
    assert_eq!(text(&again.stdout), text(&printed.stdout));
    let written = stillray_in(dir.path(), &["settings", "--settings", "a.toml", "--out", "b.toml"]);
    assert!(written.status.success());
    assert_eq!(fs::read_to_string(dir.path().join("b.toml")).unwrap(), text(&printed.stdout));

    file("c.toml", "density = 1\ntolerence = 2\n");
    for word in ["c.toml", "'tolerance'"] {
        check_refusal(&stillray_in(dir.path(), &["render", "--settings", "c.toml"]), 2, word).unwrap();
    }
    check_refusal(&stillray_in(dir.path(), &["render", "--settings", "d.toml"]), 1, "d.toml").unwrap();
}

#[test]
fn samplers_are_measured_in_a_table_and_as_data() {
    let dir = tempfile::tempdir().unwrap();
    let words = "samplers --trials 20 --samples 1,16 --dimensions 3 --json s.json";
    let output = stillray_in(dir.path(), &words.split(' ').collect::<Vec<_>>());
    assert!(output.status.success(), "{}", text(&output.stderr));
    // Six strategies with two tilings each and two without, for two shapes.
    let table = text(&output.stdout);
    assert_eq!(table.lines().filter(|l| l.matches(" ± ").count() == 2).count(), 2 * (6 * 2 + 2), "{table}");
    let rows: serde_json::Value = serde_json::from_slice(&fs::read(dir.path().join("s.json")).unwrap()).unwrap();
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 2 * 2 * (6 * 2 + 2));
    assert!(rows.iter().all(|r| r["rmse"].as_f64().unwrap() > 0.0 && r["dimensions"] == 3));
    check_refusal(&stillray(&["samplers", "--dimensions", "17"]), 2, "--dimensions").unwrap();
    check_refusal(&stillray(&["samplers", "--json", "/nowhere at all/s.json"]), 1, "/nowhere at all").unwrap();
}

#[test]
fn the_check_of_refusals_can_fail() {
    let refused = stillray(&["render", "--spp", "0"]);
    assert!(check_refusal(&refused, 2, "--spp").is_ok());
    assert!(check_refusal(&refused, 1, "--spp").is_err());
    assert!(check_refusal(&refused, 2, "--density").is_err());
    assert!(check_refusal(&stillray(&["--version"]), 0, "stillray").is_err());
}

#[test]
fn a_missing_scene_fails_before_anything_is_made() {
    let dir = tempfile::tempdir().unwrap();
    for command in ["render", "bench"] {
        let output = stillray_in(dir.path(), &[command, "no such näme.gltf"]);
        check_refusal(&output, 1, "no such näme.gltf").unwrap();
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn a_machine_without_a_driver_is_told_what_to_install() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillray"));
    // The loader's two names, old and new, for the list of drivers.
    command.env("VK_ICD_FILENAMES", "/nonexistent").env("VK_DRIVER_FILES", "/nonexistent");
    let output = command.args(["render", "builtin:cornell", "--size", "8x8"]).output().unwrap();
    check_refusal(&output, 1, "mesa-vulkan-drivers").unwrap();
}

#[test]
fn a_scene_that_is_no_scene_fails() {
    let dir = tempfile::tempdir().unwrap();
    for (name, content) in [("a.gltf", &b"no JSON"[..]), ("b.glb", b"glTF\x02"), ("c.txt", b""), ("d.gltf", b"{}")] {
        fs::write(dir.path().join(name), content).unwrap();
        check_refusal(&stillray_in(dir.path(), &["render", name]), 1, name).unwrap();
    }
    check_refusal(&stillray_in(dir.path(), &["render", "."]), 1, ".").unwrap();
}

#[test]
fn a_target_that_cannot_be_written_fails_with_its_name() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("file"), "").unwrap();
    let scene = "builtin:cornell";
    for (option, target) in [("--out", "file/frames"), ("--json", "gone/a.json"), ("--preview", "gone/a.png")] {
        let output = stillray_in(dir.path(), &["render", scene, option, target]);
        check_refusal(&output, 1, target).unwrap();
    }
    check_refusal(&stillray_in(dir.path(), &["bench", scene, "--json", "."]), 1, ".").unwrap();
}

/// `stillray --help | true`: the reader is gone before the program writes.
#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_stillray"))
        .args(["render", "--help"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{:?} {}", output.status, text(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
}
