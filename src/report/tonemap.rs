//! From scene-linear radiance to what a display shows. Twin of `glsl/include/color.glsl`.

use crate::scene::color::linear_to_srgb;

/// Radiance above which colours are compressed, less the 4 % of Fresnel that are subtracted before.
const START: f64 = 0.8 - 0.04;
const DESATURATION: f64 = 0.15;

/// Khronos PBR Neutral (Khronos Group 2024, "PBR Neutral Tone Mapper Specification"): scene-linear RGB to display-linear
/// RGB, 0..=1. Colours up to 0.8 stay as they are, except that the 4 % which a dielectric adds by Fresnel are taken off.
/// Negative channels are taken as 0, those that are not finite as the largest half.
pub fn tone_map(color: [f32; 3]) -> [f64; 3] {
    let color = color.map(|c| if c.is_finite() { f64::from(c).max(0.0) } else { 65504.0 });
    let low = color.into_iter().fold(f64::INFINITY, f64::min);
    let offset = if low < 0.08 { low - 6.25 * low * low } else { 0.04 };
    let color = color.map(|c| c - offset);
    let peak = color.into_iter().fold(0.0, f64::max);
    if peak < START {
        return color;
    }
    let range = 1.0 - START;
    let new_peak = 1.0 - range * range / (peak + range - START);
    let whiten = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    color.map(|c| c * new_peak / peak * (1.0 - whiten) + new_peak * whiten)
}

/// The 8-bit sRGB pixel of a scene-linear colour, tone-mapped and rounded to the nearest code.
pub fn display_pixel(color: [f32; 3]) -> [u8; 3] {
    tone_map(color).map(|c| (linear_to_srgb(c) * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dark_colours_lose_fresnel_and_nothing_else() {
        // 0.04 = 0.08 - 6.25 * 0.08^2: what is subtracted does not jump.
        let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() <= f64::EPSILON);
        assert!(close(tone_map([0.5, 0.25, 0.125]), [0.46, 0.21, 0.085]));
        assert!(close(tone_map([0.5, 0.25, 0.0]), [0.5, 0.25, 0.0]));
        assert!(!close(tone_map([0.9, 0.25, 0.0]), [0.9, 0.25, 0.0]), "compressed");
    }

    #[test]
    fn bright_colours_stay_below_one_and_in_order() {
        let mut last = 0.0;
        for i in 0..2000 {
            let [r, g, b] = tone_map([0.01 * i as f32, 0.004 * i as f32, 0.001 * i as f32]);
            assert!(r >= last && r <= 1.0 && g <= r && b <= g && b >= 0.0);
            // One step of 0.01 cannot change the display by more, since nothing is amplified.
            assert!(r - last < 0.0101, "jump at {i}");
            last = r;
        }
        assert_eq!(display_pixel([65504.0; 3]), [255; 3]);
    }

    #[test]
    fn what_is_no_colour_is_shown_all_the_same() {
        assert_eq!(display_pixel([f32::NAN, f32::INFINITY, 0.0]).len(), 3);
        assert_eq!(display_pixel([-1.0, -f32::MIN_POSITIVE, 0.0]), [0, 0, 0]);
        assert_eq!(display_pixel([f32::INFINITY; 3]), [255; 3]);
    }
}
