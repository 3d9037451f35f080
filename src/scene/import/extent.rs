//! Whether a scene stays within 32-bit floats, at all times of its animations.

use glam::{DAffine3, DVec3, Vec3};

use super::document::Document;
use crate::Result;
use crate::scene::{Channel, ChannelValues, Interpolation, LocalTransform, Scene};

/// The renderer rounds camera-relative positions to f32; the difference of two positions must fit, too.
const LARGEST: f64 = f32::MAX as f64 / 4.0;

/// Upper bounds of what a transform does, at any time.
#[derive(Clone, Copy)]
struct Reach {
    /// Metres by which it moves the origin.
    distance: f64,
    /// Factor by which it lengthens a vector.
    scale: f64,
}

impl Reach {
    /// Bounds of what this does to what another transform has done.
    fn then(self, inner: Self) -> Self {
        Self { distance: self.distance + self.scale * inner.distance, scale: self.scale * inner.scale }
    }
}

/// Refuses a scene of which something can get beyond the range of f32, naming the node, and a scene of nothing.
pub(super) fn check(document: &Document, scene: &Scene) -> Result<()> {
    if scene.instances.is_empty() {
        return Err(document.bad("there is no triangle in the scene: nothing to render"));
    }
    let reaches = global_reaches(scene);
    let refuse = |node: usize| {
        let name = &scene.nodes[node].name;
        Err(document.bad(format!("what node '{name}' places overflows 32-bit floats: scale it down")))
    };
    // Written so that an infinite or undefined bound fails as well.
    let fits = |length: f64| length < LARGEST;
    if let Some(node) = reaches.iter().position(|reach| !(fits(reach.distance) && fits(reach.scale))) {
        return refuse(node);
    }
    let mut radii: Vec<f64> = scene.meshes.iter().map(|mesh| farthest(&mesh.positions)).collect();
    let weights = largest_weights(scene);
    let mut skinned = vec![false; scene.instances.len()];
    for deformer in &scene.deformers {
        let instance = &scene.instances[deformer.instance];
        let most = deformer.weights.iter().fold(weights[instance.node], |most, weight| weight.abs().max(most));
        let targets = &scene.meshes[instance.mesh].morph_targets;
        radii[instance.mesh] += most * targets.iter().map(|target| farthest(&target.positions)).sum::<f64>();
        let Some(skin) = deformer.skin.map(|skin| &scene.skins[skin]) else { continue };
        skinned[deformer.instance] = true;
        let mut joints = skin.joints.iter().zip(&skin.inverse_bind);
        let beyond = |(joint, bind): &(&usize, &DAffine3)| {
            let reach = reaches[**joint].then(matrix(bind));
            !(fits(reach.scale) && fits(reach.distance + reach.scale * radii[instance.mesh]))
        };
        if let Some((joint, _)) = joints.find(beyond) {
            return refuse(*joint);
        }
    }
    for (instance, _) in scene.instances.iter().zip(&skinned).filter(|(_, skinned)| !**skinned) {
        let reach = reaches[instance.node];
        if !fits(reach.distance + reach.scale * radii[instance.mesh]) {
            return refuse(instance.node);
        }
    }
    Ok(())
}

fn farthest(positions: &[Vec3]) -> f64 {
    positions.iter().fold(0.0, |most, p| p.as_dvec3().length().max(most))
}

/// A bound of the morph weights that animations give the mesh of each node.
fn largest_weights(scene: &Scene) -> Vec<f64> {
    let mut most = vec![0.0f64; scene.nodes.len()];
    for channel in scene.animations.iter().flat_map(|animation| &animation.channels) {
        if let ChannelValues::Weights(values) = &channel.values {
            most[channel.node] = most[channel.node].max(largest(channel, values.iter().map(|weight| weight.abs())));
        }
    }
    most
}

/// Bounds of each node's transform to the world.
fn global_reaches(scene: &Scene) -> Vec<Reach> {
    let mut locals: Vec<Reach> = scene.nodes.iter().map(|node| rest(&node.local)).collect();
    for channel in scene.animations.iter().flat_map(|animation| &animation.channels) {
        let reach = &mut locals[channel.node];
        match &channel.values {
            ChannelValues::Translation(values) => {
                reach.distance = reach.distance.max(largest(channel, lengths(values)));
            }
            ChannelValues::Scale(values) => reach.scale = reach.scale.max(largest(channel, lengths(values))),
            ChannelValues::Rotation(_) => {} // of unit length
            ChannelValues::Weights(_) => {}  // no part of a transform
        }
    }
    let mut globals: Vec<Reach> = Vec::with_capacity(locals.len());
    for (node, local) in scene.nodes.iter().zip(locals) {
        globals.push(node.parent.map_or(local, |parent| globals[parent].then(local)));
    }
    globals
}

fn rest(local: &LocalTransform) -> Reach {
    match local {
        LocalTransform::Trs { translation, scale, .. } => {
            Reach { distance: translation.length(), scale: scale.abs().max_element() }
        }
        LocalTransform::Matrix(m) => matrix(m),
    }
}

fn matrix(m: &DAffine3) -> Reach {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
    let squares: f64 = columns.iter().map(|column| column.length_squared()).sum();
    Reach { distance: m.translation.length(), scale: squares.sqrt() } // the Frobenius norm
}

fn lengths(values: &[DVec3]) -> impl Iterator<Item = f64> {
    values.iter().map(|value| value.length())
}

/// A bound of the length of what a channel gives. Between keys a spline adds up two values, with weights of at most 1,
/// and two tangents, with at most 4/27 of the seconds between the keys.
fn largest(channel: &Channel, lengths: impl Iterator<Item = f64>) -> f64 {
    let most = lengths.fold(0.0, f64::max);
    if channel.interpolation != Interpolation::CubicSpline {
        return most;
    }
    let seconds = channel.times.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    2.0 * most + 2.0 * most * seconds * (4.0 / 27.0)
}
