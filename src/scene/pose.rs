//! Everything that moves, at one moment, in f64.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

use super::{
    Animation, Camera, Channel, ChannelValues, Deformation, Interpolation, LightPose, LocalTransform, Mesh, Pose,
    Scene, View, deform,
};

impl LocalTransform {
    /// The transform as a matrix: scale, then rotation, then translation.
    #[must_use]
    pub fn affine(&self) -> DAffine3 {
        match *self {
            Self::Trs { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(matrix) => matrix,
        }
    }
}

impl Animation {
    /// Seconds from 0 to the last key of any channel, after which the animation starts again; 0 if it has one key.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.channels.iter().filter_map(|channel| channel.times.last()).fold(0.0, |longest, &t| t.max(longest))
    }
}

impl Scene {
    /// Seconds that the longest animation takes; 0 if nothing is animated.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.animations.iter().map(Animation::duration).fold(0.0, f64::max)
    }

    /// Evaluates animations and hierarchy at a time in seconds; a time that is not finite stands for 0.
    ///
    /// All animations play together, each looped on its own [`Animation::duration`]. A property that several drive
    /// follows the last one (import leaves only the first in).
    #[must_use]
    pub fn pose(&self, time: f64) -> Pose {
        let globals = self.global_transforms(time);
        let mut pose = Pose {
            instances: self.instances.iter().map(|instance| globals[instance.node]).collect(),
            deformations: Vec::with_capacity(self.deformers.len()),
            lights: self.lights.iter().map(|light| light_pose(&globals[light.node])).collect(),
            cameras: self.cameras.iter().map(|camera| view(&globals[camera.node], camera)).collect(),
            drift: self.medium.map_or(DVec3::ZERO, |medium| medium.drifted(time)),
        };
        for (deformer, weights) in self.deformers.iter().zip(self.morph_weights(time)) {
            let mut joints = Vec::new();
            if let Some(skin) = deformer.skin {
                (pose.instances[deformer.instance], joints) = self.skins[skin].place(&globals);
            }
            pose.deformations.push(Deformation { instance: deformer.instance, joints, weights });
        }
        pose
    }

    /// The world-space box around all instances in a pose, as its lowest and highest corner in metres; none if there
    /// is no triangle. It contains the transformed boxes of the meshes: it can be larger than the tightest one. Deforms
    /// the meshes that the pose deforms, which takes its time.
    #[must_use]
    pub fn bounds(&self, pose: &Pose) -> Option<(DVec3, DVec3)> {
        let mut boxes: Vec<_> = self.meshes.iter().map(|mesh| mesh_bounds(mesh, &mesh.positions)).collect();
        for deformation in &pose.deformations {
            let mesh = self.instances[deformation.instance].mesh;
            boxes[mesh] = mesh_bounds(&self.meshes[mesh], &deform::positions(&self.meshes[mesh], deformation));
        }
        let placed = self.instances.iter().zip(&pose.instances);
        let boxes = placed.filter_map(|(instance, transform)| Some(transformed(boxes[instance.mesh]?, transform)));
        boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// The morph weights of each deformer.
    fn morph_weights(&self, time: f64) -> Vec<Vec<f64>> {
        let mut weights: Vec<Vec<f64>> = self.deformers.iter().map(|deformer| deformer.weights.clone()).collect();
        if weights.iter().all(Vec::is_empty) {
            return weights;
        }
        let nodes = self.deformers.iter().map(|deformer| self.instances[deformer.instance].node);
        let deformer_of: HashMap<usize, usize> = nodes.zip(0..).collect();
        for animation in &self.animations {
            let time = looped(time, animation.duration());
            for channel in &animation.channels {
                if let (ChannelValues::Weights(values), Some(&deformer)) =
                    (&channel.values, deformer_of.get(&channel.node))
                {
                    channel.weights(&Segment::find(&channel.times, time), values, &mut weights[deformer]);
                }
            }
        }
        weights
    }

    /// The object-to-world transform of each node.
    fn global_transforms(&self, time: f64) -> Vec<DAffine3> {
        let mut locals: Vec<LocalTransform> = self.nodes.iter().map(|node| node.local).collect();
        for animation in &self.animations {
            let time = looped(time, animation.duration());
            for channel in &animation.channels {
                channel.apply(time, &mut locals[channel.node]);
            }
        }
        let mut globals: Vec<DAffine3> = Vec::with_capacity(locals.len());
        for (node, local) in self.nodes.iter().zip(&locals) {
            let local = local.affine();
            globals.push(node.parent.map_or(local, |parent| globals[parent] * local));
        }
        globals
    }
}

