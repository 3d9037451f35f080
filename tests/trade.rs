//! A search for good trades ends with a front, loses nothing when it is killed, and is the same whole or in shards.

#![allow(clippy::unwrap_used, reason = "a panic in a test's helper is a failing test")]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use serde_json::Value;

const SEARCH: &str = "trade builtin:cornell --size 32x32 --candidates 10 --brackets 2 --frames 4 --reference-spp 16 \
                      --motions rotate,pan --quiet";

fn command(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stillray"));
    command.current_dir(folder).args(arguments.split_whitespace());
    command
}

fn run(folder: &Path, arguments: &str) -> Output {
    let output = command(folder, arguments).output().unwrap();
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

fn refused(folder: &Path, arguments: &str, code: i32, word: &str) {
    let output = command(folder, arguments).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments}: {message}");
    assert!(message.contains(word) && message.lines().count() == 1, "{arguments}: {message}");
}

fn trade(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("trade.json")).unwrap()).unwrap()
}

/// What was found, without what was read from a clock: every run, how far every candidate came, and the knobs of those that
/// came to the end, by name.
fn counted(folder: &Path) -> Value {
    let mut found = trade(folder);
    let mut runs = found["runs"].take();
    for run in runs.as_array_mut().unwrap() {
        run.as_object_mut().unwrap().remove("ms_alone").unwrap();
    }
    let by_name = |list: &Value| {
        let mut list = list.as_array().unwrap().clone();
        list.sort_by_key(|v| v["candidate"].as_str().unwrap().to_owned());
        list
    };
    let entries: Vec<Value> = by_name(&found["entries"]).iter().map(|e| e["knobs"].clone()).collect();
    serde_json::json!({ "runs": runs, "fates": by_name(&found["fates"]), "entries": entries })
}

/// Every file of a folder and when it was written.
fn written(folder: &Path) -> Vec<(String, SystemTime)> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().map(Result::unwrap) {
        if entry.path().is_dir() {
            all.extend(written(&entry.path()));
        } else if !entry.file_name().to_string_lossy().starts_with('.') {
            all.push((entry.path().display().to_string(), entry.metadata().unwrap().modified().unwrap()));
        }
    }
    all
}

/// Starts the search and kills it without warning once so many runs are there.
fn kill_after(folder: &Path, out: &str, runs: usize) {
    let mut child = command(folder, &format!("{SEARCH} --out {out}")).stderr(Stdio::null()).spawn().unwrap();
    let started = Instant::now();
    while written(&folder.join(out).join("runs")).len() < runs {
        assert!(started.elapsed() < Duration::from_secs(300), "no runs");
        assert!(child.try_wait().unwrap().is_none(), "the search ended before it was killed");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn whole_killed_and_in_shards_it_finds_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    run(dir.path(), &format!("{SEARCH} --out whole"));
    let whole = counted(&at("whole"));
    check_report(&at("whole"), &whole);

    kill_after(dir.path(), "killed", 4);
    let before = written(&at("killed"));
    assert!(!at("killed/trade.json").exists());
    run(dir.path(), &format!("{SEARCH} --out killed"));
    let after = written(&at("killed"));
    assert!(before.iter().all(|file| after.contains(file)), "what was measured is not measured again");
    assert_eq!(counted(&at("killed")), whole);

    for shard in [1, 2] {
        run(dir.path(), &format!("{SEARCH} --shard {shard}/2 --out part{shard}"));
    }
    assert!(!at("part1/trade.json").exists());
    run(dir.path(), "trade merge part1 part2 --out merged --quiet");
    assert_eq!(counted(&at("merged")), whole);
    refused(dir.path(), "trade merge part1 --out half --quiet", 1, "join all its shards");
    // Negative control of the comparison: another seed finds other numbers.
    run(dir.path(), &format!("{SEARCH} --seed 1 --out other"));
    assert_ne!(counted(&at("other")), whole);
    refused(dir.path(), "trade merge part1 other --out mixed --quiet", 1, "another search");
    refused(dir.path(), &format!("{SEARCH} --seed 1 --out whole"), 1, "seed is 0 there and 1 here");
    check_pick(dir.path());
}

fn check_report(folder: &Path, whole: &Value) {
    assert_eq!(whole["fates"].as_array().unwrap().len(), 10);
    let found = trade(folder);
    let entries = found["entries"].as_array().unwrap();
    // The methods' defaults are never given up.
    assert!(entries.iter().filter(|e| e["origin"] == "default").count() >= 5, "{entries:?}");
    assert!(entries.iter().any(|e| e["on_front"] == true));
    for entry in entries {
        let number = |name: &str| entry[name].as_f64().unwrap();
        assert!(entry["timing"]["ms"].as_f64().unwrap() > 0.0 && number("rays") > 0.0 && number("energy_ratio") > 0.0);
        assert!(entry["flip"]["mean"].as_f64().unwrap() > 0.0);
    }
    let rows = fs::read_to_string(folder.join("trade.csv")).unwrap().lines().count();
    assert_eq!(rows, entries.len() + 1);
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && !page.contains("/*DATA*/"));
    let addresses = page.matches("http").count() - page.matches("http://www.w3.org/2000/svg").count();
    assert_eq!(addresses, 0, "the page needs no network");
}

