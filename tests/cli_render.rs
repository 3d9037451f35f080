//! What the program leaves behind: whole pictures, true reports, and nothing else, interrupted or not.

#![allow(clippy::unwrap_used, reason = "a panic in a test's helper is a failing test")]

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use stillray::report::openexr::{Channel, Exr};

fn command(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillray"));
    command.current_dir(folder).args(arguments.split(' '));
    command
}

fn run(folder: &Path, arguments: &str) -> Output {
    let output = command(folder, arguments).output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments}: {:?}\n{err}", output.status);
    output
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Mean of all bytes of a PNG file: 0 for a black picture.
fn brightness(path: &Path) -> f64 {
    let rgb = image::open(path).unwrap().to_rgb8().into_raw();
    rgb.iter().map(|&b| f64::from(b)).sum::<f64>() / rgb.len() as f64
}

#[test]
fn frames_layers_preview_and_report() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("ä frames");
    fs::create_dir(&out).unwrap();
    let output = run(
        &out,
        "render builtin:cornell --size 48x32 --frames 3 --motion pan --fps 25 --out . --format exr,png \
         --aov changes,age,depth,motion,density --density 2 --preview p.png --json r.json",
    );
    let exrs_and_pngs = "frame_0000.exr frame_0000.png frame_0001.exr frame_0001.png frame_0002.exr frame_0002.png";
    assert_eq!(names(&out).join(" "), format!("{exrs_and_pngs} p.png r.json"));
    assert!(String::from_utf8_lossy(&output.stdout).starts_with("3 frames of 48x32 in ."));

    let exr = Exr::read(&out.join("frame_0002.exr")).unwrap();
    assert_eq!(([exr.width, exr.height], exr.fps), ([48, 32], Some(25.0)));
    for name in
        "R G B depth.Z motion.X motion.Y density.R density.G density.B age.V changes.R changes.G changes.B changes.A"
            .split(' ')
    {
        let data = exr.channel(name).unwrap_or_else(|| panic!("no {name}"));
        assert!(name == "depth.Z" || data.iter().all(|v| v.is_finite()), "{name}");
    }
    // The camera stands inside the box: everything is in front of it, and nothing has lived more than three frames.
    assert!(exr.channel("depth.Z").unwrap().iter().all(|&z| z > 0.0));
    assert!(exr.channel("age.V").unwrap().iter().all(|&a| (0.0..=3.0).contains(&a)));
    assert!(brightness(&out.join("frame_0000.png")) > 10.0);

    let report = json(&out.join("r.json"));
    assert_eq!((&report["schema"], &report["totals"]["complete"]), (&1.into(), &true.into()));
    assert_eq!(report["settings"]["motion"], "pan");
    let frames = report["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 3);
    assert_eq!(frames[0]["reused_fraction"], 0.0);
    for frame in &frames[1..] {
        let share = |v: &Value| v.as_f64().unwrap();
        assert!((0.1..=1.0).contains(&share(&frame["reused_fraction"])), "{frame}");
        let sum: f64 = frame["reprojected"].as_array().unwrap().iter().map(share).sum();
        // Five shares, each rounded to within an ulp of 1.
        assert!((sum - 1.0).abs() <= 5.0 * f64::EPSILON, "{sum}");
        assert!(!frame["phases"].as_array().unwrap().is_empty() && share(&frame["ms"]) > 0.0);
    }
}

#[test]
fn two_runs_give_the_same_files_and_another_seed_does_not() {
    let dir = tempfile::tempdir().unwrap();
    let frames = |name: &str, seed: u32| {
        let arguments = "render builtin:cornell --size 40x30 --frames 3 --motion rotate --quiet --format exr,png";
        let output = run(dir.path(), &format!("{arguments} --out {name} --seed {seed}"));
        assert!(output.stdout.is_empty() && output.stderr.is_empty(), "--quiet is not quiet");
        let out = dir.path().join(name);
        names(&out).iter().map(|n| fs::read(out.join(n)).unwrap()).collect::<Vec<_>>()
    };
    let first = frames("a", 1);
    assert_eq!(first.len(), 6);
    assert!(first == frames("b", 1), "two runs differ");
    assert!(first != frames("c", 2), "the seed does nothing");
}

