//! Damaged and hostile pictures, settings and searches end in an error or are used, never in a panic, and never take the machine's
//! memory or time: files that the program writes itself, mutated by the thousand, from fixed seeds. glTF is in `hostile_gltf.rs`.

#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

#[path = "support/mutation.rs"]
mod mutation;

use mutation::{Random, damage, number, pointers, remove, try_all, value};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use stillray::Result;
use stillray::report::folder::{self, Kind};
use stillray::scene::import;
use stillray::settings::{Method, Settings, file};
use stillray::trade::choose::{Limits, choose};
use stillray::trade::outcome;
use stillray::trade::store::{Search, Store};

/// A small picture with every kind of compression and blocks, by the library that others read.
fn pictures() -> Vec<Vec<u8>> {
    use exr::prelude::*;
    let color = |p: Vec2<usize>| (p.x() as f32 * 0.3, p.y() as f32, 1.5e4_f32);
    let encodings = [
        Encoding::UNCOMPRESSED,
        Encoding::FAST_LOSSLESS,
        Encoding::SMALL_LOSSLESS,
        Encoding { compression: Compression::PIZ, ..Encoding::UNCOMPRESSED },
        Encoding { compression: Compression::PXR24, ..Encoding::UNCOMPRESSED },
        Encoding { blocks: Blocks::Tiles(Vec2(4, 4)), ..Encoding::SMALL_LOSSLESS },
    ];
    let written = encodings.map(|encoding| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let channels = SpecificChannels::rgb(color);
        let layer = Layer::new((7, 5), LayerAttributes::named("light"), encoding, channels);
        Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    });
    written.to_vec()
}

/// A folder of each thread's own.
fn scratch(root: &Path) -> PathBuf {
    let folder = root.join(rayon::current_thread_index().map_or("main".to_owned(), |i| i.to_string()));
    fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn no_mutated_picture_makes_a_reader_panic() {
    let root = tempfile::tempdir().unwrap();
    let originals = pictures();
    for bytes in &originals {
        let path = root.path().join("whole.exr");
        fs::write(&path, bytes).unwrap();
        assert!(import::environment_map(&path, &mut Vec::new()).is_ok());
        assert!(folder::read(&path, Kind::Exr, 0.0).is_ok());
    }
    try_all("OpenEXR", 3000, |random| {
        let mut bytes = random.pick(&originals).clone();
        damage(&mut bytes, random);
        let path = scratch(root.path()).join("map.exr");
        fs::write(&path, &bytes).unwrap();
        let map = import::environment_map(&path, &mut Vec::new());
        if let Ok(map) = &map {
            assert!(map.is_whole() && map.texels.iter().flatten().all(|x| x.is_finite() && *x >= 0.0));
        }
        let frame = folder::read(&path, Kind::Exr, 0.0);
        map.is_ok() || frame.is_ok()
    });
    let mut png = std::io::Cursor::new(Vec::new());
    let rgb = image::RgbImage::from_fn(9, 6, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 7]));
    rgb.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let png = png.into_inner();
    try_all("PNG", 3000, |random| {
        let mut bytes = png.clone();
        // Checksums tell nearly all damage: some goes behind the end instead.
        if random.below(4) == 0 {
            bytes.extend((0..random.below(40)).map(|i| i as u8));
        } else {
            damage(&mut bytes, random);
        }
        let path = scratch(root.path()).join("frame.png");
        fs::write(&path, &bytes).unwrap();
        folder::read(&path, Kind::Png, 0.0).is_ok()
    });
}

#[test]
fn a_picture_that_claims_a_great_size_is_refused_before_anything_is_made_for_it() {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("frame.exr");
    let mut bytes = pictures()[0].clone();
    // xMax and yMax of the data window and of the display window.
    for name in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
        bytes[at + 8..at + 12].copy_from_slice(&60_000i32.to_le_bytes());
        bytes[at + 12..at + 16].copy_from_slice(&60_000i32.to_le_bytes());
    }
    fs::write(&path, &bytes).unwrap();
    for message in [
        folder::read(&path, Kind::Exr, 0.0).err().unwrap().to_string(),
        import::environment_map(&path, &mut Vec::new()).err().unwrap().to_string(),
    ] {
        assert!(message.contains("60001 x 60001"), "{message}");
    }
}

