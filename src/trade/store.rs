//! A search's folder: every measurement a file of its own, whole or not there.
//!
//! A search that was stopped goes on from what is there, and searches that shared the candidates out are joined by putting
//! their files together. Nothing else connects them.
//!
//! ```text
//! search.json              what is searched: another search does not go into the same folder
//! runs/RUNG/ID-MOTION.json a candidate on a rung under a motion
//! timing/SHARD-ROUND.json  a round of timing: all that came to the end, in turns
//! reference/               converged frames, by content
//! pictures/ID/             frames and maps of what came to the end
//! ```

use super::pareto::Estimate;
use crate::renderer::PhaseTime;
use crate::report::{file, json};
use crate::scene::requirements::Traits;
use crate::{Error, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// What is searched. Two searches with the same of these may share a folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Search {
    /// Version of the folder's form; 1.
    pub schema: u32,
    /// The scene as the user named it.
    pub scene: String,
    /// SHA-256 of its content.
    pub fingerprint: String,
    /// Name of the camera.
    pub camera: String,
    /// Names of the motions.
    pub motions: Vec<String>,
    /// Name of the device.
    pub device: String,
    /// Name and version of its driver.
    pub driver: String,
    /// SHA-256 of the shaders.
    pub shaders: String,
    /// Width and height in pixels of the full runs.
    pub size: [u32; 2],
    /// Frames a second of the motions.
    pub fps: f64,
    /// Measured frames of the full runs.
    pub frames: u32,
    /// Seed of all random choices.
    pub seed: u32,
    /// Samples a pixel of the reference.
    pub reference_spp: u32,
    /// Candidates asked for.
    pub candidates: usize,
    /// Brackets they are dealt into.
    pub brackets: usize,
    /// Knobs that are held, with their values in words.
    pub held: BTreeMap<String, String>,
    /// What the scene is like, as far as it decides which settings make a difference.
    pub traits: Traits,
}

/// How good a candidate's frames are, under one motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Mean FLIP, 0 to 1, over frames.
    pub flip: Estimate,
    /// Relative mean squared error, over frames.
    pub relative_mse: Estimate,
    /// Root mean square error of display values, 0 to 1.
    pub rmse: f64,
    /// Flicker error: RMS of the motion-compensated change of the error at lag 1, 0 to 1, over frames.
    pub flicker_error: Estimate,
    /// Excess flicker, mean over lags 1 to 3, -1 to 1.
    pub excess_flicker: f64,
    /// CPBD sharpness of the frames, 0 to 1; none for frames below 64 × 64.
    pub cpbd: Option<f64>,
    /// CPBD sharpness of the reference.
    pub cpbd_reference: Option<f64>,
    /// Linear light over that of the reference.
    pub energy_ratio: f64,
}

impl Quality {
    /// How far the sharpness is from the reference's, either way, 0 to 1; none where it is not measured.
    pub fn sharpness_error(&self) -> Option<f64> {
        Some((self.cpbd? - self.cpbd_reference?).abs())
    }
}

/// A candidate on a rung under a motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// The candidate's identity.
    pub candidate: String,
    /// The rung, from 0.
    pub rung: usize,
    /// Name of the motion.
    pub motion: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Frames measured.
    pub frames: u32,
    /// How good they are.
    pub quality: Quality,
    /// Mean camera rays a frame.
    pub rays: f64,
    /// Mean shadow rays a frame.
    pub shadow_rays: f64,
    /// Mean share of the camera rays that belong to samples of earlier frames.
    pub reused_fraction: f64,
    /// Mean share of the pixels onto which 0, 1, 2, 3, and 4 or more samples were reprojected.
    pub reprojected: [f64; 5],
    /// Device memory of the settings in bytes, without the scene.
    pub memory_bytes: u64,
    /// Median milliseconds a frame on the device, measured alone: not to be compared with those of another moment.
    pub ms_alone: f64,
}

/// A round of timing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Which part of the search it belongs to.
    pub shard: String,
    /// Its number, from 0. Rounds 2k and 2k + 1 render the same frames.
    pub round: usize,
    /// Name of the motion.
    pub motion: String,
    /// One entry a candidate, in the order in which they took turns.
    pub entries: Vec<RoundEntry>,
}

