//! Buffers.

use super::check;
use super::context::{Context, Inner};
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;
use std::sync::Arc;

/// Where a buffer lives and what it is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Device memory, bound as a storage buffer, copied from and to, read by indirect dispatches.
    Device,
    /// Mapped, written by the host and copied from.
    Upload,
    /// Mapped, copied to and read by the host.
    Readback,
}

/// A buffer with its memory.
pub struct Buffer {
    context: Arc<Inner>,
    raw: vk::Buffer,
    size: u64,
    purpose: String,
    allocation: Option<Allocation>,
}

impl std::fmt::Debug for Buffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Buffer({}, {} bytes)", self.purpose, self.size)
    }
}

impl Buffer {
    /// Makes a buffer of at least `size` bytes. Its content is undefined.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`], or [`Error::TooLarge`] beyond `maxBufferSize`.
    pub fn new(context: &Context, purpose: &str, size: u64, place: Place) -> Result<Self> {
        let (usage, location) = match place {
            Place::Device => (
                vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::INDIRECT_BUFFER
                    | vk::BufferUsageFlags::TRANSFER_SRC
                    | vk::BufferUsageFlags::TRANSFER_DST,
                MemoryLocation::GpuOnly,
            ),
            Place::Upload => (vk::BufferUsageFlags::TRANSFER_SRC, MemoryLocation::CpuToGpu),
            Place::Readback => (vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuToCpu),
        };
        // Vulkan has no empty buffers; fills and copies go by four bytes.
        let inner = &context.inner;
        within("maxBufferSize", inner.fit.max_buffer, purpose, size, "lower --size or --density")?;
        let size = size.max(16).checked_next_multiple_of(4).unwrap_or(size);
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device is alive and the description is complete.
        let raw = check(unsafe { inner.device.create_buffer(&info, None) }, "making a buffer")?;
        let mut buffer = Self { context: inner.clone(), raw, size, purpose: purpose.to_owned(), allocation: None };
        // SAFETY: the buffer was just made from this device.
        let requirements = unsafe { inner.device.get_buffer_memory_requirements(raw) };
        let allocation = buffer.allocation.insert(inner.memory.allocate(purpose, requirements, location, true)?);
        // SAFETY: the allocation fulfils the requirements and is bound once.
        let bound = unsafe { inner.device.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) };
        check(bound, "binding buffer memory")?;
        Ok(buffer)
    }

    /// A device buffer with this content.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`], or [`Error::TooLarge`] as for [`check_range`].
    pub fn with_data(context: &Context, purpose: &str, data: &[u8], advice: &str) -> Result<Self> {
        check_range(context, purpose, data.len() as u64, advice)?;
        let buffer = Self::new(context, purpose, data.len() as u64, Place::Device)?;
        buffer.upload(context, 0, data)?;
        Ok(buffer)
    }

    /// Copies data to the buffer and waits.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] for the staging buffer.
    pub fn upload(&self, context: &Context, offset: u64, data: &[u8]) -> Result<()> {
        if data.is_empty() {
            return Ok(());
        }
        let mut staging = Self::new(context, "staging", data.len() as u64, Place::Upload)?;
        staging.write(0, data);
        let region = vk::BufferCopy { src_offset: 0, dst_offset: offset, size: data.len() as u64 };
        let (source, target, device) = (staging.raw, self.raw, &context.inner.device);
        context.run_once("upload", |commands| {
            // SAFETY: both buffers are alive until the submission is waited for, and the region lies in both.
            unsafe { device.cmd_copy_buffer(commands, source, target, &[region]) };
        })
    }

    /// Copies the whole buffer back and waits.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] for the staging buffer.
    pub fn download(&self, context: &Context) -> Result<Vec<u8>> {
        let staging = Self::new(context, "staging", self.size, Place::Readback)?;
        let region = vk::BufferCopy { src_offset: 0, dst_offset: 0, size: self.size };
        let (source, target, device) = (self.raw, staging.raw, &context.inner.device);
        context.run_once("download", |commands| {
            // SAFETY: as in `upload`.
            unsafe { device.cmd_copy_buffer(commands, source, target, &[region]) };
        })?;
        Ok(staging.bytes().to_vec())
    }

    /// Writes to an upload buffer. The device must not be reading the range.
    pub fn write(&mut self, offset: u64, data: &[u8]) {
        if let Some(mapped) = self.allocation.as_mut().and_then(Allocation::mapped_slice_mut) {
            mapped[offset as usize..][..data.len()].copy_from_slice(data);
        }
    }

    /// The content of a mapped buffer; empty for a device buffer.
    pub fn bytes(&self) -> &[u8] {
        let mapped = self.allocation.as_ref().and_then(Allocation::mapped_slice).unwrap_or_default();
        &mapped[..mapped.len().min(self.size as usize)]
    }

    /// The handle.
    pub fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.size
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: whoever submitted work that uses the buffer has waited for it (see the lifetime rules in gpu/mod.rs).
        unsafe { self.context.device.destroy_buffer(self.raw, None) };
        if let Some(allocation) = self.allocation.take() {
            self.context.memory.free(allocation);
        }
    }
}

/// Whether a range of this size can be bound as a storage buffer.
///
/// # Errors
/// [`Error::TooLarge`] with the advice given if not.
pub fn check_range(context: &Context, what: &str, needed: u64, advice: &str) -> Result<()> {
    let limit = u64::from(context.fit().properties.limits.max_storage_buffer_range);
    within("maxStorageBufferRange", limit, what, needed, advice)
}

/// Whether `needed` bytes are within a limit.
///
/// # Errors
/// [`Error::TooLarge`] with all of the arguments if not.
pub fn within(limit_name: &'static str, limit: u64, what: &str, needed: u64, advice: &str) -> Result<()> {
    if needed <= limit {
        return Ok(());
    }
    let (what, advice) = (what.to_owned(), advice.to_owned());
    Err(Error::TooLarge { what, needed, limit, limit_name, advice })
}
