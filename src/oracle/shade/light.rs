//! Twin of `glsl/include/light.glsl`: punctual lights, and those that have an extent.

use crate::oracle::lens::disc_point;
use crate::shaders::{LIGHT_DIRECTIONAL, LIGHT_DISC, LIGHT_MESH, LIGHT_POINT, LIGHT_SHARP, LIGHT_SPOT, Light};
use glam::{DVec3, Vec3};

/// What a light sends to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incident {
    /// Unit vector to the light; zero at the light itself.
    pub direction: DVec3,
    /// Metres; infinite for directional lights.
    pub distance: f64,
    /// On a surface perpendicular to the direction, scene-linear RGB, at most [`IRRADIANCE_MAX`].
    pub irradiance: DVec3,
}

/// Irradiances are cut off here.
pub const IRRADIANCE_MAX: f64 = (1u64 << 60) as f64;

/// One point of a light that has an extent, as a light, for coordinates in [0, 1): the mean over all is the light. In f32 and
/// in the shader's order.
pub fn light_point(light: &Light, at: [f32; 2]) -> Light {
    if light.shape == LIGHT_SHARP || light.shape == LIGHT_MESH {
        return *light;
    }
    let [x, y] = if light.shape == LIGHT_DISC { disc_point(at) } else { at.map(|u| 2.0 * u - 1.0) };
    let offset = Vec3::from(light.right) * x + Vec3::from(light.up) * y;
    if light.kind == LIGHT_DIRECTIONAL {
        let towards = Vec3::from(light.direction) + offset;
        return Light { direction: (towards / towards.length()).to_array(), ..*light };
    }
    Light { position: (Vec3::from(light.position) + offset).to_array(), ..*light }
}

/// What `light` sends to a point in the same camera-relative space.
pub fn light_at(light: &Light, point: [f32; 3]) -> Incident {
    let [direction, intensity] = [light.direction, light.intensity].map(|v| Vec3::from(v).as_dvec3());
    if light.kind == LIGHT_DIRECTIONAL {
        let irradiance = intensity.min(DVec3::splat(IRRADIANCE_MAX));
        return Incident { direction: -direction, distance: f64::INFINITY, irradiance };
    }
    // The difference is rounded in f32 by both, so that they agree on what is at the light.
    let to = (Vec3::from(light.position) - Vec3::from(point)).as_dvec3();
    if to.abs().max_element() < f64::from(f32::MIN_POSITIVE) {
        return Incident { direction: DVec3::ZERO, distance: 0.0, irradiance: DVec3::ZERO };
    }
    let distance = to.length();
    let unit = to / distance;
    let part = distance * distance * f64::from(light.inv_range2);
    let mut factor = (1.0 - part * part).clamp(0.0, 1.0);
    if light.kind == LIGHT_SPOT {
        let cone = direction.dot(-unit) * f64::from(light.spot_scale) + f64::from(light.spot_offset);
        factor *= cone.clamp(0.0, 1.0).powi(2);
    }
    if light.kind == LIGHT_POINT && light.shape != LIGHT_SHARP {
        factor *= DVec3::from(light.direction.map(f64::from)).dot(-unit).max(0.0);
    }
    let irradiance = (intensity * factor / (distance * distance)).min(DVec3::splat(IRRADIANCE_MAX));
    Incident { direction: unit, distance, irradiance }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp() -> Light {
        Light { position: [0.0, 2.0, 0.0], kind: LIGHT_POINT, intensity: [8.0, 4.0, 2.0], ..Light::default() }
    }

    #[test]
    fn irradiance_falls_with_the_square_of_the_distance() {
        let at = light_at(&lamp(), [0.0, 0.0, 0.0]);
        assert_eq!(at.irradiance, DVec3::new(2.0, 1.0, 0.5));
        assert_eq!((at.direction, at.distance), (DVec3::Y, 2.0));
        assert_eq!(light_at(&lamp(), [0.0, -2.0, 0.0]).irradiance, DVec3::new(0.5, 0.25, 0.125));
    }

    #[test]
    fn the_range_is_where_light_ends() {
        let light = Light { inv_range2: 1.0 / 16.0, ..lamp() };
        // (1 - (2/4)^4) of the light without a range.
        assert_eq!(light_at(&light, [0.0; 3]).irradiance.x, 2.0 * (1.0 - 1.0 / 16.0));
        assert_eq!(light_at(&light, [0.0, -2.0, 0.0]).irradiance, DVec3::ZERO);
        assert!(light_at(&light, [0.0, -1.9, 0.0]).irradiance.x > 0.0);
    }

    #[test]
    fn the_cone_is_full_inside_and_empty_outside() {
        let (inner, outer) = (0.3_f32.cos(), 0.5_f32.cos());
        let spot_scale = 1.0 / (inner - outer);
        let spot_offset = -outer * spot_scale;
        let direction = [0.0, -1.0, 0.0];
        let light = Light { kind: LIGHT_SPOT, direction, spot_scale, spot_offset, ..lamp() };
        let at = |angle: f64| {
            let d = 2.0 * DVec3::new(angle.sin(), -angle.cos(), 0.0);
            light_at(&light, [d.x as f32, 2.0 + d.y as f32, 0.0]).irradiance.x
        };
        assert!((at(0.29) - 2.0).abs() < 1e-5);
        assert_eq!(at(0.51), 0.0);
        assert!(at(0.4) > 0.0 && at(0.4) < 2.0);
    }

    #[test]
    fn extremes_stay_finite() {
        for intensity in [0.0, 1e-38, 1.0, 1e30] {
            for distance in [0.0, 1e-38, 1e-30, 1e-6, 1e7, 1e20, 1e38] {
                let light = Light { intensity: [intensity; 3], inv_range2: 1e-3, ..lamp() };
                let at = light_at(&light, [0.0, 2.0 + distance, 0.0]);
                assert!(at.irradiance.is_finite() && at.direction.is_finite());
                assert!(at.irradiance.max_element() <= IRRADIANCE_MAX);
            }
        }
    }
}
