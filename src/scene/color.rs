//! The sRGB transfer functions (IEC 61966-2-1), which images are encoded with.

/// Linear value, 0..=1, of an sRGB-encoded one. Values outside 0..=1 are taken as the nearer end; NaN as 0.
pub fn srgb_to_linear(encoded: f64) -> f64 {
    let x = if encoded.is_nan() { 0.0 } else { encoded.clamp(0.0, 1.0) };
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// sRGB-encoded value, 0..=1, of a linear one. Values outside 0..=1 are taken as the nearer end; NaN as 0.
pub fn linear_to_srgb(linear: f64) -> f64 {
    let x = if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) };
    if x <= 0.003_130_8 { x * 12.92 } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_survive_the_round_trip() {
        for code in 0..=255_u32 {
            let encoded = linear_to_srgb(srgb_to_linear(f64::from(code) / 255.0)) * 255.0;
            // The published constants leave a step of 3e-8 where the two pieces meet; elsewhere only rounding is lost.
            assert!((encoded - f64::from(code)).abs() < 1e-4, "{code}: {encoded}");
        }
    }

    #[test]
    fn ends_and_what_is_outside() {
        assert_eq!((srgb_to_linear(0.0), srgb_to_linear(1.0)), (0.0, 1.0));
        assert_eq!((linear_to_srgb(-1.0), linear_to_srgb(f64::NAN)), (0.0, 0.0));
        // 1.055 - 0.055 rounds to one unit below 1.
        assert!((linear_to_srgb(f64::INFINITY) - 1.0).abs() <= f64::EPSILON);
        assert_eq!(srgb_to_linear(f64::NAN), 0.0);
    }
}
