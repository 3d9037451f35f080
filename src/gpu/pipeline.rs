//! Compute pipelines with their layouts.

use super::check;
use super::context::{Context, Inner};
use crate::Result;
use crate::shaders::{Kind, Shader};
use ash::vk;
use std::sync::Arc;

/// A compute pipeline, with the layouts that its reflected interface asks for.
pub struct Pipeline {
    context: Arc<Inner>,
    /// The shader.
    pub shader: &'static Shader,
    pub(crate) raw: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) set_layout: vk::DescriptorSetLayout,
}

impl std::fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Pipeline({})", self.shader.name)
    }
}

pub(crate) fn descriptor_type(kind: Kind) -> vk::DescriptorType {
    match kind {
        Kind::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
        Kind::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
        Kind::SampledImage => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
    }
}

impl Pipeline {
    /// Compiles a shader for the device. Drivers may put the real work off until the first dispatch.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] with the shader's name.
    pub fn new(context: &Context, shader: &'static Shader) -> Result<Self> {
        let inner = &context.inner;
        let mut pipeline = Self {
            context: inner.clone(),
            shader,
            raw: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
        };
        let during = format!("making the pipeline '{}'", shader.name);
        let bindings: Vec<vk::DescriptorSetLayoutBinding<'_>> = shader
            .bindings
            .iter()
            .map(|b| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(b.index)
                    .descriptor_type(descriptor_type(b.kind))
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the device is alive; the bindings come from the shader's reflection.
        pipeline.set_layout = check(unsafe { inner.device.create_descriptor_set_layout(&info, None) }, &during)?;
        let layouts = [pipeline.set_layout];
        let push =
            [vk::PushConstantRange { stage_flags: vk::ShaderStageFlags::COMPUTE, offset: 0, size: shader.push_size }];
        let info = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&layouts)
            .push_constant_ranges(if shader.push_size > 0 { &push } else { &[] });
        // SAFETY: as above.
        pipeline.layout = check(unsafe { inner.device.create_pipeline_layout(&info, None) }, &during)?;
        pipeline.raw = check(compile(inner, shader, pipeline.layout), &during)?;
        Ok(pipeline)
    }
}

fn compile(
    inner: &Inner,
    shader: &Shader,
    layout: vk::PipelineLayout,
) -> std::result::Result<vk::Pipeline, vk::Result> {
    let info = vk::ShaderModuleCreateInfo::default().code(shader.words());
    // SAFETY: the SPIR-V was made by shaderc for Vulkan 1.2, which 1.3 devices accept.
    let module = unsafe { inner.device.create_shader_module(&info, None) }?;
    let stage =
        vk::PipelineShaderStageCreateInfo::default().stage(vk::ShaderStageFlags::COMPUTE).module(module).name(c"main");
    let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout)];
    // SAFETY: module and layout are alive; the layout was made from the module's reflection.
    let made = unsafe { inner.device.create_compute_pipelines(inner.cache, &info, None) };
    // SAFETY: a pipeline does not need its module after creation.
    unsafe { inner.device.destroy_shader_module(module, None) };
    match made {
        Ok(pipelines) => pipelines.first().copied().ok_or(vk::Result::ERROR_UNKNOWN),
        Err((pipelines, result)) => {
            // SAFETY: whatever was made is not used; destroying null is a no-op.
            pipelines.into_iter().for_each(|p| unsafe { inner.device.destroy_pipeline(p, None) });
            Err(result)
        }
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: whoever submitted work that uses the pipeline has waited for it; null handles are ignored.
        unsafe {
            self.context.device.destroy_pipeline(self.raw, None);
            self.context.device.destroy_pipeline_layout(self.layout, None);
            self.context.device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