impl Pose {
    /// Whether all that samples lie on is where it is in another pose. What drifts in the air moves no sample.
    #[must_use]
    pub fn stands_like(&self, other: &Self) -> bool {
        let Self { instances, deformations, lights, cameras, drift: _ } = self;
        (instances, deformations, lights, cameras)
            == (&other.instances, &other.deformations, &other.lights, &other.cameras)
    }
}

impl Pose {
    /// Whether light falls in the other as it does here, wherever the cameras are. What drifts in mist does not count: light meets
    /// mist without its noise.
    pub fn is_lit_like(&self, other: &Self) -> bool {
        let Self { instances, deformations, lights, cameras: _, drift: _ } = self;
        (instances, deformations, lights) == (&other.instances, &other.deformations, &other.lights)
    }
}

impl Channel {
    /// Sets the property that the channel drives to its value at a time in seconds. Matrices are not driven.
    fn apply(&self, time: f64, local: &mut LocalTransform) {
        let LocalTransform::Trs { translation, rotation, scale } = local else { return };
        let at = Segment::find(&self.times, time);
        match &self.values {
            ChannelValues::Translation(values) => *translation = self.vector(&at, values),
            ChannelValues::Scale(values) => *scale = self.vector(&at, values),
            ChannelValues::Rotation(values) => *rotation = self.quaternion(&at, values),
            ChannelValues::Weights(_) => {} // no part of a transform
        }
    }

    /// Sets the weights of all morph targets.
    fn weights(&self, at: &Segment, values: &[f64], out: &mut [f64]) {
        let targets = out.len();
        for (target, out) in out.iter_mut().enumerate() {
            let value = |row: usize| values[row * targets + target];
            *out = match self.interpolation {
                Interpolation::Step => value(at.key),
                Interpolation::Linear => value(at.key) + (value(at.next) - value(at.key)) * at.fraction,
                Interpolation::CubicSpline => {
                    let weights = at.hermite();
                    at.cubic_rows().into_iter().zip(weights).map(|(row, weight)| value(row) * weight).sum()
                }
            };
        }
    }

    fn vector(&self, at: &Segment, values: &[DVec3]) -> DVec3 {
        match self.interpolation {
            Interpolation::Step => values[at.key],
            Interpolation::Linear => values[at.key].lerp(values[at.next], at.fraction),
            Interpolation::CubicSpline => {
                let [p0, b0, a1, p1] = at.cubic(values);
                let [w0, v0, v1, w1] = at.hermite();
                p0 * w0 + b0 * v0 + a1 * v1 + p1 * w1
            }
        }
    }

    fn quaternion(&self, at: &Segment, values: &[DQuat]) -> DQuat {
        match self.interpolation {
            Interpolation::Step => values[at.key],
            Interpolation::Linear => slerp(values[at.key], values[at.next], at.fraction),
            Interpolation::CubicSpline => {
                let [p0, b0, a1, p1] = at.cubic(values);
                let [w0, v0, v1, w1] = at.hermite();
                let sum = p0 * w0 + b0 * v0 + a1 * v1 + p1 * w1;
                let length = sum.length();
                if length > 0.0 && length.is_finite() { sum / length } else { p0.normalize() }
            }
        }
    }
}

/// Where a time falls between keys.
struct Segment {
    key: usize,
    /// Equal to `key` before the first and after the last key.
    next: usize,
    /// 0 at `key` ..= 1 at `next`.
    fraction: f64,
    /// Seconds from `key` to `next`.
    seconds: f64,
}

impl Segment {
    fn find(times: &[f64], time: f64) -> Self {
        let after = times.partition_point(|&key| key <= time);
        if after == 0 || after == times.len() {
            let key = after.saturating_sub(1);
            return Self { key, next: key, fraction: 0.0, seconds: 0.0 };
        }
        let (from, to) = (times[after - 1], times[after]);
        // `to > from` in f32 steps: the difference is not zero.
        Self { key: after - 1, next: after, fraction: (time - from) / (to - from), seconds: to - from }
    }

