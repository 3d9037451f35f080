//! Maps of light from all around, from OpenEXR pictures.

use std::io::Cursor;
use std::path::Path;

use exr::meta::MetaData;

use super::container::read_regular_file;
use crate::report::openexr::Exr;
use crate::scene::EnvironmentMap;
use crate::scene::environment::MOST_TEXELS_A_SIDE;
use crate::{Error, Result};

/// The most texels of a map, 16 bytes each on the device: 8192 x 4096.
const MAX_TEXELS: u64 = 1 << 25;
/// What an infinite texel stands for: the brightest half, most likely.
const BRIGHTEST: f32 = 65504.0;

/// Reads a map from an OpenEXR picture with the channels `R`, `G` and `B`, or `Y`, of its first flat part: the upper edge is
/// up. What is approximated is appended to `notices`.
///
/// # Errors
/// [`Error::Io`] if there is no such file, [`Error::Image`] if it is no such picture or has more than 2^25 texels.
pub fn read(path: &Path, notices: &mut Vec<String>) -> Result<EnvironmentMap> {
    let name = path.file_name().map_or_else(|| "map".to_owned(), |name| name.to_string_lossy().into_owned());
    decode(&read_regular_file(path)?, path, name, notices)
}

/// As [`read`], from the bytes of a file; `path` is for messages.
pub(super) fn decode(bytes: &[u8], path: &Path, name: String, notices: &mut Vec<String>) -> Result<EnvironmentMap> {
    let bad = |message: String| Error::Image { path: path.to_owned(), message };
    check_size(bytes).map_err(bad)?;
    let picture = Exr::decode(Cursor::new(bytes), path)?;
    let plane = |name: &str| picture.channel(name).or_else(|| picture.channel("Y"));
    let (Some(r), Some(g), Some(b)) = (plane("R"), plane("G"), plane("B")) else {
        let there: Vec<&str> = picture.channels.iter().map(|c| c.name.as_str()).collect();
        return Err(bad(format!("no channels R, G and B, nor Y, but {}: save it as RGB", there.join(", "))));
    };
    let mut texels: Vec<[f32; 3]> = r.iter().zip(g).zip(b).map(|((r, g), b)| [*r, *g, *b]).collect();
    let repaired = texels.iter_mut().filter_map(repair).count();
    if repaired > 0 {
        let n = texels.len();
        notices.push(format!("map '{name}': {repaired} of {n} texels are negative or not finite; they are cut off"));
    }
    let (width, height) = (picture.width, picture.height);
    Ok(EnvironmentMap { name, width, height, texels, scale: 1.0, turn: 0.0 })
}

/// A few bytes can claim any size: it is looked at before anything is made for it.
fn check_size(bytes: &[u8]) -> std::result::Result<(), String> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false)
        .map_err(|error| format!("cannot be read as OpenEXR ({error}): give an equirectangular .exr picture"))?;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.width() as u64, header.layer_size.height() as u64);
        let most = u64::from(MOST_TEXELS_A_SIDE);
        if width > most || height > most || width.saturating_mul(height) > MAX_TEXELS {
            return Err(format!("has {width} x {height} texels; {MAX_TEXELS} at most are read: scale it down"));
        }
    }
    Ok(())
}

/// Makes light of what is none; tells whether there was something to do.
fn repair(texel: &mut [f32; 3]) -> Option<()> {
    let sound =
        |x: f32| if x.is_nan() { 0.0 } else { x.clamp(0.0, if x == f32::INFINITY { BRIGHTEST } else { f32::MAX }) };
    let repaired = texel.map(sound);
    let differs = repaired != *texel;
    *texel = repaired;
    differs.then_some(())
}
