//! Where the samples of a distribution ray tracer lie: one interface, and strategies to compare (paper 2, section 4).
//!
//! A path uses some dimensions (two for the pixel, two for the lens, one for the time, two for the light, two for the lobe),
//! and a sampler says where in [0, 1) the sample of a number lies in each of them. Nothing depends on anything but pixel,
//! number, dimension and seed: a scene and a camera that stand still give the same samples in every frame.
//!
//! | module | what it holds |
//! | --- | --- |
//! | [`sudoku`] | the table of paper 2's figure 14, and the patterns made from it |
//! | [`hammersley`] | the 256 points of Hammersley, dealt out well and badly |
//! | [`sobol`] | the sequence of Sobol', scrambled after Owen |
//! | [`trial`] | how well strategies integrate |
//!
//! Coordinates are fixed-point numbers, 2^32 to one, so that they are the same on every device.

pub mod hammersley;
pub mod sobol;
pub mod sudoku;
pub mod trial;

use crate::oracle::random::{hash_combine, hash_uint};
use crate::shaders;
use crate::{Error, Result};
use std::str::FromStr;

/// Dimensions that a path uses at most.
pub const DIMENSIONS: u32 = 16;

/// Samples of a pattern, and patterns.
pub const SET: usize = 16;

/// Sixteen patterns of sixteen points each, in fixed-point numbers across and down.
pub type Patterns = [[[u32; 2]; SET]; SET];

/// How samples are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Hammersley's points, each pattern from a corner of its own: together they are even, alone they are not.
    HammersleyUncooperative,
    /// A point at random in each of 4 × 4 cells, each pattern for itself.
    Jittered,
    /// Patterns of different sudokus.
    SudokuIndependent,
    /// The sixteen patterns of one sudoku, which make a lattice together.
    Sudoku,
    /// The same, moved so that together no two share a row or column of 256.
    SudokuLatin,
    /// Hammersley's points, each pattern with one of each corner.
    Hammersley,
    /// One sequence of Sobol' over all pixels and dimensions, scrambled after Owen.
    Sobol,
    /// Independent random numbers, to compare with.
    Random,
}

/// Which pixel has which pattern.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
pub enum Tiling {
    /// In 4 × 4 pixels each pattern once, in order.
    #[serde(rename = "4x4")]
    Regular,
    /// In 16 × 16 pixels as the numbers of the sudoku (paper 2, section 4.2).
    #[serde(rename = "sudoku16")]
    Sudoku,
}

impl Strategy {
    /// All of them, those of the paper's figure 16 first and in its order.
    pub const ALL: [Self; 8] = [
        Self::HammersleyUncooperative,
        Self::Jittered,
        Self::SudokuIndependent,
        Self::Sudoku,
        Self::SudokuLatin,
        Self::Hammersley,
        Self::Sobol,
        Self::Random,
    ];

    /// As the settings file spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::HammersleyUncooperative => "hammersley-uncooperative",
            Self::Jittered => "jittered",
            Self::SudokuIndependent => "sudoku-independent",
            Self::Sudoku => "sudoku",
            Self::SudokuLatin => "sudoku-latin",
            Self::Hammersley => "hammersley",
            Self::Sobol => "sobol",
            Self::Random => "random",
        }
    }

    /// Bits of a coordinate that the pattern decides. Those below are the middle of a cell, and with a seed anywhere in it.
    const fn digits(self) -> u32 {
        match self {
            Self::Jittered => 2,
            Self::SudokuIndependent | Self::Sudoku => 4,
            Self::HammersleyUncooperative => 6,
            Self::SudokuLatin | Self::Hammersley => 8,
            Self::Sobol | Self::Random => 32,
        }
    }

    /// Its patterns; none for those that are not made of patterns.
    fn patterns(self) -> Option<Patterns> {
        match self {
            Self::HammersleyUncooperative => Some(hammersley::uncooperative()),
            Self::Hammersley => Some(hammersley::cooperative()),
            Self::Jittered => Some(jittered()),
            Self::SudokuIndependent => Some(sudoku::independent()),
            Self::Sudoku => Some(sudoku::cooperative()),
            Self::SudokuLatin => Some(sudoku::latin()),
            Self::Sobol | Self::Random => None,
        }
    }
}

