//! Whether a scene stays within 32-bit floats, at all times of its animations.

use glam::{DVec3, Vec3};

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
    let radius = |positions: &[Vec3]| positions.iter().fold(0.0f64, |most, p| most.max(p.as_dvec3().length()));
    let radii: Vec<f64> = scene.meshes.iter().map(|mesh| radius(&mesh.positions)).collect();
    for instance in &scene.instances {
        let reach = reaches[instance.node];
        if !fits(reach.distance + reach.scale * radii[instance.mesh]) {
            return refuse(instance.node);
        }
    }
    Ok(())
}

/// Bounds of each node's transform to the world.
fn global_reaches(scene: &Scene) -> Vec<Reach> {
    let mut locals: Vec<Reach> = scene.nodes.iter().map(|node| rest(&node.local)).collect();
    for channel in scene.animations.iter().flat_map(|animation| &animation.channels) {
        let reach = &mut locals[channel.node];
        match &channel.values {
            ChannelValues::Translation(values) => reach.distance = reach.distance.max(largest(channel, values)),
            ChannelValues::Scale(values) => reach.scale = reach.scale.max(largest(channel, values)),
            ChannelValues::Rotation(_) => {} // of unit length
        }
    }
    let mut globals: Vec<Reach> = Vec::with_capacity(locals.len());
    for (node, local) in scene.nodes.iter().zip(locals) {
        globals.push(node.parent.map_or(local, |parent| {
            let parent = globals[parent];
            Reach { distance: parent.distance + parent.scale * local.distance, scale: parent.scale * local.scale }
        }));
    }
    globals
}

fn rest(local: &LocalTransform) -> Reach {
    match local {
        LocalTransform::Trs { translation, scale, .. } => {
            Reach { distance: translation.length(), scale: scale.abs().max_element() }
        }
        LocalTransform::Matrix(m) => {
            let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
            let squares: f64 = columns.iter().map(|column| column.length_squared()).sum();
            Reach { distance: m.translation.length(), scale: squares.sqrt() } // the Frobenius norm
        }
    }
}

/// A bound of the length of what a channel gives. Between keys a spline adds up two values, with weights of at most 1,
/// and two tangents, with at most 4/27 of the seconds between the keys.
fn largest(channel: &Channel, values: &[DVec3]) -> f64 {
    let most = values.iter().map(|value| value.length()).fold(0.0, f64::max);
    if channel.interpolation != Interpolation::CubicSpline {
        return most;
    }
    let seconds = channel.times.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    2.0 * most + 2.0 * most * seconds * (4.0 / 27.0)
}
