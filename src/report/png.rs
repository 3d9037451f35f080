//! 8-bit sRGB pictures.

use std::path::Path;

use ::png::{BitDepth, ColorType, Compression, Encoder, EncodingError, SrgbRenderingIntent};

use super::file::{WriteSeek, write_whole};
use super::tonemap;
use crate::headless::Pixels;
use crate::{Error, Result};

/// An 8-bit sRGB picture, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Pixels across, at least 1.
    pub width: u32,
    /// Pixels down, at least 1.
    pub height: u32,
    /// `width * height` RGB triples.
    pub rgb: Vec<u8>,
}

impl Picture {
    /// Tone-maps the first three channels of scene-linear `pixels`, `exposure` stops brighter. A single channel becomes
    /// grey; missing ones are black.
    pub fn tone_mapped(pixels: &Pixels, exposure: f32) -> Self {
        let scale = exposure.exp2();
        let rgb = pixels.data.chunks_exact(pixels.channels.max(1)).flat_map(|p| {
            let at = |c: usize| if p.len() == 1 { p[0] } else { p.get(c).copied().unwrap_or(0.0) };
            tonemap::display_pixel([at(0), at(1), at(2)].map(|c| c * scale))
        });
        Self { width: pixels.width, height: pixels.height, rgb: rgb.collect() }
    }

    /// Writes a PNG file, marked as sRGB; the file is whole or not there.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Image`] with `path`.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_whole(path, |sink| {
            let mut writer = encoder(sink, self.width, self.height).write_header().map_err(|e| failed(path, e))?;
            writer.write_image_data(&self.rgb).map_err(|e| failed(path, e))?;
            writer.finish().map_err(|e| failed(path, e))
        })
    }
}

/// An encoder with the settings that all pictures share.
pub(super) fn encoder(sink: &mut dyn WriteSeek, width: u32, height: u32) -> Encoder<'static, &mut dyn WriteSeek> {
    let mut encoder = Encoder::new(sink, width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Balanced);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    encoder
}

pub(super) fn failed(path: &Path, cause: EncodingError) -> Error {
    match cause {
        EncodingError::IoError(cause) => Error::Io { path: path.to_owned(), cause },
        other => Error::Image { path: path.to_owned(), message: other.to_string() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Decodes with the `image` crate, which is not what wrote the file.
    fn decode(path: &Path) -> (u32, u32, Vec<u8>) {
        let image = image::open(path).unwrap().to_rgb8();
        (image.width(), image.height(), image.into_raw())
    }

    #[test]
    fn comes_back_as_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ramp.png");
        let picture = Picture { width: 16, height: 3, rgb: (0..144).collect() };
        picture.write(&path).unwrap();
        assert_eq!(decode(&path), (16, 3, picture.rgb.clone()));
        let other = Picture { rgb: vec![7; 144], ..picture.clone() };
        other.write(&path).unwrap();
        assert_ne!(decode(&path).2, picture.rgb);
    }

    #[test]
    fn channels_are_taken_as_they_are_there() {
        let pixels = |channels, data: &[f32]| Pixels { width: 1, height: 1, channels, data: data.to_vec() };
        let white = tonemap::display_pixel([1.0; 3]);
        assert_eq!(Picture::tone_mapped(&pixels(1, &[1.0]), 0.0).rgb, white);
        assert_eq!(Picture::tone_mapped(&pixels(4, &[1.0, 1.0, 1.0, 0.0]), 0.0).rgb, white);
        assert_eq!(Picture::tone_mapped(&pixels(2, &[1.0, 0.0]), 0.0).rgb, tonemap::display_pixel([1.0, 0.0, 0.0]));
        assert_eq!(Picture::tone_mapped(&pixels(3, &[0.25; 3]), 2.0).rgb, white);
    }

    #[test]
    fn a_picture_with_missing_rows_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let picture = Picture { width: 2, height: 2, rgb: vec![0; 6] };
        assert!(picture.write(&dir.path().join("a.png")).is_err());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