#[test]
fn settings_from_a_file_an_option_and_an_assignment_are_the_same_settings() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("s.toml"), "density = 3\ntolerance = 0.5\n").unwrap();
    let rendered = |options: &str| {
        run(
            dir.path(),
            &format!(
                "render builtin:cornell --size 32x32 --frames 2 --motion pan --quiet --out o {options} --json r.json"
            ),
        );
        let report = json(&dir.path().join("r.json"));
        (fs::read(dir.path().join("o/frame_0001.png")).unwrap(), report["settings"].clone())
    };
    let by_file = rendered("--settings s.toml");
    assert_eq!((by_file.1["density"].as_f64(), by_file.1["tolerance"].as_f64()), (Some(3.0), Some(0.5)));
    assert!(by_file == rendered("--density 3 --tolerance 0.5"));
    assert!(by_file == rendered("--set density=3 --set tolerance=0.5"));
    assert!(by_file == rendered("--settings s.toml --density 2 --set density=3"), "what is said last counts");
    // Negative control.
    assert!(by_file.0 != rendered("--density 3 --tolerance 2").0);
    assert_eq!(rendered("--set method=reference --set spp=2 --passes 2").1["spp"], 2);
}

#[test]
fn every_method_renders_the_same_light() {
    let dir = tempfile::tempdir().unwrap();
    let mean = |options: &str| {
        let out = tempfile::tempdir_in(dir.path()).unwrap();
        let target = out.path().display();
        run(dir.path(), &format!("render builtin:cornell --size 32x32 --format exr --quiet --out {target} {options}"));
        let exr = Exr::read(&out.path().join(names(out.path()).pop().unwrap())).unwrap();
        let green = exr.channel("G").unwrap();
        f64::from(green.iter().sum::<f32>()) / green.len() as f64
    };
    let reference = mean("--method reference --passes 8");
    assert!(reference > 0.01, "{reference}");
    for options in [
        "--method stable --density 4",
        "--method stable+ti --density 4 --frames 4",
        "--method supersample --spp 4",
        "--method supersample --spp 4 --jitter",
        "--method taa --spp 4 --frames 4",
    ] {
        let ratio = mean(options) / reference;
        // A wrong camera, exposure or filter shows at once; how exact the mean is, other tests tell.
        assert!((0.9..1.1).contains(&ratio), "{options}: {ratio}");
    }
}

#[test]
fn bench_prints_and_writes_what_it_promises() {
    let dir = tempfile::tempdir().unwrap();
    let output = run(
        dir.path(),
        "bench builtin:cornell --size 48x32 --frames 2 --warmup 1 --methods stable:1,supersample:1,supersample:2,taa:1,stable+ti:2 \
         --json b.json",
    );
    let text = String::from_utf8(output.stdout).unwrap();
    for word in ["reproject", "reconstruct", "temporal", "total", "supersample:2", "x supersample at equal camera rays"]
    {
        assert!(text.contains(word), "no {word} in\n{text}");
    }
    let report = json(&dir.path().join("b.json"));
    assert_eq!((&report["schema"], &report["size"]), (&1.into(), &serde_json::json!([48, 32])));
    assert!(report["device"]["name"].is_string() && report["build"]["version"].is_string());
    let methods = report["methods"].as_array().unwrap();
    assert_eq!(
        methods.iter().map(|m| m["name"].as_str().unwrap()).collect::<Vec<_>>(),
        ["stable:1", "supersample:1", "supersample:2", "taa:1", "stable+ti:2"]
    );
    let phases = |i: usize| -> Vec<&str> {
        methods[i]["phases"].as_array().unwrap().iter().map(|p| p["label"].as_str().unwrap()).collect()
    };
    for (i, integrated) in [false, false, false, true, true].into_iter().enumerate() {
        assert_eq!(phases(i).contains(&"temporal"), integrated, "{:?}", phases(i));
        assert_eq!(phases(i).contains(&"resolve"), !integrated, "{:?}", phases(i));
    }
    assert_eq!(methods[3]["kind"], "taa");
    assert_eq!((&methods[4]["kind"], &methods[4]["knobs"]["history.alpha"]), (&"stable+ti".into(), &0.25.into()));
    for method in methods {
        let ms = &method["phases"][0]["ms"];
        assert!(ms["min"].as_f64() <= ms["median"].as_f64() && ms["median"].as_f64() <= ms["p95"].as_f64());
        assert!(method["total_ms"]["median"].as_f64().unwrap() > 0.0);
        assert!(method["memory_bytes"].as_u64().unwrap() > 0);
    }
    assert_eq!(methods[2]["rays_per_frame"], f64::from(2 * 48 * 32));
    assert_eq!(methods[2]["samples_per_pixel"], 2.0);
    assert_eq!(methods[2]["reused_fraction"], 0.0);
    assert!(methods[0]["reused_fraction"].as_f64().unwrap() > 0.1);
}

