//! One step of a frame as data: what it runs, what it reads and writes. Barriers follow from that data and are data
//! too, so that they can be printed, counted, and left out one by one by a test.
//!
//! # Barrier policy
//!
//! Before a pass there is at most one global memory barrier, and there is one exactly when the pass conflicts with an
//! earlier pass of the frame (read after write, write after read, write after write on overlapping memory) and no
//! barrier in between orders the two already. The first pass of a frame follows a barrier against everything that the
//! last frame did, and one to the host follows the last. Images stay in layout GENERAL (written) or SHADER_READ_ONLY_OPTIMAL (textures), so there are no
//! layout transitions within a frame.

use super::pipeline::{Pipeline, descriptor_type};
use super::{Buffer, Context, Image, check};
use crate::Result;
use crate::shaders::{Access, Kind};
use ash::vk;
use std::sync::Arc;

/// A range of a buffer, with the name by which plans and errors call it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Range {
    /// What the range holds.
    pub name: &'static str,
    /// The buffer.
    pub buffer: vk::Buffer,
    /// First byte.
    pub offset: u64,
    /// Bytes.
    pub size: u64,
}

impl Range {
    /// All of a buffer.
    pub fn whole(name: &'static str, buffer: &Buffer) -> Self {
        Self { name, buffer: buffer.raw(), offset: 0, size: buffer.size() }
    }
}

/// Something that a shader binds. It must outlive the descriptor set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Resource {
    /// A range of a buffer.
    Buffer(Range),
    /// An image that is written, in layout GENERAL.
    Storage(&'static str, vk::ImageView),
    /// An image that is read, in layout SHADER_READ_ONLY_OPTIMAL.
    Sampled(&'static str, vk::ImageView, vk::Sampler),
}

impl Resource {
    /// All of a buffer.
    pub fn whole(name: &'static str, buffer: &Buffer) -> Self {
        Self::Buffer(Range::whole(name, buffer))
    }

    /// An image to write.
    pub fn storage(name: &'static str, image: &Image) -> Self {
        Self::Storage(name, image.view())
    }

    /// What plans call it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Buffer(range) => range.name,
            Self::Storage(name, _) | Self::Sampled(name, ..) => name,
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Buffer(a), Self::Buffer(b)) => {
                a.buffer == b.buffer && a.offset < b.offset + b.size && b.offset < a.offset + a.size
            }
            (Self::Storage(_, a), Self::Storage(_, b)) => a == b,
            _ => false,
        }
    }
}

/// How many threads a dispatch has. The recorder divides by the reflected local size.
#[derive(Debug, Clone, Copy)]
pub enum Threads {
    /// Known when the plan is made.
    Exactly([u32; 3]),
    /// Workgroup counts read from the device, three `u32` at this range.
    Indirect(Range),
}

/// What a pass does.
#[derive(Debug, Clone)]
pub enum Work {
    /// Runs a shader.
    Dispatch {
        /// The pipeline.
        pipeline: Arc<Pipeline>,
        /// Its resources.
        set: vk::DescriptorSet,
        /// Its push constants.
        push: Vec<u8>,
        /// Its size.
        threads: Threads,
    },
    /// Sets all words of a range.
    Fill(Range, u32),
    /// Copies the start of the first range over the second.
    Copy(Range, Range),
}

/// One step of a frame.
#[derive(Debug, Clone)]
pub struct Pass {
    /// Debug label, timestamp, row of the timing table, key in JSON. Passes of one phase may share it.
    pub label: &'static str,
    /// What it does.
    pub work: Work,
    /// What it touches.
    pub uses: Vec<(Resource, Access)>,
}

impl Pass {
    /// Sets all words of a range.
    pub fn fill(label: &'static str, range: Range, word: u32) -> Self {
        Self { label, work: Work::Fill(range, word), uses: vec![(Resource::Buffer(range), Access::Write)] }
    }

    /// Copies a range to another of the same size.
    pub fn copy(label: &'static str, source: Range, target: Range) -> Self {
        let uses = vec![(Resource::Buffer(source), Access::Read), (Resource::Buffer(target), Access::Write)];
        Self { label, work: Work::Copy(source, target), uses }
    }

