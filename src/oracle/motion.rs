//! Where things are while the shutter is open (paper 2, section 3.4). Twin of `glsl/include/motion.glsl` and of what
//! `glsl/include/place.glsl` makes of it, in f32 and in the shaders' order: agrees to the bit where the device divides and
//! takes roots correctly. Why each step is done as it is, and the error bounds, is told there.

use glam::Vec3;

use super::traverse::{in_range, transform_direction, transform_point};
use crate::shaders::{FRAME_TURNS, Frame, INSTANCE_FLIPPED, INSTANCE_MOVES, Instance, Light};

const INVERSE_LIMIT: f32 = 1024.0;
/// 2^-40.
const INVERSE_SIZE: f32 = 9.094_947e-13;
/// 2^-80.
const INVERSE_VOLUME: f32 = 8.271_806e-25;
/// 2^100.
const INVERSE_REACH: f32 = 1.267_650_6e30;
/// 2^46.
const RAY_RANGE: f32 = 70_368_744_177_664.0;
const LEAST: f32 = 1.0e-6;

/// Rows of a 3×4 matrix.
pub type Rows = [[f32; 4]; 3];

/// Where an instance is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Object to camera-relative space.
    pub to_relative: Rows,
    /// Its inverse; all zero if there is none to rely on.
    pub to_object: Rows,
    /// What the inverse may have been computed wrong by, times 2^24.
    pub slack: Rows,
    /// `INSTANCE_*`, of where it is.
    pub flags: u32,
}

/// When a sample with this coordinate is seen: 1 at the frame, less by up to the part for which the shutter is open.
pub fn frame_time(shutter: f32, at: f32) -> f32 {
    1.0 - shutter * (1.0 - at)
}

/// Between two matrices.
pub fn blend_rows(before: &Rows, now: &Rows, time: f32) -> Rows {
    let entry = |row: usize, i: usize| before[row][i] + (now[row][i] - before[row][i]) * time;
    [0, 1, 2].map(|row| [0, 1, 2, 3].map(|i| entry(row, i)))
}

/// Object-to-relative rows of an instance at a time.
pub fn relative_rows(instance: &Instance, time: f32) -> Rows {
    let moves = instance.flags & INSTANCE_MOVES != 0 && time < 1.0;
    if moves { blend_rows(&instance.previous, &instance.to_relative, time) } else { instance.to_relative }
}

/// An instance at a time.
pub fn placement_at(instance: &Instance, time: f32) -> Placement {
    let Instance { to_relative, to_object, flags, .. } = *instance;
    let here = Placement { to_relative, to_object, slack: [[0.0; 4]; 3], flags };
    if flags & INSTANCE_MOVES == 0 || time >= 1.0 {
        return here;
    }
    let blended = Placement { to_relative: relative_rows(instance, time), ..here };
    invert(blended).unwrap_or(Placement { to_object: [[0.0; 4]; 3], ..blended })
}

/// With the inverse; `None` for what is singular, or nearly so.
pub fn invert(at: Placement) -> Option<Placement> {
    let row = |i: usize| Vec3::new(at.to_relative[i][0], at.to_relative[i][1], at.to_relative[i][2]);
    let size = row(0).abs().max(row(1).abs()).max(row(2).abs()).max_element();
    if !(INVERSE_SIZE..=RAY_RANGE).contains(&size) {
        return None;
    }
    let unit = f32::from_bits((254 << 23) - (size.to_bits() & 0x7f80_0000));
    let [a, b, c] = [0, 1, 2].map(|i| row(i) * unit);
    let yzx = |p: Vec3| Vec3::new(p.y, p.z, p.x);
    let zxy = |p: Vec3| Vec3::new(p.z, p.x, p.y);
    let across = |p: Vec3, q: Vec3| yzx(p) * zxy(q) - zxy(p) * yzx(q);
    let sizes = |p: Vec3, q: Vec3| (yzx(p) * zxy(q)).abs() + (zxy(p) * yzx(q)).abs();
    let [bc, ca, ab] = [across(b, c), across(c, a), across(a, b)];
    let [bc_size, ca_size, ab_size] = [sizes(b, c), sizes(c, a), sizes(a, b)];
    let sum = |p: Vec3, q: Vec3| (p.x * q.x + p.y * q.y) + p.z * q.z;
    let volume = sum(a, bc);
    if volume.abs() < INVERSE_VOLUME {
        return None;
    }
    let part = 1.0 / volume;
    let spread = sum(a.abs(), bc_size) * part.abs();
    let sums = (bc_size + ca_size + ab_size) * part.abs();
    let largest = sum(a.abs(), sums).max(sum(b.abs(), sums)).max(sum(c.abs(), sums));
    if spread * largest > INVERSE_LIMIT {
        return None;
    }
    let scale = part * unit;
    let rows = [0, 1, 2].map(|i| Vec3::new(bc[i], ca[i], ab[i]) * scale);
    let from = Vec3::new(at.to_relative[0][3], at.to_relative[1][3], at.to_relative[2][3]);
    if rows.into_iter().any(|row| row.abs().dot(from.abs()) > INVERSE_REACH) {
        return None;
    }
    let loose = 19.0 * spread * scale.abs();
    let slack = |i: usize| (Vec3::new(bc_size[i], ca_size[i], ab_size[i]) * loose).extend(0.0).to_array();
    let flipped = if volume < 0.0 { INSTANCE_FLIPPED } else { 0 };
    Some(Placement {
        to_object: rows.map(|row| row.extend(-sum(row, from)).to_array()),
        slack: [0, 1, 2].map(slack),
        flags: at.flags & !INSTANCE_FLIPPED | flipped,
        ..at
    })
}

