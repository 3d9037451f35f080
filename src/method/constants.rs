//! What the host computes for a frame: everything in f64 relative to the camera, rounded once.

use super::storage::Storage;
use crate::scene::{Environment, Lens, Light, LightKind, LightPose, LightShape, View};
use crate::settings::{Edges, Filter, Grouping, Hold, Method, Settings};
use crate::shaders;
use crate::{Error, Result};
use glam::DVec3;

/// What goes into [`shaders::Frame`] besides the settings.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Where the frame is seen from.
    pub view: View,
    /// Where the last frame was seen from.
    pub previous: View,
    /// Frames since the last reset.
    pub frame: u32,
    /// The first frame, or one after a camera cut.
    pub reset: bool,
    /// Nothing has moved for two frames.
    pub settled: bool,
    /// Frames since anything moved that light falls on or comes from; all there can be if there is no frame before.
    pub lit_for: u32,
    /// Lights in the scene.
    pub lights: u32,
    /// Instances in the scene.
    pub instances: u32,
}

/// The constants of a frame whose view [`check_view`] accepts.
pub fn frame(settings: &Settings, storage: &Storage, environment: &Environment, moment: &Moment) -> shaders::Frame {
    let aspect = f64::from(settings.size[0]) / f64::from(settings.size[1]);
    let [right, up, forward] = axes(&moment.view, aspect, settings.size[1]);
    let [previous_right, previous_up, previous_forward] = axes(&moment.previous, aspect, settings.size[1]);
    let varies = match settings.method {
        Method::Taa | Method::Reference => true,
        Method::Supersample => settings.jitter,
        Method::Stable | Method::StableTi | Method::PointTracking => false,
    };
    let variation = if varies { moment.frame + 1 } else { 0 };
    let mut flags = 0;
    if moment.reset {
        flags |= shaders::FRAME_RESET;
    }
    if moment.settled {
        flags |= shaders::FRAME_SETTLED;
    }
    if settings.edges == Edges::Paper {
        flags |= shaders::FRAME_PAPER_EDGES;
    }
    if settings.texture_filter == Filter::Nearest {
        flags |= shaders::FRAME_NEAREST;
    }
    if settings.subpixels == 2 {
        flags |= shaders::FRAME_QUARTERS;
    }
    flags |= match settings.path_grouping {
        Grouping::Kind => 0,
        Grouping::Mixed => shaders::FRAME_PATHS_MIXED,
        Grouping::None => shaders::FRAME_PATHS_SPREAD,
    };
    let turned = [right != previous_right, up != previous_up, forward != previous_forward];
    if moment.view.shutter > 0.0 && turned.contains(&true) {
        flags |= shaders::FRAME_TURNS;
    }
    if settings.fills() {
        flags |= shaders::FRAME_FILL;
    }
    if moment.lit_for > forgetting(settings.indirect.alpha) {
        flags |= shaders::FRAME_LIT_ALIKE;
    }
    shaders::Frame {
        right,
        up,
        forward,
        previous_right,
        previous_up,
        previous_forward,
        environment: environment.radiance.extend(0.0).to_array(),
        lens: lens(&moment.view.lens),
        previous_lens: lens(&moment.previous.lens),
        size: settings.size,
        frame: moment.frame,
        seed: settings.seed,
        d_target: settings.density,
        d_tolerance: settings.tolerance,
        light_count: moment.lights,
        instance_count: moment.instances,
        flags,
        capacity: u32::try_from(storage.capacity).unwrap_or(u32::MAX),
        occluded_limit: storage.occluded_limit,
        alpha_seed: variation,
        spp: settings.spp,
        jitter: variation,
        shadow_rays: settings.shadow_rays,
        filter_width: settings.filter_width,
        shutter: moment.view.shutter as f32,
        variation: if settings.hold == Hold::Frame { moment.frame + 1 } else { variation },
        gloss: settings.gloss,
        part: settings.path_part,
        path_depth: settings.path_depth,
        emitters: settings.emitters,
        indirect: settings.indirect.depth,
        indirect_alpha: settings.indirect.alpha,
        indirect_count: lasting(settings.indirect.alpha),
        indirect_clamp: settings.indirect.clamp,
        ..Default::default()
    }
}

/// Frames after which an exponential mean holds less of what was before than a half float can tell, 2^-11.
fn forgetting(alpha: f32) -> u32 {
    (11.0 * 2_f64.ln() / -(1.0 - f64::from(alpha)).ln()).ceil() as u32
}