    fn scope(&self) -> Scope {
        let transfer = |write| Scope {
            stage: vk::PipelineStageFlags2::ALL_TRANSFER,
            read: vk::AccessFlags2::TRANSFER_READ,
            write,
        };
        match &self.work {
            Work::Fill(..) | Work::Copy(..) => transfer(vk::AccessFlags2::TRANSFER_WRITE),
            Work::Dispatch { threads, .. } => {
                let compute = Scope {
                    stage: vk::PipelineStageFlags2::COMPUTE_SHADER,
                    read: vk::AccessFlags2::SHADER_STORAGE_READ | vk::AccessFlags2::SHADER_SAMPLED_READ,
                    write: vk::AccessFlags2::SHADER_STORAGE_WRITE,
                };
                match threads {
                    Threads::Exactly(_) => compute,
                    Threads::Indirect(_) => Scope {
                        stage: compute.stage | vk::PipelineStageFlags2::DRAW_INDIRECT,
                        read: compute.read | vk::AccessFlags2::INDIRECT_COMMAND_READ,
                        write: compute.write,
                    },
                }
            }
        }
    }

    /// Everything it touches, the indirect arguments included.
    fn touches(&self) -> Vec<(Resource, Access)> {
        let mut all = self.uses.clone();
        if let Work::Dispatch { threads: Threads::Indirect(range), .. } = &self.work {
            all.push((Resource::Buffer(*range), Access::Read));
        }
        all
    }

    fn conflicts(&self, earlier: &Self) -> bool {
        let reads_only = |a: Access| a == Access::Read;
        self.touches().iter().any(|(mine, my_access)| {
            let hit = |(theirs, access): &(Resource, Access)| {
                mine.overlaps(theirs) && !(reads_only(*my_access) && reads_only(*access))
            };
            earlier.touches().iter().any(hit)
        })
    }
}

struct Scope {
    stage: vk::PipelineStageFlags2,
    read: vk::AccessFlags2,
    write: vk::AccessFlags2,
}

/// A global memory barrier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Barrier {
    /// What must be done.
    pub src_stage: vk::PipelineStageFlags2,
    /// Which writes must be available.
    pub src_access: vk::AccessFlags2,
    /// What waits.
    pub dst_stage: vk::PipelineStageFlags2,
    /// To which accesses the writes become visible.
    pub dst_access: vk::AccessFlags2,
}

/// The barrier before each pass, if it needs one (see the policy above).
pub fn barriers(passes: &[Pass]) -> Vec<Option<Barrier>> {
    let mut found: Vec<Option<Barrier>> = Vec::with_capacity(passes.len());
    for (i, pass) in passes.iter().enumerate() {
        if i == 0 {
            found.push(Some(frame_start()));
            continue;
        }
        let scope = pass.scope();
        let mut barrier: Option<Barrier> = None;
        for (j, earlier) in passes[..i].iter().enumerate() {
            if !pass.conflicts(earlier) || ordered(&found[j + 1..], &earlier.scope(), &scope) {
                continue;
            }
            let theirs = earlier.scope();
            let b = barrier.get_or_insert(Barrier {
                src_stage: vk::PipelineStageFlags2::NONE,
                src_access: vk::AccessFlags2::NONE,
                dst_stage: scope.stage,
                dst_access: scope.read | scope.write,
            });
            b.src_stage |= theirs.stage;
            b.src_access |= theirs.write;
        }
        found.push(barrier);
    }
    found
}

fn ordered(between: &[Option<Barrier>], earlier: &Scope, later: &Scope) -> bool {
    between.iter().flatten().any(|b| {
        b.src_stage.contains(earlier.stage)
            && b.src_access.contains(earlier.write)
            && b.dst_stage.contains(later.stage)
            && b.dst_access.contains(later.read | later.write)
    })
}

/// Orders a frame after everything that the last one did on the same queue.
fn frame_start() -> Barrier {
    let stage = vk::PipelineStageFlags2::COMPUTE_SHADER
        | vk::PipelineStageFlags2::ALL_TRANSFER
        | vk::PipelineStageFlags2::DRAW_INDIRECT;
    let write = vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE;
    let read = vk::AccessFlags2::SHADER_STORAGE_READ
        | vk::AccessFlags2::SHADER_SAMPLED_READ
        | vk::AccessFlags2::TRANSFER_READ
        | vk::AccessFlags2::INDIRECT_COMMAND_READ;
    Barrier { src_stage: stage, src_access: write, dst_stage: stage, dst_access: read | write }
}

