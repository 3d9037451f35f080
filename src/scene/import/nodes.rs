//! The node hierarchy, and the cameras and lights that hang in it.

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use gltf::json;
use gltf::json::camera::Type as CameraType;
use gltf::json::extensions::scene::khr_lights_punctual::{Light as JsonLight, Type as LightType};
use gltf::json::validation::Checked;

use super::document::{Document, label, name_or};
use super::extras;
use crate::Result;
use crate::scene::{Camera, Light, LightKind, LightShape, LocalTransform, Node, Scene};

/// Where a node of the scene comes from; its own index is its place in the list.
pub(super) struct Placed {
    /// Index in the file.
    pub source: usize,
}

/// The scene's node for each of the file's, if it has one.
pub(super) fn node_of(document: &Document, placed: &[Placed]) -> Vec<Option<usize>> {
    let mut node_of = vec![None; document.root.nodes.len()];
    for (node, placed) in placed.iter().enumerate() {
        node_of[placed.source] = Some(node);
    }
    node_of
}

/// Takes over the nodes of scene `wanted` (or of the default or first one), parents before children.
pub(super) fn flatten(document: &Document, wanted: Option<usize>, scene: &mut Scene) -> Result<Vec<Placed>> {
    let scenes = &document.root.scenes;
    let index = wanted.or(document.root.scene.map(|scene| scene.value())).unwrap_or(0);
    let Some(source) = scenes.get(index) else {
        let there = match scenes.len() {
            0 => "no scene".to_owned(),
            n => format!("scenes 0 to {}", n - 1),
        };
        return Err(document.bad(format!("there is no scene {index}: the file has {there}")));
    };
    if scenes.len() > 1 && wanted.is_none() {
        let name = label("scene", index, source.name.as_deref());
        scene.notices.push(format!("the file has {} scenes; {name} is shown", scenes.len()));
    }
    let mut placed = Vec::new();
    let mut seen = vec![false; document.root.nodes.len()];
    // An explicit stack: a hostile hierarchy is deeper than the thread's.
    let mut stack: Vec<(usize, Option<usize>)> = source.nodes.iter().rev().map(|n| (n.value(), None)).collect();
    while let Some((index, parent)) = stack.pop() {
        let Some(node) = document.root.nodes.get(index) else {
            return Err(document.bad(format!("node {index} does not exist: export the file again")));
        };
        if std::mem::replace(&mut seen[index], true) {
            let name = document.node_label(index);
            return Err(document.bad(format!("{name} has two parents or is its own ancestor: export it again")));
        }
        let local = local_transform(document, index, node)?;
        let children = node.children.iter().flatten().rev();
        stack.extend(children.map(|child| (child.value(), Some(placed.len()))));
        scene.nodes.push(Node { name: name_or("node", index, node.name.as_deref()), parent, local });
        placed.push(Placed { source: index });
    }
    Ok(placed)
}

fn local_transform(document: &Document, index: usize, node: &json::Node) -> Result<LocalTransform> {
    let bad = |what: &str| document.bad(format!("{} has {what}: repair it", document.node_label(index)));
    if let Some(matrix) = node.matrix {
        return affine(matrix)
            .map(LocalTransform::Matrix)
            .ok_or_else(|| bad("a matrix that is no finite affine transform"));
    }
    let translation = DVec3::from_array(node.translation.unwrap_or_default().map(f64::from));
    let scale = DVec3::from_array(node.scale.unwrap_or([1.0; 3]).map(f64::from));
    let rotation = node.rotation.unwrap_or_default().0.map(f64::from);
    let rotation = unit_quaternion(rotation).ok_or_else(|| bad("a rotation that is no unit quaternion"))?;
    if !translation.is_finite() || !scale.is_finite() {
        return Err(bad("a translation or scale that is not finite"));
    }
    Ok(LocalTransform::Trs { translation, rotation, scale })
}

/// The affine transform of a file's matrix, column by column; none if it is not finite or a projection.
pub(super) fn affine(matrix: [f32; 16]) -> Option<DAffine3> {
    let m = matrix.map(f64::from);
    // Files carry rounding noise in the last row; anything more is a projection.
    let last = [m[3], m[7], m[11], m[15] - 1.0];
    if !m.iter().all(|x| x.is_finite()) || last.iter().any(|x| x.abs() > 1e-4) {
        return None;
    }
    let column = |c: usize| DVec3::new(m[4 * c], m[4 * c + 1], m[4 * c + 2]);
    Some(DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3)))
}

