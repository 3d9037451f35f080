//! The samplers on the device are their CPU twins, to the bit.
#![allow(clippy::expect_used)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::{Pod, Zeroable, cast_slice, pod_collect_to_vec};
use stillray::gpu::Context;
use stillray::gpu::kernel::{self, Argument};
use stillray::sampler::{DIMENSIONS, Sampler, Strategy, Tiling};
use stillray::shaders::{Access, Binding, Kind, Shader};
use support::random::Random;

#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Question {
    pixel: [u32; 2],
    index: u32,
    dimension: u32,
}

fn questions(random: &mut Random, count: u32) -> Vec<Question> {
    let one = |_| Question {
        pixel: [random.below(5000), random.below(5000)],
        // Also beyond the count, and beyond all 256 points of a pattern's copy.
        index: random.pick(&[0, 1, 15, 16, 255, 256, 4097]) + random.below(3),
        dimension: random.below(DIMENSIONS),
    };
    (0..count).map(one).collect()
}

fn probe() -> &'static Shader {
    let binding = |name, index, access| Binding { name, index, kind: Kind::StorageBuffer, access };
    let bindings = vec![
        binding("questions", 0, Access::Read),
        binding("answers", 1, Access::Write),
        binding("sampler_table", 2, Access::Read),
    ];
    support::probe::compile("sampling.comp", &[], bindings)
}

fn on_device(context: &Context, shader: &'static Shader, sampler: &Sampler, questions: &[Question]) -> Vec<u32> {
    let mut asked: Vec<u8> = cast_slice(questions).to_vec();
    let mut answers = vec![0u8; questions.len() * 4];
    let mut table: Vec<u8> = cast_slice(&sampler.table()).to_vec();
    let mut arguments = [Argument::Buffer(&mut asked), Argument::Buffer(&mut answers), Argument::Buffer(&mut table)];
    kernel::run(context, shader, &mut arguments, &[], [questions.len() as u32, 1, 1]).expect("the probe runs");
    pod_collect_to_vec(&answers)
}

#[test]
fn coordinates_are_the_twins() {
    let context = support::validated_context();
    let shader = probe();
    let random = &mut Random::new(7);
    for strategy in Strategy::ALL {
        for tiling in Tiling::ALL {
            for (count, seed) in [(1, 0), (16, 0), (16, 99), (64, 7), (1000, 0)] {
                let sampler = Sampler::new(strategy, tiling, count, seed);
                let questions = questions(random, 512);
                let device = on_device(&context, shader, &sampler, &questions);
                let twin = |s: &Sampler| -> Vec<u32> {
                    questions.iter().map(|q| s.coordinate(q.pixel, q.index, q.dimension)).collect()
                };
                assert!(device == twin(&sampler), "{}, {}, {count}, {seed}", strategy.name(), tiling.name());
                // Negative control: another seed.
                assert!(device != twin(&Sampler::new(strategy, tiling, count, seed + 1)));
            }
        }
    }
    support::assert_clean(&context);
}