/// A text with something wrong in it, most likely.
fn mutate_text(text: &str, random: &mut Random) -> String {
    const WORDS: [&str; 16] = [
        "=", "nan", "-inf", "1e999", "[", "]]", "\"", "''", "density", "method", "true", "0x", "-0", "\u{feff}", "#",
        ".",
    ];
    match random.below(4) {
        0 => {
            let mut bytes = text.as_bytes().to_vec();
            damage(&mut bytes, random);
            String::from_utf8_lossy(&bytes).into_owned()
        }
        1 => {
            let mut lines: Vec<&str> = text.lines().collect();
            let (from, to) = (random.below(lines.len()), random.below(lines.len()));
            lines.swap(from, to);
            if random.below(2) == 0 {
                lines.remove(from);
            }
            lines.join("\n")
        }
        2 => {
            let at = random.below(text.len());
            let at = (at..text.len()).find(|i| text.is_char_boundary(*i)).unwrap_or(0);
            format!("{}{}{}", &text[..at], random.pick(&WORDS), &text[at..])
        }
        _ => {
            // A knob gets another value.
            let lines: Vec<&str> = text.lines().filter(|line| line.contains(" = ")).collect();
            let name = random.pick(&lines).split(" = ").next().unwrap();
            format!("{name} = {}", number(random))
        }
    }
}

#[test]
fn no_mutated_settings_make_the_parser_panic() {
    const METHODS: [Method; 6] =
        [Method::Stable, Method::Supersample, Method::Taa, Method::StableTi, Method::Reference, Method::PointTracking];
    let texts = METHODS.map(|method| file::text(&Settings::of(method)));
    for text in &texts {
        assert_eq!(file::parse(text, &mut Settings::default()), Ok(()), "{text}");
    }
    try_all("settings", 20_000, |random| {
        let text = random.pick(&texts);
        let mutated = mutate_text(text, random);
        let mut settings = Settings::default();
        // What is refused changes nothing; what is taken can be written and read again.
        match file::parse(&mutated, &mut settings) {
            Err(message) => {
                assert!(!message.is_empty() && settings == Settings::default(), "{mutated}");
                false
            }
            Ok(()) => {
                let mut again = Settings::default();
                file::parse(&file::text(&settings), &mut again).unwrap();
                assert_eq!(again, settings, "{mutated}");
                true
            }
        }
    });
}

/// A search that has come to its end, with made-up measurements.
fn searched(folder: &Path) -> Vec<PathBuf> {
    let search: Search = serde_json::from_value(serde_json::json!({
        "schema": 1, "scene": "builtin:cornell", "fingerprint": "f", "camera": "main", "motions": ["pan", "orbit"], "device": "d",
        "driver": "v", "shaders": "s", "size": [32, 32], "fps": 30.0, "frames": 8, "seed": 0, "reference_spp": 64, "candidates": 4,
        "brackets": 1, "held": BTreeMap::from([("shadow.rays", "0")]),
        "traits": { "lights": 1, "textures": false, "distributed": false, "transmits": false, "medium": false },
    }))
    .unwrap();
    let store = Store::open(folder, &search).unwrap();
    let candidates = outcome::candidates(&search, &outcome::space(&search).unwrap());
    let estimate = |mean: f64| serde_json::json!({ "mean": mean, "half_width": 0.001 });
    for (i, candidate) in candidates.iter().enumerate() {
        let x = 0.1 + 0.05 * i as f64;
        for (rung, motion) in (0..3).flat_map(|rung| ["pan", "orbit"].map(|motion| (rung, motion))) {
            let run = serde_json::json!({
                "candidate": candidate.id, "rung": rung, "motion": motion, "size": [32, 32], "frames": 8,
                "quality": {
                    "flip": estimate(x), "relative_mse": estimate(x), "rmse": x, "flicker_error": estimate(0.1 * x),
                    "excess_flicker": 0.05 * x, "cpbd": 0.9, "cpbd_reference": 0.8, "energy_ratio": 1.0,
                },
                "rays": 1024.0, "shadow_rays": 512.0, "reused_fraction": 0.9, "reprojected": [0.2, 0.6, 0.2, 0.0, 0.0],
                "memory_bytes": 4096, "ms_alone": 1.5,
            });
            store.put_run(&serde_json::from_value(run).unwrap()).unwrap();
        }
    }
    for round in 0..2 {
        let entries = candidates
            .iter()
            .map(|c| serde_json::json!({ "candidate": c.id, "ms": 2.0, "phases": [{ "label": "verify", "ms": 1.0 }] }));
        let entries: Vec<Value> = entries.collect();
        let round = serde_json::json!({ "shard": "1of1", "round": round, "motion": "pan", "entries": entries });
        store.put_round(&serde_json::from_value(round).unwrap()).unwrap();
    }
    files_of(folder)
}

