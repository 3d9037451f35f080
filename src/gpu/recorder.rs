//! Turns passes into commands. Knows nothing of what they are for.

use super::pass::{Barrier, Pass, Threads, Work};
use super::{Context, check};
use crate::Result;
use ash::vk;
use std::ffi::CString;

/// Records plans into command buffers and reads back the time of each pass.
#[derive(Debug)]
pub struct Recorder {
    context: Context,
    timestamps: Option<vk::QueryPool>,
    most_passes: u32,
    slots: u32,
}

/// Workgroups needed for this many threads.
pub fn workgroups(threads: [u32; 3], local_size: [u32; 3]) -> [u32; 3] {
    [0, 1, 2].map(|i| threads[i].div_ceil(local_size[i].max(1)))
}

impl Recorder {
    /// A recorder for plans of up to `most_passes`, in `slots` frames in flight.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn new(context: &Context, most_passes: u32, slots: u32) -> Result<Self> {
        let timed = context.fit().timestamp_bits > 0;
        let timestamps = if timed { Some(make_queries(context, 2 * most_passes * slots)?) } else { None };
        Ok(Self { context: context.clone(), timestamps, most_passes, slots })
    }

    /// Records a plan with its barriers, and a timestamp before and after every pass.
    ///
    /// # Safety
    /// `commands` must be recording outside a render pass, for the context's queue family. What the passes use must
    /// outlive the submission, and the slot's last recording must have been waited for.
    pub unsafe fn record(&self, commands: vk::CommandBuffer, passes: &[Pass], barriers: &[Option<Barrier>], slot: u32) {
        let device = &self.context.inner.device;
        let first = 2 * self.most_passes * (slot % self.slots);
        if let Some(pool) = self.timestamps {
            // SAFETY: the caller has waited for this slot's last frame, so its queries are not in use.
            unsafe { device.cmd_reset_query_pool(commands, pool, first, 2 * self.most_passes) };
        }
        for (i, (pass, barrier)) in passes.iter().zip(barriers).enumerate() {
            if let Some(barrier) = barrier {
                // SAFETY: the caller says that the command buffer is recording.
                unsafe { self.barrier(commands, barrier) };
            }
            self.label(commands, Some(pass.label));
            self.timestamp(commands, first + 2 * i as u32);
            self.work(commands, &pass.work);
            self.timestamp(commands, first + 2 * i as u32 + 1);
            self.label(commands, None);
        }
    }

    /// Milliseconds of each of the slot's `passes`, once its submission has been waited for; empty if the device has
    /// no timestamps.
    pub fn times(&self, passes: usize, slot: u32) -> Vec<f64> {
        let Some(pool) = self.timestamps else { return Vec::new() };
        let mut ticks = vec![0_u64; 2 * passes];
        let first = 2 * self.most_passes * (slot % self.slots);
        let flags = vk::QueryResultFlags::TYPE_64;
        // SAFETY: the pool is alive and holds this many queries from `first`.
        let got = unsafe { self.context.inner.device.get_query_pool_results(pool, first, &mut ticks, flags) };
        if got.is_err() {
            return Vec::new();
        }
        let fit = self.context.fit();
        let mask = u64::MAX >> (64 - fit.timestamp_bits.clamp(1, 64));
        let period = f64::from(fit.properties.limits.timestamp_period);
        ticks.chunks_exact(2).map(|t| (t[1].wrapping_sub(t[0]) & mask) as f64 * period * 1e-6).collect()
    }

    fn work(&self, commands: vk::CommandBuffer, work: &Work) {
        let device = &self.context.inner.device;
        // SAFETY: the command buffer is recording; pipelines, sets and buffers are held by the plan's owner, which
        // outlives the submission; ranges lie in their buffers by construction.
        unsafe {
            match work {
                Work::Fill(range, word) => {
                    device.cmd_fill_buffer(commands, range.buffer, range.offset, range.size, *word);
                }
                Work::Copy(source, target) => {
                    let region = vk::BufferCopy {
                        src_offset: source.offset,
                        dst_offset: target.offset,
                        size: source.size.min(target.size),
                    };
                    device.cmd_copy_buffer(commands, source.buffer, target.buffer, &[region]);
                }
                Work::Dispatch { pipeline, set, push, threads } => {
                    let point = vk::PipelineBindPoint::COMPUTE;
                    device.cmd_bind_pipeline(commands, point, pipeline.raw);
                    device.cmd_bind_descriptor_sets(commands, point, pipeline.layout, 0, &[*set], &[]);
                    if !push.is_empty() {
                        let stage = vk::ShaderStageFlags::COMPUTE;
                        device.cmd_push_constants(commands, pipeline.layout, stage, 0, push);
                    }
                    match threads {
                        Threads::Exactly(threads) => {
                            let [x, y, z] = workgroups(*threads, pipeline.shader.local_size);
                            device.cmd_dispatch(commands, x, y, z);
                        }
                        Threads::Indirect(range) => {
                            device.cmd_dispatch_indirect(commands, range.buffer, range.offset);
                        }
                    }
                }
            }
        }
    }

    /// Records one global memory barrier.
    ///
    /// # Safety
    /// `commands` must be recording outside a render pass.
    pub unsafe fn barrier(&self, commands: vk::CommandBuffer, barrier: &Barrier) {
        let memory = [vk::MemoryBarrier2::default()
            .src_stage_mask(barrier.src_stage)
            .src_access_mask(barrier.src_access)
            .dst_stage_mask(barrier.dst_stage)
            .dst_access_mask(barrier.dst_access)];
        let info = vk::DependencyInfo::default().memory_barriers(&memory);
        // SAFETY: the command buffer is recording outside a render pass; synchronization2 is enabled.
        unsafe { self.context.inner.device.cmd_pipeline_barrier2(commands, &info) };
    }

    fn timestamp(&self, commands: vk::CommandBuffer, query: u32) {
        if let Some(pool) = self.timestamps {
            let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
            // SAFETY: the query was reset at the start of this recording and is written once.
            unsafe { self.context.inner.device.cmd_write_timestamp2(commands, stage, pool, query) };
        }
    }

    fn label(&self, commands: vk::CommandBuffer, begin: Option<&str>) {
        let Some(debug) = &self.context.inner.debug else { return };
        let name = CString::new(begin.unwrap_or_default()).unwrap_or_default();
        let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
        // SAFETY: the extension is enabled when `debug` is there; begin and end come in pairs.
        unsafe {
            if begin.is_some() {
                debug.cmd_begin_debug_utils_label(commands, &label);
            } else {
                debug.cmd_end_debug_utils_label(commands);
            }
        }
    }
}

fn make_queries(context: &Context, count: u32) -> Result<vk::QueryPool> {
    let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(count);
    // SAFETY: the device is alive.
    check(unsafe { context.inner.device.create_query_pool(&info, None) }, "making timestamp queries")
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if let Some(pool) = self.timestamps {
            // SAFETY: whoever submitted recordings has waited for them.
            unsafe { self.context.inner.device.destroy_query_pool(pool, None) };
        }
    }
}