/// A candidate in a round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoundEntry {
    /// The candidate's identity.
    pub candidate: String,
    /// Median milliseconds a frame on the device.
    pub ms: f64,
    /// The same of each phase, in order.
    pub phases: Vec<Phase>,
}

/// Time of a phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// The phase's label.
    pub label: String,
    /// Milliseconds on the device.
    pub ms: f64,
}

impl From<&PhaseTime> for Phase {
    fn from(time: &PhaseTime) -> Self {
        Self { label: time.label.to_owned(), ms: time.ms }
    }
}

/// Settings that a search tries at most.
pub const MOST_CANDIDATES: u32 = 100_000;
/// Brackets that they are dealt into at most.
pub const MOST_BRACKETS: u32 = 1000;
/// Frames of a full run at most.
pub const MOST_FRAMES: u32 = 10_000;

/// A search's folder.
#[derive(Debug, Clone)]
pub struct Store {
    folder: PathBuf,
}

impl Store {
    /// Makes the folder, or goes on with the one that is there.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Search`] if the folder holds another search, with what differs.
    pub fn open(folder: &Path, search: &Search) -> Result<Self> {
        let store = Self { folder: folder.to_owned() };
        let path = folder.join("search.json");
        if path.exists() {
            let found = read_search(&path)?;
            if let Some(difference) = difference(&found, search) {
                return Err(
                    store.wrong(&format!("holds another search ({difference}); choose another --out, or remove it"))
                );
            }
            return Ok(store);
        }
        for part in ["runs", "timing", "reference", "pictures"] {
            make(&folder.join(part))?;
        }
        json::write(&path, search)?;
        Ok(store)
    }

    /// A folder that is there, and what is searched in it.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Search`] if it is no search's.
    pub fn existing(folder: &Path) -> Result<(Self, Search)> {
        let search = read_search(&folder.join("search.json"))?;
        Ok((Self { folder: folder.to_owned() }, search))
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// A run, if it is there.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Search`] if it is there and cannot be read.
    pub fn run(&self, rung: usize, candidate: &str, motion: &str) -> Result<Option<Run>> {
        let path = self.run_path(rung, candidate, motion);
        if path.exists() { read(&path).map(Some) } else { Ok(None) }
    }

    /// Keeps a run.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn put_run(&self, run: &Run) -> Result<()> {
        let path = self.run_path(run.rung, &run.candidate, &run.motion);
        make(path.parent().unwrap_or(&self.folder))?;
        json::write(&path, run)
    }

    /// All runs, by rung, candidate and motion.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Search`].
    pub fn runs(&self) -> Result<Vec<Run>> {
        let mut runs: Vec<Run> = Vec::new();
        for rung in files(&self.folder.join("runs"))? {
            for path in files(&rung)? {
                runs.push(read(&path)?);
            }
        }
        let key = |r: &Run| (r.rung, r.candidate.clone(), r.motion.clone());
        runs.sort_by_key(key);
        Ok(runs)
    }

    /// Whether a round has been timed.
    pub fn has_round(&self, shard: &str, round: usize) -> bool {
        self.round_path(shard, round).exists()
    }

