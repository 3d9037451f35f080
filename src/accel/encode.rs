//! Vertex attributes packed as `glsl/include/types.glsl` says: the encoders; the decoders are GLSL's.

use glam::{Vec2, Vec3, Vec4};

use crate::shaders;

/// Signed 16-bit fixed point of -1..=1, in the low half of the word.
fn snorm16(x: f32) -> u32 {
    let fixed = (x.clamp(-1.0, 1.0) * 32767.0).round() as i16;
    u32::from(fixed as u16)
}

/// Signed 15-bit fixed point of -1..=1, in the low 15 bits.
fn snorm15(x: f32) -> u32 {
    let fixed = (x.clamp(-1.0, 1.0) * 16383.0).round() as i16;
    u32::from(fixed as u16) & 0x7fff
}

fn unorm16(x: f32) -> u32 {
    (x.clamp(0.0, 1.0) * 65535.0).round() as u32
}

/// Octahedral map of a direction to -1..=1 squared (Meyer et al. 2010). A zero vector maps to the centre, which is +z.
fn octahedral(n: Vec3) -> Vec2 {
    let sum = n.x.abs() + n.y.abs() + n.z.abs();
    // Not `sum == 0`: what is not a finite direction must not become NaN either.
    if !(sum > 0.0 && sum.is_finite()) {
        return Vec2::ZERO;
    }
    let flat = Vec2::new(n.x, n.y) / sum;
    if n.z >= 0.0 {
        return flat;
    }
    let sign = |x: f32| if x < 0.0 { -1.0 } else { 1.0 };
    Vec2::new((1.0 - flat.y.abs()) * sign(flat.x), (1.0 - flat.x.abs()) * sign(flat.y))
}

/// A unit normal as two 16-bit snorms, x in the low half. Decodes to within 0.04 milliradians.
pub fn normal(n: Vec3) -> u32 {
    let flat = octahedral(n);
    snorm16(flat.x) | snorm16(flat.y) << 16
}

/// A unit tangent with its handedness (the sign of `w`): 16-bit snorm, 15-bit snorm, and the handedness in bit 31.
pub fn tangent(t: Vec4) -> u32 {
    let flat = octahedral(t.truncate());
    snorm16(flat.x) | snorm15(flat.y) << 16 | u32::from(t.w < 0.0) << 31
}

/// A linear RGBA colour, clamped to 0..=1, as four 16-bit unorms: (red | green << 16, blue | alpha << 16).
pub fn color(c: Vec4) -> [u32; 2] {
    [unorm16(c.x) | unorm16(c.y) << 16, unorm16(c.z) | unorm16(c.w) << 16]
}

/// All attributes of a vertex.
pub fn vertex(n: Vec3, t: Vec4, uvs: [Vec2; 2], c: Vec4) -> shaders::Vertex {
    let [color_rg, color_ba] = color(c);
    shaders::Vertex {
        normal: normal(n),
        tangent: tangent(t),
        uv0: uvs[0].to_array(),
        uv1: uvs[1].to_array(),
        color_rg,
        color_ba,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What types.glsl documents, read back.
    fn decode(x: f32, y: f32) -> Vec3 {
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).max(0.0);
        let sign = |x: f32| if x < 0.0 { -1.0 } else { 1.0 };
        Vec3::new(x - fold * sign(x), y - fold * sign(y), z).normalize()
    }

    fn low(word: u32) -> f32 {
        f32::from(word as u16 as i16) / 32767.0
    }

    fn directions() -> impl Iterator<Item = Vec3> {
        (0..=20).flat_map(|i| (0..=20).map(move |j| (i, j))).map(|(i, j)| {
            let (theta, phi) = (i as f32 / 20.0 * std::f32::consts::PI, j as f32 / 20.0 * std::f32::consts::TAU);
            Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
        })
    }

    #[test]
    fn normals_survive() {
        for n in directions().chain([Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z]) {
            let word = normal(n);
            // A step is 1/32767 and half of it is lost; the map stretches lengths by at most 3^0.5 * 3^0.5.
            let error = (decode(low(word), low(word >> 16)) - n).length();
            assert!(error < 3.0 / 32767.0, "{n} off by {error}");
        }
    }

    #[test]
    fn tangents_keep_their_handedness() {
        for n in directions() {
            for w in [1.0, -1.0] {
                let word = tangent(n.extend(w));
                let y = ((word << 1) as i32 >> 17) as f32 / 16383.0;
                assert!((decode(low(word), y) - n).length() < 3.0 / 16383.0, "{n}");
                assert_eq!(word >> 31 == 1, w < 0.0);
            }
        }
    }

    #[test]
    fn bits_are_where_documented() {
        assert_eq!(normal(Vec3::Z), 0);
        assert_eq!(normal(Vec3::X), 32767);
        assert_eq!(normal(-Vec3::Y), u32::from(-32767i16 as u16) << 16);
        // Folded with sign(0) = +1.
        assert_eq!(normal(-Vec3::Z), 32767 | 32767 << 16);
        assert_eq!(tangent(Vec4::new(0.0, 1.0, 0.0, -1.0)), 16383 << 16 | 1 << 31);
        assert_eq!(color(Vec4::new(1.0, 0.0, 2.0, -1.0)), [65535, 65535]);
    }

    #[test]
    fn what_is_no_direction_becomes_one() {
        assert_eq!(normal(Vec3::ZERO), normal(Vec3::Z));
        assert_eq!(normal(Vec3::NAN), normal(Vec3::Z));
        assert_eq!(normal(Vec3::INFINITY), normal(Vec3::Z));
    }
}
