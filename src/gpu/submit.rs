//! Submissions that wait. Uploads, read-back and frames without a host go through here; a host that records frames
//! into its own command buffers needs none of it after creation.

use super::check;
use super::context::{Context, Inner};
use crate::Result;
use ash::vk;
use std::sync::Arc;

/// A command buffer with its pool and fence, used again and again.
pub struct Submitter {
    context: Arc<Inner>,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
}

impl std::fmt::Debug for Submitter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Submitter").finish_non_exhaustive()
    }
}

impl Submitter {
    /// Makes pool, command buffer and fence.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn new(context: &Context) -> Result<Self> {
        Self::of(&context.inner)
    }

    fn of(inner: &Arc<Inner>) -> Result<Self> {
        let device = &inner.device;
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(inner.queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device is alive and has this queue family.
        let pool = check(unsafe { device.create_command_pool(&info, None) }, "making a command pool")?;
        let commands = vk::CommandBuffer::null();
        let mut submitter = Self { context: inner.clone(), pool, commands, fence: vk::Fence::null() };
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool was just made.
        let buffers = check(unsafe { device.allocate_command_buffers(&info) }, "allocating a command buffer")?;
        submitter.commands = buffers.first().copied().unwrap_or_default();
        // SAFETY: the device is alive.
        let fence = unsafe { device.create_fence(&vk::FenceCreateInfo::default(), None) };
        submitter.fence = check(fence, "making a fence")?;
        Ok(submitter)
    }

    /// Records, submits and waits. Everything that was written is visible to the host afterwards.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the device is lost or out of memory.
    pub fn run(&mut self, label: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<()> {
        let device = &self.context.device;
        let during = format!("running '{label}'");
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the command buffer is not in use: the last run waited for its fence.
        check(unsafe { device.begin_command_buffer(self.commands, &begin) }, &during)?;
        record(self.commands);
        self.make_visible();
        // SAFETY: recording was begun above.
        check(unsafe { device.end_command_buffer(self.commands) }, &during)?;
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(self.commands)];
        let submit = [vk::SubmitInfo2::default().command_buffer_infos(&buffers)];
        let queue = self.context.queue();
        // SAFETY: the queue is ours and locked, or lent for the duration of this call (`Context::adopt`); the fence is
        // unsignalled.
        let submitted = unsafe { device.queue_submit2(*queue, &submit, self.fence) };
        drop(queue);
        check(submitted, &during)?;
        // SAFETY: the fence was submitted, and is reset once it is signalled.
        unsafe {
            check(device.wait_for_fences(&[self.fence], true, u64::MAX), &during)?;
            check(device.reset_fences(&[self.fence]), &during)
        }
    }

    fn make_visible(&self) {
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST | vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(vk::AccessFlags2::HOST_READ | vk::AccessFlags2::MEMORY_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is recording outside a render pass.
        unsafe { self.context.device.cmd_pipeline_barrier2(self.commands, &info) };
    }
}

impl Drop for Submitter {
    fn drop(&mut self) {
        // SAFETY: every run waited for its fence (or the device is lost); null handles are ignored.
        unsafe {
            self.context.device.destroy_fence(self.fence, None);
            self.context.device.destroy_command_pool(self.pool, None);
        }
    }
}

pub(crate) fn run_once(inner: &Arc<Inner>, label: &str, record: impl FnOnce(vk::CommandBuffer)) -> Result<()> {
    Submitter::of(inner)?.run(label, record)
}
