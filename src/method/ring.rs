//! What the host hands the device every frame, and what it gets back: mapped memory, a slot a frame in flight.

use super::SLOTS;
use super::plan::Transfers;
use crate::Result;
use crate::accel::Node;
use crate::gpu::{Buffer, Context, Place, Range};
use crate::phase::FrameResources;
use crate::resident::ResidentScene;
use crate::shaders::{Counters, Frame, Instance, Light, Medium, Traversals};

/// A slot holds the frame's constants, instances, lights, medium, top level, and what deforms, in this order.
#[derive(Debug)]
pub struct Ring {
    up: Vec<Buffer>,
    down: Vec<Buffer>,
    instances: u64,
    lights: u64,
    light_count: usize,
    medium: u64,
    top_level: u64,
    /// Offsets of what deforms.
    shapes: Vec<u64>,
}

impl Ring {
    /// For the instances and lights of this scene, and what deforms in it, which goes to `shapes`; `counts` if rays are counted.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`].
    pub fn new(
        context: &Context,
        scene: &ResidentScene,
        light_count: usize,
        shapes: &[Range],
        counts: bool,
    ) -> Result<Self> {
        let after = |offset: u64, bytes: usize| (offset + bytes as u64).next_multiple_of(16);
        let instances = after(0, size_of::<Frame>());
        let lights = after(instances, scene.instance_count() * size_of::<Instance>());
        let medium = after(lights, light_count * size_of::<Light>());
        let top_level = after(medium, size_of::<Medium>());
        let mut size = top_level + scene.top_level().size;
        let mut offsets = Vec::with_capacity(shapes.len());
        for range in shapes {
            size = size.next_multiple_of(16);
            offsets.push(size);
            size += range.size;
        }
        let up = || Buffer::new(context, "upload ring", size, Place::Upload);
        let back = size_of::<Counters>() + if counts { size_of::<Traversals>() } else { 0 };
        let down = || Buffer::new(context, "read-back ring", back as u64, Place::Readback);
        Ok(Self {
            up: (0..SLOTS).map(|_| up()).collect::<Result<_>>()?,
            down: (0..SLOTS).map(|_| down()).collect::<Result<_>>()?,
            instances,
            lights,
            light_count,
            medium,
            top_level,
            shapes: offsets,
        })
    }

    /// The copies of a slot's frame.
    pub fn transfers(&self, slot: usize, f: &FrameResources, scene: &ResidentScene, shapes: &[Range]) -> Transfers {
        let from = |offset, size| Range { offset, size, ..Range::whole("upload ring", &self.up[slot]) };
        let sized = |range: Range, count: usize, each: usize| Range { size: (count * each) as u64, ..range };
        let instances = sized(f.instances, scene.instance_count(), size_of::<Instance>());
        let lights = sized(f.lights, self.light_count, size_of::<Light>());
        let all =
            [(0, f.frame), (self.instances, instances), (self.lights, lights), (self.top_level, scene.top_level())];
        let medium = f.medium.map(|to| (self.medium, to));
        let shapes = self.shapes.iter().copied().zip(shapes.iter().copied());
        // Vulkan has no empty copies.
        let uploads = all
            .into_iter()
            .chain(medium)
            .chain(shapes)
            .filter(|(_, to)| to.size > 0)
            .map(|(at, to)| (from(at, to.size), to));
        let to = |offset, size| Range { offset, size, ..Range::whole("read-back ring", &self.down[slot]) };
        let traversals = f.traversals.map(|from| (from, to(size_of::<Counters>() as u64, from.size)));
        let readbacks = [(f.counters, to(0, f.counters.size))].into_iter().chain(traversals);
        Transfers { uploads: uploads.collect(), readbacks: readbacks.collect() }
    }

    /// Writes the constants of a frame.
    pub fn write_frame(&mut self, slot: usize, frame: &Frame) {
        self.up[slot].write(0, bytemuck::bytes_of(frame));
    }

    /// Writes all instances.
    pub fn write_instances(&mut self, slot: usize, instances: &[Instance]) {
        self.up[slot].write(self.instances, bytemuck::cast_slice(instances));
    }

    /// Writes all lights.
    pub fn write_lights(&mut self, slot: usize, lights: &[Light]) {
        self.up[slot].write(self.lights, bytemuck::cast_slice(lights));
    }

    /// Writes the medium.
    pub fn write_medium(&mut self, slot: usize, medium: &Medium) {
        self.up[slot].write(self.medium, bytemuck::bytes_of(medium));
    }

    /// Writes the top level, at most as many nodes as the scene reserves.
    pub fn write_top_level(&mut self, slot: usize, nodes: &[Node]) {
        self.up[slot].write(self.top_level, bytemuck::cast_slice(nodes));
    }

    /// Writes what deforms, in the order of the ranges that the ring was made for.
    pub fn write_shapes(&mut self, slot: usize, shapes: &[&[u8]]) {
        self.shapes.iter().zip(shapes).for_each(|(offset, bytes)| self.up[slot].write(*offset, bytes));
    }

    /// The counters of the slot's last frame.
    pub fn counters(&self, slot: usize) -> Option<Counters> {
        self.down[slot].bytes().get(..size_of::<Counters>()).map(bytemuck::pod_read_unaligned)
    }

    /// What rays cost in the slot's last frame, if that is counted.
    pub fn traversals(&self, slot: usize) -> Option<Traversals> {
        let behind = self.down[slot].bytes().get(size_of::<Counters>()..)?;
        behind.get(..size_of::<Traversals>()).map(bytemuck::pod_read_unaligned)
    }
}
