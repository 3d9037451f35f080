//! Animated node transforms.

use std::collections::HashSet;

use glam::{DQuat, DVec3};
use gltf::json;
use gltf::json::animation::{Interpolation as JsonInterpolation, Property};
use gltf::json::validation::Checked;

use super::accessor::{Encoding, read_floats};
use super::document::{Document, label, name_or};
use super::nodes::{Placed, unit_quaternion};
use crate::Result;
use crate::scene::{Animation, Channel, ChannelValues, Interpolation, LocalTransform, Scene};

/// Takes over all animations of nodes of the scene. They play together; if two drive the same property of a node, the
/// first one does.
pub(super) fn import(document: &Document, placed: &[Placed], scene: &mut Scene) -> Result<()> {
    let mut node_of = vec![None; document.root.nodes.len()];
    for (node, placed) in placed.iter().enumerate() {
        node_of[placed.source] = Some(node);
    }
    let mut importer = Importer { document, node_of, driven: HashSet::new() };
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
        if property == Property::MorphTargetWeights {
            return Ok(None); // nodes with morph targets are refused
        }
        if matches!(scene.nodes[node].local, LocalTransform::Matrix(_)) {
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
        let mut keys = Keys {
            times: times.into_iter().map(|[time]| f64::from(time)).collect(),
            per_key: if interpolation == Interpolation::CubicSpline { 3 } else { 1 },
            place,
        };
        let output = sampler.output.value();
        let values_place = format!("{place}, values");
        let values = if property == Property::Rotation {
            let values = read_floats::<4>(document, output, Encoding::Normalized, &values_place)?;
            let values = keys.checked(document, values, notices)?;
            ChannelValues::Rotation(rotations(document, &values, keys.per_key, place)?)
        } else {
            let values = read_floats::<3>(document, output, Encoding::Quantized, &values_place)?;
            let values = keys.checked(document, values, notices)?;
            let values = values.into_iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
            if property == Property::Scale { ChannelValues::Scale(values) } else { ChannelValues::Translation(values) }
        };
        document.spend(keys.times.len())?;
        Ok(Channel { node, times: keys.times, interpolation, values })
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
    per_key: usize,
    place: &'a str,
}

impl Keys<'_> {
    /// Checks that the values fit the keys; of keys that coincide only the last one stays.
    fn checked<T: Copy>(&mut self, document: &Document, values: Vec<T>, notices: &mut Vec<String>) -> Result<Vec<T>> {
        let place = self.place;
        let (keys, found) = (self.times.len(), values.len());
        if keys == 0 || found != keys * self.per_key {
            return Err(document.bad(format!(
                "{place} has {keys} keys and {found} values, {} a key are needed: export it again",
                self.per_key
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
        let range = |key: &usize| key * self.per_key..(key + 1) * self.per_key;
        Ok(kept.iter().flat_map(range).map(|index| values[index]).collect())
    }
}
