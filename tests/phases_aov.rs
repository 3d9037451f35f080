//! The images besides colour agree with their CPU twin exactly, in all variants of the shader.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test
mod support;

use ash::vk;
use bytemuck::Zeroable;
use half::f16;
use stillray::gpu::submit::Submitter;
use stillray::gpu::{Buffer, Context, Image, ImageDesc, Place};
use stillray::oracle::aov::{AovPixel, Cache, aov};
use stillray::oracle::slots::Slots;
use stillray::shaders::{self, FRAME_FILL, Frame, MOTION_UNKNOWN, Shaded};
use support::kernel::{Bound, Kernel, data};
use support::random::Random;

const SIZES: [[u32; 2]; 4] = [[1, 1], [7, 5], [32, 24], [1, 100]];

/// A frame's worth of what the shader reads.
struct Inputs {
    size: [u32; 2],
    offsets: Vec<u32>,
    /// Second runs of the pixels, behind the first ones.
    extras: Vec<u32>,
    shaded: Vec<Shaded>,
    masks: Vec<u32>,
    plan: Vec<u32>,
    ages: Vec<u32>,
}

impl Inputs {
    fn random(random: &mut Random, size: [u32; 2]) -> Self {
        let pixels = (size[0] * size[1]) as usize;
        let mut offsets = vec![0];
        for i in 0..pixels {
            // Empty pixels, single samples and crowds.
            let count = [0, 1, 1, 3, 16][random.below(5) as usize];
            offsets.push(offsets[i] + count);
        }
        let mut extras = vec![offsets[pixels]];
        for i in 0..pixels {
            extras.push(extras[i] + random.pick(&[0, 0, 1, 2]));
        }
        let samples = extras[pixels] as usize;
        // Halves of a quarter pixel: lengths are compared exactly, ties included.
        let mut step = || f16::from_f32((random.below(65) as f32 - 32.0) * 0.25).to_bits();
        let motions: Vec<u32> = (0..samples).map(|_| u32::from(step()) | u32::from(step()) << 16).collect();
        let known = |motion: u32| if motion.is_multiple_of(7) { MOTION_UNKNOWN } else { motion };
        let depths = [-1.0, 0.5, 2.0, 1e7, f32::INFINITY];
        let shaded = motions.into_iter().map(|motion| Shaded {
            motion: known(motion),
            depth: depths[random.below(5) as usize],
            ..Shaded::zeroed()
        });
        let shaded = shaded.collect();
        // The high half of a mask word is a part of the low one; the plan is any two halves.
        let mut word = || random.below(1 << 16) | random.below(1 << 16) << 16;
        let masks = (0..pixels).map(|_| word()).map(|w| w & (w << 16 | 0xffff)).collect();
        let plan = (0..pixels).map(|_| word()).collect();
        let ages = (0..samples).map(|_| random.below(1000)).collect();
        Self { size, offsets, extras, shaded, masks, plan, ages }
    }

    fn slots(&self, fill: bool) -> Slots<'_> {
        Slots { offsets: &self.offsets, extras: if fill { &self.extras } else { &[] } }
    }

    fn cache(&self, aged: bool) -> Cache<'_> {
        Cache { masks: &self.masks, plan: &self.plan, ages: if aged { &self.ages } else { &[] } }
    }
}

/// Number of channels and format of each image, in the order of the bindings.
const IMAGES: [(usize, vk::Format); 4] = [
    (1, vk::Format::R32_SFLOAT),
    (2, vk::Format::R32G32_SFLOAT),
    (4, vk::Format::R32G32B32A32_SFLOAT),
    (1, vk::Format::R32_SFLOAT),
];

fn on_device(context: &Context, kernel: &Kernel, inputs: &Inputs, [stable, fill, aged]: [bool; 3]) -> Vec<AovPixel> {
    let size = inputs.size;
    let make = |(_, format): &(usize, vk::Format)| {
        let desc =
            ImageDesc { format: *format, extent: size, layers: 1, array: false, usage: vk::ImageUsageFlags::STORAGE };
        let image = Image::new(context, "aov", desc).unwrap();
        image.clear(context).unwrap();
        image
    };
    let images: Vec<Image> = IMAGES.iter().map(make).collect();
    let flags = if fill { FRAME_FILL } else { 0 };
    let frame = Frame { size, flags, ..Frame::zeroed() };
    let mut bound = vec![data(&[frame]), data(&inputs.offsets), data(&inputs.shaded)];
    bound.extend(images.iter().map(Bound::Image));
    bound.push(data(&inputs.extras));
    if stable {
        bound.extend([data(&inputs.masks), data(&inputs.plan)]);
    }
    if aged {
        bound.push(data(&inputs.ages));
    }
    kernel.run(&mut bound, &[], [size[0], size[1], 1]);
    let pixels = (size[0] * size[1]) as usize;
    let read = |(image, (channels, _)): (&Image, &(usize, vk::Format))| -> Vec<f32> {
        let bytes = 4 * channels * pixels;
        let back = Buffer::new(context, "back", bytes as u64, Place::Readback).unwrap();
        // SAFETY: `run` hands over a command buffer that is recording and waits for it.
        let copy = |commands| unsafe { image.record_copy(commands, &back) };
        Submitter::new(context).unwrap().run("copy", copy).unwrap();
        bytemuck::pod_collect_to_vec(&back.bytes()[..bytes])
    };
    let read: Vec<Vec<f32>> = images.iter().zip(&IMAGES).map(read).collect();
    let pixel = |i: usize| AovPixel {
        depth: read[0][i],
        motion: [read[1][2 * i], read[1][2 * i + 1]],
        density: [0, 1, 2, 3].map(|c| read[2][4 * i + c]),
        age: read[3][i],
    };
    (0..pixels).map(pixel).collect()
}

#[test]
fn images_agree_with_the_twin() {
    let context = support::validated_context();
    let shaders = [
        (shaders::aov::SHADER, false, false, false),
        (shaders::aov_stable::SHADER, true, false, false),
        (shaders::aov_age::SHADER, true, false, true),
        (shaders::aov_stable::SHADER, true, true, false),
        (shaders::aov_age::SHADER, true, true, true),
    ];
    for (shader, stable, fill, aged) in shaders {
        let kernel = Kernel::new(&context, shader);
        let random = &mut Random::new(11);
        for size in SIZES {
            let inputs = Inputs::random(random, size);
            let twin = aov(size, inputs.slots(fill), &inputs.shaded, stable.then(|| inputs.cache(aged)));
            assert_eq!(on_device(&context, &kernel, &inputs, [stable, fill, aged]), twin, "{} {size:?}", shader.name);
        }
    }
    support::assert_clean(&context);
}

#[test]
fn the_comparison_notices_one_sample_and_one_bit() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::aov_age::SHADER);
    let mut inputs = Inputs::random(&mut Random::new(12), [32, 24]);
    let device = on_device(&context, &kernel, &inputs, [true, false, true]);
    let twin = |inputs: &Inputs| aov(inputs.size, inputs.slots(false), &inputs.shaded, Some(inputs.cache(true)));
    assert_eq!(device, twin(&inputs));
    inputs.plan[5] ^= 0x10;
    assert_ne!(device, twin(&inputs));
    inputs.plan[5] ^= 0x10;
    inputs.shaded[3] = Shaded { depth: 0.25, ..inputs.shaded[3] };
    assert_ne!(device, twin(&inputs));
}