#[test]
fn info_tells_of_devices_scene_and_memory() {
    let dir = tempfile::tempdir().unwrap();
    let text = String::from_utf8(run(dir.path(), "info").stdout).unwrap();
    assert!(text.contains("yes") && text.contains("builtin:hairball"), "{text}");
    let text = String::from_utf8(run(dir.path(), "info builtin:cornell --size 100x50").stdout).unwrap();
    for word in ["triangles", "lights", "cameras", "memory at 100x50", "bytes/pixel", "total"] {
        assert!(text.contains(word), "no {word} in\n{text}");
    }
    assert!(names(dir.path()).is_empty());
}

#[test]
fn info_tells_what_is_modelled_and_what_is_left_out() {
    let dir = tempfile::tempdir().unwrap();
    let line = |arguments: &str, part: &str| {
        let text = String::from_utf8(run(dir.path(), arguments).stdout).unwrap();
        let lines: Vec<String> = text.lines().filter(|l| l.contains(part)).map(str::to_owned).collect();
        lines.first().cloned().unwrap_or_else(|| panic!("no {part} in\n{text}"))
    };
    let soft = "info builtin:penumbra --size 40x30";
    assert!(line(soft, "area lights").contains("light 'lamp'"));
    assert!(line(soft, "lights with an extent").contains("light 'lamp'"));
    assert!(line(soft, "an aperture").contains("left out"));
    assert!(line("info builtin:penumbra?light=0 --size 40x30", "lights with an extent").contains("left out"));
    assert!(line("info builtin:cornell --size 40x30 --model all", "an aperture").contains("model = all"));
    // What it costs in memory is told as well.
    assert!(line(soft, "sample seeds").contains('B'));
}

#[test]
fn a_lens_is_asked_for_on_the_command_line() {
    let dir = tempfile::tempdir().unwrap();
    let render = |name: &str, more: &str| {
        run(dir.path(), format!("render builtin:cornell --size 48x32 --out {name} --quiet {more}").trim_end());
        std::fs::read(dir.path().join(name).join("frame_0000.png")).unwrap()
    };
    let sharp = render("a", "");
    assert!(sharp == render("b", "--aperture 0"));
    assert!(sharp != render("c", "--aperture 1 --focus 4"));
    assert!(render("d", "--aperture 1 --focus 4 --blades 3") != render("e", "--aperture 1 --focus 4"));
    // In a placed camera too.
    let placed = "--camera 0,2.7,10:0,2.7,0";
    assert!(render("f", placed) != render("g", &format!("{placed} --aperture 1 --focus 4")));
}

