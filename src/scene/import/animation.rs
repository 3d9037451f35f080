//! Animated node transforms and morph weights.

use std::collections::{HashMap, HashSet};

use glam::{DQuat, DVec3};
use gltf::json;
use gltf::json::animation::{Interpolation as JsonInterpolation, Property};
use gltf::json::validation::Checked;

use super::accessor::{Encoding, read_floats};
use super::document::{Document, label, name_or};
use super::nodes::{self, Placed, unit_quaternion};
use crate::Result;
use crate::scene::{Animation, Channel, ChannelValues, Interpolation, LocalTransform, Scene};

/// Takes over all animations of nodes of the scene. They play together; if two drive the same property of a node, the
/// first one does.
pub(super) fn import(document: &Document, placed: &[Placed], scene: &mut Scene) -> Result<()> {
    let weighed = scene.deformers.iter().filter(|deformer| !deformer.weights.is_empty());
    let targets_of = weighed.map(|d| (scene.instances[d.instance].node, d.weights.len())).collect();
    let node_of = nodes::node_of(document, placed);
    let mut importer = Importer { document, node_of, targets_of, driven: HashSet::new() };
    for (index, source) in document.root.animations.iter().enumerate() {
        let place = label("animation", index, source.name.as_deref());
        let mut animation =
            Animation { name: name_or("animation", index, source.name.as_deref()), channels: Vec::new() };
        for channel in &source.channels {
            animation.channels.extend(importer.channel(source, channel, &place, scene)?);
        }
        if !animation.channels.is_empty() {
            scene.animations.push(animation);
        }
    }
    Ok(())
}

struct Importer<'a> {
    document: &'a Document,
    /// The scene's node for each of the file's.
    node_of: Vec<Option<usize>>,
    /// How many morph targets the mesh has that a node of the scene places, where it has some.
    targets_of: HashMap<usize, usize>,
    /// Properties that an animation drives already.
    driven: HashSet<(usize, u8)>,
}

impl Importer<'_> {
    /// A channel, or none if it moves nothing in the scene.
    fn channel(
        &mut self,
        animation: &json::Animation,
        channel: &json::animation::Channel,
        place: &str,
        scene: &mut Scene,
    ) -> Result<Option<Channel>> {
        let document = self.document;
        let target = channel.target.node.value();
        let place = format!("{place}, channel of {}", document.node_label(target));
        let Checked::Valid(property) = channel.target.path else {
            scene.notices.push(format!("{place} has an unknown path and is ignored"));
            return Ok(None);
        };
        let node = match self.node_of.get(target) {
            None => return Err(document.bad(format!("{place}: there is no such node: export it again"))),
            Some(None) => return Ok(None), // a node of another scene
            Some(Some(node)) => *node,
        };
        let weighs = property == Property::MorphTargetWeights;
        if weighs && !self.targets_of.contains_key(&node) {
            scene.notices.push(format!("{place} is ignored: the node shows no mesh with morph targets"));
            return Ok(None);
        }
        if !weighs && matches!(scene.nodes[node].local, LocalTransform::Matrix(_)) {
            scene.notices.push(format!("{place} is ignored: the node has a matrix, which glTF does not animate"));
            return Ok(None);
        }
        if !self.driven.insert((node, property as u8)) {
            scene.notices.push(format!("{place} is ignored: an earlier channel drives the same property"));
            return Ok(None);
        }
        let missing = || document.bad(format!("{place} has a sampler that does not exist: export it again"));
        let sampler = animation.samplers.get(channel.sampler.value()).ok_or_else(missing)?;
        self.sampled(sampler, node, property, &place, &mut scene.notices).map(Some)
    }

    fn sampled(
        &self,
        sampler: &json::animation::Sampler,
        node: usize,
        property: Property,
        place: &str,
        notices: &mut Vec<String>,
    ) -> Result<Channel> {
        let document = self.document;
        let interpolation = match sampler.interpolation {
            Checked::Valid(JsonInterpolation::Step) => Interpolation::Step,
            Checked::Valid(JsonInterpolation::Linear) => Interpolation::Linear,
            Checked::Valid(JsonInterpolation::CubicSpline) => Interpolation::CubicSpline,
            Checked::Invalid => {
                return Err(document.bad(format!("{place} has an unknown interpolation: export it again")));
            }
        };
        let times = read_floats::<1>(document, sampler.input.value(), Encoding::Float, &format!("{place}, times"))?;
        let targets = self.targets_of.get(&node).copied().filter(|_| property == Property::MorphTargetWeights);
        let mut keys = Keys {
            times: times.into_iter().map(|[time]| f64::from(time)).collect(),
            rows: if interpolation == Interpolation::CubicSpline { 3 } else { 1 },
            width: targets.unwrap_or(1),
            place,
        };
        let values = self.values(sampler.output.value(), property, &mut keys, notices)?;
        document.spend(keys.times.len() * keys.width)?;
        Ok(Channel { node, times: keys.times, interpolation, values })
    }

    fn values(
        &self,
        output: usize,
        property: Property,
        keys: &mut Keys,
        notices: &mut Vec<String>,
    ) -> Result<ChannelValues> {
        let document = self.document;
        let place = format!("{}, values", keys.place);
        if property == Property::Rotation {
            let values = read_floats::<4>(document, output, Encoding::Normalized, &place)?;
            let values = keys.checked(document, values, notices)?;
            return Ok(ChannelValues::Rotation(rotations(document, &values, keys.rows, keys.place)?));
        }
        if property == Property::MorphTargetWeights {
            let values = read_floats::<1>(document, output, Encoding::Normalized, &place)?;
            let values = keys.checked(document, values, notices)?;
            return Ok(ChannelValues::Weights(values.into_iter().map(|[weight]| f64::from(weight)).collect()));
        }
        let values = read_floats::<3>(document, output, Encoding::Quantized, &place)?;
        let values = keys.checked(document, values, notices)?;
        let values = values.into_iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
        Ok(if property == Property::Scale { ChannelValues::Scale(values) } else { ChannelValues::Translation(values) })
    }
}

