//! Random numbers of a search: the same on every machine.

use crate::oracle::random::hash_uint;

/// A hash of a counter.
#[derive(Debug, Clone)]
pub struct Random {
    state: u32,
}

impl Random {
    /// For a seed.
    pub fn new(seed: u32) -> Self {
        Self { state: hash_uint(seed) }
    }

    /// A number below `n`, at least 1 and small against 2^32.
    pub fn below(&mut self, n: usize) -> usize {
        self.state = self.state.wrapping_add(0x9e37_79b9);
        hash_uint(hash_uint(self.state)) as usize % n
    }
}
