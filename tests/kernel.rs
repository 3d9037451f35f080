//! A shader can be run on host data, and the validation layer is really listening.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use bytemuck::{Zeroable, bytes_of, cast_slice};
use stillray::gpu::kernel::{self, Argument};
use stillray::shaders::{self, Counters, Frame};

#[test]
fn a_kernel_reads_and_writes() {
    let context = support::validated_context();
    let mut frame = bytes_of(&Frame { capacity: 1000, ..Frame::zeroed() }).to_vec();
    let mut tiles = cast_slice(&[3_u32, 0, 5, 7]).to_vec();
    let mut counters = bytes_of(&Counters::zeroed()).to_vec();
    let mut arguments = [Argument::Buffer(&mut frame), Argument::Buffer(&mut tiles), Argument::Buffer(&mut counters)];
    let push = shaders::scan::Push { tile_count: 4 };
    kernel::run(&context, shaders::scan::SHADER, &mut arguments, bytes_of(&push), [256, 1, 1]).unwrap();
    assert_eq!(cast_slice::<u8, u32>(&tiles), [0, 3, 3, 8]);
    assert_eq!(bytemuck::pod_read_unaligned::<Counters>(&counters).samples, 15);
    support::assert_clean(&context);
}