/// Of how many paths the mean has the noise of an exponential one.
fn lasting(alpha: f32) -> u32 {
    ((2.0 - f64::from(alpha)) / f64::from(alpha)).round() as u32
}

fn lens(lens: &Lens) -> [f32; 4] {
    [(lens.aperture / 2.0) as f32, (1.0 / lens.focus) as f32, lens.blades as f32, 0.0]
}

/// Whether a view can be rendered from.
///
/// # Errors
/// [`Error::Setting`] if it is not finite, has no rotation, or its field of view is not between 0 and π or so close to
/// either that the tangents of a frame or the angle of a pixel have no normal `f32`; and for a lens that is none.
pub fn check_view(view: &View, [width, height]: [u32; 2]) -> Result<()> {
    let turned = view.rotation.length_squared().is_normal();
    let opened = view.yfov > 0.0 && view.yfov < std::f64::consts::PI;
    let axes = axes(view, f64::from(width) / f64::from(height), height);
    check_lens(&view.lens)?;
    if !(0.0..=1.0).contains(&view.shutter) {
        let expected = "from 0 to 1, the part of the time between frames".to_owned();
        return Err(Error::Setting { name: "view.shutter", value: view.shutter.to_string(), expected });
    }
    if view.position.is_finite() && turned && opened && axes.iter().all(|a| a[3].is_normal()) {
        return Ok(());
    }
    let expected = "a finite position, a unit quaternion and a field of view between 0 and π".to_owned();
    Err(Error::Setting { name: "view", value: format!("{view:?}"), expected })
}

/// Whether a lens is one, also in `f32`.
fn check_lens(lens: &Lens) -> Result<()> {
    let [radius, focus, ..] = self::lens(lens);
    let blades = lens.blades == 0 || (3..=16).contains(&lens.blades);
    if lens.aperture >= 0.0 && lens.focus > 0.0 && radius.is_finite() && focus.is_finite() && blades {
        return Ok(());
    }
    let expected = "an aperture of 0 or more and a focus above 0, in metres, and 0 or 3 to 16 blades".to_owned();
    Err(Error::Setting { name: "view.lens", value: format!("{lens:?}"), expected })
}

/// Camera axes in world space, with the tangents of half the field of view and the angle of a pixel.
fn axes(view: &View, aspect: f64, height: u32) -> [[f32; 4]; 3] {
    let rotation = view.rotation.normalize();
    let tangent = (view.yfov * 0.5).tan();
    let axis = |direction: DVec3, w: f64| (rotation * direction).extend(w).as_vec4().to_array();
    [axis(DVec3::X, tangent * aspect), axis(DVec3::Y, tangent), axis(DVec3::NEG_Z, 2.0 * tangent / f64::from(height))]
}

