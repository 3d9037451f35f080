//! A scene's identity by its content: what is rendered the same has the same fingerprint.

use super::{Mesh, Scene};
use sha2::{Digest, Sha256};
use std::fmt::{self, Write};

/// SHA-256 of everything in the scene that can show in a picture, in 64 hexadecimal digits. Names and notices do not count.
pub fn fingerprint(scene: &Scene) -> String {
    let mut hash = Hasher::default();
    scene.meshes.iter().for_each(|mesh| hash.mesh(mesh));
    for image in &scene.images {
        hash.words(&[image.width, image.height]);
        hash.list(&image.texels);
    }
    for (i, node) in scene.nodes.iter().enumerate() {
        hash.shown(format_args!("node {i} {:?} {:?}", node.parent, node.local));
    }
    for material in &scene.materials {
        let unnamed = super::Material { name: String::new(), ..material.clone() };
        hash.shown(format_args!("{unnamed:?}"));
    }
    for light in &scene.lights {
        let unnamed = super::Light { name: String::new(), ..light.clone() };
        hash.shown(format_args!("{unnamed:?}"));
    }
    scene.cameras.iter().for_each(|c| hash.shown(format_args!("camera {} {} {:?}", c.node, c.yfov, c.lens)));
    scene.animations.iter().for_each(|a| hash.shown(format_args!("{:?}", a.channels)));
    for skin in &scene.skins {
        hash.shown(format_args!("skin {:?} {:?}", skin.joints, skin.inverse_bind));
    }
    scene.deformers.iter().for_each(|deformer| hash.shown(format_args!("{deformer:?}")));
    hash.shown(format_args!("{:?} {:?} {:?}", scene.instances, scene.textures, scene.environment));
    if let Some(map) = &scene.environment_map {
        hash.words(&[map.width, map.height, map.scale.to_bits()]);
        hash.shown(format_args!("map turned by {}", map.turn));
        hash.list(&map.texels);
    }
    if let Some(medium) = &scene.medium {
        hash.shown(format_args!("{medium:?}"));
    }
    hex(&hash.0.finalize())
}

/// Hexadecimal digits, two a byte.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[derive(Default)]
struct Hasher(Sha256);

impl Hasher {
    fn mesh(&mut self, mesh: &Mesh) {
        self.list(&mesh.positions);
        self.list(&mesh.normals);
        self.list(&mesh.tangents);
        mesh.uvs.iter().for_each(|uv| self.list(uv));
        self.list(&mesh.colors);
        self.list(&mesh.triangles);
        self.list(&mesh.triangle_materials);
        if mesh.deforms() {
            self.shape(mesh);
        }
    }

    fn shape(&mut self, mesh: &Mesh) {
        for target in &mesh.morph_targets {
            [&target.positions, &target.normals, &target.tangents].into_iter().for_each(|deltas| self.list(deltas));
        }
        mesh.joints.iter().for_each(|joints| self.list(joints));
        mesh.weights.iter().for_each(|weights| self.list(weights));
        self.shown(format_args!("{:?}", mesh.flat));
    }

    /// With its length, so that nothing can move from one list to the next unnoticed.
    fn list<T: bytemuck::NoUninit>(&mut self, items: &[T]) {
        self.words(&[items.len() as u32]);
        self.0.update(bytemuck::cast_slice(items));
    }

    fn words(&mut self, words: &[u32]) {
        self.0.update(bytemuck::cast_slice(words));
    }

    /// The debug form of floats is exact: it reads back to the same bits.
    fn shown(&mut self, text: fmt::Arguments<'_>) {
        // Writing into a hash cannot fail.
        let _ = self.write_fmt(text);
        self.0.update([0]);
    }
}

impl Write for Hasher {
    fn write_str(&mut self, s: &str) -> fmt::Result {
        self.0.update(s.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{EnvironmentMap, builtin};

    #[test]
    fn the_same_content_and_only_that_is_the_same() {
        let load = |name| builtin::load(name, 0).unwrap();
        let scene = load("cornell");
        let own = fingerprint(&scene);
        assert_eq!(own.len(), 64);
        assert_eq!(own, fingerprint(&load("cornell")));
        let renamed = Scene { name: "other".into(), ..scene.clone() };
        assert_eq!(own, fingerprint(&renamed));
        let changes: [fn(&mut Scene); 8] = [
            |s| s.meshes[0].positions[0].x = f32::from_bits(s.meshes[0].positions[0].x.to_bits() + 1),
            |s| s.materials[0].roughness += 0.1,
            |s| s.lights[0].intensity *= 1.0 + f32::EPSILON,
            |s| s.environment.radiance.x += 0.1,
            |s| s.environment_map = Some(EnvironmentMap::default()),
            |s| s.medium = Some(crate::scene::Medium::fog(0.1)),
            |s| s.cameras[0].yfov += 1e-12,
            |s| s.meshes[0].triangles[0].rotate_left(1),
        ];
        let mapped = |texel: f32, scale: f32, turn: f64| {
            let map =
                EnvironmentMap { width: 1, height: 1, texels: vec![[texel; 3]], scale, turn, ..Default::default() };
            fingerprint(&Scene { environment_map: Some(map), ..scene.clone() })
        };
        let plain = mapped(1.0, 1.0, 0.0);
        assert_eq!(plain, mapped(1.0, 1.0, 0.0));
        assert!(
            [mapped(2.0, 1.0, 0.0), mapped(1.0, 2.0, 0.0), mapped(1.0, 1.0, 0.1)].iter().all(|other| *other != plain)
        );
        for (i, change) in changes.into_iter().enumerate() {
            let mut changed = scene.clone();
            change(&mut changed);
            assert_ne!(own, fingerprint(&changed), "change {i}");
        }
        let mut morphing = scene.clone();
        morphing.meshes[0].morph_targets.push(super::super::MorphTarget::default());
        assert_ne!(own, fingerprint(&morphing), "a mesh that morphs");
        let mut held = morphing.clone();
        held.deformers.push(super::super::Deformer::default());
        assert_ne!(fingerprint(&morphing), fingerprint(&held), "what deforms it");
    }
}