impl FromStr for Strategy {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|s| s.name() == name).ok_or_else(|| Error::Setting {
            name: "sampler",
            value: name.to_owned(),
            expected: format!("one of {}", Self::ALL.map(Self::name).join(", ")),
        })
    }
}

impl Tiling {
    /// Both of them.
    pub const ALL: [Self; 2] = [Self::Regular, Self::Sudoku];

    /// As the settings file spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Regular => "4x4",
            Self::Sudoku => "sudoku16",
        }
    }

    /// The pattern of a pixel, below 16.
    pub fn pattern(self, [x, y]: [u32; 2]) -> usize {
        match self {
            Self::Regular => (y % 4 * 4 + x % 4) as usize,
            Self::Sudoku => usize::from(sudoku::SOLUTION[(y % 16) as usize][(x % 16) as usize]),
        }
    }
}

/// Says where samples lie.
#[derive(Debug, Clone)]
pub struct Sampler {
    strategy: Strategy,
    tiling: Tiling,
    /// Log2 of the samples a pixel, rounded up.
    log_count: u32,
    seed: u32,
    /// Of every pair of dimensions; none for strategies that are not made of patterns.
    pairs: Vec<Patterns>,
}

impl Sampler {
    /// For `count` samples a pixel, at least 1. `seed` 0 leaves patterns as the paper has them. With others, cells change places
    /// digit by digit, which keeps what is even about a pattern, and a sample lies anywhere in its cell ("randomized for
    /// applications that demand unbiased solutions", paper 2, section 2).
    pub fn new(strategy: Strategy, tiling: Tiling, count: u32, seed: u32) -> Self {
        let log_count = count.max(1).next_power_of_two().trailing_zeros();
        let pairs = strategy.patterns().map(|p| (0..DIMENSIONS / 2).map(|pair| assembled(&p, pair)).collect());
        Self { strategy, tiling, log_count, seed, pairs: pairs.unwrap_or_default() }
    }

    /// Where sample `index` of a pixel lies in a dimension below [`DIMENSIONS`].
    pub fn coordinate(&self, pixel: [u32; 2], index: u32, dimension: u32) -> u32 {
        let dimension = dimension % DIMENSIONS;
        match (self.pairs.get(dimension as usize / 2), self.strategy) {
            (Some(patterns), _) => self.of_pattern(patterns, pixel, index, dimension),
            (None, Strategy::Sobol) => self.of_sequence(pixel, index, dimension),
            (None, _) => [pixel[0], pixel[1], index, dimension].into_iter().fold(hash_uint(self.seed), hash_combine),
        }
    }

    /// The same in [0, 1).
    pub fn unit(&self, pixel: [u32; 2], index: u32, dimension: u32) -> f32 {
        crate::oracle::random::unit_float(self.coordinate(pixel, index, dimension))
    }

    /// What a shader needs to say the same (`glsl/include/sampler.glsl`), in words.
    pub fn table(&self) -> Vec<u32> {
        let kind = match self.strategy {
            Strategy::Sobol => shaders::SAMPLER_SEQUENCE,
            Strategy::Random => shaders::SAMPLER_RANDOM,
            _ => shaders::SAMPLER_PATTERNS,
        };
        let mut table = vec![0; shaders::SAMPLER_POINTS as usize];
        table[shaders::SAMPLER_KIND as usize] = kind;
        table[shaders::SAMPLER_DIGITS as usize] = self.strategy.digits();
        table[shaders::SAMPLER_LOG_COUNT as usize] = self.log_count;
        table[shaders::SAMPLER_SEED as usize] = self.seed;
        for i in 0..256 {
            let pattern = self.tiling.pattern([i % 16, i / 16]) as u32;
            table[(shaders::SAMPLER_TILE + i / 4) as usize] |= pattern << (8 * (i % 4));
        }
        let directions = sobol::DIRECTIONS.iter().flatten();
        table[shaders::SAMPLER_DIRECTIONS as usize..].iter_mut().zip(directions).for_each(|(word, d)| *word = *d);
        table.extend(self.pairs.iter().flatten().flatten().flatten());
        table
    }

