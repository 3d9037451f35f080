//! Folders of frames, ours or anybody's: which files are which frame, and what is in them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::openexr::Exr;
use crate::metric::causes::Changes;
use crate::metric::image::{Frame, Plane, Rgb, planar};
use crate::metric::warp::Geometry;
use crate::{Error, Result};

/// A kind of picture file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Scene-linear floats.
    Exr,
    /// sRGB, 8 or 16 bits.
    Png,
}

/// By what a frame is known: the last number in its file's name (`frame_0007.exr` is frame 7), or the whole name without
/// its extension if there is none. In order of the numbers, names last.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// A number.
    Number(u128),
    /// A name without a number.
    Name(String),
}

/// Frames of one kind.
#[derive(Debug, Clone)]
pub struct Folder {
    path: PathBuf,
    kind: Kind,
    files: BTreeMap<Key, PathBuf>,
}

/// A frame and how it should look.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pair {
    /// By what both are known.
    pub key: Key,
    /// The file of the frame.
    pub frame: PathBuf,
    /// The file of the reference.
    pub reference: PathBuf,
}

/// A picture that has been read.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// Its colour.
    pub frame: Frame,
    /// The motion and depth of its surfaces, from the layers `motion` and `depth`.
    pub geometry: Option<Geometry>,
    /// What happened to its samples, from the layer `changes`.
    pub changes: Option<Changes>,
}

impl std::fmt::Display for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Name(name) => f.write_str(name),
        }
    }
}

impl Folder {
    /// Lists the folder's `.exr` or `.png` files.
    ///
    /// # Errors
    /// [`Error::Io`] if there is no such folder; [`Error::Frames`] if it has no frames, frames of both kinds, or two of one
    /// number.
    pub fn open(path: &Path) -> Result<Self> {
        let io = |cause| Error::Io { path: path.to_owned(), cause };
        let mut folder = Self { path: path.to_owned(), kind: Kind::Exr, files: BTreeMap::new() };
        let mut found = Vec::new();
        for entry in fs::read_dir(path).map_err(io)? {
            let file = entry.map_err(io)?.path();
            found.extend(kind_of(&file).filter(|_| file.is_file()).map(|kind| (file, kind)));
        }
        found.sort();
        folder.kind = found.first().ok_or_else(|| folder.wrong("has no .exr or .png file"))?.1;
        for (file, kind) in found {
            if kind != folder.kind {
                return Err(folder.wrong("has both .exr and .png files; keep one kind of frame in a folder"));
            }
            let key = key_of(&file);
            let message = |first: &PathBuf| format!("{} and {} are both frame {key}", name(first), name(&file));
            if let Some(first) = folder.files.get(&key) {
                return Err(folder.wrong(&message(first)));
            }
            folder.files.insert(key, file);
        }
        Ok(folder)
    }

    /// What its files are.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Its frames with those of the same numbers in `reference`.
    ///
    /// # Errors
    /// [`Error::Frames`] if they are of different kinds, or a frame is in one folder only.
    pub fn paired(&self, reference: &Self) -> Result<Vec<Pair>> {
        if self.kind != reference.kind {
            let message = format!(
                "has {} files and {} {} files; both must be of one kind",
                self.kind.extension(),
                reference.path.display(),
                reference.kind.extension()
            );
            return Err(self.wrong(&message));
        }
        for (folder, other) in [(reference, self), (self, reference)] {
            let missing: Vec<String> =
                other.files.keys().filter(|key| !folder.files.contains_key(key)).map(Key::to_string).collect();
            if !missing.is_empty() {
                let more = if missing.len() > 5 { format!(" and {} more", missing.len() - 5) } else { String::new() };
                return Err(folder
                    .wrong(&format!("has no file for frame {}{more}", missing[..missing.len().min(5)].join(", "))));
            }
        }
        let both = self.files.iter().zip(reference.files.values());
        Ok(both.map(|((key, f), r)| Pair { key: key.clone(), frame: f.clone(), reference: r.clone() }).collect())
    }

    fn wrong(&self, message: &str) -> Error {
        Error::Frames { message: format!("{}: {message}", self.path.display()) }
    }
}

impl Kind {
    fn extension(self) -> &'static str {
        match self {
            Self::Exr => ".exr",
            Self::Png => ".png",
        }
    }
}

/// Reads a picture. Scene-linear ones are brightened by `exposure` stops before display values are made of them.
///
/// # Errors
/// [`Error::Io`] or [`Error::Image`] with `path`, also for pixels that are not finite.
pub fn read(path: &Path, kind: Kind, exposure: f32) -> Result<Loaded> {
    match kind {
        Kind::Png => read_png(path),
        Kind::Exr => read_exr(path, exposure),
    }
}

fn read_png(path: &Path) -> Result<Loaded> {
    let image = image::open(path).map_err(|e| match e {
        image::ImageError::IoError(cause) => Error::Io { path: path.to_owned(), cause },
        other => image_error(path, other.to_string()),
    })?;
    let pixels = image.to_rgb32f();
    let frame = Frame::from_display([pixels.width(), pixels.height()], planar(3, &pixels));
    Ok(Loaded { frame: frame.map_err(|e| image_error(path, e.to_string()))?, geometry: None, changes: None })
}