    /// Value and out-tangent of this key, in-tangent and value of the next one.
    fn cubic<T: Copy>(&self, values: &[T]) -> [T; 4] {
        self.cubic_rows().map(|row| values[row])
    }

    /// Where [`Segment::cubic`] finds its values.
    fn cubic_rows(&self) -> [usize; 4] {
        [3 * self.key + 1, 3 * self.key + 2, 3 * self.next, 3 * self.next + 1]
    }

    /// Weights of what [`Segment::cubic`] returns (glTF 2.0, appendix C.4).
    fn hermite(&self) -> [f64; 4] {
        let (t, d) = (self.fraction, self.seconds);
        let (t2, t3) = (t * t, t * t * t);
        [2.0 * t3 - 3.0 * t2 + 1.0, d * (t3 - 2.0 * t2 + t), d * (t3 - t2), -2.0 * t3 + 3.0 * t2]
    }
}

/// `time` wrapped into 0..duration.
fn looped(time: f64, duration: f64) -> f64 {
    if !time.is_finite() {
        return 0.0;
    }
    if duration > 0.0 { time.rem_euclid(duration) } else { time }
}

/// Spherical interpolation along the shorter arc (appendix C.3). The angle comes from the arc tangent, which is exact
/// to a few ulps for nearly equal rotations, where an arc cosine is not.
fn slerp(from: DQuat, to: DQuat, fraction: f64) -> DQuat {
    let to = if from.dot(to) < 0.0 { -to } else { to };
    let angle = 2.0 * (to - from).length().atan2((to + from).length());
    let sine = angle.sin();
    // Below this the weights are those of a linear interpolation to within the last bit (x - sin x < x^3 / 6).
    if angle < 1e-8 || sine <= 0.0 {
        return from.lerp(to, fraction);
    }
    let sum = from * (((1.0 - fraction) * angle).sin() / sine) + to * ((fraction * angle).sin() / sine);
    sum.normalize()
}

/// The box around a mesh's triangles, were its vertices at `positions`.
fn mesh_bounds(mesh: &Mesh, positions: &[Vec3]) -> Option<(DVec3, DVec3)> {
    let first = positions.get(mesh.triangles.first()?[0] as usize)?.to_owned();
    let corners = mesh.triangles.iter().flatten().map(|&vertex| positions[vertex as usize]);
    let (low, high) = corners.fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
    Some((low.as_dvec3(), high.as_dvec3()))
}

fn transformed((low, high): (DVec3, DVec3), transform: &DAffine3) -> (DVec3, DVec3) {
    let (center, half) = (low.midpoint(high), (high - low) / 2.0);
    let matrix = transform.matrix3;
    let extent = matrix.x_axis.abs() * half.x + matrix.y_axis.abs() * half.y + matrix.z_axis.abs() * half.z;
    let center = transform.transform_point3(center);
    (center - extent, center + extent)
}

fn light_pose(global: &DAffine3) -> LightPose {
    let direction = unit(-global.matrix3.z_axis).unwrap_or(DVec3::NEG_Z);
    let [right, up] = upright(-direction, global.matrix3.y_axis);
    LightPose { position: global.translation, direction, axes: [right, up] }
}

/// A camera ignores its node's scale, and a mirrored node's mirroring: it looks along -Z with +Y as far up as possible.
fn view(global: &DAffine3, camera: &Camera) -> View {
    let back = unit(global.matrix3.z_axis).unwrap_or(DVec3::Z);
    let [right, up] = upright(back, global.matrix3.y_axis);
    let rotation = DQuat::from_mat3(&DMat3::from_cols(right, up, back)).normalize();
    View { position: global.translation, rotation, yfov: camera.yfov, lens: camera.lens, shutter: camera.shutter }
}

/// The unit vectors to the right and up across `back`, a unit vector, with `up` as far up as possible.
fn upright(back: DVec3, up: DVec3) -> [DVec3; 2] {
    let up = unit(up).unwrap_or(DVec3::Y);
    let right = unit(up.cross(back)).unwrap_or_else(|| back.any_orthonormal_vector());
    [right, back.cross(right)]
}