/// Normalises (x, y, z, w); none if it is zero or not finite. The values were f32: their squares do not overflow.
pub(super) fn unit_quaternion(xyzw: [f64; 4]) -> Option<DQuat> {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    (q.is_finite() && length > 0.0).then(|| q / length)
}

/// Takes over perspective cameras; orthographic ones are left out, with a notice.
pub(super) fn import_cameras(document: &Document, placed: &[Placed], scene: &mut Scene) -> Result<()> {
    for (node, placed) in placed.iter().enumerate() {
        let source = document.root.nodes.get(placed.source);
        let Some((index, name)) = source.and_then(|n| Some((n.camera?.value(), n.name.as_deref()))) else { continue };
        let node_label = document.node_label(placed.source);
        let missing =
            || document.bad(format!("{node_label} uses camera {index}, which does not exist: export it again"));
        let camera = document.root.cameras.get(index).ok_or_else(missing)?;
        if matches!(camera.type_, Checked::Valid(CameraType::Orthographic)) {
            scene.notices.push(format!("{node_label} has an orthographic camera, which is left out"));
            continue;
        }
        let yfov = camera.perspective.as_ref().map_or(f64::NAN, |perspective| f64::from(perspective.yfov));
        if !(yfov > 0.0 && yfov < std::f64::consts::PI) {
            let message =
                format!("the camera of {node_label} has a vertical field of view that is not between 0 and π");
            return Err(document.bad(message + ": repair it"));
        }
        let name = name_or("camera", index, camera.name.as_deref().or(name));
        let (lens, shutter) = extras::camera(document, index)?;
        scene.cameras.push(Camera { name, node, yfov, lens, shutter });
    }
    Ok(())
}

/// Takes over punctual lights.
pub(super) fn import_lights(document: &Document, placed: &[Placed], scene: &mut Scene) -> Result<()> {
    let lights = document.root.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
    let lights = lights.map_or(&[][..], |extension| &extension.lights);
    for (node, placed) in placed.iter().enumerate() {
        let source = document.root.nodes.get(placed.source);
        let used = source.and_then(|n| n.extensions.as_ref()?.khr_lights_punctual.as_ref());
        let Some(index) = used.map(|used| used.light.value()) else { continue };
        let node_label = document.node_label(placed.source);
        let missing =
            || document.bad(format!("{node_label} uses light {index}, which does not exist: export it again"));
        let light = lights.get(index).ok_or_else(missing)?;
        let name = light.name.as_deref().or(source.and_then(|n| n.name.as_deref()));
        let light = import_light(light, name_or("light", index, name), node)
            .map_err(|what| document.bad(format!("the light of {node_label} has {what}: repair it")))?;
        scene.lights.push(Light { shape: extras::light_shape(document, index, light.kind)?, ..light });
    }
    Ok(())
}

fn import_light(light: &JsonLight, name: String, node: usize) -> std::result::Result<Light, &'static str> {
    let color = Vec3::from(light.color);
    let valid = |x: f32| x.is_finite() && x >= 0.0;
    if !color.to_array().into_iter().all(valid) || !valid(light.intensity) {
        return Err("a colour or intensity that is negative or not finite");
    }
    if light.range.is_some_and(|range| !(range > 0.0 && range.is_finite())) {
        return Err("a range that is not positive");
    }
    let kind = match light.type_ {
        Checked::Valid(LightType::Directional) => LightKind::Directional,
        Checked::Valid(LightType::Point) => LightKind::Point,
        Checked::Valid(LightType::Spot) => {
            let quarter = std::f32::consts::FRAC_PI_4;
            let (inner, outer) =
                light.spot.as_ref().map_or((0.0, quarter), |s| (s.inner_cone_angle, s.outer_cone_angle));
            // Half a turn, rounded up to f32, is what exporters write for the widest cone.
            if !(inner >= 0.0 && inner < outer && outer <= std::f32::consts::FRAC_PI_2) {
                return Err("cone angles that are not 0 <= inner < outer <= π/2");
            }
            LightKind::Spot { inner, outer }
        }
        Checked::Invalid => return Err("an unknown type"),
    };
    Ok(Light { name, node, kind, color, intensity: light.intensity, range: light.range, shape: LightShape::Sharp })
}
