//! What metrics look at: a frame as light and as a display shows it, and planes of single values.

use rayon::prelude::*;

use crate::scene::color::{linear_to_srgb, srgb_to_linear};
use crate::{Error, Result};

/// One value a pixel, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// `width * height` values.
    pub data: Vec<f32>,
}

impl Plane {
    /// A plane of zeros.
    pub fn zeros(width: usize, height: usize) -> Self {
        Self { width, height, data: vec![0.0; width * height] }
    }

    /// Mean of all values; 0 of an empty plane.
    pub fn mean(&self) -> f64 {
        self.data.iter().map(|v| f64::from(*v)).sum::<f64>() / self.data.len().max(1) as f64
    }
}

/// Three planes of as many values each: red, green, blue.
pub type Rgb = [Vec<f32>; 3];

/// What the values of a frame were before they were decoded or encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DynamicRange {
    /// Scene-linear light, from 0 with no upper end (EXR).
    High,
    /// Display values in 0..=1 (PNG).
    Standard,
}

/// A frame in the two spaces that metrics work in. Rec. 709 primaries, D65.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    width: usize,
    height: usize,
    range: DynamicRange,
    /// Display light of a linear value.
    scale: f32,
    linear: Rgb,
    display: Rgb,
}

impl Frame {
    /// A frame of scene-linear light. Its display values are sRGB-encoded after `exposure` stops and clipped to 0..=1.
    ///
    /// # Errors
    /// [`Error::Frames`] if a plane has not `width * height` values, or there are pixels that are not finite.
    pub fn from_linear([width, height]: [u32; 2], linear: Rgb, exposure: f32) -> Result<Self> {
        check(width, height, &linear)?;
        let scale = exposure.exp2();
        let display = each(&linear, |v| linear_to_srgb(f64::from(v * scale)) as f32);
        let (width, height) = (width as usize, height as usize);
        Ok(Self { width, height, range: DynamicRange::High, scale, linear, display })
    }

    /// A frame of sRGB-encoded values. What is outside 0..=1 is clipped.
    ///
    /// # Errors
    /// As for [`Frame::from_linear`].
    pub fn from_display([width, height]: [u32; 2], display: Rgb) -> Result<Self> {
        check(width, height, &display)?;
        let display = each(&display, |v| v.clamp(0.0, 1.0));
        let linear = each(&display, |v| srgb_to_linear(f64::from(v)) as f32);
        let (width, height) = (width as usize, height as usize);
        Ok(Self { width, height, range: DynamicRange::Standard, scale: 1.0, linear, display })
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// What the frame was made from.
    pub fn range(&self) -> DynamicRange {
        self.range
    }

    /// Scene-linear light, or what a display of peak 1 emits.
    pub fn linear(&self) -> &Rgb {
        &self.linear
    }

    /// sRGB-encoded values in 0..=1.
    pub fn display(&self) -> &Rgb {
        &self.display
    }

    /// The light of each pixel as one display value: the sRGB encoding, in 0..=1, of its linear luminance.
    pub fn display_luminance(&self) -> Plane {
        let [r, g, b] = &self.linear;
        let encode = |i: usize| linear_to_srgb(luminance([r[i], g[i], b[i]].map(|v| v * self.scale))) as f32;
        let data = (0..r.len()).into_par_iter().with_min_len(4096).map(encode).collect();
        Plane { width: self.width, height: self.height, data }
    }
}

/// Relative luminance of linear Rec. 709 primaries (ITU-R BT.709-6, 3.2).
pub fn luminance([r, g, b]: [f32; 3]) -> f64 {
    0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
}

/// The planes of interleaved pixels: the first three of `channels`, or one repeated thrice.
pub fn planar(channels: usize, data: &[f32]) -> Rgb {
    let plane = |c: usize| data.iter().skip(c).step_by(channels.max(1)).copied().collect::<Vec<f32>>();
    if channels < 3 { [plane(0), plane(0), plane(0)] } else { [plane(0), plane(1), plane(2)] }
}

fn each(planes: &Rgb, map: impl Fn(f32) -> f32 + Sync) -> Rgb {
    let apply = |plane: &Vec<f32>| plane.par_iter().with_min_len(4096).map(|v| map(*v)).collect();
    [apply(&planes[0]), apply(&planes[1]), apply(&planes[2])]
}

fn check(width: u32, height: u32, [r, g, b]: &Rgb) -> Result<()> {
    let pixels = width as usize * height as usize;
    if [r, g, b].iter().any(|plane| plane.len() != pixels) || pixels == 0 {
        let found = format!("{}, {} and {} values for {width}x{height} pixels", r.len(), g.len(), b.len());
        return Err(Error::Frames { message: found });
    }
    let bad = (0..pixels).filter(|&i| ![r[i], g[i], b[i]].iter().all(|v| v.is_finite())).count();
    if bad > 0 {
        return Err(Error::Frames { message: format!("{bad} pixels are infinite or not a number") });
    }
    Ok(())
}
