//! What is kept to be looked at: the frames in motion, and where they are wrong.

use super::evaluate::Pictures;
use crate::Result;
use crate::headless::Pixels;
use crate::metric::image::Frame;
use crate::report::apng::Animation;
use crate::report::compare::colored;
use crate::report::png::Picture;
use std::path::Path;

/// Writes `frames.png` (animated), `flip.png` and `flicker.png`, as far as there are any.
///
/// # Errors
/// [`crate::Error::Io`] or [`crate::Error::Image`].
pub fn write(folder: &Path, pictures: &Pictures, fps: f64) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|cause| crate::Error::Io { path: folder.to_owned(), cause })?;
    if let Some(first) = pictures.frames.first() {
        let size = first.size().map(|side| side as u32);
        let mut animation = Animation::new(&folder.join("frames.png"), size, fps)?;
        for frame in &pictures.frames {
            animation.push(&picture(frame))?;
        }
        animation.finish()?;
    }
    for (name, map, white) in [("flip.png", &pictures.flip, 0.5), ("flicker.png", &pictures.flicker, 0.25)] {
        if let Some(map) = map {
            // The same white for all candidates, so that their maps can be compared.
            colored(map, white).write(&folder.join(name))?;
        }
    }
    Ok(())
}

/// As `stillray render` writes it.
pub fn picture(frame: &Frame) -> Picture {
    let [width, height] = frame.size().map(|side| side as u32);
    let [r, g, b] = frame.linear();
    let data = r.iter().zip(g).zip(b).flat_map(|((r, g), b)| [*r, *g, *b]).collect();
    Picture::tone_mapped(&Pixels { width, height, channels: 3, data }, 0.0)
}
