//! Twin of `glsl/include/pack.glsl`: packed attributes and shaded samples.

use crate::shaders::Shaded;
use glam::{DVec2, DVec3, DVec4};
use half::f16;

/// Unit vector of a point of the octahedral map.
pub fn octahedral_decode(p: DVec2) -> DVec3 {
    let z = 1.0 - p.x.abs() - p.y.abs();
    let fold = (-z).max(0.0);
    let unfold = |c: f64| if c >= 0.0 { c - fold } else { c + fold };
    DVec3::new(unfold(p.x), unfold(p.y), z).normalize()
}

fn snorm(code: i32, max: f64) -> f64 {
    (f64::from(code) / max).max(-1.0)
}

/// Unit normal of [`crate::shaders::Vertex::normal`].
pub fn decode_normal(packed: u32) -> DVec3 {
    let [x, y] = [packed as u16 as i16, (packed >> 16) as i16].map(|c| snorm(c.into(), 32767.0));
    octahedral_decode(DVec2::new(x, y))
}

/// Unit tangent of [`crate::shaders::Vertex::tangent`], with the handedness in w.
pub fn decode_tangent(packed: u32) -> DVec4 {
    let x = snorm((packed as u16 as i16).into(), 32767.0);
    let y = snorm(((packed << 1) as i32) >> 17, 16383.0);
    octahedral_decode(DVec2::new(x, y)).extend(if packed >> 31 == 0 { 1.0 } else { -1.0 })
}

/// Linear RGBA of [`crate::shaders::Vertex::color_rg`] and `color_ba`.
pub fn decode_color(rg: u32, ba: u32) -> DVec4 {
    let [r, g, b, a] = [rg, rg >> 16, ba, ba >> 16].map(|c| f64::from(c as u16) / 65535.0);
    DVec4::new(r, g, b, a)
}

fn storable(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 65504.0) }
}

fn halves(a: f32, b: f32) -> u32 {
    u32::from(f16::from_f32(a).to_bits()) | u32::from(f16::from_f32(b).to_bits()) << 16
}

/// A shaded sample. Halves are rounded to nearest here; a driver may round them to either neighbour.
pub fn pack_shaded(color: [f32; 3], offset: [f32; 2], motion: [f32; 2], depth: f32) -> Shaded {
    let [r, g, b] = color.map(storable);
    let [x, y] = offset.map(|o| (o.clamp(0.0, 0.998_046_9) * 256.0) as u32);
    let [mx, my] = motion.map(|m| if m.is_finite() { m.clamp(-65504.0, 65504.0) } else { 0.0 });
    Shaded { color_rg: halves(r, g), color_b_offset: halves(b, 0.0) | x << 16 | y << 24, motion: halves(mx, my), depth }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::encode;
    use glam::{Vec3, Vec4};
    use proptest::prelude::*;

    fn direction() -> impl Strategy<Value = Vec3> {
        let axis = -1.0..1.0f32;
        [axis.clone(), axis.clone(), axis].prop_map(Vec3::from).prop_filter("not at the centre", |v| v.length() > 0.01)
    }

    proptest! {
        // A step is 2/65534 of the map's side, rounding errs by half of it, h. On the octahedron that is a vector of up to
        // (h, h, 2h), since z is 1 - |x| - |y|; seen from the centre, at a distance of at least 1/sqrt(3), an angle of
        // sqrt(3) sqrt(6) h = 3 sqrt(2) h. f32 in the encoder adds less than 1e-6.
        #[test]
        fn normals_survive_within_the_bound(v in direction()) {
            let angle = decode_normal(encode::normal(v.normalize())).angle_between(v.as_dvec3());
            prop_assert!(angle <= 3.0 * 2f64.sqrt() / 65534.0 + 1e-6);
        }

        // y has steps of twice the size: (h, 2h, 3h), sqrt(3) sqrt(14) h.
        #[test]
        fn tangents_survive_within_the_bound(v in direction(), mirrored in any::<bool>()) {
            let w = if mirrored { -1.0 } else { 1.0 };
            let decoded = decode_tangent(encode::tangent(v.normalize().extend(w)));
            prop_assert!(decoded.truncate().angle_between(v.as_dvec3()) <= 42f64.sqrt() / 65534.0 + 1e-6);
            prop_assert_eq!(decoded.w, f64::from(w));
        }
    }

    #[test]
    fn the_bound_of_normals_is_not_idle() {
        // The worst of many directions comes near the bound, and an encoding with one bit less breaks it.
        let worst = |mask: u32| {
            let angle = |i: u32| {
                let (y, a) = (f64::from(i) / 50_000.0 - 1.0, f64::from(i) * 2.4);
                let v = DVec3::new((1.0 - y * y).sqrt() * a.cos(), y, (1.0 - y * y).sqrt() * a.sin()).as_vec3();
                decode_normal(encode::normal(v.normalize()) & mask).angle_between(v.as_dvec3())
            };
            (0..100_000).map(angle).fold(0.0, f64::max)
        };
        let bound = 3.0 * 2f64.sqrt() / 65534.0;
        assert!(worst(!0) > 0.4 * bound);
        assert!(worst(0xfffe_fffe) > bound);
    }

    #[test]
    fn axes_and_colours_are_exact() {
        for v in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            assert_eq!(decode_normal(encode::normal(v)), v.as_dvec3());
            assert_eq!(decode_tangent(encode::tangent(v.extend(1.0))).truncate(), v.as_dvec3());
        }
        let [rg, ba] = encode::color(Vec4::new(0.0, 1.0, 0.0, 1.0));
        assert_eq!(decode_color(rg, ba), DVec4::new(0.0, 1.0, 0.0, 1.0));
    }

    #[test]
    fn what_cannot_be_stored_is_not() {
        let [inf, nan] = [f32::INFINITY, f32::NAN];
        let s = pack_shaded([nan, inf, -1.0], [1.0, -3.0], [nan, -inf], 2.0);
        assert_eq!(s.color_rg, u32::from(f16::MAX.to_bits()) << 16);
        assert_eq!(s.color_b_offset, 255 << 16);
        assert_eq!(s.motion, 0);
    }
}
