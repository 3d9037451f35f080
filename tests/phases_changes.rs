//! The image of what changed agrees with its CPU twin exactly, and tells of whole frames what happened in them.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test
mod support;

use ash::vk;
use bytemuck::Zeroable;
use glam::DVec3;
use stillray::gpu::submit::Submitter;
use stillray::gpu::{Buffer, Context, Image, ImageDesc, Place};
use stillray::headless::Session;
use stillray::oracle::changes::{Memory, changes};
use stillray::oracle::slots::Slots;
use stillray::renderer::{Aov, FrameInputs, FrameStats, Method, Settings};
use stillray::scene::motion::Motion;
use stillray::scene::{Pose, View};
use stillray::shaders::{self, FRAME_FILL, Frame, NEW_INSTANCE, NO_SOURCE, OCCLUDED_BIT, Sample};
use support::kernel::{Bound, Kernel, blank, data, values};
use support::random::Random;
use support::rig::{Rig, load};

const SIZES: [[u32; 2]; 4] = [[1, 1], [7, 5], [32, 24], [1, 100]];

/// A frame's worth of what the shader reads.
#[derive(Clone)]
struct Inputs {
    size: [u32; 2],
    offsets: Vec<u32>,
    /// Second runs of the pixels, if a fill has added samples.
    extras: Vec<u32>,
    masks: Vec<u32>,
    plan: Vec<u32>,
    previous: Vec<Sample>,
    samples: Vec<Sample>,
    sources: Vec<u32>,
    lit: Vec<u32>,
    reached: Vec<u32>,
}

impl Inputs {
    fn random(random: &mut Random, size: [u32; 2], fill: bool) -> Self {
        let pixels = (size[0] * size[1]) as usize;
        let mut offsets = vec![0];
        for i in 0..pixels {
            offsets.push(offsets[i] + [0, 1, 1, 3, 16][random.below(5) as usize]);
        }
        let mut extras = if fill { vec![offsets[pixels]] } else { Vec::new() };
        for i in 0..if fill { pixels } else { 0 } {
            extras.push(extras[i] + random.pick(&[0, 0, 1, 2]));
        }
        let count = *extras.last().unwrap_or(&offsets[pixels]) as usize;
        let sample = |random: &mut Random| Sample {
            position: random.direction(),
            instance: random.below(9) | random.pick(&[0, OCCLUDED_BIT]),
        };
        let previous: Vec<Sample> = (0..count + 5).map(|_| sample(random)).collect();
        let reached: Vec<u32> = (0..count + 5).map(|_| random.below(4)).collect();
        let sources: Vec<u32> =
            (0..count).map(|_| if random.chance(0.2) { NO_SOURCE } else { random.below(count as u32 + 5) }).collect();
        let after = |random: &mut Random, source: &u32| {
            let Some(before) = previous.get(*source as usize) else { return sample(random) };
            match random.below(8) {
                0 => Sample { instance: NEW_INSTANCE, ..*before },
                1 => Sample { instance: before.instance ^ OCCLUDED_BIT, ..*before },
                2 => Sample { instance: before.instance & !OCCLUDED_BIT, position: random.direction() },
                3 => Sample { position: before.position.map(|x| f32::from_bits(x.to_bits() ^ 1)), ..*before },
                _ => *before,
            }
        };
        let samples = sources.iter().map(|source| after(random, source)).collect();
        let lights = |random: &mut Random, source: &u32| match reached.get(*source as usize) {
            Some(reached) if random.chance(0.7) => *reached,
            _ => random.below(4) | random.pick(&[0, 1 << 31]),
        };
        let lit = sources.iter().map(|source| lights(random, source)).collect();
        let mut word = || random.below(1 << 16) | random.below(1 << 16) << 16;
        let masks = (0..pixels).map(|_| word()).map(|w| w & (w << 16 | 0xffff)).collect();
        let plan = (0..pixels).map(|_| word()).collect();
        Self { size, offsets, extras, masks, plan, previous, samples, sources, lit, reached }
    }

