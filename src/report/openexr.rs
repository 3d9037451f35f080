//! Scene-linear pictures with named channels, as OpenEXR.
//!
//! One part with scan lines and ZIP compression, the form that most programs read. Colour is in channels `R`, `G`, `B`
//! (and `A`); what else a frame has is in layers named the usual way, `layer.channel`.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use ::exr::meta::MetaData;
use ::exr::meta::attribute::Chromaticities;
use ::exr::prelude as format;
use half::f16;

use super::file::write_whole;
use crate::headless::Pixels;
use crate::renderer::Aov;
use crate::{Error, Result};

/// A plane of floats.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name in the file.
    pub name: String,
    /// Whether it is stored in 16 bits.
    pub half: bool,
    /// One value a pixel, row by row from the top.
    pub data: Vec<f32>,
}

/// A picture of named channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Exr {
    /// Pixels across, at least 1.
    pub width: u32,
    /// Pixels down, at least 1.
    pub height: u32,
    /// Frames a second of the sequence it belongs to, if known.
    pub fps: Option<f64>,
    /// In the order of the file, which sorts them by name.
    pub channels: Vec<Channel>,
}

impl Exr {
    /// A picture of scene-linear colour (1, 3 or 4 channels), stored in 32 bits if `float` and in 16 otherwise.
    pub fn new(color: &Pixels, float: bool) -> Self {
        let mut exr = Self { width: color.width, height: color.height, fps: None, channels: Vec::new() };
        let names: &[&str] = if color.channels == 1 { &["Y"] } else { &["R", "G", "B", "A"] };
        exr.push(names, color, !float);
        exr
    }

    /// Adds an AOV as a layer of 32-bit channels: `depth.Z`, `motion.X` and `.Y`, `density.R`, `.G` and `.B`, `age.V`,
    /// `changes.R`, `.G`, `.B` and `.A`. The pixels must be as many as the picture has.
    pub fn push_aov(&mut self, aov: Aov, pixels: &Pixels) {
        let names: &[&str] = match aov {
            Aov::Depth => &["depth.Z"],
            Aov::Motion => &["motion.X", "motion.Y"],
            Aov::Density => &["density.R", "density.G", "density.B"],
            Aov::Age => &["age.V"],
            Aov::Changes => &["changes.R", "changes.G", "changes.B", "changes.A"],
        };
        self.push(names, pixels, false);
    }

    fn push(&mut self, names: &[&str], pixels: &Pixels, half: bool) {
        for (offset, name) in names.iter().enumerate().take(pixels.channels) {
            let data = pixels.data.iter().skip(offset).step_by(pixels.channels).copied().collect();
            self.channels.push(Channel { name: (*name).to_owned(), half, data });
        }
    }