/// `v` normalised; none if it is zero or not finite. Scaled first, because extreme scales overflow when squared.
pub(super) fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    (v.is_finite() && largest > 0.0).then(|| (v / largest).normalize())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::{Camera, Instance, Lens, Light, LightKind, LightShape, Node};

    fn channel(interpolation: Interpolation, times: &[f64], values: ChannelValues) -> Channel {
        Channel { node: 0, times: times.to_vec(), interpolation, values }
    }

    /// A scene of one node with an instance, driven by one channel.
    fn driven(channel: Channel) -> Scene {
        Scene {
            nodes: vec![Node::default()],
            instances: vec![Instance { node: 0, mesh: 0 }],
            animations: vec![Animation { name: String::new(), channels: vec![channel] }],
            ..Scene::default()
        }
    }

    fn place(scene: &Scene, time: f64) -> DVec3 {
        scene.pose(time).instances[0].translation
    }

    #[test]
    fn steps_hold_and_lines_run_between_keys() {
        let values = ChannelValues::Translation(vec![DVec3::X, DVec3::Y, DVec3::Z * 4.0]);
        let times = [0.5, 1.0, 2.0];
        let step = driven(channel(Interpolation::Step, &times, values.clone()));
        assert_eq!(
            [0.0, 0.5, 0.75, 1.0, 1.99].map(|t| place(&step, t)),
            [DVec3::X, DVec3::X, DVec3::X, DVec3::Y, DVec3::Y]
        );
        let linear = driven(channel(Interpolation::Linear, &times, values));
        assert_eq!(place(&linear, 0.25), DVec3::X, "before the first key");
        assert_eq!(place(&linear, 0.75), DVec3::new(0.5, 0.5, 0.0));
        assert_eq!(place(&linear, 1.75), DVec3::new(0.0, 0.25, 3.0));
        assert_eq!(linear.duration(), 2.0);
        assert_eq!(place(&linear, 2.75), place(&linear, 0.75), "looped");
        assert_eq!(place(&linear, -1.25), place(&linear, 0.75), "looped backwards");
        assert_eq!(place(&linear, f64::NAN), DVec3::X);
    }

    #[test]
    fn a_single_key_holds_forever() {
        for interpolation in [Interpolation::Step, Interpolation::Linear] {
            let scene = driven(channel(interpolation, &[0.0], ChannelValues::Scale(vec![DVec3::splat(3.0)])));
            assert_eq!([-1.0, 0.0, 7.0].map(|t| scene.pose(t).instances[0].matrix3.determinant()), [27.0; 3]);
        }
        let values = ChannelValues::Translation(vec![DVec3::ONE, DVec3::X, DVec3::ONE]);
        assert_eq!(place(&driven(channel(Interpolation::CubicSpline, &[1.0], values)), 9.0), DVec3::X);
    }

    /// A cubic Hermite spline whose tangents are the derivatives of a cubic polynomial is that polynomial.
    #[test]
    fn a_spline_reproduces_a_cubic_polynomial() {
        let p = |t: f64| DVec3::new(t * t * t - 2.0 * t, 0.5 * t * t, 3.0 - t);
        let slope = |t: f64| DVec3::new(3.0 * t * t - 2.0, t, -1.0);
        let times = [0.0, 0.5, 2.0];
        let values = times.iter().flat_map(|&t| [slope(t), p(t), slope(t)]).collect();
        let scene = driven(channel(Interpolation::CubicSpline, &times, ChannelValues::Translation(values)));
        for i in 0..200 {
            let t = f64::from(i) * 0.01;
            // A few dozen roundings of 2^-53 on values below 10.
            assert!((place(&scene, t) - p(t)).length() < 1e-13, "at {t}");
        }
        assert!((place(&scene, 1.0) - p(1.01)).length() > 1e-3, "the comparison sees a hundredth of a second");
    }

    #[test]
    fn rotations_take_the_shorter_arc_at_constant_speed() {
        for (angle, sign) in [(1.0, 1.0), (3.0, -1.0), (1e-10, 1.0), (2.0, -1.0)] {
            let values = vec![DQuat::IDENTITY, DQuat::from_rotation_z(angle) * sign];
            let scene = driven(channel(Interpolation::Linear, &[0.0, 1.0], ChannelValues::Rotation(values)));
            for t in [0.0, 0.1, 0.5, 0.9] {
                let expected = DMat3::from_rotation_z(angle * t);
                let found = scene.pose(t).instances[0].matrix3;
                assert!((found.x_axis - expected.x_axis).length() < 1e-14 * (1.0 + angle), "{angle} at {t}");
            }
        }
    }

    #[test]
    fn opposite_rotations_stay_finite() {
        let values = vec![DQuat::IDENTITY, DQuat::from_rotation_z(std::f64::consts::PI)];
        let scene = driven(channel(Interpolation::Linear, &[0.0, 1.0], ChannelValues::Rotation(values)));
        assert!((scene.pose(0.5).instances[0].matrix3.determinant() - 1.0).abs() < 1e-14);
        let cancelling = vec![DQuat::IDENTITY * 0.0, DQuat::IDENTITY, -DQuat::IDENTITY * 0.0];
        let cancelling = [cancelling.clone(), cancelling.iter().map(|&q| -q).collect()].concat();
        let scene = driven(channel(Interpolation::CubicSpline, &[0.0, 1.0], ChannelValues::Rotation(cancelling)));
        assert_eq!(scene.pose(0.5).instances[0].matrix3.determinant(), 1.0, "the spline passes through zero");
    }

    #[test]
    fn children_follow_their_parents() {
        let trs = |translation, rotation, scale| LocalTransform::Trs { translation, rotation, scale };
        let parent = trs(DVec3::X, DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2), DVec3::splat(2.0));
        let child = trs(DVec3::X, DQuat::IDENTITY, DVec3::ONE);
        let node = |parent, local| Node { name: String::new(), parent, local };
        let scene = Scene {
            nodes: vec![node(None, parent), node(Some(0), child)],
            instances: vec![Instance { node: 1, mesh: 0 }],
            ..Scene::default()
        };
        assert!((place(&scene, 0.0) - DVec3::new(1.0, 2.0, 0.0)).length() < 1e-15);
    }

    #[test]
    fn lights_and_cameras_ignore_scale_and_survive_none() {
        for scale in [DVec3::ONE, DVec3::new(1e-200, 3.0, 1e200), DVec3::new(2.0, -1.0, 5.0), DVec3::ZERO] {
            let local = LocalTransform::Trs { translation: DVec3::ONE, rotation: DQuat::IDENTITY, scale };
            let scene = Scene {
                nodes: vec![Node { name: String::new(), parent: None, local }],
                cameras: vec![Camera { name: String::new(), node: 0, yfov: 1.0, lens: Lens::PINHOLE, shutter: 0.0 }],
                lights: vec![Light {
                    name: String::new(),
                    node: 0,
                    kind: LightKind::Directional,
                    color: Vec3::ONE,
                    intensity: 1.0,
                    range: None,
                    shape: LightShape::Sharp,
                }],
                ..Scene::default()
            };
            let pose = scene.pose(0.0);
            assert_eq!(pose.lights[0].direction, DVec3::NEG_Z, "{scale}");
            let rotation = pose.cameras[0].rotation;
            assert!((rotation * DVec3::NEG_Z - DVec3::NEG_Z).length() < 1e-15, "{scale}");
            assert!((rotation.length() - 1.0).abs() < 1e-15, "{scale}");
        }
    }

    #[test]
    fn bounds_contain_rotated_meshes() {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(100.0)],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let mut scene = Scene {
            meshes: vec![mesh],
            ..driven(channel(Interpolation::Step, &[0.0], ChannelValues::Scale(vec![DVec3::ONE])))
        };
        scene.nodes[0].local = LocalTransform::Matrix(DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2));
        let (low, high) = scene.bounds(&scene.pose(0.0)).unwrap();
        assert!((low - DVec3::NEG_X).length() < 1e-15 && (high - DVec3::Y).length() < 1e-15, "{low} {high}");
        scene.meshes[0].triangles.clear();
        assert_eq!(scene.bounds(&scene.pose(0.0)), None);
    }
}