/// A light of a frame, relative to the camera, that was at `before` relative to where the camera was in the last frame.
pub fn light(light: &Light, pose: &LightPose, camera: DVec3, before: DVec3) -> shaders::Light {
    let (kind, inner, outer) = match light.kind {
        LightKind::Point => (shaders::LIGHT_POINT, 0.0, std::f32::consts::PI),
        LightKind::Spot { inner, outer } => (shaders::LIGHT_SPOT, inner, outer),
        LightKind::Directional => (shaders::LIGHT_DIRECTIONAL, 0.0, std::f32::consts::PI),
    };
    // KHR_lights_punctual, "Inner and Outer Cone Angles": its own guard against equal angles.
    let spot_scale = 1.0 / (inner.cos() - outer.cos()).max(0.001);
    let (shape, [width, height]) = match light.shape {
        LightShape::Sharp => (shaders::LIGHT_SHARP, [0.0; 2]),
        LightShape::Rectangle(size) => (shaders::LIGHT_RECTANGLE, size),
        LightShape::Disc(size) => (shaders::LIGHT_DISC, size),
    };
    // Half a width; or of directional lights the tangent of half an angle.
    let half = |size: f32| {
        let half = f64::from(size) / 2.0;
        if kind == shaders::LIGHT_DIRECTIONAL { half.tan() } else { half }
    };
    let [right, up] = [(pose.axes[0], width), (pose.axes[1], height)].map(|(axis, size)| (axis * half(size)).as_vec3());
    let moved = (pose.position - camera - before).as_vec3();
    let moved = if moved.is_finite() { moved } else { glam::Vec3::ZERO };
    let range = light.range.filter(|r| *r > 0.0 && r.is_finite());
    shaders::Light {
        position: (pose.position - camera).as_vec3().to_array(),
        moved: moved.to_array(),
        kind,
        direction: pose.direction.as_vec3().to_array(),
        inv_range2: range.map_or(0.0, |r| 1.0 / (r * r)),
        intensity: (light.color * light.intensity).to_array(),
        spot_scale,
        spot_offset: -outer.cos() * spot_scale,
        right: right.to_array(),
        up: up.to_array(),
        shape,
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn view() -> View {
        View {
            position: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            yfov: std::f64::consts::FRAC_PI_2,
            lens: Lens::PINHOLE,
            shutter: 0.0,
        }
    }

    #[test]
    fn an_unrotated_camera_looks_along_minus_z() {
        let [right, up, forward] = axes(&view(), 2.0, 100);
        assert_eq!(right[..3], [1.0, 0.0, 0.0]);
        assert_eq!(up[..3], [0.0, 1.0, 0.0]);
        assert_eq!(forward[..3], [0.0, 0.0, -1.0]);
        // tan(π/4) is 1 to an ulp of f64, which f32 rounds away.
        assert_eq!([right[3], up[3], forward[3]], [2.0, 1.0, 0.02]);
    }

    #[test]
    fn a_view_that_no_frame_can_be_seen_from_is_refused() {
        let check = |view: View| check_view(&view, [640, 480]).is_ok();
        let yfov = |yfov| check(View { yfov, ..view() });
        assert!(check(view()) && yfov(1e-30) && yfov(3.1));
        for bad in [0.0, -1.0, std::f64::consts::PI, 4.0, f64::NAN, f64::INFINITY, 1e-40] {
            assert!(!yfov(bad), "{bad}");
        }
        assert!(!check(View { position: DVec3::new(0.0, f64::NAN, 0.0), ..view() }));
        assert!(check(View { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), ..view() }), "is normalised");
        for bad in [0.0, f64::NAN, 1e200, 1e-200, f64::INFINITY] {
            assert!(!check(View { rotation: DQuat::from_xyzw(0.0, 0.0, bad, 0.0), ..view() }), "{bad}");
        }
    }

    #[test]
    fn a_lens_that_is_none_is_refused() {
        let check = |aperture, focus, blades| {
            check_view(&View { lens: Lens { aperture, focus, blades }, ..view() }, [640, 480]).is_ok()
        };
        assert!(check(0.0, f64::INFINITY, 0) && check(0.1, 4.0, 3) && check(1e3, 1e-6, 16));
        for (aperture, focus, blades) in [
            (-0.1, 4.0, 0),
            (f64::NAN, 4.0, 0),
            (f64::INFINITY, 4.0, 0),
            (1e40, 4.0, 0),
            (0.1, 0.0, 0),
            (0.1, -1.0, 0),
            (0.1, f64::NAN, 0),
            (0.1, 1e-40, 0),
            (0.1, 4.0, 2),
            (0.1, 4.0, 17),
        ] {
            assert!(!check(aperture, focus, blades), "{aperture} {focus} {blades}");
        }
    }

    #[test]
    fn a_shutter_is_open_for_no_less_than_no_time_and_no_longer_than_a_frame() {
        let check = |shutter| check_view(&View { shutter, ..view() }, [640, 480]).map_err(|e| e.to_string());
        assert!(check(0.0).is_ok() && check(1.0).is_ok() && check(1e-300).is_ok());
        for bad in [-1e-9, 1.0 + 1e-9, f64::NAN, f64::INFINITY] {
            let message = check(bad).unwrap_err();
            assert!(message.contains("view.shutter") && message.contains("from 0 to 1"), "{message}");
        }
    }

    #[test]
    fn a_light_is_placed_relative_to_the_camera_in_double_precision() {
        let far = DVec3::new(1e9, 0.0, 0.0);
        let lamp = Light {
            name: String::new(),
            node: 0,
            kind: LightKind::Point,
            color: glam::Vec3::ONE,
            intensity: 2.0,
            range: Some(10.0),
            shape: LightShape::Sharp,
        };
        let pose = LightPose {
            position: far + DVec3::new(0.25, 0.5, 1.0),
            direction: DVec3::NEG_Z,
            axes: [DVec3::X, DVec3::Y],
        };
        let placed = light(&lamp, &pose, far, DVec3::ZERO);
        assert_eq!(placed.position, [0.25, 0.5, 1.0]);
        assert_eq!(placed.moved, placed.position);
        assert_eq!((placed.intensity, placed.inv_range2), ([2.0; 3], 1.0 / 100.0));
    }
}
