//! Runs one shader on host data and waits: how tests, and the conformance workload, ask a shader a question.

use super::pass::{Binder, Resource, Threads, barriers};
use super::submit::Submitter;
use super::{Buffer, Context, Image, Pipeline, Recorder};
use crate::Result;
use crate::shaders::{Access, Shader};
use std::sync::Arc;

/// What a kernel binds, in the order of the shader's bindings.
#[derive(Debug)]
pub enum Argument<'a> {
    /// Uploaded before the run; if the shader writes it, downloaded after.
    Buffer(&'a mut Vec<u8>),
    /// A texture, uploaded already.
    Texture(&'a Image, &'a super::image::Sampler),
    /// An image in layout GENERAL.
    Storage(&'a Image),
}

/// Runs `shader` over `threads` threads with these arguments and push constants, and returns the milliseconds that the
/// device took (0 without timestamps).
///
/// # Errors
/// [`crate::Error::OutOfMemory`], or [`crate::Error::TooLarge`] for a buffer that cannot be bound.
pub fn run(
    context: &Context,
    shader: &'static Shader,
    arguments: &mut [Argument<'_>],
    push: &[u8],
    threads: [u32; 3],
) -> Result<f64> {
    let pipeline = Arc::new(Pipeline::new(context, shader)?);
    let mut buffers = Vec::new();
    let mut resources = Vec::new();
    for argument in arguments.iter() {
        resources.push(match argument {
            Argument::Buffer(data) => {
                let buffer = Buffer::with_data(context, "kernel argument", data, "use less data")?;
                let resource = Resource::whole("argument", &buffer);
                buffers.push(Some(buffer));
                resource
            }
            Argument::Texture(image, sampler) => {
                buffers.push(None);
                Resource::Sampled("texture", image.view(), sampler.raw())
            }
            Argument::Storage(image) => {
                buffers.push(None);
                Resource::storage("image", image)
            }
        });
    }
    let binder = Binder::new(context, 1, shader.bindings.len().max(1) as u32)?;
    let pass = [binder.dispatch(shader.name, &pipeline, &resources, push, Threads::Exactly(threads))?];
    let recorder = Recorder::new(context, 1, 1)?;
    Submitter::new(context)?.run(shader.name, |commands| {
        // SAFETY: `run` hands over a command buffer that is recording and waits for it; all that the pass uses lives here.
        unsafe { recorder.record(commands, &pass, &barriers(&pass), 0) };
    })?;
    for ((argument, buffer), binding) in arguments.iter_mut().zip(&buffers).zip(shader.bindings) {
        if let (Argument::Buffer(data), Some(buffer)) = (argument, buffer)
            && binding.access != Access::Read
        {
            let mut back = buffer.download(context)?;
            back.truncate(data.len());
            **data = back;
        }
    }
    Ok(recorder.times(1, 0).first().copied().unwrap_or_default())
}