    /// After sixteen samples a pixel goes on with the next pattern; after all 256 with another copy of them.
    fn of_pattern(&self, patterns: &Patterns, pixel: [u32; 2], index: u32, dimension: u32) -> u32 {
        let round = index as usize / SET;
        let pattern = (self.tiling.pattern(pixel) + round) % SET;
        let sample = index as usize % SET;
        let at = patterns[pattern][sample][dimension as usize % 2];
        if self.seed == 0 && round < SET {
            return at;
        }
        let copy = hash_combine(hash_combine(self.seed, (round / SET) as u32), dimension);
        let inside = hash_combine(hash_combine(copy, round as u32), (pattern * SET + sample) as u32);
        let cells = u32::MAX << (32 - self.strategy.digits());
        ((at ^ copy) & cells) | (inside & !cells)
    }

    /// Pixels in Morton order of blocks of 256 × 256 share out one sequence: what is near in the picture is near in it, and
    /// every aligned run of it is even. What comes after the count a pixel has another scrambling.
    fn of_sequence(&self, [x, y]: [u32; 2], index: u32, dimension: u32) -> u32 {
        let block = hash_combine(hash_combine(self.seed, x >> 8), y >> 8);
        let round = hash_combine(block, index >> self.log_count);
        let place = morton(x & 255, y & 255);
        let number = (place << self.log_count) | (index & ((1 << self.log_count) - 1));
        sobol::scrambled(number, dimension, round)
    }
}

const PAIRS: u32 = 0x5bd1_e995;
const ORDERS: u32 = 0x2545_f491;

/// The patterns of a pair of dimensions. But for the first pair, the one of the pixel, patterns change places, and in all pairs
/// the samples of each do, so that pairs are independent of each other (paper 2, section 2: "use a permutation to assemble
/// those into a set of nine-dimensional samples"). Both are the same for all pixels, so that they still cooperate.
///
/// The paper has sixteen samples a pixel always. With fewer, the first of a pattern should not be all in one corner, nor the
/// first of all patterns. Every pattern has a point in each of 4 × 4 cells: sample s of pattern p is the one in the (s xor p)-th,
/// so that the s-th samples of sixteen pixels are in sixteen cells.
fn assembled(patterns: &Patterns, pair: u32) -> Patterns {
    let of_pixels = permutation(SET, hash_combine(PAIRS, pair));
    let cells = permutation(SET, hash_combine(ORDERS, pair));
    std::array::from_fn(|own| {
        let pattern = if pair == 0 { own } else { of_pixels[own] };
        let mut points = patterns[pattern];
        points.sort_unstable_by_key(|[x, y]| (y >> 30, x >> 30));
        std::array::from_fn(|sample| points[cells[sample ^ pattern]])
    })
}

/// The numbers below `count` in an order that a hash chooses (Fisher and Yates).
fn permutation(count: usize, seed: u32) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    let mut h = seed;
    for last in (1..count).rev() {
        h = hash_uint(h);
        order.swap(last, h as usize % (last + 1));
    }
    order
}

/// The bits of two numbers below 2^16 in turns, those of `x` first.
fn morton(x: u32, y: u32) -> u32 {
    let spread = |n: u32| (0..16).map(|i| (n >> i & 1) << (2 * i)).sum::<u32>();
    spread(x) | spread(y) << 1
}

