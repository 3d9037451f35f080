//! Patterns from sudokus (paper 2, section 4.1): the places of a number are in no row, column or block twice.

use super::{Patterns, SET, permutation};
use crate::oracle::random::{hash_combine, hash_uint};

/// Paper 2, figure 14: numbers of 16 × 16 places, row by row.
pub const SOLUTION: [[u8; SET]; SET] = [
    [9, 1, 3, 8, 13, 14, 10, 11, 2, 15, 12, 0, 5, 7, 6, 4],
    [11, 6, 5, 15, 3, 9, 2, 8, 10, 1, 4, 7, 14, 13, 0, 12],
    [0, 12, 14, 10, 7, 4, 6, 1, 5, 3, 9, 13, 15, 2, 8, 11],
    [2, 13, 4, 7, 12, 0, 15, 5, 14, 6, 8, 11, 1, 3, 10, 9],
    [10, 5, 2, 12, 15, 8, 11, 9, 4, 13, 6, 14, 7, 0, 1, 3],
    [7, 0, 9, 3, 5, 6, 13, 14, 1, 2, 10, 15, 11, 12, 4, 8],
    [8, 14, 11, 6, 1, 2, 3, 4, 9, 0, 7, 12, 13, 10, 15, 5],
    [4, 15, 13, 1, 0, 12, 7, 10, 3, 5, 11, 8, 2, 6, 9, 14],
    [6, 8, 0, 9, 10, 11, 4, 13, 7, 14, 15, 3, 12, 5, 2, 1],
    [12, 3, 15, 13, 2, 1, 14, 6, 0, 4, 5, 10, 8, 9, 11, 7],
    [5, 7, 1, 2, 8, 15, 12, 3, 11, 9, 13, 6, 0, 4, 14, 10],
    [14, 4, 10, 11, 9, 5, 0, 7, 8, 12, 1, 2, 6, 15, 3, 13],
    [1, 2, 7, 5, 14, 13, 8, 0, 15, 10, 3, 9, 4, 11, 12, 6],
    [15, 9, 8, 4, 6, 10, 5, 12, 13, 11, 0, 1, 3, 14, 7, 2],
    [13, 10, 6, 14, 11, 3, 1, 15, 12, 7, 2, 4, 9, 8, 5, 0],
    [3, 11, 12, 0, 4, 7, 9, 2, 6, 8, 14, 5, 10, 1, 13, 15],
];

type Solution = [[u8; SET]; SET];

/// The places of each number, row by row, in the middles of their cells: together a lattice of 256 points.
pub fn cooperative() -> Patterns {
    std::array::from_fn(|number| places(&SOLUTION, number as u8).map(|place| place.map(|at| middle(at, 4))))
}

/// The same, moved inside the cells so that together no two points share one of 256 rows or columns: a point's place among
/// those of its column says where across it lies, and the other way round.
pub fn latin() -> Patterns {
    let fine = |[x, y]: [u32; 2]| [middle(x * 16 + y, 8), middle(y * 16 + x, 8)];
    std::array::from_fn(|number| places(&SOLUTION, number as u8).map(fine))
}

/// Pattern k of the k-th of sixteen different sudokus, in the middles of their cells.
pub fn independent() -> Patterns {
    std::array::from_fn(|number| {
        let other = shuffled(hash_uint(number as u32));
        places(&other, number as u8).map(|place| place.map(|at| middle(at, 4)))
    })
}

/// Across and down, row by row.
fn places(solution: &Solution, number: u8) -> [[u32; 2]; SET] {
    let column = |row: &[u8; SET]| row.iter().position(|n| *n == number).unwrap_or_default() as u32;
    std::array::from_fn(|y| [column(&solution[y]), y as u32])
}

/// The middle of cell `at` of 2^bits, as a fixed-point number.
fn middle(at: u32, bits: u32) -> u32 {
    at << (32 - bits) | 1 << (31 - bits)
}

/// Another sudoku: numbers renamed, rows exchanged inside their bands and bands with each other, and columns likewise.
fn shuffled(seed: u32) -> Solution {
    let names = permutation(SET, hash_combine(seed, 0));
    let rows = lines(hash_combine(seed, 1));
    let columns = lines(hash_combine(seed, 2));
    std::array::from_fn(|y| std::array::from_fn(|x| names[usize::from(SOLUTION[rows[y]][columns[x]])] as u8))
}

/// Sixteen rows, four of each band together.
fn lines(seed: u32) -> Vec<usize> {
    let inside =
        |band: usize| permutation(4, hash_combine(seed, 1 + band as u32)).into_iter().map(move |i| 4 * band + i);
    permutation(4, seed).into_iter().flat_map(inside).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn is_sudoku(solution: &Solution) -> bool {
        let complete = |numbers: Vec<u8>| numbers.into_iter().collect::<BTreeSet<_>>() == (0..16).collect();
        (0..16).all(|i| {
            let block = (0..16).map(|j| solution[i / 4 * 4 + j / 4][i % 4 * 4 + j % 4]);
            complete(solution[i].to_vec())
                && complete(solution.iter().map(|r| r[i]).collect())
                && complete(block.collect())
        })
    }

    #[test]
    fn the_table_is_a_sudoku_and_so_are_those_made_of_it() {
        assert!(is_sudoku(&SOLUTION));
        let others: BTreeSet<Solution> = (0..16).map(|i| shuffled(hash_uint(i))).collect();
        assert!(others.len() == 16 && others.iter().all(is_sudoku) && !others.contains(&SOLUTION));
        // Negative control: two numbers exchanged.
        let mut wrong = SOLUTION;
        wrong[0].swap(0, 1);
        assert!(!is_sudoku(&wrong));
    }
}