/// Makes copies to mapped memory visible to the host, which still has to wait for the submission: a fence alone does not
/// (specification, "Host Access to Device Memory Objects").
pub fn to_host() -> Barrier {
    Barrier {
        src_stage: vk::PipelineStageFlags2::ALL_TRANSFER,
        src_access: vk::AccessFlags2::TRANSFER_WRITE,
        dst_stage: vk::PipelineStageFlags2::HOST,
        dst_access: vk::AccessFlags2::HOST_READ,
    }
}

/// Makes descriptor sets and the passes that use them.
#[derive(Debug)]
pub struct Binder {
    context: Context,
    pool: vk::DescriptorPool,
}

impl Binder {
    /// A pool for up to `sets` descriptor sets of up to `bindings` descriptors each.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn new(context: &Context, sets: u32, bindings: u32) -> Result<Self> {
        let size = |ty, each: u32| vk::DescriptorPoolSize { ty, descriptor_count: sets * each };
        let sizes = [
            size(vk::DescriptorType::STORAGE_BUFFER, bindings),
            size(vk::DescriptorType::STORAGE_IMAGE, 4),
            size(vk::DescriptorType::COMBINED_IMAGE_SAMPLER, 1),
        ];
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(sets).pool_sizes(&sizes);
        // SAFETY: the device is alive.
        let pool = check(unsafe { context.inner.device.create_descriptor_pool(&info, None) }, "making descriptors")?;
        Ok(Self { context: context.clone(), pool })
    }

    /// A dispatch of `pipeline` over `threads`, with resources in the order of its bindings and its push constants.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the pool is exhausted.
    pub fn dispatch(
        &self,
        label: &'static str,
        pipeline: &Arc<Pipeline>,
        resources: &[Resource],
        push: &[u8],
        threads: Threads,
    ) -> Result<Pass> {
        let set = self.set(pipeline, resources)?;
        let accesses = pipeline.shader.bindings.iter().map(|b| b.access);
        let uses = resources.iter().copied().zip(accesses).collect();
        debug_assert_eq!(push.len(), pipeline.shader.push_size as usize, "{label}: push constants");
        let work = Work::Dispatch { pipeline: pipeline.clone(), set, push: push.to_vec(), threads };
        Ok(Pass { label, work, uses })
    }

    fn set(&self, pipeline: &Pipeline, resources: &[Resource]) -> Result<vk::DescriptorSet> {
        let device = &self.context.inner.device;
        let layouts = [pipeline.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(self.pool).set_layouts(&layouts);
        // SAFETY: pool and layout are alive and belong to the device.
        let sets = check(unsafe { device.allocate_descriptor_sets(&info) }, "allocating a descriptor set")?;
        let set = sets.first().copied().unwrap_or_default();
        for (binding, resource) in pipeline.shader.bindings.iter().zip(resources) {
            debug_assert!(matches(binding.kind, resource), "{}.{}", pipeline.shader.name, binding.name);
            let write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding.index)
                .descriptor_type(descriptor_type(binding.kind));
            let buffer;
            let image;
            let write = match *resource {
                Resource::Buffer(r) => {
                    buffer = [vk::DescriptorBufferInfo { buffer: r.buffer, offset: r.offset, range: r.size }];
                    write.buffer_info(&buffer)
                }
                Resource::Storage(_, image_view) => {
                    let image_layout = vk::ImageLayout::GENERAL;
                    image = [vk::DescriptorImageInfo { image_view, image_layout, ..Default::default() }];
                    write.image_info(&image)
                }
                Resource::Sampled(_, image_view, sampler) => {
                    let image_layout = vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL;
                    image = [vk::DescriptorImageInfo { image_view, image_layout, sampler }];
                    write.image_info(&image)
                }
            };
            // SAFETY: the set is not in use yet; the resources are alive and outlive it (see `Resource`).
            unsafe { device.update_descriptor_sets(&[write], &[]) };
        }
        Ok(set)
    }
}

fn matches(kind: Kind, resource: &Resource) -> bool {
    matches!(
        (kind, resource),
        (Kind::StorageBuffer, Resource::Buffer(_))
            | (Kind::StorageImage, Resource::Storage(..))
            | (Kind::SampledImage, Resource::Sampled(..))
    )
}

impl Drop for Binder {
    fn drop(&mut self) {
        // SAFETY: whoever submitted work that uses the sets has waited for it.
        unsafe { self.context.inner.device.destroy_descriptor_pool(self.pool, None) };
    }
}