    fn twin(&self, stable: bool) -> Vec<[f32; 4]> {
        let memory = Memory {
            masks: &self.masks,
            plan: &self.plan,
            previous: &self.previous,
            samples: &self.samples,
            sources: &self.sources,
            lit: &self.lit,
            reached: &self.reached,
        };
        changes(self.size, Slots { offsets: &self.offsets, extras: &self.extras }, stable.then_some(memory))
    }

    fn on_device(&self, context: &Context, kernel: &Kernel, stable: bool) -> Vec<[f32; 4]> {
        let format = vk::Format::R32G32B32A32_SFLOAT;
        let usage = vk::ImageUsageFlags::STORAGE;
        let image =
            Image::new(context, "changes", ImageDesc { format, extent: self.size, layers: 1, array: false, usage });
        let image = image.unwrap();
        image.clear(context).unwrap();
        let flags = if self.extras.is_empty() { 0 } else { FRAME_FILL };
        let frame = Frame { size: self.size, flags, ..Frame::zeroed() };
        let mut bound = vec![data(&[frame]), data(&self.offsets), Bound::Image(&image)];
        bound.push(if flags == 0 { blank::<u32>(1) } else { data(&self.extras) });
        if stable {
            bound.extend([data(&self.masks), data(&self.plan), data(&self.previous), data(&self.samples)]);
            bound.extend([data(&self.sources), data(&self.lit), data(&self.reached)]);
            bound.push(blank::<u32>(self.lit.len()));
        }
        kernel.run(&mut bound, &[], [self.size[0], self.size[1], 1]);
        if stable {
            assert_eq!(values::<u32>(&bound[11]), self.lit, "what the next frame is told");
        }
        let bytes = 16 * (self.size[0] * self.size[1]) as usize;
        let back = Buffer::new(context, "back", bytes as u64, Place::Readback).unwrap();
        // SAFETY: `run` hands over a command buffer that is recording and waits for it.
        let copy = |commands| unsafe { image.record_copy(commands, &back) };
        Submitter::new(context).unwrap().run("copy", copy).unwrap();
        bytemuck::pod_collect_to_vec(&back.bytes()[..bytes])
    }
}

#[test]
fn images_agree_with_the_twin() {
    let context = support::validated_context();
    let plain = shaders::changes::SHADER;
    let stable = shaders::changes_stable::SHADER;
    for (shader, stable, fill) in [(plain, false, false), (stable, true, false), (stable, true, true)] {
        let kernel = Kernel::new(&context, shader);
        let random = &mut Random::new(11);
        for size in SIZES {
            let inputs = Inputs::random(random, size, fill);
            let twin = inputs.twin(stable);
            assert_eq!(inputs.on_device(&context, &kernel, stable), twin, "{} {size:?}", shader.name);
            let there = |channel: usize| twin.iter().any(|p| p[channel] > 0.0);
            assert!(size != [32, 24] || (0..4).all(|channel| there(channel) == (stable || channel == 0)));
        }
    }
    support::assert_clean(&context);
}

#[test]
fn the_comparison_notices_each_kind_of_change() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::changes_stable::SHADER);
    let inputs = Inputs::random(&mut Random::new(12), [32, 24], false);
    let device = inputs.on_device(&context, &kernel, true);
    assert_eq!(device, inputs.twin(true));
    // A sample that is as it was.
    let is_calm = |&slot: &usize| {
        let source = inputs.sources[slot] as usize;
        inputs.previous.get(source).is_some_and(|before| {
            let same = before.position.map(f32::to_bits) == inputs.samples[slot].position.map(f32::to_bits);
            same && before.instance == inputs.samples[slot].instance && before.instance & OCCLUDED_BIT == 0
        }) && inputs.lit[slot] == inputs.reached[source]
    };
    let calm = (0..inputs.lit.len()).find(is_calm).unwrap();
    let differs = |change: &dyn Fn(&mut Inputs), what: &str| {
        let mut changed = inputs.clone();
        change(&mut changed);
        assert_ne!(device, changed.twin(true), "{what}");
    };
    differs(&|i| i.sources[calm] = NO_SOURCE, "new");
    differs(&|i| i.plan[5] ^= i.masks[5] >> 16 | 1, "evicted");
    differs(&|i| i.samples[calm].instance |= OCCLUDED_BIT, "hidden");
    differs(&|i| i.samples[calm].instance = NEW_INSTANCE, "lost");
    differs(&|i| i.samples[calm].position[2] += 1.0, "replaced");
    differs(&|i| i.lit[calm] ^= 1 << 31, "relit");
}

