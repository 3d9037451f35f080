//! Images.

use super::check;
use super::context::{Context, Inner};
use super::{Buffer, Place};
use crate::Result;
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;
use std::sync::Arc;

/// What kind of image to make.
#[derive(Debug, Clone, Copy)]
pub struct ImageDesc {
    /// Texel format.
    pub format: vk::Format,
    /// Texels across and down.
    pub extent: [u32; 2],
    /// Array layers; the view is a 2D array if `array` says so.
    pub layers: u32,
    /// Whether shaders see an array.
    pub array: bool,
    /// How it is used; transfers are always possible.
    pub usage: vk::ImageUsageFlags,
}

/// A two-dimensional image with its memory and view.
pub struct Image {
    context: Arc<Inner>,
    raw: vk::Image,
    view: vk::ImageView,
    desc: ImageDesc,
    allocation: Option<Allocation>,
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Image").field(&self.desc).finish()
    }
}

const LAYERS: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: vk::REMAINING_ARRAY_LAYERS,
};

impl Image {
    /// Makes an image in layout UNDEFINED.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`].
    pub fn new(context: &Context, purpose: &str, desc: ImageDesc) -> Result<Self> {
        let inner = &context.inner;
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(desc.format)
            .extent(vk::Extent3D { width: desc.extent[0], height: desc.extent[1], depth: 1 })
            .mip_levels(1)
            .array_layers(desc.layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(desc.usage | vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST);
        // SAFETY: the device is alive; the extents were checked against its limits by whoever chose them.
        let raw = check(unsafe { inner.device.create_image(&info, None) }, "making an image")?;
        let mut image = Self { context: inner.clone(), raw, view: vk::ImageView::null(), desc, allocation: None };
        // SAFETY: the image was just made from this device.
        let requirements = unsafe { inner.device.get_image_memory_requirements(raw) };
        let location = MemoryLocation::GpuOnly;
        let allocation = image.allocation.insert(inner.memory.allocate(purpose, requirements, location, false)?);
        // SAFETY: the allocation fulfils the requirements and is bound once.
        let bound = unsafe { inner.device.bind_image_memory(raw, allocation.memory(), allocation.offset()) };
        check(bound, "binding image memory")?;
        let kind = if desc.array { vk::ImageViewType::TYPE_2D_ARRAY } else { vk::ImageViewType::TYPE_2D };
        let view =
            vk::ImageViewCreateInfo::default().image(raw).view_type(kind).format(desc.format).subresource_range(LAYERS);
        // SAFETY: the image has memory and the format is its own.
        image.view = check(unsafe { inner.device.create_image_view(&view, None) }, "making an image view")?;
        Ok(image)
    }

    /// Fills every layer, one after the other in `texels`, and leaves the image in SHADER_READ_ONLY_OPTIMAL.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] for the staging buffer.
    pub fn upload(&self, context: &Context, texels: &[u8]) -> Result<()> {
        let mut staging = Buffer::new(context, "staging", texels.len() as u64, Place::Upload)?;
        staging.write(0, texels);
        let device = &context.inner.device;
        context.run_once("upload image", |commands| {
            let undefined = vk::ImageLayout::UNDEFINED;
            self.transition(device, commands, undefined, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
            let target = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
            // SAFETY: the staging buffer holds all layers; both live until the submission is waited for.
            unsafe { device.cmd_copy_buffer_to_image(commands, staging.raw(), self.raw, target, &[self.whole()]) };
            self.transition(device, commands, target, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
        })
    }

    /// Brings a new image into layout GENERAL and clears it to zero.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] if the submission fails.
    pub fn clear(&self, context: &Context) -> Result<()> {
        let device = &context.inner.device;
        context.run_once("clear image", |commands| {
            let general = vk::ImageLayout::GENERAL;
            self.transition(device, commands, vk::ImageLayout::UNDEFINED, general);
            let zero = vk::ClearColorValue { float32: [0.0; 4] };
            // SAFETY: the image is a colour image in GENERAL and was made with TRANSFER_DST.
            unsafe { device.cmd_clear_color_image(commands, self.raw, general, &zero, &[LAYERS]) };
            self.transition(device, commands, general, general);
        })
    }

    /// Copies an image in layout GENERAL to a buffer that is large enough, and leaves it in GENERAL.
    ///
    /// # Safety
    /// `commands` must be recording outside a render pass; `target` must hold the image and outlive the submission.
    pub unsafe fn record_copy(&self, commands: vk::CommandBuffer, target: &Buffer) {
        let device = &self.context.device;
        let (general, source) = (vk::ImageLayout::GENERAL, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        self.transition(device, commands, general, source);
        // SAFETY: the command buffer is recording; image and buffer belong to the same device.
        unsafe { device.cmd_copy_image_to_buffer(commands, self.raw, source, target.raw(), &[self.whole()]) };
        self.transition(device, commands, source, general);
    }

    fn whole(&self) -> vk::BufferImageCopy {
        let subresource = vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: self.desc.layers,
        };
        let extent = vk::Extent3D { width: self.desc.extent[0], height: self.desc.extent[1], depth: 1 };
        vk::BufferImageCopy { image_subresource: subresource, image_extent: extent, ..Default::default() }
    }

    fn transition(
        &self,
        device: &ash::Device,
        commands: vk::CommandBuffer,
        old: vk::ImageLayout,
        new: vk::ImageLayout,
    ) {
        let barrier = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)
            .old_layout(old)
            .new_layout(new)
            .image(self.raw)
            .subresource_range(LAYERS)];
        // SAFETY: the command buffer is recording outside a render pass; `old` is the image's layout or UNDEFINED.
        unsafe {
            let info = vk::DependencyInfo::default().image_memory_barriers(&barrier);
            device.cmd_pipeline_barrier2(commands, &info);
        }
    }

    /// The handle.
    pub fn raw(&self) -> vk::Image {
        self.raw
    }

    /// A view of all layers.
    pub fn view(&self) -> vk::ImageView {
        self.view
    }

    /// What was asked for.
    pub fn desc(&self) -> &ImageDesc {
        &self.desc
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        // SAFETY: whoever submitted work that uses the image has waited for it; destroying a null view is a no-op.
        unsafe {
            self.context.device.destroy_image_view(self.view, None);
            self.context.device.destroy_image(self.raw, None);
        }
        if let Some(allocation) = self.allocation.take() {
            self.context.memory.free(allocation);
        }
    }
}

/// A sampler for texel fetches: nearest, clamped, no mip levels.
pub struct Sampler {
    context: Arc<Inner>,
    raw: vk::Sampler,
}

impl std::fmt::Debug for Sampler {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sampler").finish_non_exhaustive()
    }
}

impl Sampler {
    /// Makes the sampler.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`].
    pub fn new(context: &Context) -> Result<Self> {
        let info = vk::SamplerCreateInfo::default()
            .address_mode_u(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .address_mode_v(vk::SamplerAddressMode::CLAMP_TO_EDGE)
            .address_mode_w(vk::SamplerAddressMode::CLAMP_TO_EDGE);
        // SAFETY: the device is alive.
        let raw = check(unsafe { context.inner.device.create_sampler(&info, None) }, "making a sampler")?;
        Ok(Self { context: context.inner.clone(), raw })
    }

    /// The handle.
    pub fn raw(&self) -> vk::Sampler {
        self.raw
    }
}

impl Drop for Sampler {
    fn drop(&mut self) {
        // SAFETY: as for images.
        unsafe { self.context.device.destroy_sampler(self.raw, None) };
    }
}
