//! What paths bring goes into the means of their samples. Twin of `glsl/accumulate.comp` and `glsl/include/mean.glsl`, in f32
//! and in the shader's order.

use crate::shaders::{FRAME_LIT_ALIKE, Frame, Gathered, NO_SOURCE};

/// That a mean counts for at most.
pub const MEAN_COUNT: u32 = 0xffff;
/// Of a path, in any channel.
pub const BROUGHT_MAX: f32 = 1e30;

/// What a path may bring: finite, and at most `most` in any channel, of the same colour; 0: no limit.
pub fn within_limit(brought: [f32; 3], most: f32) -> [f32; 3] {
    let finite = brought.map(|x| if x.is_nan() { 0.0 } else { x.clamp(0.0, BROUGHT_MAX) });
    let brightest = finite.into_iter().fold(0.0, f32::max);
    if most > 0.0 && brightest > most { finite.map(|x| x * (most / brightest)) } else { finite }
}

/// With one path more: the mean of all if light falls `alike` for long, else with a weight of `alpha` at least.
pub fn with_path(g: Gathered, brought: [f32; 3], alike: bool, alpha: f32, count: u32) -> Gathered {
    let before = g.paths & MEAN_COUNT;
    let equal = 1.0 / (before + 1) as f32;
    let weight = if alike { equal } else { alpha.max(equal) };
    let radiance = [0, 1, 2].map(|i| g.radiance[i] + weight * (brought[i] - g.radiance[i]));
    let counts = (before + 1).min(if alike { MEAN_COUNT } else { count });
    Gathered { radiance, paths: counts | (g.paths & 0xffff_0000).wrapping_add(0x1_0000) }
}

/// What a sample has gathered, and what that adds to its colour. `started` says what its surface scatters, and whether there is
/// a path; `brought` what that brings, and the sample's number in the last frame.
pub fn accumulate(
    frame: &Frame,
    previous: Option<&[Gathered]>,
    started: Gathered,
    brought: [u32; 4],
) -> (Gathered, [f32; 3]) {
    let nothing = Gathered { radiance: [0.0; 3], paths: 0 };
    let source = previous.filter(|_| brought[3] != NO_SOURCE);
    let before = source.map_or(nothing, |list| list[brought[3] as usize]);
    if started.paths == 0 {
        return (before, [0.0; 3]);
    }
    let [r, g, b, _] = brought.map(f32::from_bits);
    let light = within_limit([r, g, b], frame.indirect_clamp);
    let alike = frame.flags & FRAME_LIT_ALIKE != 0;
    let mean = with_path(before, light, alike, frame.indirect_alpha, frame.indirect_count);
    (mean, [0, 1, 2].map(|i| started.radiance[i] * mean.radiance[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Gathered = Gathered { radiance: [0.0; 3], paths: 0 };

    #[test]
    fn alike_it_is_the_mean_of_all() {
        let values: Vec<f32> = (0..1000_u32).map(|i| (i * 7919 % 1000) as f32).collect();
        let all = values.iter().fold(NONE, |g, x| with_path(g, [*x; 3], true, 0.1, 19));
        // Each step rounds thrice at up to 1000, and later ones forget: within the sum of 1/n, 7.5, times that.
        assert!((all.radiance[0] - 499.5).abs() < 7.5 * 3.0 * 1000.0 / 16_777_216.0, "{:?}", all.radiance);
        assert_eq!(all.paths, 1000 | 1000 << 16);
        let other = values.iter().fold(NONE, |g, x| with_path(g, [*x; 3], false, 0.1, 19));
        assert!((other.radiance[0] - 499.5).abs() > 1.0);
        assert_eq!(other.paths, 19 | 1000 << 16);
    }

    #[test]
    fn else_a_step_is_followed_exponentially() {
        let mut g = Gathered { radiance: [1.0; 3], paths: 500 | 500 << 16 };
        for frame in 1..100 {
            g = with_path(g, [0.0; 3], false, 0.1, 19);
            let expected = 0.9_f64.powi(frame);
            assert!((f64::from(g.radiance[0]) - expected).abs() < 4.0 * f64::from(frame) * expected / 16_777_216.0);
        }
    }

    #[test]
    fn numbers_of_paths_turn_over_and_counts_stay() {
        let full = Gathered { radiance: [1.0; 3], paths: MEAN_COUNT | 0xffff_0000 };
        assert_eq!(with_path(full, [1.0; 3], true, 0.1, 19).paths, MEAN_COUNT);
    }

    #[test]
    fn limits_keep_the_colour_and_numbers_are_finite() {
        assert_eq!(within_limit([8.0, 4.0, 0.0], 2.0), [2.0, 1.0, 0.0]);
        assert_eq!(within_limit([1.0, 0.5, 0.0], 2.0), [1.0, 0.5, 0.0]);
        assert_eq!(within_limit([f32::NAN, f32::INFINITY, -1.0], 0.0), [0.0, BROUGHT_MAX, 0.0]);
    }
}