/// What `trade` does with a folder at its end.
fn conclude(folder: &Path) -> Result<()> {
    let (store, search) = Store::existing(folder)?;
    let found = outcome::collect(&store, &search, &outcome::space(&search)?)?;
    for limits in [
        Limits { budget_ms: Some(5.0), ..Limits::default() },
        Limits { max_flicker: Some(0.02), max_error: Some(0.2), ..Limits::default() },
    ] {
        match choose(&found, &limits) {
            Ok(choice) => assert!(!choice.candidate.is_empty()),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    stillray::report::trade::write_csv(folder, &found)?;
    assert!(!stillray::report::trade::table(&found).to_string().is_empty());
    Ok(())
}

#[test]
fn no_mutated_search_makes_trade_panic() {
    let root = tempfile::tempdir().unwrap();
    let whole = root.path().join("whole");
    searched(&whole);
    conclude(&whole).unwrap();
    try_all("searches", 1500, |random| {
        let folder = scratch(root.path()).join("search");
        let files = if folder.exists() { files_of(&folder) } else { searched(&folder) };
        // The search itself as often as one of its measurements.
        let path = if random.below(2) == 0 { &files[0] } else { random.pick(&files) };
        let bytes = fs::read(path).unwrap();
        let mut mutated = bytes.clone();
        if random.below(4) == 0 {
            damage(&mut mutated, random);
        } else {
            let mut json: Value = serde_json::from_slice(&bytes).unwrap();
            let (mut numbers, mut others) = (Vec::new(), Vec::new());
            pointers(&json, "", &mut numbers, &mut others);
            match random.below(6) {
                0 => remove(&mut json, random.pick::<String>(&others)),
                1 => *json.pointer_mut(random.pick::<String>(&others)).unwrap() = value(random),
                _ => *json.pointer_mut(random.pick::<String>(&numbers)).unwrap() = number(random),
            }
            mutated = serde_json::to_vec(&json).unwrap();
        }
        fs::write(path, &mutated).unwrap();
        let result = std::panic::catch_unwind(|| conclude(&folder));
        fs::write(path, &bytes).unwrap();
        match result {
            Ok(result) => result.is_ok(),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    });
}

#[test]
fn a_search_with_counts_that_none_has_is_refused() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("search");
    let path = searched(&folder).remove(0);
    let whole = fs::read(&path).unwrap();
    for (pointer, wrong, word) in [
        ("/candidates", u64::MAX, "from 1 to 100000"),
        ("/candidates", 0, "'candidates'"),
        ("/brackets", 1001, "from 1 to 1000"),
        ("/frames", 3, "from 4 to 10000"),
        ("/size/1", 16_385, "from 1 to 16384"),
        ("/fps", 0, "'fps'"),
    ] {
        let mut json: Value = serde_json::from_slice(&whole).unwrap();
        *json.pointer_mut(pointer).unwrap() = wrong.into();
        fs::write(&path, serde_json::to_vec(&json).unwrap()).unwrap();
        let message = conclude(&folder).err().unwrap().to_string();
        assert!(message.contains(word) && message.contains("search.json"), "{message}");
    }
    fs::write(&path, &whole).unwrap();
    conclude(&folder).unwrap();
}

/// The files of a search, its own first.
fn files_of(folder: &Path) -> Vec<PathBuf> {
    let mut files = vec![folder.join("search.json")];
    for part in ["runs/0", "runs/1", "runs/2", "timing"] {
        let Ok(entries) = fs::read_dir(folder.join(part)) else { continue };
        let mut found: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        found.sort();
        files.extend(found);
    }
    files
}
