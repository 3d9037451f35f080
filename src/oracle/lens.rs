//! The thin lens (paper 2, section 3.1). Twin of `glsl/include/disc.glsl` and `glsl/include/place.glsl`, in f32 and in the
//! shaders' order: agrees to the bit where the device takes roots correctly.

use super::bounded::Bounded;
use crate::shaders::Frame;

/// The unit vector at a part of a full turn, 0 to 1, within 2^-21.
pub fn turn_vector(turn: f32) -> [f32; 2] {
    let quarters = (4.0 * turn + 0.5).floor();
    let x = (4.0 * turn - quarters) * std::f32::consts::FRAC_PI_2;
    let x2 = x * x;
    let s = x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 - x2 * (1.0 / 5040.0))));
    let c = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40320.0))));
    match quarters as u32 % 4 {
        0 => [c, s],
        1 => [-s, c],
        2 => [-c, -s],
        _ => [s, -c],
    }
}

/// Uniform on the unit disc.
pub fn disc_point([u, v]: [f32; 2]) -> [f32; 2] {
    turn_vector(u).map(|x| x * v.sqrt())
}

/// Uniform on the regular polygon with so many corners on the unit circle, one of them at a part of a turn.
pub fn polygon_point([u, v]: [f32; 2], corners: f32, turn: f32) -> [f32; 2] {
    let along = u * corners;
    let first = along.floor().min(corners - 1.0);
    let part = along - first;
    let corner = |number: f32| {
        let t = number / corners + turn;
        turn_vector(t - t.floor())
    };
    let (a, b) = (corner(first), corner(first + 1.0));
    [0, 1].map(|axis| (a[axis] + (b[axis] - a[axis]) * part) * v.sqrt())
}

/// Where a sample with these coordinates is on a frame's lens: metres along the axes across and up.
pub fn lens_point(lens: [f32; 4], at: [f32; 2]) -> [f32; 2] {
    let [radius, _, blades, turn] = lens;
    let unit = if blades > 0.0 { polygon_point(at, blades, turn) } else { disc_point(at) };
    unit.map(|x| x * radius)
}

/// How far the ray from a lens point shows something beside where the middle shows it: metres at its depth.
pub fn lens_shift(frame: &Frame, point: [f32; 2], relative: [f32; 3], surface: bool) -> [f32; 2] {
    let forward = frame.forward;
    let depth = forward[0] * relative[0] + forward[1] * relative[1] + forward[2] * relative[2];
    let out_of_focus = depth * frame.lens[1] - if surface { 1.0 } else { 0.0 };
    point.map(|p| p * out_of_focus)
}

/// The same with its error bound.
pub fn lens_shift_bounded(frame: &Frame, point: [f32; 2], relative: [Bounded; 3], surface: bool) -> [Bounded; 2] {
    let axis = frame.forward.map(Bounded::exact);
    let depth = axis[0] * relative[0] + axis[1] * relative[1] + axis[2] * relative[2];
    let out_of_focus = depth * Bounded::exact(frame.lens[1]) - Bounded::exact(if surface { 1.0 } else { 0.0 });
    point.map(|p| Bounded::exact(p) * out_of_focus)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_turns() {
        for i in 0..10_000 {
            let turn = i as f32 / 10_000.0;
            let angle = f64::from(turn) * std::f64::consts::TAU;
            let [c, s] = turn_vector(turn).map(f64::from);
            let off = (c - angle.cos()).hypot(s - angle.sin());
            // The series leave out x^9 / 9! and x^10 / 10! of x below 0.786: 3.2e-7 and 2.5e-8; some ten roundings of 2^-24.
            assert!(off < 2.0_f64.powi(-20), "{turn}: {off:e}");
        }
        assert_eq!([turn_vector(0.0), turn_vector(0.25), turn_vector(0.5)], [[1.0, 0.0], [-0.0, 1.0], [-1.0, -0.0]]);
    }

    /// Second moments of the disc, 1/4 along either axis, and of the square with corners on the unit circle, 1/6.
    #[test]
    fn points_are_spread_evenly_over_disc_and_polygon() {
        let side = 256;
        let grid = (0..side * side).map(|i| [i % side, i / side].map(|n| (n as f32 + 0.5) / side as f32));
        let points: Vec<[f32; 2]> = grid.collect();
        let moment = |shape: &dyn Fn([f32; 2]) -> [f32; 2], axis: usize| {
            points.iter().map(|u| f64::from(shape(*u)[axis]).powi(2)).sum::<f64>() / points.len() as f64
        };
        for axis in 0..2 {
            // The midpoint rule's error with 256 cells: well below 1e-4 for such smooth integrands.
            assert!((moment(&disc_point, axis) - 0.25).abs() < 1e-4);
            assert!((moment(&|u| polygon_point(u, 4.0, 0.1), axis) - 1.0 / 6.0).abs() < 1e-4);
            // Without the root they crowd in the middle.
            assert!((moment(&|[u, v]| disc_point([u, v * v]), axis) - 0.25).abs() > 0.05);
        }
        let inside = |u: &[f32; 2]| polygon_point(*u, 5.0, 0.0).iter().map(|x| x * x).sum::<f32>() <= 1.0 + 1e-6;
        assert!(points.iter().all(inside));
    }

    /// The ray through a lens point meets the plane in focus where the ray through the middle of the lens does.
    #[test]
    fn what_is_in_focus_is_shown_in_one_place() {
        let frame = Frame { forward: [0.0, 0.0, -1.0, 0.0], lens: [0.1, 0.25, 0.0, 0.0], ..Frame::default() };
        let point = lens_point(frame.lens, [0.3, 0.9]);
        assert_eq!(lens_shift(&frame, point, [1.0, 2.0, -4.0], true), [0.0, 0.0]);
        // Twice as far: a metre of lens is a metre of blur there.
        assert_eq!(lens_shift(&frame, point, [1.0, 2.0, -8.0], true), point);
        assert_eq!(lens_shift(&frame, point, [0.0, 0.0, -2.0], true), point.map(|p| -0.5 * p));
        // The sky: to the side by p / f at a distance of one.
        assert_eq!(lens_shift(&frame, point, [0.0, 0.0, -1.0], false), point.map(|p| 0.25 * p));
    }
}
