//! Camera motions by name, which any scene can be given.
//!
//! All are smooth and start from the base view, exactly. Speeds follow the field of view and the scene's size, such
//! that at 60 frames a second an image of some 500 pixels a side moves by one to three pixels a frame: fast enough to
//! show every flaw of a temporal method, slow enough that most of the image can be reused.

use super::View;
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use std::f64::consts::LN_2;
use std::fmt;
use std::str::FromStr;

/// A camera motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Motion {
    /// The view as it is.
    #[default]
    Static,
    /// Turns to the left and right about the camera's own up axis, by a third of the field of view each way.
    Rotate,
    /// Slides to the right and left by a third of the field of view at the focus' distance.
    Pan,
    /// Magnifies up to twice and back.
    Zoom,
    /// Circles the focus about the world's +Y at an even speed.
    Orbit,
    /// Approaches the focus to half the distance and returns.
    Dolly,
}

/// Fields of view that the image moves by in a second, at most: 3 pixels of 500 a frame.
const PEAK_SPEED: f64 = 0.36;
/// The same for even motion: 2 pixels of 500 a frame.
const EVEN_SPEED: f64 = 0.24;
/// Fields of view to either side that rotation and panning reach.
const REACH: f64 = 1.0 / 3.0;
/// Change of the logarithm of the magnification in a second, at most: it moves the border of the image, 250 pixels from
/// the centre, by 3 pixels a frame.
const PEAK_GROWTH: f64 = 0.72;
/// The part of the way to the focus that a dolly travels.
const DOLLY_REACH: f64 = 0.5;

impl Motion {
    /// Every motion.
    pub const ALL: [Self; 6] = [Self::Static, Self::Rotate, Self::Pan, Self::Zoom, Self::Orbit, Self::Dolly];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Static => "static",
            Self::Rotate => "rotate",
            Self::Pan => "pan",
            Self::Zoom => "zoom",
            Self::Orbit => "orbit",
            Self::Dolly => "dolly",
        }
    }

    /// The view at `t` seconds, any finite number, of a camera that starts at `base`; bit for bit `base` at 0.
    ///
    /// `focus` is the scene's centre and `radius` that of a sphere around it which holds the scene, both in metres.
    pub fn view(self, base: &View, focus: DVec3, radius: f64, t: f64) -> View {
        if t == 0.0 {
            return *base;
        }
        // A camera near the focus is inside the scene: what it sees is about a radius away.
        let distance = base.position.distance(focus).max(0.25 * radius);
        match self {
            Self::Static => *base,
            Self::Rotate => {
                let turn = DQuat::from_rotation_y(sway(t) * base.yfov);
                View { rotation: (base.rotation * turn).normalize(), ..*base }
            }
            Self::Pan => {
                let slide = base.rotation * DVec3::X * (sway(t) * 2.0 * (base.yfov * 0.5).tan() * distance);
                View { position: base.position + slide, ..*base }
            }
            Self::Zoom => {
                let magnification = (LN_2 * there_and_back(2.0 * PEAK_GROWTH / LN_2, t)).exp();
                View { yfov: 2.0 * ((base.yfov * 0.5).tan() / magnification).atan(), ..*base }
            }
            Self::Orbit => orbit(base, focus, radius, distance, t),
            Self::Dolly => {
                // Half-way, 3/4 of the distance are left: the border grows at speed / (3/4).
                let rate = 2.0 * PEAK_GROWTH * (1.0 - 0.5 * DOLLY_REACH) / DOLLY_REACH;
                View { position: base.position.lerp(focus, DOLLY_REACH * there_and_back(rate, t)), ..*base }
            }
        }
    }
}

/// Sideways place in fields of view: a sine that starts at 0 with the peak speed.
fn sway(t: f64) -> f64 {
    REACH * (PEAK_SPEED / REACH * t).sin()
}

/// 0 at the start, 1 after half a period and 0 again, without a jump in speed; `rate` in radians a second.
fn there_and_back(rate: f64, t: f64) -> f64 {
    (1.0 - (rate * t).cos()) * 0.5
}

