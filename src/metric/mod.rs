//! How good frames are: error, sharpness and stability of sequences of images. No Vulkan, no files.
//!
//! | module | measure | of | range, better | source |
//! | --- | --- | --- | --- | --- |
//! | [`rmse`] | root mean square error | display, linear | 0.., low | |
//! | [`psnr`] | peak signal-to-noise ratio, dB | display | .., high | |
//! | [`relative_mse`] | relative mean squared error | linear | 0.., low | Rousselle et al. 2011 |
//! | [`energy`] | light over that of the reference | linear | 0.., 1 | |
//! | [`ssim`] | structural similarity | display | -1..=1, high | Wang et al. 2004 |
//! | [`flip`] | difference seen when alternating | EXR: linear; PNG: display | 0..=1, low | Andersson et al. 2020, 2021 |
//! | [`cpbd`] | sharpness | 8-bit luma of display | 0..=1, high | Narvekar and Karam 2011; paper 1, section 6 |
//! | [`temporal`] | change of the error on the screen | display, linear | 0.., low | |
//! | [`flicker`] | change of the error along the motion | display luminance | 0..=2, low | ours |
//! | [`bias`] | relative error of a sum over a part | as given | -1.., 0 | |
//!
//! *Linear* values are scene-linear (EXR) or decoded (PNG); *display* values are sRGB-encoded in 0..=1. Sums are in f64, in the
//! same order in each run.
//!
//! [`sequence::Sequence`] takes frames one by one, from memory, and gives a report. Single measures can be called by themselves.
//!
//! ```
//! use stillray::metric::image::{Frame, planar};
//! use stillray::metric::sequence::{Options, Sequence, Step};
//! use stillray::metric::warp::Geometry;
//!
//! # fn main() -> stillray::Result<()> {
//! let size = [64, 64];
//! let still = Geometry::still(64, 64);
//! let reference = Frame::from_linear(size, planar(1, &[0.5; 64 * 64]), 0.0)?;
//! let mut sequence = Sequence::new(Options::default())?;
//! for (name, light) in [("0", 0.5), ("1", 0.4), ("2", 0.5)] {
//!     let frame = Frame::from_linear(size, planar(1, &[light; 64 * 64]), 0.0)?;
//!     let step = Step { name, frame: &frame, reference: &reference, geometry: Some(&still), changes: None };
//!     sequence.push(&step)?;
//! }
//! let report = sequence.finish();
//! assert!(report.flicker.is_some_and(|f| f.flicker_error > 0.0));
//! # Ok(())
//! # }
//! ```

pub mod bias;
mod canny;
pub mod causes;
mod convolve;
pub mod cpbd;
pub mod energy;
pub mod flicker;
pub mod flip;
pub mod image;
pub mod psnr;
pub mod relative_mse;
pub mod rmse;
pub mod sequence;
pub mod ssim;
pub mod temporal;
pub mod warp;
