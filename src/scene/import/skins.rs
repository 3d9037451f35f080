//! Skins: joints with their inverse bind matrices, and which joints a vertex follows.

use std::collections::HashMap;

use glam::DAffine3;
use gltf::json;
use gltf::json::mesh::Semantic;

use super::accessor::{self, Encoding};
use super::document::{Document, label, name_or};
use super::mesh::Part;
use super::nodes::affine;
use crate::Result;
use crate::scene::{Mesh, Skin};

/// What a joint matrix costs of what a file may hold, in vertices: every pose has one for each joint of each instance.
const JOINT_COST: usize = 16;

/// The joints of [`Mesh::joints`] that a vertex can have.
const MOST: usize = 8;

/// Takes over the skins that something uses, each once.
pub(super) struct Skins<'a> {
    document: &'a Document,
    /// The scene's node for each of the file's.
    node_of: &'a [Option<usize>],
    known: HashMap<usize, usize>,
}

impl<'a> Skins<'a> {
    pub fn new(document: &'a Document, node_of: &'a [Option<usize>]) -> Self {
        Self { document, node_of, known: HashMap::new() }
    }

    /// The number in `skins` of the file's skin `index`, which has to have all joints that the mesh names. `place` is the
    /// node with its mesh.
    pub fn bind(&mut self, index: usize, place: &str, mesh: &Mesh, skins: &mut Vec<Skin>) -> Result<usize> {
        let document = self.document;
        let missing = || document.bad(format!("{place} uses skin {index}, which does not exist: export it again"));
        let source = document.root.skins.get(index).ok_or_else(missing)?;
        let own_place = label("skin", index, source.name.as_deref());
        let number = match self.known.get(&index) {
            Some(&number) => number,
            None => {
                skins.push(self.import(index, source, &own_place)?);
                *self.known.entry(index).or_insert(skins.len() - 1)
            }
        };
        let count = skins[number].joints.len();
        document.spend(JOINT_COST * count)?;
        let named = mesh.joints.iter().flatten().flatten().copied().max().unwrap_or(0);
        if usize::from(named) >= count {
            return Err(document.bad(format!(
                "{place} has a vertex that follows joint {named}, but {own_place} has {count} joints: export it again"
            )));
        }
        Ok(number)
    }

    fn import(&self, index: usize, source: &json::Skin, place: &str) -> Result<Skin> {
        let document = self.document;
        if source.joints.is_empty() {
            return Err(document.bad(format!("{place} has no joints: export it again")));
        }
        document.spend(JOINT_COST * source.joints.len())?;
        let joints = source.joints.iter().map(|joint| self.joint(joint.value(), place)).collect::<Result<Vec<_>>>()?;
        let inverse_bind = match source.inverse_bind_matrices {
            Some(matrices) => self.inverse_bind(matrices.value(), joints.len(), place)?,
            None => vec![DAffine3::IDENTITY; joints.len()],
        };
        Ok(Skin { name: name_or("skin", index, source.name.as_deref()), joints, inverse_bind })
    }

    fn joint(&self, source: usize, place: &str) -> Result<usize> {
        let name = self.document.node_label(source);
        let problem = match self.node_of.get(source) {
            Some(Some(node)) => return Ok(*node),
            Some(None) => "is not in the scene",
            None => "does not exist",
        };
        Err(self.document.bad(format!("{place} has the joint {name}, which {problem}: export it again")))
    }

    fn inverse_bind(&self, accessor: usize, joints: usize, place: &str) -> Result<Vec<DAffine3>> {
        let (document, matrices_place) = (self.document, format!("{place}, inverse bind matrices"));
        let matrices = accessor::read_floats::<16>(document, accessor, Encoding::Float, &matrices_place)?;
        if matrices.len() < joints {
            let count = matrices.len();
            return Err(
                document.bad(format!("{place} has {count} inverse bind matrices for {joints} joints: export it again"))
            );
        }
        let checked = |(joint, matrix): (usize, &[f32; 16])| {
            affine(*matrix).ok_or_else(|| {
                let message =
                    format!("{place} has an inverse bind matrix of joint {joint} that is no affine transform");
                document.bad(message + ": repair it")
            })
        };
        matrices.iter().take(joints).enumerate().map(checked).collect()
    }
}

/// What a vertex has in one set: joints with their weights.
type Four = ([u16; 4], [f32; 4]);

/// A `JOINTS_n` with its `WEIGHTS_n`.
type Set = (Vec<[u16; 4]>, Vec<[f32; 4]>);

/// How many vertices had to be helped.
#[derive(Default)]
struct Helped {
    negative: usize,
    weightless: usize,
    crowded: usize,
}

