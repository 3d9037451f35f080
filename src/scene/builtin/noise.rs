//! Fractal gradient noise in the plane.

use glam::DVec2;
use std::f64::consts::TAU;

/// Gradient noise (Perlin 1985, 2002) summed over octaves.
#[derive(Clone, Copy)]
pub(super) struct Fractal {
    /// Tells independent noises apart.
    pub(super) seed: u32,
    /// Octaves, each twice as fine as the one before.
    pub(super) octaves: u32,
    /// Amplitude of an octave relative to the one before.
    pub(super) gain: f64,
    /// Lattice cells after which the first octave repeats, a power of two; large for noise that need not tile.
    pub(super) period: u32,
}

impl Fractal {
    /// Noise at `p`, in lattice cells of the first octave: about -1..1 and zero on average.
    pub(super) fn at(&self, p: DVec2) -> f64 {
        let octave = |o: u32| {
            let scale = f64::from(1u32 << o);
            self.gain.powi(o as i32) * gradient_noise(p * scale, self.period << o, self.seed.wrapping_add(o))
        };
        (0..self.octaves).map(octave).sum()
    }
}

fn gradient_noise(p: DVec2, period: u32, seed: u32) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let corner = |dx: i64, dy: i64| {
        let wrap = |c: f64, d: i64| (c as i64 + d).rem_euclid(i64::from(period)) as u32;
        let hash = mix(wrap(cell.x, dx) ^ mix(wrap(cell.y, dy) ^ mix(seed)));
        let angle = f64::from(hash) / 4_294_967_296.0 * TAU;
        DVec2::from_angle(angle).dot(f - DVec2::new(dx as f64, dy as f64))
    };
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let low = corner(0, 0) * (1.0 - fade.x) + corner(1, 0) * fade.x;
    let high = corner(0, 1) * (1.0 - fade.x) + corner(1, 1) * fade.x;
    // The square root of two brings the range to -1..1.
    (low * (1.0 - fade.y) + high * fade.y) * 2f64.sqrt()
}

/// A bijection of 32 bits that spreads every bit (Wellons 2018, "lowbias32").
fn mix(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_after_its_period_and_not_before() {
        let noise = Fractal { seed: 7, octaves: 4, gain: 0.5, period: 8 };
        let p = DVec2::new(1.375, 5.625);
        assert_eq!(noise.at(p), noise.at(p + DVec2::new(8.0, -16.0)));
        assert_ne!(noise.at(p), noise.at(p + DVec2::new(4.0, 0.0)));
    }

    #[test]
    fn stays_in_range_and_varies() {
        let noise = Fractal { seed: 1, octaves: 1, gain: 0.5, period: 1 << 16 };
        let values: Vec<f64> = (0..10_000).map(|i| noise.at(DVec2::new(0.173, 0.311) * f64::from(i))).collect();
        assert!(values.iter().all(|v| v.abs() <= 1.0));
        assert!(values.iter().any(|v| *v > 0.4) && values.iter().any(|v| *v < -0.4));
    }
}
