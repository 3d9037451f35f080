//! A shader that is compiled once and run on host data many times: drivers compile at the first dispatch, which takes
//! longer than all the runs of a test.

use bytemuck::Pod;
use std::sync::Arc;
use stillray::gpu::image::Sampler;
use stillray::gpu::pass::{Binder, Resource, Threads, barriers};
use stillray::gpu::submit::Submitter;
use stillray::gpu::{Buffer, Context, Image, Pipeline, Recorder};
use stillray::shaders::{Access, Shader};

/// Bytes behind every buffer that a shader may write, and what they hold: a write past the end is noticed.
const GUARD: [u8; 64] = [0xa5; 64];

pub struct Kernel {
    context: Context,
    pipeline: Arc<Pipeline>,
}

/// What a kernel binds, in the order of the shader's bindings.
pub enum Bound<'a> {
    Data(Vec<u8>),
    Image(&'a Image),
    Texture(&'a Image, &'a Sampler),
}

/// A buffer with this content.
pub fn data<'a, T: Pod>(values: &[T]) -> Bound<'a> {
    Bound::Data(bytemuck::cast_slice(values).to_vec())
}

/// A buffer of this many values that are all bits set, so that what is not written shows.
pub fn blank<'a, T: Pod>(count: usize) -> Bound<'a> {
    Bound::Data(vec![0xff; count * size_of::<T>()])
}

/// What a buffer holds now.
pub fn values<T: Pod>(bound: &Bound<'_>) -> Vec<T> {
    match bound {
        Bound::Data(bytes) => bytemuck::pod_collect_to_vec(bytes),
        Bound::Image(_) | Bound::Texture(..) => Vec::new(),
    }
}

impl Kernel {
    pub fn new(context: &Context, shader: &'static Shader) -> Self {
        Self { context: context.clone(), pipeline: Arc::new(Pipeline::new(context, shader).unwrap()) }
    }

    /// Runs over `threads`; every buffer holds afterwards what the device made of it. Fails if the shader wrote behind
    /// the end of a buffer, or changed one that it only reads.
    pub fn run(&self, bound: &mut [Bound<'_>], push: &[u8], threads: [u32; 3]) {
        let context = &self.context;
        assert_eq!(bound.len(), self.pipeline.shader.bindings.len(), "{}: bindings", self.pipeline.shader.name);
        let buffers: Vec<Option<Buffer>> = bound.iter().map(|b| self.upload(b)).collect();
        let resources: Vec<Resource> = bound
            .iter()
            .zip(&buffers)
            .map(|(b, buffer)| match (b, buffer) {
                (Bound::Image(image), _) => Resource::storage("image", image),
                (Bound::Texture(image, sampler), _) => Resource::Sampled("texture", image.view(), sampler.raw()),
                (_, Some(buffer)) => Resource::whole("argument", buffer),
                _ => unreachable!(),
            })
            .collect();
        let label = self.pipeline.shader.name;
        let binder = Binder::new(context, 1, bound.len() as u32).unwrap();
        let pass = [binder.dispatch(label, &self.pipeline, &resources, push, Threads::Exactly(threads)).unwrap()];
        let recorder = Recorder::new(context, 1, 1).unwrap();
        // SAFETY: the submitter hands over a command buffer that is recording and waits for it.
        let record = |commands| unsafe { recorder.record(commands, &pass, &barriers(&pass), 0) };
        Submitter::new(context).unwrap().run(label, record).unwrap();
        for (i, (b, buffer)) in bound.iter_mut().zip(&buffers).enumerate() {
            let (Bound::Data(bytes), Some(buffer)) = (b, buffer) else { continue };
            let binding = &self.pipeline.shader.bindings[i];
            let back = buffer.download(context).unwrap();
            let (content, guard) = back.split_at(bytes.len());
            assert_eq!(guard, GUARD, "{label}.{}: written behind its end", binding.name);
            if binding.access == Access::Read {
                assert_eq!(content, bytes, "{label}.{}: changed", binding.name);
            }
            bytes.copy_from_slice(content);
        }
    }

    fn upload(&self, bound: &Bound<'_>) -> Option<Buffer> {
        let Bound::Data(bytes) = bound else { return None };
        let guarded = [&bytes[..], &GUARD].concat();
        Some(Buffer::with_data(&self.context, "argument", &guarded, "use less data").unwrap())
    }
}
