//! Excess flicker and flicker error: how much of what changes from frame to frame should not.
//!
//! # What is measured
//!
//! The values are display luminances f (frames) and r (a converged reference of the same frames): linear Rec. 709 luminance,
//! clipped to 0..=1 and sRGB-encoded, one number a pixel, about evenly spaced to the eye. For a lag k of 1, 2 or 3 frames
//!
//! `D_k[f](p, t) = f(p, t) - f(w_k(p, t), t - k)`
//!
//! is how much the surface at pixel p has changed since k frames ago, when it was at w_k: exact motion vectors lead there
//! (see [`warp`](super::warp)), pixels that were outside the frame or hidden are left out, and images are read bilinearly
//! there. Over all valid pixels of all frames
//!
//! - **excess flicker** `= RMS(D_k[f]) - RMS(D_k[r])`: the change of the frames beyond that of the reference, whose shadows and
//!   highlights move, too;
//! - **flicker error** `= RMS(D_k[f] - D_k[r]) = RMS(D_k[f - r])`: the change of the *error*, along the motion.
//!
//! Both are in units of display values, where 1 is from black to white and 1/255 a step of an 8-bit picture. Excess flicker is
//! in -1..=1 (negative for what is steadier than the reference), flicker error in 0..=2 and never below the size of excess
//! flicker. Lower is better. Each is told for
//! each lag; the one number is the mean over lags. Lag 1 sees what alternates, lag 3 what drifts as well.
//!
//! # Which one
//!
//! An independent change e adds to the reference's own change as √(r² + e²): where the reference changes a lot, excess flicker
//! hardly sees e. It also forgives: a frame that is blurred changes less than the reference does, and that may make up for
//! flicker elsewhere. Flicker error has neither weakness: it is 0 only if the error sticks to the surface, or is none. In
//! turn it counts as flicker where the frames miss a change that the reference makes (shadows that lag behind), which
//! excess flicker rewards. Compare methods by flicker error; excess flicker says which way a method errs.
//!
//! # Causes
//!
//! Where it is known how many samples of a pixel were new, evicted, or changed in visibility or in light, the square of
//! `D_1[f] - D_1[r]` of each pixel is shared equally by the causes that occur among the 3x3 pixels which its filter reads.
//! Where none occurs it is `unattributed`: filter weights that shift with the samples, and shading that depends on the
//! view. Parts add up to the whole. Attribution is by presence: it does not weigh how much each of two causes did.
//!
//! # What it cannot see
//!
//! - Anything in the first frame, at pixels that were just uncovered or entered the picture, or in surfaces that approach or
//!   recede by themselves; the share of valid pixels tells how much is left.
//! - Chroma that changes at constant luminance, and light above display white.
//! - A wrong picture that stays wrong: a bias, a blur or a missing strand that sticks to its surface is no flicker.
//! - How fast the frames are shown, and what the eye makes of it: the change of a single pixel counts like one pixel of an area.
//! - Mirrored and refracted images, and shadows: they move otherwise than the surface they are seen on. Excess flicker takes
//!   away what the reference has of that.
//! - Where motion is not a whole number of pixels, bilinear reading smooths the earlier frame: hard edges, and errors as fine
//!   as a pixel, then look as if they changed even if they stick to their surface. It is the same for all methods along the
//!   same motion, but it can exceed the true change where a hard-edged picture moves by less than a pixel a frame: compare
//!   methods with each other, not motions.

use std::collections::VecDeque;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::causes::{Causes, Changes, Present, Shares};
use super::image::Plane;
use super::warp::{Change, Geometry, Position};

/// Frames back to which changes are measured.
pub const LAGS: usize = 3;

/// What is known of a sequence's flicker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Flicker {
    /// Mean over lags of RMS(D\[f\]) - RMS(D\[r\]), -1..=1.
    pub excess_flicker: f64,
    /// Mean over lags of RMS(D\[f - r\]), 0..=2.
    pub flicker_error: f64,
    /// Share of pixels, 0..=1, that were valid; mean over lags.
    pub valid: f64,
    /// Each lag for which there were valid pixels, shortest first.
    pub lags: Vec<Lag>,
    /// Where the flicker error of lag 1 comes from, if that is known of every frame.
    pub causes: Option<Causes>,
}

/// What is known of one lag.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lag {
    /// Frames back.
    pub lag: usize,
    /// RMS(D\[f\]) - RMS(D\[r\]), -1..=1.
    pub excess_flicker: f64,
    /// RMS(D\[f - r\]), 0..=2.
    pub flicker_error: f64,
    /// RMS(D\[f\]), 0..=1.
    pub frames: f64,
    /// RMS(D\[r\]), 0..=1.
    pub reference: f64,
    /// Share of pixels that were valid, 0..=1.
    pub valid: f64,
}

/// One frame of a sequence.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// Display luminance.
    pub frame: &'a Plane,
    /// That of the reference.
    pub reference: &'a Plane,
    /// How surfaces moved since the last frame.
    pub geometry: &'a Geometry,
    /// What happened to the samples of the frame, if known.
    pub changes: Option<&'a Changes>,
}

/// Sums over the frames so far. All must be of one size.
#[derive(Debug, Clone, Default)]
pub struct FlickerMeter {
    /// The last frames, latest first.
    past: VecDeque<Kept>,
    totals: [Tally; LAGS],
    shares: Shares,
    /// Some frame had no changes.
    incomplete: bool,
    /// Sum over frames and lags of the squared change of error, and how many they were, a pixel.
    squares: Vec<(f64, u32)>,
}

#[derive(Debug, Clone)]
struct Kept {
    frame: Plane,
    reference: Plane,
    geometry: Geometry,
    /// How distances changed since the frame before it.
    change: Option<Change>,
}