    /// Keeps a round.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn put_round(&self, round: &Round) -> Result<()> {
        json::write(&self.round_path(&round.shard, round.round), round)
    }

    /// All rounds, by shard and number.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Search`].
    pub fn rounds(&self) -> Result<Vec<Round>> {
        let mut rounds: Vec<Round> =
            files(&self.folder.join("timing"))?.iter().map(|path| read(path)).collect::<Result<_>>()?;
        rounds.sort_by_key(|r| (r.shard.clone(), r.round));
        Ok(rounds)
    }

    /// Where pictures of a candidate are.
    pub fn pictures(&self, candidate: &str) -> PathBuf {
        self.folder.join("pictures").join(candidate)
    }

    /// Puts the files of other folders of the same search into this one.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Search`] if one of them is another search's.
    pub fn absorb(&self, others: &[PathBuf]) -> Result<()> {
        let own: Search = read(&self.folder.join("search.json"))?;
        for other in others {
            let (store, search) = Self::existing(other)?;
            if let Some(difference) = difference(&own, &search) {
                return Err(store.wrong(&format!("is of another search than {} ({difference})", self.folder.display())));
            }
            for part in ["runs", "timing", "reference", "pictures"] {
                copy_tree(&other.join(part), &self.folder.join(part))?;
            }
        }
        Ok(())
    }

    fn run_path(&self, rung: usize, candidate: &str, motion: &str) -> PathBuf {
        self.folder.join("runs").join(rung.to_string()).join(format!("{candidate}-{motion}.json"))
    }

    fn round_path(&self, shard: &str, round: usize) -> PathBuf {
        self.folder.join("timing").join(format!("{shard}-{round:03}.json"))
    }

    fn wrong(&self, message: &str) -> Error {
        Error::Search { path: self.folder.clone(), message: message.to_owned() }
    }
}

/// The first thing in which two searches differ, in words.
fn difference(found: &Search, wanted: &Search) -> Option<String> {
    let fields = |s: &Search| serde_json::to_value(s).unwrap_or_default();
    let (found, wanted) = (fields(found), fields(wanted));
    let names = wanted.as_object()?.keys();
    let differing = names.into_iter().find(|name| found.get(*name) != wanted.get(*name))?;
    Some(format!("{differing} is {} there and {} here", found[differing], wanted[differing]))
}

fn read<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let text = fs::read_to_string(path).map_err(|cause| Error::Io { path: path.to_owned(), cause })?;
    serde_json::from_str(&text).map_err(|e| Error::Search {
        path: path.to_owned(),
        message: format!("is not what a search writes ({e}); remove it"),
    })
}

/// A search whose counts are those that a search can have: they decide how much is made for it.
fn read_search(path: &Path) -> Result<Search> {
    let search: Search = read(path)?;
    let [width, height] = search.size;
    let wrong = [
        (
            !(1..=MOST_CANDIDATES as usize).contains(&search.candidates),
            "candidates",
            format!("from 1 to {MOST_CANDIDATES}"),
        ),
        (!(1..=MOST_BRACKETS as usize).contains(&search.brackets), "brackets", format!("from 1 to {MOST_BRACKETS}")),
        (!(4..=MOST_FRAMES).contains(&search.frames), "frames", format!("from 4 to {MOST_FRAMES}")),
        (![width, height].iter().all(|n| (1..=16_384).contains(n)), "size", "from 1 to 16384 each way".to_owned()),
        (!(0.001..=1000.0).contains(&search.fps), "fps", "from 0.001 to 1000".to_owned()),
        (search.motions.is_empty(), "motions", "a motion at least".to_owned()),
    ];
    match wrong.into_iter().find(|(wrong, ..)| *wrong) {
        None => Ok(search),
        Some((_, name, expected)) => Err(Error::Search {
            path: path.to_owned(),
            message: format!("is not what a search writes ('{name}' should be {expected}); remove it"),
        }),
    }
}

fn make(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(|cause| Error::Io { path: folder.to_owned(), cause })
}

