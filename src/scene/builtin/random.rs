//! A small seeded random stream, so that scenes are the same everywhere.

use glam::{DQuat, DVec3};
use std::f64::consts::TAU;

/// SplitMix64 (Steele, Lea and Flood 2014): equidistributed, and any seed is a good one.
pub(super) struct Random(u64);

impl Random {
    /// `stream` tells apart what is drawn for different things from one `seed`.
    pub(super) fn new(seed: u32, stream: u32) -> Self {
        Self((u64::from(stream) << 32) | u64::from(seed))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in `low..high`.
    pub(super) fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 * 2f64.powi(-53))
    }

    /// A uniform rotation (Shoemake 1992).
    pub(super) fn rotation(&mut self) -> DQuat {
        let (u, a, b) = (self.range(0.0, 1.0), self.range(0.0, TAU), self.range(0.0, TAU));
        let (p, q) = ((1.0 - u).sqrt(), u.sqrt());
        DQuat::from_xyzw(p * a.sin(), p * a.cos(), q * b.sin(), q * b.cos()).normalize()
    }

    /// A colour with each channel uniform in `low..high`.
    pub(super) fn color(&mut self, low: f64, high: f64) -> DVec3 {
        DVec3::new(self.range(low, high), self.range(low, high), self.range(low, high))
    }
}