#[test]
fn a_shutter_is_asked_for_on_the_command_line() {
    let dir = tempfile::tempdir().unwrap();
    let render = |name: &str, more: &str| {
        let command = format!("render builtin:billiards?rings=6 --size 48x32 --fps 10 --frames 2 --out {name} --quiet");
        run(dir.path(), format!("{command} {more}").trim_end());
        [0, 1].map(|i| std::fs::read(dir.path().join(name).join(format!("frame_000{i}.png"))).unwrap())
    };
    let [of_scene, half, whole, none] =
        [("a", ""), ("b", "--shutter 0.5"), ("c", "--shutter 1"), ("d", "--shutter 0")].map(|(n, m)| render(n, m));
    assert!(of_scene == whole, "the scene's camera has this one");
    // Before the first frame there is none from which anything moves.
    assert!(whole[0] == none[0] && whole[1] != none[1] && whole[1] != half[1]);
    let placed = "--camera 0,1,1:0,0,0";
    assert!(render("e", placed)[1] != render("f", &format!("{placed} --shutter 1"))[1]);
}

#[test]
fn light_from_all_around_is_asked_for_on_the_command_line() {
    let dir = tempfile::tempdir().unwrap();
    let data: Vec<f32> = (0..32).map(|i| if i % 8 < 4 { 1.0 } else { 0.1 }).collect();
    let channel = |name: &str| Channel { name: name.to_owned(), half: true, data: data.clone() };
    let channels = ["B", "G", "R"].map(channel).to_vec();
    Exr { width: 8, height: 4, fps: None, channels }.write(&dir.path().join("sky.exr")).unwrap();
    let render = |name: &str, more: &str| {
        run(dir.path(), &format!("render builtin:spheres?beads=0 --size 48x32 --out {name} --quiet {more}"));
        std::fs::read(dir.path().join(name).join("frame_0000.png")).unwrap()
    };
    let mapped = render("a", "--environment sky.exr");
    assert!(mapped != render("b", "--environment sky.exr --environment-turn 90"));
    assert!(mapped == render("c", "--environment sky.exr --environment-turn 360"));
    assert!(mapped != render("d", "--environment sky.exr --environment-scale 2"));
    let day = render("e", "--sky 3");
    assert!(day == render("f", "--sky 3 --sun 130,35") && day != render("g", "--sky 3 --sun=-60,10"));
    assert!(day != render("h", "--sky 3 --environment-scale 0.5") && day != render("i", "--sky 8"));
    let info = run(dir.path(), "info builtin:skylight --size 40x30").stdout;
    let info = String::from_utf8_lossy(&info);
    assert!(info.contains("sky of turbidity 3") && info.contains("a map of light from all around"), "{info}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_whole_frames_only() {
    let dir = tempfile::tempdir().unwrap();
    let arguments = "render builtin:cornell --size 64x64 --frames 100000 --motion pan --out o --format exr,png \
                     --preview o/preview.png --json o/r.json";
    let mut child = command(dir.path(), arguments).stderr(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let started = Instant::now();
    while !dir.path().join("o/frame_0003.png").exists() {
        assert!(started.elapsed() < Duration::from_secs(120), "no frame after two minutes");
        std::thread::sleep(Duration::from_millis(5));
    }
    // The shell's own kill: small systems have no other.
    let interrupt = format!("kill -s INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &interrupt]).status().unwrap().success());
    let status = child.wait().unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(status.code(), Some(130), "{said}");

    let out = dir.path().join("o");
    let names = names(&out);
    let pngs: Vec<&String> = names.iter().filter(|n| n.starts_with("frame_") && n.ends_with(".png")).collect();
    assert!(said.lines().last().unwrap().contains(&format!("{} whole frames", pngs.len())), "{said}");
    assert_eq!(names.len(), 2 * pngs.len() + 2, "{names:?}");
    pngs.iter().for_each(|n| assert!(brightness(&out.join(n)) > 1.0));
    names.iter().filter(|n| n.ends_with(".exr")).for_each(|n| drop(Exr::read(&out.join(n)).unwrap()));
    assert!(brightness(&out.join("preview.png")) > 1.0);
    let report = json(&out.join("r.json"));
    assert_eq!(report["totals"]["complete"], false);
    assert_eq!(report["frames"].as_array().unwrap().len(), pngs.len());
}