/// What is in a folder, by name; nothing if it is not there. Temporary files of a writer that was killed are passed over.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let io = |cause| Error::Io { path: folder.to_owned(), cause };
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let hidden = path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
        if !hidden {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

fn copy_tree(from: &Path, to: &Path) -> Result<()> {
    make(to)?;
    for path in files(from)? {
        let Some(name) = path.file_name() else { continue };
        let target = to.join(name);
        if path.is_dir() {
            copy_tree(&path, &target)?;
        } else if !target.exists() {
            let bytes = fs::read(&path).map_err(|cause| Error::Io { path: path.clone(), cause })?;
            file::write_bytes(&target, &bytes)?;
        }
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub fn search() -> Search {
        Search {
            schema: 1,
            scene: "builtin:test".into(),
            fingerprint: "f".into(),
            camera: "main".into(),
            motions: vec!["pan".into(), "orbit".into()],
            device: "d".into(),
            driver: "v".into(),
            shaders: "s".into(),
            size: [32, 32],
            fps: 30.0,
            frames: 8,
            seed: 0,
            reference_spp: 64,
            candidates: 12,
            brackets: 3,
            held: BTreeMap::new(),
            traits: Traits::default(),
        }
    }

    pub fn run(candidate: &str, rung: usize, motion: &str, flip: f64) -> Run {
        let quality = Quality {
            flip: Estimate { mean: flip, half_width: 0.001 },
            relative_mse: Estimate::exact(flip),
            rmse: flip,
            flicker_error: Estimate::exact(0.1 * flip),
            excess_flicker: 0.05 * flip,
            cpbd: Some(0.9),
            cpbd_reference: Some(0.8),
            energy_ratio: 1.0,
        };
        Run {
            candidate: candidate.into(),
            rung,
            motion: motion.into(),
            size: [32, 32],
            frames: 8,
            quality,
            rays: 1024.0,
            shadow_rays: 512.0,
            reused_fraction: 0.9,
            reprojected: [0.2, 0.6, 0.2, 0.0, 0.0],
            memory_bytes: 4096,
            ms_alone: 1.5,
        }
    }

    fn round(shard: &str, round: usize) -> Round {
        let entry =
            RoundEntry { candidate: "a".into(), ms: 2.0, phases: vec![Phase { label: "verify".into(), ms: 1.0 }] };
        Round { shard: shard.into(), round, motion: "pan".into(), entries: vec![entry] }
    }

    #[test]
    fn what_is_kept_is_found_again_and_survives_a_killed_writer() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("out");
        let store = Store::open(&folder, &search()).unwrap();
        assert_eq!(store.run(0, "a", "pan").unwrap(), None);
        store.put_run(&run("a", 0, "pan", 0.1)).unwrap();
        store.put_run(&run("a", 1, "pan", 0.2)).unwrap();
        store.put_round(&round("all", 0)).unwrap();
        fs::write(folder.join("runs/0/.tmp123"), "{").unwrap();

        let again = Store::open(&folder, &search()).unwrap();
        assert_eq!(again.run(0, "a", "pan").unwrap(), Some(run("a", 0, "pan", 0.1)));
        assert_eq!(again.runs().unwrap().len(), 2);
        assert!(again.has_round("all", 0) && !again.has_round("all", 1));
        assert_eq!(again.rounds().unwrap(), [round("all", 0)]);
    }

    #[test]
    fn another_search_is_refused_with_what_differs() {
        let dir = tempfile::tempdir().unwrap();
        Store::open(dir.path(), &search()).unwrap();
        let other = Search { size: [64, 64], ..search() };
        let message = Store::open(dir.path(), &other).unwrap_err().to_string();
        assert!(message.contains("size is [32,32] there and [64,64] here"), "{message}");
        fs::write(dir.path().join("search.json"), "{").unwrap();
        let message = Store::open(dir.path(), &search()).unwrap_err().to_string();
        assert!(message.contains("search.json") && message.contains("remove it"), "{message}");
    }

    #[test]
    fn parts_are_joined_and_strangers_are_not() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let open = |name: &str| Store::open(&at(name), &search()).unwrap();
        let (a, b) = (open("a"), open("b"));
        a.put_run(&run("x", 0, "pan", 0.1)).unwrap();
        b.put_run(&run("y", 0, "pan", 0.2)).unwrap();
        a.put_round(&round("0of2", 0)).unwrap();
        b.put_round(&round("1of2", 0)).unwrap();
        let joined = open("c");
        joined.absorb(&[at("a"), at("b")]).unwrap();
        let names: Vec<String> = joined.runs().unwrap().into_iter().map(|r| r.candidate).collect();
        assert_eq!(names, ["x", "y"]);
        assert_eq!(joined.rounds().unwrap().len(), 2);
        Store::open(&at("d"), &Search { seed: 7, ..search() }).unwrap();
        let message = joined.absorb(&[at("d")]).unwrap_err().to_string();
        assert!(message.contains("another search") && message.contains("seed"), "{message}");
    }
}
