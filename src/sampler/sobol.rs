//! The sequence of Sobol', with primitive polynomials and initial numbers of Joe and Kuo (2008), scrambled after Owen by a
//! hash (Laine and Karras 2011, with the constants of Vegdahl; as a sampler for rendering: Burley 2020).

use crate::oracle::random::{hash_combine, hash_uint};

/// Of dimensions from the second on: degree of the polynomial, its inner coefficients, and the initial numbers.
const POLYNOMIALS: [(u32, u32, &[u32]); 15] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
    (5, 11, &[1, 1, 5, 1, 1]),
    (5, 13, &[1, 1, 1, 3, 11]),
    (5, 14, &[1, 3, 5, 5, 31]),
    (6, 1, &[1, 3, 3, 9, 7, 49]),
    (6, 13, &[1, 1, 1, 15, 21, 21]),
    (6, 16, &[1, 3, 1, 13, 27, 49]),
];

/// Direction numbers of a dimension: what bit i of the index toggles.
pub type Directions = [u32; 32];

/// Direction numbers of all dimensions.
pub static DIRECTIONS: [Directions; super::DIMENSIONS as usize] = all_directions();

const fn all_directions() -> [Directions; super::DIMENSIONS as usize] {
    let mut all = [[0; 32]; super::DIMENSIONS as usize];
    let mut i = 0;
    while i < 32 {
        all[0][i] = 1 << (31 - i);
        i += 1;
    }
    let mut dimension = 1;
    while dimension < all.len() {
        all[dimension] = directions(POLYNOMIALS[dimension - 1]);
        dimension += 1;
    }
    all
}

/// Bratley and Fox (1988).
const fn directions((degree, inner, initial): (u32, u32, &[u32])) -> Directions {
    let mut v = [0; 32];
    let s = degree as usize;
    let mut i = 0;
    while i < 32 {
        if i < s {
            v[i] = initial[i] << (31 - i);
        } else {
            v[i] = v[i - s] ^ (v[i - s] >> s);
            let mut k = 1;
            while k < s {
                v[i] ^= ((inner >> (s - 1 - k)) & 1) * v[i - k];
                k += 1;
            }
        }
        i += 1;
    }
    v
}

/// Point `index` of the sequence in a dimension.
pub fn point(index: u32, dimension: u32) -> u32 {
    let directions = &DIRECTIONS[dimension as usize % DIRECTIONS.len()];
    (0..32).filter(|i| index >> i & 1 != 0).fold(0, |x, i| x ^ directions[i as usize])
}

/// Point `index` of a sequence that a seed chooses: the order is shuffled such that aligned runs of 2^k stay such runs, and
/// every dimension is scrambled by itself.
pub fn scrambled(index: u32, dimension: u32, seed: u32) -> u32 {
    scramble(point(scramble(index, hash_uint(seed)), dimension), hash_combine(seed, dimension))
}

/// Nested uniform scrambling (Owen 1995): every bit is turned or not by a hash of those above.
pub fn scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polynomial over two elements, bit i the coefficient of x^i, is primitive if x has the order 2^degree - 1.
    fn is_primitive(polynomial: u32, degree: u32) -> bool {
        let step = |x: u32| if x >> (degree - 1) & 1 != 0 { x << 1 ^ polynomial } else { x << 1 };
        let mut x = 1;
        for order in 1..(1_u32 << degree) {
            x = step(x);
            if x == 1 {
                return order == (1 << degree) - 1;
            }
        }
        false
    }

    #[test]
    fn polynomials_are_primitive_and_different() {
        let mut seen = std::collections::BTreeSet::new();
        for (degree, inner, initial) in POLYNOMIALS {
            let polynomial = 1 << degree | inner << 1 | 1;
            assert!(is_primitive(polynomial, degree), "{polynomial:b}");
            assert!(seen.insert(polynomial));
            assert_eq!(initial.len(), degree as usize);
            assert!(initial.iter().zip(1..).all(|(m, i)| m % 2 == 1 && *m < 1 << i), "{initial:?}");
        }
        assert!(!is_primitive(0b11111, 4), "x^4 + x^3 + x^2 + x + 1 divides x^5 - 1");
    }

    #[test]
    fn the_first_points_are_the_published_ones() {
        let halves = |index: u32| (0..3).map(|d| f64::from(point(index, d)) / 4_294_967_296.0).collect::<Vec<_>>();
        assert_eq!(halves(1), [0.5, 0.5, 0.5]);
        assert_eq!(halves(2), [0.25, 0.75, 0.75]);
        assert_eq!(halves(3), [0.75, 0.25, 0.25]);
    }

    /// Every aligned run of 2^k points has one in each of 2^k intervals, in every dimension; in the first two dimensions one in
    /// each rectangle of that area, whatever its shape (a (0, 2)-sequence in base 2).
    #[test]
    fn runs_are_even_also_when_scrambled() {
        let check = |of: &dyn Fn(u32, u32) -> u32| {
            for (bits, start) in [(4_u32, 0_u32), (4, 16 * 13), (8, 0), (8, 256 * 5)] {
                for down in 0..=bits {
                    let across = bits - down;
                    let mut seen = std::collections::BTreeSet::new();
                    let top = |x: u32, n: u32| if n == 0 { 0 } else { x >> (32 - n) };
                    (start..start + (1 << bits)).for_each(|i| {
                        seen.insert((top(of(i, 0), across), top(of(i, 1), down)));
                    });
                    assert_eq!(seen.len(), 1 << bits);
                }
                for dimension in 0..super::super::DIMENSIONS {
                    let seen: std::collections::BTreeSet<u32> =
                        (start..start + (1 << bits)).map(|i| of(i, dimension) >> (32 - bits)).collect();
                    assert_eq!(seen.len(), 1 << bits, "{dimension}");
                }
            }
        };
        check(&point);
        check(&|i, d| scrambled(i, d, 77));
    }

    #[test]
    fn scrambling_is_nested_and_reaches_every_bit() {
        // Numbers that agree in the top bits do so afterwards, and differ in the next one if they did.
        for (i, bits) in (0..32).enumerate() {
            let x = hash_uint(i as u32);
            let y = x ^ (0x8000_0000 >> bits) ^ (hash_uint(x) & (0x7fff_ffff >> bits));
            for seed in 0..50 {
                let differing = scramble(x, hash_uint(seed)) ^ scramble(y, hash_uint(seed));
                assert_eq!(differing.leading_zeros(), bits);
            }
        }
        // Whether a bit is turned is a coin's throw: 4000 throws are within six standard deviations of their half.
        for bit in 0..32 {
            let turned = (0..4000).filter(|i| {
                let x = hash_uint(*i);
                (scramble(x, hash_uint(i ^ 0x55)) ^ x) >> bit & 1 != 0
            });
            let count = turned.count() as f64;
            assert!((count - 2000.0).abs() < 6.0 * 1000_f64.sqrt(), "{bit} {count}");
        }
    }
}
