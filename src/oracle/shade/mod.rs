//! Shading on the CPU: twins of the includes of `glsl/include/` with the same names.
//!
//! What decides (hashes, texel addresses, masks) is computed in f32 exactly as in GLSL; what is measured (colours,
//! directions) in f64, from the f32 inputs, as the answer that the shader's f32 is compared with.

pub mod alpha;
pub mod brdf;
pub mod kernel;
pub mod light;
pub mod lobe;
pub mod material;
pub mod pack;
pub mod texture;