/// A ray in the space of an instance at a time: its origin and direction; `None` if it does not meet the instance.
pub fn ray_in(instance: &Instance, time: f32, origin: Vec3, direction: Vec3) -> Option<(Vec3, Vec3)> {
    let at = placement_at(instance, time);
    let ray = (transform_point(&at.to_object, origin), transform_direction(&at.to_object, direction));
    in_range(ray.0, ray.1).then_some(ray)
}

/// The axes of the camera at a time.
pub fn frame_at(frame: &Frame, time: f32) -> Frame {
    if frame.flags & FRAME_TURNS == 0 || time >= 1.0 {
        return *frame;
    }
    let between = |before: f32, now: f32| before + (now - before) * time;
    let axis = |a: [f32; 4]| Vec3::new(a[0], a[1], a[2]);
    let blended = blend_axes(
        [axis(frame.previous_right), axis(frame.previous_forward)],
        [axis(frame.right), axis(frame.forward)],
        time,
    );
    let [right, forward] = blended;
    let up = Vec3::new(
        right.y * forward.z - right.z * forward.y,
        right.z * forward.x - right.x * forward.z,
        right.x * forward.y - right.y * forward.x,
    );
    Frame {
        right: right.extend(between(frame.previous_right[3], frame.right[3])).to_array(),
        up: up.extend(between(frame.previous_up[3], frame.up[3])).to_array(),
        forward: forward.extend(frame.forward[3]).to_array(),
        ..*frame
    }
}

fn blend_axes([right_before, forward_before]: [Vec3; 2], now: [Vec3; 2], time: f32) -> [Vec3; 2] {
    let [right, forward] = now;
    let sum = |p: Vec3, q: Vec3| (p.x * q.x + p.y * q.y) + p.z * q.z;
    let f = forward_before + (forward - forward_before) * time;
    let r = right_before + (right - right_before) * time;
    let f2 = sum(f, f);
    if f2 < LEAST {
        return now;
    }
    let ahead = f / f2.sqrt();
    let across = r - ahead * sum(ahead, r);
    let r2 = sum(across, across);
    if r2 < LEAST {
        return now;
    }
    [across / r2.sqrt(), ahead]
}

