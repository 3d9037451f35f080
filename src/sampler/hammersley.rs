//! The 256 points of Hammersley, (k / 256, the bits of k reversed), dealt out to sixteen patterns (paper 2, section 4.2).

use super::{Patterns, SET};

/// Point k, in fixed-point numbers, in the middle of its column and row.
fn point(k: u32) -> [u32; 2] {
    let middle = 1 << 23;
    [k << 24 | middle, (k.reverse_bits() & 0xff00_0000) | middle]
}

/// The points of each of 4 × 4 cells, in order.
fn cells() -> [[[u32; 2]; SET]; SET] {
    let mut filled = [0; SET];
    let mut cells = [[[0; 2]; SET]; SET];
    for [x, y] in (0..256).map(point) {
        let cell = (y >> 30 << 2 | x >> 30) as usize;
        cells[cell][filled[cell]] = [x, y];
        filled[cell] += 1;
    }
    cells
}

/// Each pattern is a cell, magnified.
pub fn uncooperative() -> Patterns {
    cells().map(|cell| cell.map(|[x, y]| [x << 2, y << 2]))
}

/// Each pattern has one point of each cell. In the same order in all cells, a pattern would be a regular grid; with the order
/// of each cell turned by its place, no two points of a pattern share one of 16 rows or columns.
pub fn cooperative() -> Patterns {
    let cells = cells();
    std::array::from_fn(|pattern| std::array::from_fn(|cell| cells[cell][pattern ^ turned(cell)]))
}

/// Which of its points a cell gives to the first pattern.
fn turned(cell: usize) -> usize {
    let (x, y) = (cell % 4, cell / 4);
    y << 2 | x
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_point_is_dealt_out_once() {
        let all: BTreeSet<[u32; 2]> = (0..256).map(point).collect();
        let dealt: BTreeSet<[u32; 2]> = cooperative().into_iter().flatten().collect();
        assert_eq!((all.len(), dealt), (256, all));
        assert!(cells().iter().flatten().all(|p| *p != [0, 0]), "sixteen points in each cell");
    }
}
