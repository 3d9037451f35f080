//! Fractal gradient noise in the plane.

use glam::DVec2;
use std::f64::consts::SQRT_2;

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
    let (x, y) = (cell.x as i64 as u32, cell.y as i64 as u32);
    let columns = [x, x.wrapping_add(1)].map(|x| x & (period - 1));
    let rows = [y, y.wrapping_add(1)].map(|y| mix((y & (period - 1)) ^ mix(seed)));
    let corner = |i: usize, j: usize| slope(mix(columns[i] ^ rows[j]), f - DVec2::new(i as f64, j as f64));
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let low = corner(0, 0) * (1.0 - fade.x) + corner(1, 0) * fade.x;
    let high = corner(0, 1) * (1.0 - fade.x) + corner(1, 1) * fade.x;
    low * (1.0 - fade.y) + high * fade.y
}

/// `d` along one of eight gradients of length sqrt(2), which brings the noise's range to -1..1.
fn slope(hash: u32, d: DVec2) -> f64 {
    let sign = |bit: u32, v: f64| if hash >> bit & 1 == 0 { v } else { -v };
    match hash >> 30 {
        0 => sign(0, d.x) * SQRT_2,
        1 => sign(0, d.y) * SQRT_2,
        _ => sign(0, d.x) + sign(1, d.y),
    }
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