impl Part<'_> {
    /// Gives the vertices the joints that they follow.
    pub(super) fn follow_joints(&self, mesh: &mut Mesh, count: u64, notices: &mut Vec<String>) -> Result<()> {
        let sets = self.joint_sets(count)?;
        let mut helped = Helped::default();
        let mut followed = Vec::new();
        for vertex in 0..mesh.positions.len() {
            let joints = sets.iter().flat_map(|(joints, weights)| joints[vertex].into_iter().zip(weights[vertex]));
            let own = helped.tidy(joints, &mut followed);
            for (set, (joints, weights)) in own.into_iter().enumerate() {
                mesh.joints[set].push(joints);
                mesh.weights[set].push(weights);
            }
        }
        if mesh.weights[1].iter().flatten().all(|&weight| weight == 0.0) {
            mesh.joints[1] = Vec::new();
            mesh.weights[1] = Vec::new();
        }
        helped.tell(self.place, notices);
        Ok(())
    }

    fn joint_sets(&self, count: u64) -> Result<Vec<Set>> {
        let (document, place) = (self.document, self.place);
        let mut sets = Vec::new();
        loop {
            let number = sets.len() as u32;
            let (joints, weights) = (Semantic::Joints(number), Semantic::Weights(number));
            match (self.attribute(&joints), self.attribute(&weights)) {
                (Some(index), Some(_)) => {
                    let joints_place = format!("{place}, {}", joints.to_string());
                    self.check_count(index, count, &joints_place)?;
                    let weights = self.read(&weights, Encoding::Normalized, count)?;
                    document.spend(weights.len())?;
                    sets.push((accessor::read_joints(document, index, &joints_place)?, weights));
                }
                (None, None) if number > 0 => return Ok(sets),
                (None, None) => {
                    let message = format!("{place} has no {} and no {}", joints.to_string(), weights.to_string());
                    return Err(document.bad(message + ", but a node shows it with a skin: export it again"));
                }
                (has_joints, _) => {
                    let (there, lacking) = if has_joints.is_some() { (joints, weights) } else { (weights, joints) };
                    let (there, lacking) = (there.to_string(), lacking.to_string());
                    return Err(document.bad(format!("{place} has {there}, but no {lacking}: export it again")));
                }
            }
        }
    }
}

impl Helped {
    /// The joints that a vertex really follows, the heaviest first if they are more than four, with weights that add up to 1.
    fn tidy(&mut self, joints: impl Iterator<Item = (u16, f32)>, kept: &mut Vec<(u16, f32)>) -> [Four; 2] {
        kept.clear();
        kept.extend(joints);
        let first = kept.first().map_or(0, |(joint, _)| *joint);
        self.negative += usize::from(kept.iter().any(|(_, weight)| *weight < 0.0));
        kept.retain(|(_, weight)| *weight > 0.0);
        if kept.is_empty() {
            self.weightless += 1;
            kept.push((first, 1.0));
        }
        if kept.len() > 4 {
            kept.sort_by(|a, b| b.1.total_cmp(&a.1));
            self.crowded += usize::from(kept.len() > MOST);
            kept.truncate(MOST);
        }
        let sum: f64 = kept.iter().map(|(_, weight)| f64::from(*weight)).sum();
        let entry = |i: usize| kept.get(i).map_or((0, 0.0), |(j, weight)| (*j, (f64::from(*weight) / sum) as f32));
        [0, 4].map(|first| {
            let four = [0, 1, 2, 3].map(|k| entry(first + k));
            (four.map(|(joint, _)| joint), four.map(|(_, weight)| weight))
        })
    }

    fn tell(&self, place: &str, notices: &mut Vec<String>) {
        let told = [
            (self.negative, "follow joints with a negative weight, which counts as 0"),
            (self.weightless, "follow no joint with a weight: they follow the first that they name"),
            (self.crowded, "follow more than eight joints: the eight with the largest weights move them"),
        ];
        let told = told.into_iter().filter(|(count, _)| *count > 0);
        notices.extend(told.map(|(count, what)| format!("{place}: {count} vertices {what}")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tidied(joints: &[(u16, f32)]) -> ([Four; 2], Helped) {
        let mut helped = Helped::default();
        (helped.tidy(joints.iter().copied(), &mut Vec::new()), helped)
    }

    #[test]
    fn weights_are_made_to_add_up() {
        let ([first, second], helped) = tidied(&[(7, 1.0), (9, 0.0), (3, 3.0), (0, 0.0)]);
        assert_eq!((first, second.1), (([7, 3, 0, 0], [0.25, 0.75, 0.0, 0.0]), [0.0; 4]));
        assert_eq!((helped.negative, helped.weightless, helped.crowded), (0, 0, 0));
        let extreme = tidied(&[(1, f32::MAX), (2, f32::MAX), (3, 1e-45), (4, 0.0)]).0[0];
        assert_eq!(extreme, ([1, 2, 3, 0], [0.5, 0.5, 0.0, 0.0]));
        assert_eq!(tidied(&[(4, 1e-45), (0, 0.0), (0, 0.0), (0, 0.0)]).0[0], ([4, 0, 0, 0], [1.0, 0.0, 0.0, 0.0]));
    }

    #[test]
    fn vertices_without_weight_follow_the_first_joint() {
        let ([first, _], helped) = tidied(&[(5, 0.0), (6, -1.0), (7, 0.0), (8, 0.0)]);
        assert_eq!((first, helped.weightless, helped.negative), (([5, 0, 0, 0], [1.0, 0.0, 0.0, 0.0]), 1, 1));
    }

    #[test]
    fn the_eight_heaviest_of_many_stay() {
        let many: Vec<(u16, f32)> = (0..12).map(|i| (i, 1.0 + f32::from(i % 6))).collect();
        let ([first, second], helped) = tidied(&many);
        assert_eq!((first.0, second.0, helped.crowded), ([5, 11, 4, 10], [3, 9, 2, 8], 1));
        // 6 + 6 + 5 + 5 + 4 + 4 + 3 + 3 = 36
        assert_eq!((first.1[0], second.1[3]), (1.0 / 6.0, 1.0 / 12.0));
        assert_eq!(tidied(&many[..8]).1.crowded, 0);
    }
}