/// Picks under limits from the whole search, and renders with what was picked.
fn check_pick(folder: &Path) {
    run(folder, "trade pick whole --budget-ms 100000 --pick best.toml --quiet");
    let text = fs::read_to_string(folder.join("best.toml")).unwrap();
    assert!(text.contains("method = "), "{text}");
    run(folder, "render builtin:cornell --size 32x32 --settings best.toml --out frames --quiet");
    check_promises(folder);
    refused(folder, "trade pick whole --max-error 0.000001", 2, "nearest is");
    refused(folder, "trade pick whole", 2, "--budget-ms");
    refused(folder, "trade pick nowhere --budget-ms 1", 1, "search.json");
    fs::write(folder.join("whole/search.json"), "{").unwrap();
    refused(folder, "trade pick whole --budget-ms 1", 1, "search.json");
}

/// What was picked is tried under a motion that the search has not seen; that it says how often limits were kept, and fails if
/// that is too seldom. How often that is, is measured on a search of a real size: see the README.
fn check_promises(folder: &Path) {
    refused(folder, "trade check whole --motions pan", 2, "has not seen");
    refused(folder, "trade check nowhere", 1, "search.json");
    let output = command(folder, "trade check whole --motions orbit --limits 3 --json trials.json").output().unwrap();
    let trials: Value = serde_json::from_slice(&fs::read(folder.join("trials.json")).unwrap()).unwrap();
    let trials = trials.as_array().unwrap();
    let number = |t: &Value, name: &str| t[name].as_f64().unwrap();
    for axis in ["ms", "flicker", "flip"] {
        assert_eq!(trials.iter().filter(|t| t["axis"] == axis).count(), 3, "{trials:?}");
    }
    for t in trials {
        assert!(number(t, "value") > 0.0 && number(t, "limit") > 0.0 && t["motion"] == "orbit", "{t}");
        assert_eq!(t["kept"] == true, number(t, "value") <= number(t, "limit"), "{t}");
    }
    let kept = trials.iter().filter(|t| t["kept"] == true).count();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains(&format!("all: {kept} of 9 limits kept")), "{text}");
    assert_eq!(output.status.code(), Some(i32::from(10 * kept < 9 * 9)), "{text}");
}

#[test]
fn wrong_words_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    for (arguments, word) in [
        ("trade builtin:cornell --shard 3/2", "--shard"),
        ("trade builtin:cornell --shard 1/9 --brackets 2", "--brackets"),
        ("trade builtin:cornell --motions pan,pan", "twice"),
        ("trade builtin:cornell --motions wobble", "--motions"),
        ("trade builtin:cornell --hold densty=1", "'density'"),
        ("trade builtin:cornell --hold density=99", "from 0.0625 to 16"),
        ("trade builtin:cornell --frames 3", "--frames"),
        ("trade builtin:cornell --budget-ms 0", "--budget-ms"),
        ("trade check --motions pan,pan", "twice"),
        ("trade merge", "DIR"),
    ] {
        refused(dir.path(), arguments, 2, word);
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "nothing is left behind");
}

#[test]
fn methods_are_measured_beside_the_papers() {
    let dir = tempfile::tempdir().unwrap();
    let small = "reproduce --size 64x64 --frames 4 --reference-spp 16 --motions pan --quiet --out r";
    run(
        dir.path(),
        &format!("{small} --scenes builtin:cornell,builtin:terrain --methods stable:2,supersample:2,point-tracking"),
    );
    let text = fs::read_to_string(dir.path().join("r/reproduce.md")).unwrap();
    let row = |begin: &str| text.lines().find(|l| l.starts_with(begin)).unwrap_or_default().to_owned();
    assert!(row("| stable:2 |").matches('|').count() == 9, "{text}");
    assert!(row("| flicker error of stable:2 to supersample:2 |").ends_with(" of 2 |"), "{text}");
    assert!(row("| builtin:terrain, pan |").contains(" % |"), "{text}");
    assert!(!row("| taa:4 | 0.6610 |").contains('–'), "{text}");
    let scores: Value = serde_json::from_slice(&fs::read(dir.path().join("r/reproduce.json")).unwrap()).unwrap();
    assert_eq!(scores.as_array().unwrap().len(), 6);
    // Every picture that is shown is there: figure 6 has four, figure 8 fourteen in each of three scenes, figure 10 three;
    // and paper 2's figure 16 two for each of eight strategies, its figures 17 to 20 one each.
    let shown: BTreeSet<&str> = text.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    assert_eq!(shown.len(), 4 + 3 * 14 + 3 + 2 * 8 + 4, "{shown:?}");
    assert!(shown.iter().all(|file| dir.path().join("r").join(file).is_file()), "{shown:?}");
    assert!(row("| 4 | here |").matches('|').count() == 8, "{text}");
    refused(dir.path(), "reproduce --methods magic:1", 2, "--methods");
    refused(dir.path(), "reproduce --scenes builtin:teapot", 2, "teapot");
}