fn read_exr(path: &Path, exposure: f32) -> Result<Loaded> {
    let exr = Exr::read(path)?;
    let frame = Frame::from_linear([exr.width, exr.height], colors(&exr, path)?, exposure);
    Ok(Loaded {
        frame: frame.map_err(|e| image_error(path, e.to_string()))?,
        geometry: geometry(&exr, path)?,
        changes: changes(&exr),
    })
}

/// R, G and B, or Y thrice, in capitals or not.
fn colors(exr: &Exr, path: &Path) -> Result<Rgb> {
    let plane = |name: &str| exr.channels.iter().find(|c| c.name.eq_ignore_ascii_case(name)).map(|c| c.data.clone());
    let rgb = || Some([plane("R")?, plane("G")?, plane("B")?]);
    let grey = || plane("Y").map(|y| [y.clone(), y.clone(), y]);
    rgb().or_else(grey).ok_or_else(|| {
        let names: Vec<&str> = exr.channels.iter().map(|c| c.name.as_str()).collect();
        image_error(path, format!("neither R, G and B nor Y among its channels ({})", names.join(", ")))
    })
}

fn geometry(exr: &Exr, path: &Path) -> Result<Option<Geometry>> {
    let names = ["motion.X", "motion.Y", "depth.Z"];
    let [Some(right), Some(down), Some(depth)] = names.map(|name| exr.channel(name)) else { return Ok(None) };
    let bad = right.iter().chain(down).filter(|v| !v.is_finite()).count() + depth.iter().filter(|d| d.is_nan()).count();
    if bad > 0 {
        return Err(image_error(path, format!("{bad} values of motion or depth are not numbers")));
    }
    let motion = right.iter().zip(down).map(|(x, y)| [*x, *y]).collect();
    let depth = Plane { width: exr.width as usize, height: exr.height as usize, data: depth.to_vec() };
    Ok(Some(Geometry { motion, depth }))
}

fn changes(exr: &Exr) -> Option<Changes> {
    let plane = |name: &str| exr.channel(name).map(<[f32]>::to_vec);
    let counts = [plane("changes.R")?, plane("changes.G")?, plane("changes.B")?, plane("changes.A")?];
    Some(Changes { width: exr.width as usize, counts })
}

fn kind_of(path: &Path) -> Option<Kind> {
    let extension = path.extension()?.to_str()?;
    [Kind::Exr, Kind::Png].into_iter().find(|kind| kind.extension()[1..].eq_ignore_ascii_case(extension))
}

fn key_of(path: &Path) -> Key {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let last = stem.split(|c: char| !c.is_ascii_digit()).rfind(|digits| !digits.is_empty());
    last.and_then(|digits| digits.parse().ok()).map_or(Key::Name(stem), Key::Number)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn image_error(path: &Path, message: String) -> Error {
    Error::Image { path: path.to_owned(), message }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(names: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        names.iter().for_each(|name| fs::write(dir.path().join(name), "").unwrap());
        dir
    }

    fn refused(names: &[&str]) -> String {
        Folder::open(filled(names).path()).unwrap_err().to_string()
    }

    #[test]
    fn a_frame_is_known_by_the_last_number_in_its_name() {
        let key = |name: &str| key_of(Path::new(name)).to_string();
        let names = ["frame_0007.exr", "ref.7.exr", "shot2_v3-007 final.exr", "000.png", "beauty.exr", "a/12/b.exr"];
        assert_eq!(names.map(key), ["7", "7", "7", "0", "beauty", "b"]);
    }

    #[test]
    fn frames_come_in_the_order_of_their_numbers() {
        let frames = Folder::open(filled(&["f10.png", "f9.png", "f011.PNG", "notes.txt", "last.png"]).path()).unwrap();
        let pairs = frames.paired(&frames).unwrap();
        let keys: Vec<String> = pairs.iter().map(|p| p.key.to_string()).collect();
        assert_eq!(keys, ["9", "10", "11", "last"]);
    }

    #[test]
    fn folders_that_cannot_be_compared() {
        assert!(refused(&["a.txt"]).ends_with("has no .exr or .png file"));
        assert!(refused(&["1.exr", "2.png"]).contains("both .exr and .png"));
        assert!(refused(&["a1.png", "b_01.png"]).ends_with("a1.png and b_01.png are both frame 1"));
        assert!(Folder::open(Path::new("/nowhere at all")).unwrap_err().to_string().starts_with("/nowhere at all"));
        let open = |names: &[&str]| Folder::open(filled(names).path()).unwrap();
        let two = open(&["1.png", "2.png"]);
        let missing = |a: &Folder, b: &Folder| a.paired(b).unwrap_err().to_string();
        assert!(missing(&two, &open(&["1.png"])).ends_with("has no file for frame 2"));
        assert!(missing(&open(&["1.png"]), &two).ends_with("has no file for frame 2"));
        assert!(missing(&two, &open(&["1.exr", "2.exr"])).contains("both must be of one kind"));
        let many: Vec<String> = (0..9).map(|i| format!("{i}.png")).collect();
        let many = open(&many.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(missing(&open(&["0.png"]), &many).ends_with("frame 1, 2, 3, 4, 5 and 3 more"));
    }
}
