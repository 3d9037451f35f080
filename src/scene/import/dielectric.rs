//! What light does inside a material: `KHR_materials_ior`, `KHR_materials_transmission` and `KHR_materials_volume`.

use glam::Vec3;
use gltf::json;

use super::document::Document;
use crate::Result;
use crate::scene::Material;

/// Takes over index, transmission and absorption; the texture of the transmission is for the caller.
///
/// # Errors
/// [`crate::Error::Scene`] for a value out of its range, with the key and the range.
pub(super) fn import(
    document: &Document,
    source: &json::extensions::material::Material,
    place: &str,
    material: &mut Material,
) -> Result<()> {
    let check = |key: &str, value: f32, expected: &str, allowed: bool| {
        let wrong = || document.bad(format!("{place}: {key} is {value}; expected {expected}"));
        if allowed && !value.is_nan() { Ok(value) } else { Err(wrong()) }
    };
    if let Some(ior) = source.ior.as_ref().map(|ior| ior.ior.0) {
        let known = (ior >= 1.0 && ior.is_finite()) || ior == 0.0;
        material.ior = check("KHR_materials_ior.ior", ior, "1 or more, or 0", known)?;
    }
    if let Some(part) = source.transmission.as_ref().map(|t| t.transmission_factor.0) {
        let key = "KHR_materials_transmission.transmissionFactor";
        material.transmission = check(key, part, "0 to 1", (0.0..=1.0).contains(&part))?;
    }
    let Some(volume) = source.volume.as_ref() else { return Ok(()) };
    let (thickness, distance) = (volume.thickness_factor.0, volume.attenuation_distance.0);
    let key = |name: &str| format!("KHR_materials_volume.{name}");
    check(&key("thicknessFactor"), thickness, "0 or more", thickness >= 0.0)?;
    check(&key("attenuationDistance"), distance, "above 0", distance > 0.0)?;
    let color = volume.attenuation_color.0;
    for part in color {
        check(&key("attenuationColor"), part, "0 to 1 in each channel", (0.0..=1.0).contains(&part))?;
    }
    material.volume = (thickness > 0.0).then(|| Vec3::from(color.map(|c| absorption(c, distance))));
    Ok(())
}

/// What absorbs all but so much of the light over a distance: 1/metre. What is black absorbs all but 10^-38.
fn absorption(left: f32, distance: f32) -> f32 {
    let per_metre = -f64::from(left.max(f32::MIN_POSITIVE)).ln() / f64::from(distance);
    per_metre.clamp(0.0, f64::from(f32::MAX)) as f32
}

#[cfg(test)]
mod tests {
    use super::absorption;

    #[test]
    fn absorption_leaves_its_color_after_its_distance() {
        for (left, distance) in [(0.5, 2.0), (0.9, 1e-3), (1.0, 1.0), (0.25, f32::INFINITY)] {
            let rest = (-absorption(left, distance) * distance.min(1e30)).exp();
            let expected = if distance.is_finite() { left } else { 1.0 };
            assert!((rest - expected).abs() < 1e-6, "{left} {distance}: {rest}");
        }
        assert!(absorption(0.0, 1.0).is_finite() && absorption(0.0, f32::MIN_POSITIVE).is_finite());
    }
}
