//! From scene-linear light to display values.

/// Scene-linear RGB (Rec. 709 primaries) to 8-bit sRGB. `exposure` is in stops: 1 doubles the light first.
pub fn display(rgb: [f32; 3], exposure: f32) -> [u8; 3] {
    rgb.map(|c| encode((c * exposure.exp2()).clamp(0.0, 1.0)))
}

/// IEC 61966-2-1's curve, of a value from 0 to 1.
fn encode(linear: f32) -> u8 {
    let curve = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (curve * 255.0).round() as u8
}