    /// The data of the channel of this name.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).map(|c| c.data.as_slice())
    }

    /// Writes the picture; the file is whole or not there. The same picture gives the same bytes.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Image`] with `path`.
    pub fn write(&self, path: &Path) -> Result<()> {
        let pixels = self.width as usize * self.height as usize;
        if let Some(short) = self.channels.iter().find(|c| c.data.len() != pixels) {
            let message = format!("channel {} has {} values for {pixels} pixels", short.name, short.data.len());
            return Err(Error::Image { path: path.to_owned(), message });
        }
        let image = self.image();
        write_whole(path, |sink| {
            use format::WritableImage;
            // One thread: blocks arrive in the order of the lines, so that the bytes repeat.
            image.write().non_parallel().to_buffered(sink).map_err(|e| failed(path, e))
        })
    }

    fn image(&self) -> format::FlatImage {
        let channels = self.channels.iter().map(|c| format::AnyChannel::new(c.name.as_str(), c.samples())).collect();
        let attributes = format::LayerAttributes {
            software_name: Some(concat!("stillray ", env!("CARGO_PKG_VERSION")).into()),
            frames_per_second: self.fps.map(rational),
            ..Default::default()
        };
        let encoding = format::Encoding {
            compression: format::Compression::ZIP16,
            blocks: format::Blocks::ScanLines,
            line_order: format::LineOrder::Increasing,
        };
        let size = (self.width as usize, self.height as usize);
        let layer = format::Layer::new(size, attributes, encoding, format::AnyChannels::sort(channels));
        let mut image = format::Image::from_layer(layer);
        image.attributes.chromaticities = Some(rec709());
        format::Image { attributes: image.attributes, layer_data: [image.layer_data].into_iter().collect() }
    }

    /// Reads the first flat part of a file, whoever wrote it; integer channels are converted to floats.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Image`] with `path`.
    pub fn read(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|cause| Error::Io { path: path.to_owned(), cause })?;
        Self::decode(BufReader::new(file), path)
    }

    /// As [`read`](Self::read), from the bytes of a file; `path` is for messages.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn decode(mut bytes: impl Read + Seek, path: &Path) -> Result<Self> {
        use format::{ReadChannels, ReadLayers};
        check_size(&mut bytes, path)?;
        let reader = format::read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
        let layer = reader.all_attributes().from_buffered(bytes).map_err(|e| failed(path, e))?.layer_data;
        let channel = |c: &format::AnyChannel<format::FlatSamples>| Channel {
            name: c.name.to_string(),
            half: matches!(c.sample_data, format::FlatSamples::F16(_)),
            data: c.sample_data.values_as_f32().collect(),
        };
        let fps = layer.attributes.frames_per_second.map(|(n, d)| f64::from(n) / f64::from(d.max(1)));
        let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        Ok(Self {
            width: side(layer.size.width()),
            height: side(layer.size.height()),
            fps,
            channels: layer.channel_data.list.iter().map(channel).collect(),
        })
    }
}

/// A few bytes can claim any size: it is looked at before anything is made for it.
fn check_size(bytes: &mut (impl Read + Seek), path: &Path) -> Result<()> {
    /// Bytes of a picture that one of a file may stand for: four times what the best of the compressions reaches.
    const MOST: u64 = 4096;
    let io = |cause| Error::Io { path: path.to_owned(), cause };
    let meta = MetaData::read_from_buffered(&mut *bytes, false).map_err(|e| failed(path, e))?;
    let length = bytes.seek(SeekFrom::End(0)).map_err(io)?;
    bytes.rewind().map_err(io)?;
    for header in &meta.headers {
        let [width, height] = [header.layer_size.width(), header.layer_size.height()];
        let texel = header.channels.bytes_per_pixel.max(1) as u64;
        let claimed = (width as u64).saturating_mul(height as u64).saturating_mul(texel);
        if claimed > length.saturating_mul(MOST) {
            let message =
                format!("says that it has {width} x {height} pixels, and has {length} bytes: it is not whole");
            return Err(Error::Image { path: path.to_owned(), message });
        }
    }
    Ok(())
}

impl Channel {
    fn samples(&self) -> format::FlatSamples {
        if !self.half {
            return format::FlatSamples::F32(self.data.clone());
        }
        // Light that is too bright for 16 bits stays the brightest finite value: an infinity spreads in every filter.
        let max = f16::MAX.to_f32();
        let half = |v: &f32| f16::from_f32(if v.is_finite() { v.clamp(-max, max) } else { *v });
        format::FlatSamples::F16(self.data.iter().map(half).collect())
    }
}

/// ITU-R BT.709's primaries and D65, as CIE xy.
fn rec709() -> Chromaticities {
    Chromaticities {
        red: format::Vec2(0.64, 0.33),
        green: format::Vec2(0.30, 0.60),
        blue: format::Vec2(0.15, 0.06),
        white: format::Vec2(0.3127, 0.3290),
    }
}

fn rational(fps: f64) -> (i32, u32) {
    if fps.fract() == 0.0 { (fps as i32, 1) } else { ((fps * 1000.0).round() as i32, 1000) }
}

fn failed(path: &Path, cause: ::exr::error::Error) -> Error {
    match cause {
        ::exr::error::Error::Io(cause) => Error::Io { path: path.to_owned(), cause },
        other => Error::Image { path: path.to_owned(), message: other.to_string() },
    }
}