/// Sums of squares of one lag.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    frames: f64,
    reference: f64,
    error: f64,
    valid: u64,
    pixels: u64,
}

/// What one row of pixels adds.
#[derive(Default)]
struct Row {
    tallies: [Tally; LAGS],
    shares: Shares,
}

impl FlickerMeter {
    /// Adds a frame and tells what is known of it alone at lag 1, if anything.
    pub fn push(&mut self, moment: &Moment<'_>) -> Option<Lag> {
        let change = self.past.front().map(|last| moment.geometry.change(&last.geometry));
        self.past.push_front(Kept {
            frame: moment.frame.clone(),
            reference: moment.reference.clone(),
            geometry: moment.geometry.clone(),
            change,
        });
        self.past.truncate(LAGS + 1);
        if self.past.len() < 2 {
            return None;
        }
        self.incomplete |= moment.changes.is_none();
        let rows = self.measure(moment.changes);
        let mut first = Tally::default();
        // Rows are added in their order, whichever thread was first.
        for row in rows {
            self.totals.iter_mut().zip(&row.tallies).for_each(|(total, tally)| total.add(tally));
            first.add(&row.tallies[0]);
            self.shares.add(&row.shares);
        }
        first.lag(1)
    }

    /// Forgets the frames so far, but not what was measured of them: the next one is the first after a cut.
    pub fn cut(&mut self) {
        self.past.clear();
    }

    /// The measures of what was added; none without a valid pixel.
    pub fn finish(&self) -> Option<Flicker> {
        let lags: Vec<Lag> = self.totals.iter().zip(1..).filter_map(|(tally, lag)| tally.lag(lag)).collect();
        let mean = |of: fn(&Lag) -> f64| lags.iter().map(of).sum::<f64>() / lags.len() as f64;
        let (excess_flicker, flicker_error) = (mean(|l| l.excess_flicker), mean(|l| l.flicker_error));
        let valid = mean(|l| l.valid);
        let causes = (!self.incomplete).then(|| self.shares.finish(self.totals[0].valid));
        (!lags.is_empty()).then_some(Flicker { excess_flicker, flicker_error, valid, lags, causes })
    }

    /// RMS over frames and lags of each pixel's change of error, 0..=2; 0 where it was never valid. The second plane is the
    /// number of valid observations.
    pub fn map(&self) -> Option<[Plane; 2]> {
        let Kept { frame, .. } = self.past.front()?;
        let plane = |of: fn(&(f64, u32)) -> f64| {
            let data = self.squares.iter().map(|pixel| of(pixel) as f32).collect();
            Plane { width: frame.width, height: frame.height, data }
        };
        let rms = |(sum, count): &(f64, u32)| (sum / f64::from((*count).max(1))).sqrt();
        (!self.squares.is_empty()).then(|| [plane(rms), plane(|(_, count)| f64::from(*count))])
    }

    fn measure(&mut self, changes: Option<&Changes>) -> Vec<Row> {
        let present = changes.map(Changes::nearby);
        let (width, pixels) = (self.past[0].frame.width, self.past[0].frame.data.len());
        self.squares.resize(pixels, (0.0, 0));
        let past = &self.past;
        self.squares
            .par_chunks_mut(width)
            .enumerate()
            .map(|(y, squares)| {
                let mut row = Row::default();
                for (x, square) in squares.iter_mut().enumerate() {
                    let pixel = y * width + x;
                    row.pixel(past, pixel, present.as_ref().map(|p| p[pixel]), square);
                }
                row
            })
            .collect()
    }
}

impl Row {
    /// Follows one pixel back.
    fn pixel(&mut self, past: &VecDeque<Kept>, pixel: usize, causes: Option<Present>, square: &mut (f64, u32)) {
        let now = &past[0];
        let mut trace = Some(now.geometry.start(pixel));
        for lag in 1..past.len() {
            let (later, earlier) = (&past[lag - 1], &past[lag]);
            let found = trace
                .zip(later.change)
                .and_then(|(trace, change)| later.geometry.step(&earlier.geometry, change, trace));
            trace = found.map(|(trace, _)| trace);
            let tally = &mut self.tallies[lag - 1];
            tally.pixels += 1;
            let Some((_, position)) = found else { continue };
            let error = tally.change(now, earlier, pixel, position);
            square.0 += error;
            square.1 += 1;
            if let Some(causes) = causes.filter(|_| lag == 1) {
                self.shares.share(error, causes);
            }
        }
    }
}

impl Tally {
    /// Adds what a pixel changed by since an earlier frame, and returns the square of the error's change.
    fn change(&mut self, now: &Kept, earlier: &Kept, pixel: usize, position: Position) -> f64 {
        let frame = f64::from(now.frame.data[pixel]) - position.read(&earlier.frame);
        let reference = f64::from(now.reference.data[pixel]) - position.read(&earlier.reference);
        let error = (frame - reference).powi(2);
        self.frames += frame.powi(2);
        self.reference += reference.powi(2);
        self.error += error;
        self.valid += 1;
        error
    }

    fn add(&mut self, other: &Self) {
        self.frames += other.frames;
        self.reference += other.reference;
        self.error += other.error;
        self.valid += other.valid;
        self.pixels += other.pixels;
    }

    fn lag(&self, lag: usize) -> Option<Lag> {
        let rms = |sum: f64| (sum / self.valid as f64).sqrt();
        let (frames, reference) = (rms(self.frames), rms(self.reference));
        (self.valid > 0).then(|| Lag {
            lag,
            excess_flicker: frames - reference,
            flicker_error: rms(self.error),
            frames,
            reference,
            valid: self.valid as f64 / self.pixels as f64,
        })
    }
}
