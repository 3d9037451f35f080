//! Seeded random inputs: the same on every run, so that a failure can be looked at.

use stillray::oracle::random::{hash_uint, unit_float};

/// A sequence of random numbers.
#[derive(Clone)]
pub struct Random(u32);

impl Random {
    pub fn new(seed: u32) -> Self {
        Self(hash_uint(seed ^ 0x5eed_5eed))
    }

    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9);
        hash_uint(self.0)
    }

    /// In 0..n.
    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.bits()) * u64::from(n)) >> 32) as u32
    }

    /// In [a, b).
    pub fn between(&mut self, a: f32, b: f32) -> f32 {
        a + (b - a) * unit_float(self.bits())
    }

    pub fn chance(&mut self, probability: f32) -> bool {
        unit_float(self.bits()) < probability
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len() as u32) as usize]
    }

    pub fn shuffle<T>(&mut self, all: &mut [T]) {
        for i in (1..all.len()).rev() {
            all.swap(i, self.below(i as u32 + 1) as usize);
        }
    }

    /// A unit vector.
    pub fn direction(&mut self) -> [f32; 3] {
        let z = self.between(-1.0, 1.0);
        let angle = self.between(0.0, std::f32::consts::TAU);
        let r = (1.0 - z * z).max(0.0).sqrt();
        [r * angle.cos(), r * angle.sin(), z]
    }
}

/// Frame sizes that are awkward in one way or another.
pub const SIZES: [[u32; 2]; 8] = [[1, 1], [7, 5], [64, 64], [1, 100], [100, 1], [97, 61], [13, 131], [8, 16]];