/// Renders a frame; its counts, and the sums of the image's channels.
fn frame(session: &mut Session, view: View, pose: &Pose) -> (FrameStats, [f64; 4]) {
    let stats = session.frame(&FrameInputs { view, pose, reset: false }).unwrap();
    let pixels = session.aov(Aov::Changes).unwrap();
    (stats, [0, 1, 2, 3].map(|c| pixels.data.iter().skip(c).step_by(4).map(|x| f64::from(*x)).sum()))
}

fn settings(method: Method) -> Settings {
    Settings { size: [64, 48], aovs: vec![Aov::Changes], ..Settings::of(method) }
}

#[test]
fn whole_frames_tell_new_samples_passing_occluders_and_moving_lights_apart() {
    let rig = Rig::new(load("builtin:cornell"));
    let mut session = rig.session(&settings(Method::Stable));
    let still = rig.scene.pose(0.0);
    let view = still.cameras[0];
    let (stats, first) = frame(&mut session, view, &still);
    assert_eq!(first, [f64::from(stats.added), 0.0, 0.0, 0.0], "everything is new in the first frame");
    let rest = |session: &mut Session, pose: &Pose| (0..3).map(|_| frame(session, view, pose)).last();
    rest(&mut session, &still);
    assert_eq!(frame(&mut session, view, &still).1, [0.0; 4], "nothing moves, nothing changes");

    // The light moves: what it reaches changes, and nothing else.
    let mut lit = still.clone();
    lit.lights[0].position += DVec3::new(0.8, 0.0, 0.3);
    let (_, [new, evicted, turned, relit]) = frame(&mut session, view, &lit);
    println!("light: {new} {evicted} {turned} {relit}");
    assert!(turned == 0.0 && relit > 20.0, "{turned} {relit}");
    rest(&mut session, &lit);

    // A block passes: it hides what it comes to stand before, and what lay on it is seen through it no more.
    let mut passed = lit.clone();
    passed.instances[1].translation += DVec3::new(0.4, 0.0, 0.0);
    let (stats, [new, evicted, turned, _]) = frame(&mut session, view, &passed);
    println!("block: {new} {evicted} {turned} {stats:?}");
    assert_eq!([new, evicted], [stats.added, stats.evicted].map(f64::from));
    // Nothing was hidden before, so that each sample found hidden or lost is a change, and those replaced were hidden.
    assert!(stats.occluded > 20);
    assert_eq!(turned, f64::from(stats.occluded + stats.lost));
    let (stats, [_, _, back, _]) = frame(&mut session, view, &lit);
    println!("back: {back} {stats:?}");
    assert!(back > f64::from(stats.occluded + stats.lost), "what was hidden comes back into view");
    rig.assert_clean();
}

#[test]
fn samples_without_identity_are_all_new() {
    let rig = Rig::new(load("builtin:cornell"));
    for method in Method::ALL.iter().copied().filter(|m| !m.keeps_samples()) {
        let mut session = rig.session(&settings(method));
        for i in 0..3 {
            let pose = rig.scene.pose(0.0);
            let (stats, sums) = frame(&mut session, rig.view(Motion::Pan, f64::from(i) / 60.0), &pose);
            assert_eq!(sums, [f64::from(stats.rays), 0.0, 0.0, 0.0], "{method:?}");
        }
    }
    rig.assert_clean();
}