/// A point at random in each of 4 × 4 cells.
fn jittered() -> Patterns {
    std::array::from_fn(|pattern| {
        std::array::from_fn(|sample| {
            let h = hash_combine(hash_combine(ORDERS, pattern as u32), sample as u32);
            let cell = [sample as u32 % 4, sample as u32 / 4];
            [0, 1].map(|axis| cell[axis] << 30 | hash_combine(h, axis as u32) >> 2)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samplers() -> impl Iterator<Item = Sampler> {
        Strategy::ALL.into_iter().flat_map(|s| Tiling::ALL.map(move |t| Sampler::new(s, t, 16, 0)))
    }

    /// The points of a pixel in a pair of dimensions.
    fn points(sampler: &Sampler, pixel: [u32; 2], pair: u32, count: u32) -> Vec<[u32; 2]> {
        (0..count).map(|i| [0, 1].map(|axis| sampler.coordinate(pixel, i, 2 * pair + axis))).collect()
    }

    /// How many of the cells of a grid of so many bits across and down hold exactly one point.
    fn single(points: &[[u32; 2]], [across, down]: [u32; 2]) -> usize {
        let mut cells = vec![0; 1 << (across + down)];
        let top = |x: u32, bits: u32| if bits == 0 { 0 } else { (x >> (32 - bits)) as usize };
        points.iter().for_each(|[x, y]| cells[top(*y, down) << across | top(*x, across)] += 1);
        cells.into_iter().filter(|count| *count == 1).count()
    }

    #[test]
    fn every_pixel_has_a_point_in_each_cell_row_and_column() {
        for sampler in samplers() {
            for pair in 0..4 {
                for pixel in [[0, 0], [3, 1], [17, 250]] {
                    let points = points(&sampler, pixel, pair, 16);
                    let even = |shape| single(&points, shape) == 16;
                    let [cells, rows, columns] = [even([2, 2]), even([0, 4]), even([4, 0])];
                    let (cells_wanted, lines_wanted) = match sampler.strategy {
                        Strategy::Random => continue,
                        Strategy::Jittered => (true, false),
                        // Even only in the pairs that go together in the sequence: the first two dimensions do.
                        Strategy::Sobol => (pair == 0, true),
                        _ => (true, true),
                    };
                    let name = sampler.strategy.name();
                    assert!(cells || !cells_wanted, "{name}, pair {pair}");
                    assert!(rows && columns || !lines_wanted, "{name}, pair {pair}");
                }
            }
        }
    }

    #[test]
    fn pixels_cooperate_where_they_should() {
        for strategy in Strategy::ALL {
            let sampler = Sampler::new(strategy, Tiling::Regular, 16, 0);
            for pair in 0..3 {
                let window = (0..16).map(|i| [4 + i % 4, 8 + i / 4]);
                let all: Vec<[u32; 2]> = window.flat_map(|pixel| points(&sampler, pixel, pair, 16)).collect();
                let lattice = single(&all, [4, 4]);
                let lines = single(&all, [8, 0]).min(single(&all, [0, 8]));
                match strategy {
                    Strategy::Sudoku => assert_eq!(lattice, 256),
                    Strategy::SudokuLatin | Strategy::HammersleyUncooperative | Strategy::Hammersley => {
                        let wanted = strategy != Strategy::HammersleyUncooperative;
                        assert_eq!((lattice, lines) == (256, 256), wanted, "{}", strategy.name());
                    }
                    Strategy::Sobol => assert!(pair > 0 && lines == 256 || (lattice, lines) == (256, 256)),
                    // Of 256 points at random, 94 are alone in one of 256 cells; these are somewhat more even.
                    _ => assert!(lattice < 200, "{} {lattice}", strategy.name()),
                }
            }
        }
    }

    /// Also with fewer samples than the paper's: the first of sixteen pixels are in sixteen cells.
    #[test]
    fn the_first_samples_cooperate() {
        for strategy in Strategy::ALL.into_iter().filter(|s| *s != Strategy::Random) {
            let sampler = Sampler::new(strategy, Tiling::Sudoku, 1, 0);
            for pair in 0..4 {
                let window = (0..16).map(|i| [8 + i % 4, 20 + i / 4]);
                let all: Vec<[u32; 2]> = window.flat_map(|pixel| points(&sampler, pixel, pair, 1)).collect();
                let even = single(&all, [2, 2]) == 16;
                assert!(even || strategy == Strategy::Sobol && pair > 0, "{} {pair}", strategy.name());
            }
        }
    }

    #[test]
    fn tilings_use_every_pattern_as_often() {
        for tiling in Tiling::ALL {
            let mut uses = [0; SET];
            (0..256).for_each(|i| uses[tiling.pattern([i % 16, i / 16])] += 1);
            assert_eq!(uses, [16; SET]);
            // Sixteen pixels from a corner of the tile on have each once.
            let mut corner: Vec<usize> = (0..16).map(|i| tiling.pattern([4 + i % 4, 12 + i / 4])).collect();
            corner.sort_unstable();
            assert_eq!(corner, (0..16).collect::<Vec<_>>());
        }
        assert_ne!(Tiling::Sudoku.pattern([0, 0]), Tiling::Sudoku.pattern([4, 0]));
    }

    /// Chi-squared over 64 cells of each dimension, over independent seeds, one sample each: 63 degrees of freedom; 120 is
    /// beyond all but 2e-5.
    #[test]
    fn every_dimension_is_uniform() {
        for strategy in Strategy::ALL {
            let mut cells = vec![[0_u32; 64]; 9];
            for seed in 1..=4096 {
                let sampler = Sampler::new(strategy, Tiling::Sudoku, 16, seed);
                for (dimension, cells) in cells.iter_mut().enumerate() {
                    let at = sampler.coordinate([seed % 19, seed % 23], seed % 64, dimension as u32);
                    cells[(at >> 26) as usize] += 1;
                }
            }
            for (dimension, cells) in cells.iter().enumerate() {
                let chi: f64 = cells.iter().map(|c| (f64::from(*c) - 64.0).powi(2) / 64.0).sum();
                assert!(chi < 120.0, "{}, dimension {dimension}: {chi}", strategy.name());
            }
        }
    }

    /// L2 star discrepancy in the unit square (Warnock 1972).
    fn discrepancy(points: &[[u32; 2]]) -> f64 {
        let n = points.len() as f64;
        let points: Vec<[f64; 2]> = points.iter().map(|p| p.map(|x| f64::from(x) / 4_294_967_296.0)).collect();
        let singles: f64 = points.iter().map(|[x, y]| (1.0 - x * x) * (1.0 - y * y)).sum();
        let product = |a: &[f64; 2], b: &[f64; 2]| (1.0 - a[0].max(b[0])) * (1.0 - a[1].max(b[1]));
        let pairs: f64 = points.iter().flat_map(|a| points.iter().map(move |b| product(a, b))).sum();
        (1.0 / 9.0 - singles / (2.0 * n) + pairs / (n * n)).max(0.0).sqrt()
    }

    /// Independent points have a mean squared discrepancy of (1/4 - 1/9) / n. Strata lower it: those of a pixel, and for
    /// strategies that cooperate those of sixteen pixels together; the one that does not is worse there than chance, or as bad.
    #[test]
    fn discrepancies_are_below_those_of_chance() {
        let chance = |n: f64| ((0.25 - 1.0 / 9.0) / n).sqrt();
        for strategy in Strategy::ALL {
            let of = |count: u32, window: u32| -> f64 {
                let seeds = 1..=8;
                let squares = seeds.map(|seed| {
                    let sampler = Sampler::new(strategy, Tiling::Regular, count, seed);
                    let pixels = (0..window * window).map(|i| [8 + i % window, 16 + i / window]);
                    let all: Vec<[u32; 2]> = pixels.flat_map(|p| points(&sampler, p, 3, count)).collect();
                    discrepancy(&all).powi(2)
                });
                (squares.sum::<f64>() / 8.0).sqrt()
            };
            let [alone, together] = [of(16, 1) / chance(16.0), of(16, 4) / chance(256.0)];
            let name = strategy.name();
            match strategy {
                // The mean of eight squares is within a factor of three of its expectation, almost always.
                Strategy::Random => assert!((0.55..1.8).contains(&alone) && (0.55..1.8).contains(&together), "{name}"),
                Strategy::HammersleyUncooperative => assert!(alone < 0.7, "{name} {alone}"),
                _ => assert!(alone < 0.8 && together < 0.8, "{name} {alone} {together}"),
            }
            let cooperates =
                matches!(strategy, Strategy::Sudoku | Strategy::SudokuLatin | Strategy::Hammersley | Strategy::Sobol);
            assert!(!cooperates || together < 0.4, "{name} {together}");
        }
    }

    #[test]
    fn samples_stand_still_and_seeds_move_them() {
        for sampler in samplers() {
            let again = Sampler::new(sampler.strategy, sampler.tiling, 16, 0);
            let other = Sampler::new(sampler.strategy, sampler.tiling, 16, 1);
            let all = |s: &Sampler| (0..9).map(|d| s.coordinate([5, 6], 7, d)).collect::<Vec<_>>();
            assert_eq!(all(&sampler), all(&again));
            assert_ne!(all(&sampler), all(&other), "{}", sampler.strategy.name());
            // Nor are later samples copies of earlier ones.
            let values: std::collections::BTreeSet<[u32; 2]> = points(&sampler, [5, 6], 2, 1024).into_iter().collect();
            assert!(values.len() > 512, "{} {}", sampler.strategy.name(), values.len());
        }
    }

    #[test]
    fn names_are_read_back() {
        assert!(Strategy::ALL.into_iter().all(|s| s.name().parse::<Strategy>().is_ok_and(|t| t == s)));
        assert!("halton".parse::<Strategy>().unwrap_err().to_string().contains("sudoku-latin"));
    }
}
