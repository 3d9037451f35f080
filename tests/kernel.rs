//! A shader can be run on host data, and the validation layer is really listening.
mod support;

use bytemuck::Zeroable;
use stillray::gpu::kernel::{self, Argument};
use stillray::shaders::{self, Sample};

#[test]
fn a_kernel_reads_and_writes() {
    let context = support::validated_context();
    let samples: Vec<Sample> = (0..1000).map(|i| Sample { instance: 5000 - i, ..Sample::zeroed() }).collect();
    let mut samples = bytemuck::cast_slice(&samples).to_vec();
    let mut claims = bytemuck::cast_slice(&[u32::MAX; 4]).to_vec();
    let shader = &shaders::reproject::SHADER;
    let push = shaders::reproject::Push { count: 1000 };
    let mut arguments = [Argument::Buffer(&mut samples), Argument::Buffer(&mut claims)];
    kernel::run(&context, shader, &mut arguments, bytemuck::bytes_of(&push), [1000, 1, 1]).unwrap();
    assert_eq!(bytemuck::cast_slice::<u8, u32>(&claims)[0], 4001);
    support::assert_clean(&context);
}
