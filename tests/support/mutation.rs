//! Mutations of files, from seeds: bytes, and the values of JSON.
#![allow(dead_code)] // each test binary uses a part of it

use rayon::prelude::*;
use serde_json::{Value, json};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// The seeds to try: so many, from 0 on, unless `STILLRAY_MUTATIONS` and `STILLRAY_MUTATIONS_FROM` say otherwise.
pub fn mutations(usual: usize) -> std::ops::Range<u64> {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let first = number("STILLRAY_MUTATIONS_FROM").unwrap_or(0);
    first..first + number("STILLRAY_MUTATIONS").unwrap_or(usual as u64)
}

/// SplitMix64 (Steele et al. 2014): any seed is a good one.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    pub fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }
}

/// Flips bits, overwrites runs, cuts off, or cuts out.
pub fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    match random.below(5) {
        0 => bytes.truncate(random.below(bytes.len())),
        1 => {
            let from = random.below(bytes.len());
            let to = (from + random.below(64)).min(bytes.len());
            bytes.drain(from..to);
        }
        2 => {
            let (from, value) = (random.below(bytes.len()), *random.pick(&[0, 0xff, 0x7f, b'9', b'[']));
            bytes.iter_mut().skip(from).take(1 + random.below(16)).for_each(|byte| *byte = value);
        }
        _ => {
            for _ in 0..1 + random.below(8) {
                let at = random.below(bytes.len());
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << random.below(8);
                }
            }
        }
    }
}

/// Numbers that indices, counts, sizes and factors should not be.
pub fn number(random: &mut Random) -> Value {
    let choices = [
        json!(0),
        json!(1),
        json!(-1),
        json!(2),
        json!(3),
        json!(4),
        json!(7),
        json!(127),
        json!(255),
        json!(65535),
        json!(5121),
        json!(5125),
        json!(5126),
        json!(i32::MAX),
        json!(u32::MAX),
        json!(1u64 << 32),
        json!(i64::MAX),
        json!(u64::MAX),
        json!(u64::MAX - 3),
        json!(i64::MIN),
        json!(0.5),
        json!(-0.0),
        json!(1e-40),
        json!(3e38),
        json!(-3e38),
        json!(1e39),
        json!(1e300),
        json!(100_000_000),
        json!(1 << 22),
    ];
    if random.below(3) == 0 { json!(random.below(40)) } else { random.pick(&choices).clone() }
}

pub fn value(random: &mut Random) -> Value {
    match random.below(8) {
        0 => json!(null),
        1 => json!(random.pick(&[
            "",
            "SCALAR",
            "VEC4",
            "MAT4",
            "STEP",
            "CUBICSPLINE",
            "BLEND",
            "../../x",
            "data:,",
            "a%zz"
        ])),
        2 => json!([]),
        3 => json!({}),
        4 => json!([0, 1, 2, 3]),
        _ => number(random),
    }
}

/// Pointers to all values of a tree, the numbers among them first.
pub fn pointers(tree: &Value, here: &str, numbers: &mut Vec<String>, others: &mut Vec<String>) {
    let mut visit = |key: &str, child: &Value| {
        let there = format!("{here}/{}", key.replace('~', "~0").replace('/', "~1"));
        if child.is_number() { &mut *numbers } else { &mut *others }.push(there.clone());
        pointers(child, &there, numbers, others);
    };
    match tree {
        Value::Object(map) => map.iter().for_each(|(key, child)| visit(key, child)),
        Value::Array(array) => array.iter().enumerate().for_each(|(i, child)| visit(&i.to_string(), child)),
        _ => {}
    }
}

pub fn remove(tree: &mut Value, pointer: &str) {
    let Some((parent, key)) = pointer.rsplit_once('/') else { return };
    match tree.pointer_mut(parent) {
        Some(Value::Object(map)) => drop(map.remove(&key.replace("~1", "/").replace("~0", "~"))),
        Some(Value::Array(array)) => drop(array.remove(key.parse().unwrap())),
        _ => {}
    }
}

/// The most memory the process has had, where the system says.
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? << 10)
}

/// Tries inputs of a kind, one a seed; `run` tells whether its input is accepted. Prints how many were tried, and how long the slowest took.
///
/// # Panics
/// If an input makes `run` panic or is not done with in time, and if nearly all are accepted or nearly all refused: mutations are too tame
/// or too wild then to show anything.
pub fn try_all(kind: &str, usual: usize, run: impl Fn(&mut Random) -> bool + Sync) {
    let accepted = AtomicUsize::new(0);
    let seeds = mutations(usual);
    let count = (seeds.end - seeds.start) as usize;
    let outcomes: Vec<(u64, Duration, bool)> = seeds
        .into_par_iter()
        .map(|seed| {
            let start = Instant::now();
            let result = catch_unwind(AssertUnwindSafe(|| run(&mut Random(seed))));
            accepted.fetch_add(usize::from(matches!(result, Ok(true))), Ordering::Relaxed);
            (seed, start.elapsed(), result.is_err())
        })
        .collect();
    let accepted = accepted.into_inner();
    let slowest = outcomes.iter().max_by_key(|(_, time, _)| *time).unwrap();
    println!(
        "{kind}: {count} inputs, {accepted} are accepted, the rest is refused; slowest {:?}, seed {}",
        slowest.1, slowest.0
    );
    println!("{kind}: peak memory {:?} bytes", peak_memory());
    let panics: Vec<u64> = outcomes.iter().filter(|(_, _, panicked)| *panicked).map(|(seed, _, _)| *seed).collect();
    assert!(panics.is_empty(), "{kind}: {} inputs panic, of the seeds {panics:?}", panics.len());
    assert!(accepted * 50 > count && (count - accepted) * 20 > count, "{kind}: {accepted} of {count} are accepted");
    // What is mutated is small: milliseconds each, seconds for a search of 100,000 settings. A count that is trusted would take hours, or
    // gigabytes.
    assert!(slowest.1 < Duration::from_secs(300), "{kind}: seed {} took {:?}", slowest.0, slowest.1);
    assert!(peak_memory().is_none_or(|bytes| bytes < 2 << 30), "{kind}: {:?} bytes", peak_memory());
}
