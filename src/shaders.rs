//! What `build.rs` emits: the compiled shaders with their reflected interfaces, and the Rust twins of the structs and
//! constants that GLSL declares. See `glsl/include/types.glsl` for what the members mean.

/// A compiled compute shader and its interface.
#[derive(Debug)]
pub struct Shader {
    /// File stem, with the variant's name if it is one.
    pub name: &'static str,
    /// SPIR-V words in the order of this machine's bytes, aligned to words.
    pub spirv: &'static [u8],
    /// Threads of a workgroup.
    pub local_size: [u32; 3],
    /// Bytes of push constants, 0 if there are none.
    pub push_size: u32,
    /// Descriptors of set 0 in ascending order of their binding.
    pub bindings: &'static [Binding],
}

impl Shader {
    /// SPIR-V words.
    pub fn words(&self) -> &'static [u32] {
        bytemuck::cast_slice(self.spirv)
    }
}

/// Bytes where words may be.
#[repr(C, align(4))]
struct Aligned<B>(B);

/// Position among `sets` of what is asked for of some models, with what that brings; bit i of a set is the i-th model.
fn member_of(model: u32, models: &[u32], sets: &[usize]) -> usize {
    let model = with_brought(model);
    let set = models.iter().enumerate().fold(0, |set, (i, bit)| set | usize::from(model & bit != 0) << i);
    sets.iter().position(|s| *s == set).unwrap_or(0)
}

/// `MODEL_` bits with those that they are never modelled without.
pub fn with_brought(model: u32) -> u32 {
    let more = MODEL_BRINGS.iter().filter(|(bit, _)| model & bit != 0).fold(model, |model, (_, others)| model | others);
    if more == model { model } else { with_brought(more) }
}

/// One descriptor of a shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Binding {
    /// Name of the block instance or image in GLSL.
    pub name: &'static str,
    /// Binding number in set 0.
    pub index: u32,
    /// Descriptor type.
    pub kind: Kind,
    /// What the shader does with it.
    pub access: Access,
}

/// Kinds of descriptors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A range of a buffer.
    StorageBuffer,
    /// An image that is written, in layout GENERAL.
    StorageImage,
    /// An image that is read through a sampler, in layout SHADER_READ_ONLY_OPTIMAL.
    SampledImage,
}

/// What a shader does with a resource, from `readonly` and `writeonly`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Only reads.
    Read,
    /// Only writes.
    Write,
    /// Both, or atomics.
    ReadWrite,
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
