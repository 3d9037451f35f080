//! Builds a [`Scene`] from parts with a line each.

use crate::scene::{
    Animation, Camera, Environment, Image, Instance, Lens, Light, LightKind, LightShape, LocalTransform, Material,
    Mesh, Node, Scene, Texture, TextureRef, Wrap,
};
use glam::{Affine2, DMat3, DQuat, DVec3, Vec3};

/// A scene under construction.
pub(super) struct Stage {
    scene: Scene,
}

impl Stage {
    pub(super) fn new(name: &str, environment: Vec3) -> Self {
        let environment = Environment { radiance: environment };
        Self { scene: Scene { name: name.to_owned(), environment, ..Scene::default() } }
    }

    pub(super) fn material(&mut self, material: Material) -> u32 {
        self.scene.materials.push(material);
        (self.scene.materials.len() - 1) as u32
    }

    pub(super) fn texture(&mut self, image: Image, wrap: Wrap, nearest: bool) -> TextureRef {
        self.scene.images.push(image);
        let image = self.scene.images.len() - 1;
        self.scene.textures.push(Texture { image, wrap_u: wrap, wrap_v: wrap, nearest });
        TextureRef { texture: self.scene.textures.len() - 1, uv_set: 0, transform: Affine2::IDENTITY }
    }

    pub(super) fn mesh(&mut self, mesh: Mesh) -> usize {
        self.scene.meshes.push(mesh);
        self.scene.meshes.len() - 1
    }

    /// Adds a node; `parent` is one that was added before.
    pub(super) fn node(&mut self, name: &str, parent: Option<usize>, local: LocalTransform) -> usize {
        self.scene.nodes.push(Node { name: name.to_owned(), parent, local });
        self.scene.nodes.len() - 1
    }

    /// Puts a mesh at a node.
    pub(super) fn instance(&mut self, node: usize, mesh: usize) {
        self.scene.instances.push(Instance { node, mesh });
    }

    /// Puts a mesh where it was modelled.
    pub(super) fn place(&mut self, name: &str, mesh: usize) {
        let node = self.node(name, None, LocalTransform::default());
        self.instance(node, mesh);
    }

    /// `intensity` in candela.
    pub(super) fn point_light(&mut self, position: DVec3, color: Vec3, intensity: f32) {
        self.light("lamp", at(position), (LightKind::Point, LightShape::Sharp), color, intensity);
    }

    /// A luminaire that shines `toward`; `intensity` in candela along it. Without an extent it shines to all sides.
    pub(super) fn area_light(
        &mut self,
        position: DVec3,
        toward: DVec3,
        color: Vec3,
        intensity: f32,
        shape: LightShape,
    ) {
        let local = LocalTransform::Trs { translation: position, rotation: look_along(toward), scale: DVec3::ONE };
        self.light("lamp", local, (LightKind::Point, shape), color, intensity);
    }

    /// `toward` is where the light travels; `intensity` in lux.
    pub(super) fn sun(&mut self, toward: DVec3, color: Vec3, intensity: f32) {
        let rotation = look_along(toward);
        let local = LocalTransform::Trs { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
        self.light("sun", local, (LightKind::Directional, LightShape::Sharp), color, intensity);
    }

    fn light(
        &mut self,
        name: &str,
        local: LocalTransform,
        (kind, shape): (LightKind, LightShape),
        color: Vec3,
        intensity: f32,
    ) {
        let node = self.node(name, None, local);
        self.scene.lights.push(Light { name: name.to_owned(), node, kind, color, intensity, range: None, shape });
    }

    /// The camera `main`; `yfov` in radians.
    pub(super) fn camera(&mut self, eye: DVec3, target: DVec3, yfov: f64) {
        let rotation = look_along(target - eye);
        let local = LocalTransform::Trs { translation: eye, rotation, scale: DVec3::ONE };
        let node = self.node("main", None, local);
        self.scene.cameras.push(Camera { name: "main".to_owned(), node, yfov, lens: Lens::PINHOLE, shutter: 0.0 });
    }

    pub(super) fn finish(self) -> Scene {
        self.scene
    }

    pub(super) fn local(&self, node: usize) -> LocalTransform {
        self.scene.nodes[node].local
    }

    pub(super) fn animation(&mut self, animation: Animation) {
        self.scene.animations.push(animation);
    }
}

/// A plain translation.
pub(super) fn at(translation: DVec3) -> LocalTransform {
    LocalTransform::Trs { translation, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
}

/// The rotation that turns -Z into `direction`, with +Y as near to up as it can be. `direction` is not vertical.
pub(super) fn look_along(direction: DVec3) -> DQuat {
    let back = -direction.normalize();
    let right = DVec3::Y.cross(back).normalize();
    DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back)).normalize()
}
