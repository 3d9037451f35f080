//! Converged frames to compare with, rendered once and kept by content.

use super::store::Search;
use super::studio::Studio;
use crate::metric::image::{Frame, Plane};
use crate::metric::warp::Geometry;
use crate::progress::Progress;
use crate::renderer::Aov;
use crate::report::openexr::Exr;
use crate::scene::fingerprint::hex;
use crate::scene::motion::Motion;
use crate::settings::{Method, Settings};
use crate::{Error, Result};
use sha2::{Digest, Sha256};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Samples a pixel of one pass of the reference.
const PASS: u32 = 16;

/// A converged frame.
#[derive(Debug, Clone)]
pub struct Still {
    /// Its picture.
    pub frame: Frame,
    /// How its surfaces moved since the frame before, and how far away they are.
    pub geometry: Geometry,
}

/// Which frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Footage {
    /// The motion.
    pub motion: Motion,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Their numbers.
    pub frames: Range<u32>,
}

/// SHA-256 of all shaders: what is rendered by others is not the same.
pub fn shaders_digest() -> String {
    let mut hash = Sha256::new();
    for shader in crate::shaders::ALL {
        hash.update(shader.name);
        hash.update(shader.spirv);
    }
    hex(&hash.finalize())
}

/// Renders the frames that are not there yet, and reads all of them.
///
/// `stop` is asked before every frame; if it says so, none is returned, and what has been rendered is kept.
///
/// # Errors
/// Those of rendering, and of files.
pub fn footage(
    studio: &Studio<'_>,
    search: &Search,
    folder: &Path,
    footage: &Footage,
    progress: &dyn Progress,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<Still>>> {
    let folder = folder.join(key(search, footage));
    let path = |index: u32| folder.join(format!("frame_{index:04}.exr"));
    let missing: Vec<u32> = footage.frames.clone().filter(|i| !path(*i).exists()).collect();
    if let Some(first) = missing.first() {
        std::fs::create_dir_all(&folder).map_err(|cause| Error::Io { path: folder.clone(), cause })?;
        let [w, h] = footage.size;
        progress.begin(&format!("reference {} {w}x{h}", footage.motion), missing.len() as u64);
        if !render(studio, search, footage, *first, &missing, &path, progress, stop)? {
            return Ok(None);
        }
        progress.finish();
    }
    footage.frames.clone().map(|i| read(&path(i))).collect::<Result<Vec<_>>>().map(Some)
}

/// What the frames depend on besides their number.
fn key(search: &Search, footage: &Footage) -> String {
    let Search { fingerprint, camera, device, driver, shaders, fps, seed, reference_spp, .. } = search;
    let [w, h] = footage.size;
    let motion = footage.motion;
    let words =
        format!("{fingerprint} {camera} {device} {driver} {shaders} {fps} {seed} {reference_spp} {motion} {w}x{h}");
    hex(&Sha256::digest(words))[..16].to_owned()
}

#[allow(clippy::too_many_arguments, reason = "one call of a private function")]
fn render(
    studio: &Studio<'_>,
    search: &Search,
    footage: &Footage,
    first: u32,
    missing: &[u32],
    path: &dyn Fn(u32) -> PathBuf,
    progress: &dyn Progress,
    stop: &dyn Fn() -> bool,
) -> Result<bool> {
    let settings = Settings {
        size: footage.size,
        seed: search.seed,
        spp: PASS.min(search.reference_spp),
        float_output: true,
        aovs: vec![Aov::Depth, Aov::Motion],
        ..Settings::of(Method::Reference)
    };
    let passes = search.reference_spp.div_ceil(settings.spp);
    let mut take = studio.take(&settings, footage.motion)?;
    // One pass of the frame before, from which the motion is told.
    let mut last = first.saturating_sub(1);
    take.render(last, true)?;
    for &index in missing {
        if stop() {
            return Ok(false);
        }
        if index > last + 1 {
            take.render(index - 1, true)?;
        }
        (0..passes).try_for_each(|pass| take.render(index, pass == 0).map(|_| ()))?;
        last = index;
        let session = take.session();
        let mut exr = Exr::new(&session.color()?, true);
        exr.fps = Some(search.fps);
        exr.push_aov(Aov::Depth, &session.aov(Aov::Depth)?);
        exr.push_aov(Aov::Motion, &session.aov(Aov::Motion)?);
        exr.write(&path(index))?;
        progress.advance(1);
    }
    Ok(true)
}

fn read(path: &Path) -> Result<Still> {
    let exr = Exr::read(path)?;
    let channel = |name: &str| {
        exr.channel(name).map(<[f32]>::to_vec).ok_or_else(|| Error::Image {
            path: path.to_owned(),
            message: format!("has no channel {name}; remove it, and it is rendered again"),
        })
    };
    let rgb = [channel("R")?, channel("G")?, channel("B")?];
    let (x, y) = (channel("motion.X")?, channel("motion.Y")?);
    let depth = Plane { width: exr.width as usize, height: exr.height as usize, data: channel("depth.Z")? };
    Ok(Still {
        frame: Frame::from_linear([exr.width, exr.height], rgb, 0.0)?,
        geometry: Geometry { motion: x.into_iter().zip(y).map(|(x, y)| [x, y]).collect(), depth },
    })
}
