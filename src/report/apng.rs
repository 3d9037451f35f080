//! Animated pictures, since stability is seen in motion only.

use std::fs::File;
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

use super::file::{WriteSeek, spool_beside, write_whole};
use super::png::{Picture, encoder, failed};
use crate::{Error, Result};

/// Collects frames and writes them as one APNG that loops for ever.
///
/// The format states the number of frames before the first of them, and an interrupted run does not know it: so the
/// frames wait uncompressed in a nameless file beside the target, 3 bytes a pixel.
#[derive(Debug)]
pub struct Animation {
    path: PathBuf,
    spool: File,
    size: [u32; 2],
    frames: u32,
    delay: (u16, u16),
}

impl Animation {
    /// An animation of `size` pixels to be written to `path`, at `fps` frames a second (0.001 to 1000).
    ///
    /// # Errors
    /// [`Error::Io`] if the folder of `path` cannot be written to.
    pub fn new(path: &Path, size: [u32; 2], fps: f64) -> Result<Self> {
        Ok(Self { path: path.to_owned(), spool: spool_beside(path)?, size, frames: 0, delay: delay(fps) })
    }

    /// Adds a frame of the animation's size.
    ///
    /// # Errors
    /// [`Error::Io`] if the disk is full, [`Error::Image`] if the picture has another size.
    pub fn push(&mut self, picture: &Picture) -> Result<()> {
        if [picture.width, picture.height] != self.size || picture.rgb.len() != self.frame_bytes() {
            let [w, h] = self.size;
            let message = format!("a frame of {}x{} in an animation of {w}x{h}", picture.width, picture.height);
            return Err(Error::Image { path: self.path.clone(), message });
        }
        self.spool.write_all(&picture.rgb).map_err(|cause| self.io(cause))?;
        self.frames += 1;
        Ok(())
    }

    /// Encodes what was added; with no frames, nothing is written.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Image`] with the path.
    pub fn finish(mut self) -> Result<()> {
        if self.frames == 0 {
            return Ok(());
        }
        self.spool.rewind().map_err(|cause| self.io(cause))?;
        let path = self.path.clone();
        write_whole(&path, |sink| self.encode(sink))
    }

    fn encode(mut self, sink: &mut dyn WriteSeek) -> Result<()> {
        let path = self.path.clone();
        let failed = |e| failed(&path, e);
        let mut encoder = encoder(sink, self.size[0], self.size[1]);
        encoder.set_animated(self.frames, 0).map_err(failed)?;
        encoder.set_frame_delay(self.delay.0, self.delay.1).map_err(failed)?;
        let mut writer = encoder.write_header().map_err(failed)?;
        let mut frame = vec![0; self.frame_bytes()];
        for _ in 0..self.frames {
            self.spool.read_exact(&mut frame).map_err(|cause| self.io(cause))?;
            writer.write_image_data(&frame).map_err(failed)?;
        }
        writer.finish().map_err(failed)
    }

    fn frame_bytes(&self) -> usize {
        3 * self.size[0] as usize * self.size[1] as usize
    }

    fn io(&self, cause: std::io::Error) -> Error {
        Error::Io { path: self.path.clone(), cause }
    }
}

/// Seconds a frame as a fraction of two u16: exact for whole rates, else on the finest of three clocks that can tell it.
fn delay(fps: f64) -> (u16, u16) {
    if fps.fract() == 0.0 && (1.0..=65535.0).contains(&fps) {
        return (1, fps as u16);
    }
    let ticks = |clock: u16| (f64::from(clock) / fps).round();
    let clock = [60000, 600, 60].into_iter().find(|&c| ticks(c) <= 65535.0).unwrap_or(1);
    (ticks(clock).clamp(1.0, 65535.0) as u16, clock)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(size: [u32; 2], shade: u8) -> Picture {
        Picture { width: size[0], height: size[1], rgb: vec![shade; 3 * (size[0] * size[1]) as usize] }
    }

    /// Frames and the delay of each, as the `image` crate, which did not write them, reads them.
    fn decode(path: &Path) -> Vec<(u8, (u32, u32))> {
        use image::AnimationDecoder;
        let file = std::io::BufReader::new(File::open(path).unwrap());
        let frames = image::codecs::png::PngDecoder::new(file).unwrap().apng().unwrap().into_frames();
        let frame = |f: image::Frame| (f.buffer().get_pixel(0, 0)[0], f.delay().numer_denom_ms());
        frames.map(|f| frame(f.unwrap())).collect()
    }

    #[test]
    fn all_frames_come_back_in_order_with_their_delay() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.png");
        let mut animation = Animation::new(&path, [5, 4], 25.0).unwrap();
        for shade in [10, 20, 30] {
            animation.push(&picture([5, 4], shade)).unwrap();
        }
        animation.finish().unwrap();
        let frames = decode(&path);
        assert_eq!(frames.iter().map(|f| f.0).collect::<Vec<_>>(), [10, 20, 30]);
        assert!(frames.iter().all(|f| f.1.0 == 40 * f.1.1), "{frames:?}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn another_size_is_refused_and_an_unfinished_animation_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let mut animation = Animation::new(&dir.path().join("p.png"), [2, 2], 25.0).unwrap();
        animation.push(&picture([2, 2], 1)).unwrap();
        assert!(animation.push(&picture([4, 1], 1)).is_err());
        drop(animation);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn delays_are_exact_for_whole_rates_and_close_for_others() {
        assert_eq!(delay(60.0), (1, 60));
        assert_eq!(delay(30.0), (1, 30));
        for fps in [0.001, 0.01, 0.4, 0.5, 12.5, 23.976, 29.97, 59.94, 999.5] {
            let (ticks, clock) = delay(fps);
            let seconds = f64::from(ticks) / f64::from(clock);
            // Half a tick of the clock that is used.
            assert!((seconds - 1.0 / fps).abs() <= 0.5 / f64::from(clock), "{fps}: {ticks}/{clock}");
        }
    }
}