/// A light at a time.
pub fn light_at_time(light: &Light, time: f32) -> Light {
    let position = [0, 1, 2].map(|i| light.position[i] - light.moved[i] * (1.0 - time));
    Light { position, ..*light }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DMat3, DQuat, DVec3};

    const U: f64 = 1.0 / 16_777_216.0;

    fn rows(m: &DAffine3) -> Rows {
        [0, 1, 2].map(|i| m.matrix3.row(i).extend(m.translation[i]).as_vec4().to_array())
    }

    fn moving(before: &DAffine3, now: &DAffine3) -> Instance {
        let (to_relative, to_object) = (rows(now), rows(&now.inverse()));
        Instance { to_relative, to_object, previous: rows(before), flags: INSTANCE_MOVES, ..Instance::default() }
    }

    fn matrix(rows: &Rows) -> (DMat3, DVec3) {
        let [a, b, c] = rows.map(|row| row.map(f64::from));
        let linear =
            DMat3::from_cols(DVec3::new(a[0], b[0], c[0]), DVec3::new(a[1], b[1], c[1]), DVec3::new(a[2], b[2], c[2]));
        (linear, DVec3::new(a[3], b[3], c[3]))
    }

    /// Against f64: a point of camera-relative space comes to where the exact inverse takes it, within what `slack` tells, and
    /// an inverse that is off by a hundred times as much does not.
    #[test]
    fn an_inverse_is_as_exact_as_it_says() {
        let mut worst = 0.0_f64;
        for step in 0..4000_u32 {
            let random = |salt: u32| {
                let h = super::super::random::hash_uint(step.wrapping_mul(31).wrapping_add(salt));
                f64::from(super::super::random::unit_float(h)) * 2.0 - 1.0
            };
            let vector = |salt: u32| DVec3::new(random(salt), random(salt + 1), random(salt + 2));
            let turn = |salt: u32| DQuat::from_scaled_axis(vector(salt) * 3.0);
            let scale =
                DVec3::new(10f64.powf(random(9) * 5.0), 10f64.powf(random(10) * 5.0), 10f64.powf(random(11) * 5.0));
            let near = DAffine3::from_scale_rotation_translation(scale, turn(0), vector(3) * 10.0);
            let then = DAffine3::from_scale_rotation_translation(
                scale,
                turn(0) * turn(6).slerp(DQuat::IDENTITY, 0.8),
                vector(12),
            );
            let at = placement_at(&moving(&then, &near), 0.37);
            if at.to_object == [[0.0; 4]; 3] {
                continue;
            }
            let (linear, translation) = matrix(&at.to_relative);
            let (inverse, back) = matrix(&at.to_object);
            let p = vector(15) / scale;
            let found = inverse * (linear * p + translation) + back;
            let size = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs()) * p.abs()
                + translation.abs();
            let (slack, _) = matrix(&at.slack);
            let bound = slack * size * U;
            let part = ((found - p).abs() / bound).max_element();
            worst = worst.max(part);
            assert!(part <= 1.0, "{part} of the bound: {scale}");
        }
        assert!(worst > 0.01, "the bound is within a hundred times of what is seen: {worst}");
    }

    #[test]
    fn what_is_singular_has_no_inverse_and_nothing_is_no_number() {
        let mirrored = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let instance = moving(&mirrored, &DAffine3::IDENTITY);
        assert_eq!(placement_at(&instance, 0.5).to_object, [[0.0; 4]; 3]);
        assert_eq!(ray_in(&instance, 0.5, Vec3::ZERO, Vec3::X), None);
        assert_eq!(placement_at(&instance, 0.25).flags & INSTANCE_FLIPPED, INSTANCE_FLIPPED);
        assert_eq!(placement_at(&instance, 0.75).flags & INSTANCE_FLIPPED, 0);
        assert_eq!(placement_at(&instance, 1.0).to_relative, instance.to_relative);
        for scale in [1e-5, 1e-3, 1.0, 1e3, 1e5] {
            for other in [1e-5, 1.0, 1e5, -1e5, 0.0] {
                let far = DVec3::new(1e9, -1e-9, 1.0);
                let [a, b] =
                    [scale, other].map(|s| DAffine3 { translation: far, ..DAffine3::from_scale(DVec3::splat(s)) });
                for time in [0.0, 1e-7, 0.25, 0.5, 0.75, 1.0 - 1e-7] {
                    let at = placement_at(&moving(&b, &a), time);
                    assert!(
                        at.to_object.iter().chain(&at.slack).flatten().all(|x| x.is_finite()),
                        "{scale} {other} {time}"
                    );
                }
            }
        }
    }

    /// A camera that turns has orthonormal axes at any time, those of the frame at its end, and none without a direction.
    #[test]
    fn axes_stay_axes() {
        let frame = |turn: f64| {
            let q = DQuat::from_rotation_y(turn);
            let axis = |v: DVec3| (q * v).extend(1.0).as_vec4().to_array();
            [axis(DVec3::X), axis(DVec3::Y), axis(DVec3::NEG_Z)]
        };
        for turn in [0.001, 0.3, 2.0, std::f64::consts::PI] {
            let ([right, up, forward], [previous_right, previous_up, previous_forward]) = (frame(turn), frame(0.0));
            let f = Frame {
                right,
                up,
                forward,
                previous_right,
                previous_up,
                previous_forward,
                flags: FRAME_TURNS,
                ..Frame::default()
            };
            assert_eq!(frame_at(&f, 1.0), f);
            for time in [0.0, 0.25, 0.5, 0.875] {
                let at = frame_at(&f, time);
                let axis = |a: [f32; 4]| Vec3::new(a[0], a[1], a[2]);
                let [r, u, d] = [axis(at.right), axis(at.up), axis(at.forward)];
                // Some ten roundings; half-way through half a turn the frame's own axes stand in.
                let off = [r.length() - 1.0, u.length() - 1.0, d.length() - 1.0, r.dot(d), u.dot(d), r.dot(u)];
                assert!(off.iter().all(|x| x.abs() < 2e-6), "{turn} {time}: {off:?}");
            }
        }
    }
}