fn orbit(base: &View, focus: DVec3, radius: f64, distance: f64, t: f64) -> View {
    // The scene's rim moves at radius * rate, seen from the distance. The bounds keep a camera that is inside from
    // standing still and one that is far away from spinning.
    let ratio = if radius > 0.0 { (distance / radius).clamp(0.5, 4.0) } else { 1.0 };
    let turn = DQuat::from_rotation_y(EVEN_SPEED * base.yfov * ratio * t);
    View { position: focus + turn * (base.position - focus), rotation: (turn * base.rotation).normalize(), ..*base }
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Motion {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|m| m.name() == name).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            Error::Setting { name: "motion", value: name.to_owned(), expected: format!("the motions are {names}") }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Lens;

    fn base() -> View {
        let lens = Lens { aperture: 0.1, ..Lens::PINHOLE };
        View {
            position: DVec3::new(3.0, 1.0, 4.0),
            rotation: DQuat::from_rotation_y(0.6),
            yfov: 0.7,
            lens,
            shutter: 0.5,
        }
    }

    const FOCUS: DVec3 = DVec3::new(0.1, 0.2, -0.3);

    /// Where a world-space point is seen, in pixels of an image of 500 lines.
    fn pixel(view: &View, point: DVec3) -> glam::DVec2 {
        let p = view.rotation.inverse() * (point - view.position);
        glam::DVec2::new(p.x, p.y) / -p.z * (250.0 / (view.yfov * 0.5).tan())
    }

    #[test]
    fn starts_from_the_base_exactly_and_without_a_jump() {
        for motion in Motion::ALL {
            assert_eq!(motion.view(&base(), FOCUS, 1.5, 0.0), base());
            let soon = motion.view(&base(), FOCUS, 1.5, 1e-9);
            assert!(soon.position.distance(base().position) < 1e-8, "{motion}");
            assert!((soon.yfov - base().yfov).abs() < 1e-8, "{motion}");
        }
    }

    #[test]
    fn speed_is_bounded_and_every_motion_but_static_moves() {
        // Points within the radius around the focus, and in the image.
        let points = [FOCUS, FOCUS + DVec3::Y * 0.8, FOCUS + DVec3::X * 0.9, FOCUS - DVec3::Z * 0.9];
        for motion in Motion::ALL {
            let mut fastest = 0.0_f64;
            for frame in 0..600 {
                let at = |f: u32| motion.view(&base(), FOCUS, 1.0, f64::from(f) / 60.0);
                let (a, b) = (at(frame), at(frame + 1));
                for p in points {
                    fastest = fastest.max(pixel(&a, p).distance(pixel(&b, p)));
                }
            }
            // Three pixels at the focus; what is nearer or towards the border moves up to twice as fast.
            let range = if motion == Motion::Static { 0.0..=0.0 } else { 0.9..=6.0 };
            assert!(range.contains(&fastest), "{motion}: {fastest} pixels a frame");
        }
    }

    #[test]
    fn rotation_stays_of_unit_length_and_fields_of_view_valid() {
        for motion in Motion::ALL {
            for t in [-3.0, 0.25, 7.0, 1e4, 1e9] {
                let view = motion.view(&View { yfov: 3.0, ..base() }, FOCUS, 1.0, t);
                assert!((view.rotation.length() - 1.0).abs() < 4.0 * f64::EPSILON, "{motion} at {t}");
                assert!(view.yfov > 0.0 && view.yfov < std::f64::consts::PI, "{motion} at {t}");
                assert!(view.position.is_finite());
            }
        }
    }

    #[test]
    fn no_scene_and_a_camera_at_the_focus_are_no_trouble() {
        for motion in Motion::ALL {
            let view = motion.view(&View { position: FOCUS, ..base() }, FOCUS, 0.0, 1.0);
            assert!(view.position.is_finite() && view.rotation.is_finite() && view.yfov.is_finite(), "{motion}");
        }
    }

    #[test]
    fn names_are_read_back_and_errors_list_them() {
        for motion in Motion::ALL {
            assert_eq!(motion.to_string().parse::<Motion>().unwrap(), motion);
        }
        let message = "spin".parse::<Motion>().unwrap_err().to_string();
        assert!(message.contains("spin") && message.contains("orbit"), "{message}");
    }
}