/// Quaternions, normalised; those of cubic splines stay as they are, because their tangents belong to them, and what
/// they add up to is normalised (appendix C.4).
fn rotations(document: &Document, values: &[[f32; 4]], per_key: usize, place: &str) -> Result<Vec<DQuat>> {
    let quaternion = |(index, value): (usize, &[f32; 4])| {
        let value = value.map(f64::from);
        let unit = unit_quaternion(value);
        let is_tangent = per_key == 3 && index % 3 != 1;
        if per_key == 3 { (is_tangent || unit.is_some()).then_some(DQuat::from_array(value)) } else { unit }
    };
    let rotations: Option<Vec<DQuat>> = values.iter().enumerate().map(quaternion).collect();
    rotations.ok_or_else(|| document.bad(format!("{place} has a rotation that is zero: repair it")))
}

struct Keys<'a> {
    times: Vec<f64>,
    /// 3 for cubic splines, or else 1.
    rows: usize,
    /// Values a row: one a morph target, or else 1.
    width: usize,
    place: &'a str,
}

impl Keys<'_> {
    /// Checks that the values fit the keys; of keys that coincide only the last one stays.
    fn checked<T: Copy>(&mut self, document: &Document, values: Vec<T>, notices: &mut Vec<String>) -> Result<Vec<T>> {
        let place = self.place;
        let (keys, found, per_key) = (self.times.len(), values.len(), self.rows * self.width);
        if keys == 0 || found != keys * per_key {
            return Err(document.bad(format!(
                "{place} has {keys} keys and {found} values, {per_key} a key are needed: export it again"
            )));
        }
        if self.times.windows(2).any(|pair| pair[1] < pair[0]) {
            return Err(document.bad(format!("{place} has key times that decrease: export it again")));
        }
        let last_of_its_time = |key: usize| key + 1 == keys || self.times[key + 1] > self.times[key];
        let kept: Vec<usize> = (0..keys).filter(|&key| last_of_its_time(key)).collect();
        if kept.len() == keys {
            return Ok(values);
        }
        notices.push(format!("{place} has keys that coincide; the last of each is used"));
        self.times = kept.iter().map(|&key| self.times[key]).collect();
        let range = |key: &usize| key * per_key..(key + 1) * per_key;
        Ok(kept.iter().flat_map(range).map(|index| values[index]).collect())
    }
}
