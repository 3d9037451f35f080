//! The last-sample rule agrees with its CPU twin to the bit.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::{Zeroable, cast_slice};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use stillray::oracle::retain::{Corners, retain};
use stillray::shaders::{self, Counters, FOUND_LOST, FRAME_SETTLED, Found, Frame, HIT_SKY, OCCLUDED_BIT, SKY_INSTANCE};
use stillray::shaders::{NEW_INSTANCE, Sample};
use support::kernel::{Kernel, data, values};
use support::random::{Random, SIZES};

const TRIANGLES: u32 = 500;

#[derive(Clone)]
struct Inputs {
    frame: Frame,
    offsets: Vec<u32>,
    corners: Vec<[f32; 4]>,
    rest: Vec<f32>,
    found: Vec<Found>,
    samples: Vec<Sample>,
}

#[derive(Debug, PartialEq)]
struct Outcome {
    found: Vec<Found>,
    samples: Vec<Sample>,
    counters: Counters,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Visible,
    Sky,
    Occluded,
    Lost,
}

const ALL: [Kind; 4] = [Kind::Visible, Kind::Sky, Kind::Occluded, Kind::Lost];

fn found(random: &mut Random, kind: Kind) -> Found {
    let instance = random.below(1000);
    let primitive = random.below(TRIANGLES);
    let u = random.between(0.0, 1.0);
    let hit = Found { instance, primitive, u, v: random.between(0.0, 1.0 - u) };
    match kind {
        Kind::Visible => hit,
        Kind::Sky => Found { instance: SKY_INSTANCE, primitive: HIT_SKY, u: 0.0, v: 0.0 },
        Kind::Occluded => Found { instance: instance | OCCLUDED_BIT, ..hit },
        Kind::Lost => Found { instance: instance | random.pick(&[0, OCCLUDED_BIT]), primitive: FOUND_LOST, ..hit },
    }
}

impl Inputs {
    /// Pixels of 0 to `most` samples, each with kinds drawn from a subset of its own.
    fn random(seed: u32, size: [u32; 2], most: u32, kinds: &[Kind]) -> Self {
        let random = &mut Random::new(seed);
        let mut offsets = vec![0];
        let mut all = Vec::new();
        for _ in 0..size[0] * size[1] {
            let drawn: Vec<Kind> = kinds.iter().copied().filter(|_| random.chance(0.5)).collect();
            let drawn = if drawn.is_empty() { kinds.to_vec() } else { drawn };
            let count = random.below(most + 1);
            all.extend((0..count).map(|_| random.pick(&drawn)));
            offsets.push(all.len() as u32);
        }
        let scale = random.between(-10.0, 20.0).exp2();
        let mut coordinate = || random.between(-scale, scale);
        let corners = (0..2 * TRIANGLES).map(|_| [(); 4].map(|()| coordinate())).collect();
        let rest = (0..TRIANGLES).map(|_| coordinate()).collect();
        let found = all.iter().map(|&kind| found(random, kind)).collect();
        let samples = all
            .iter()
            .map(|_| Sample {
                position: [0, 1, 2].map(|_| random.between(-9.0, 9.0)),
                instance: random.pick(&[NEW_INSTANCE, 3, 4 | OCCLUDED_BIT]),
            })
            .collect();
        let frame = Frame { size, ..Frame::zeroed() };
        Self { frame, offsets, corners, rest, found, samples }
    }

    fn twin(&self) -> Outcome {
        let (mut found, mut samples) = (self.found.clone(), self.samples.clone());
        let triangles = Corners { corners: &self.corners, rest: &self.rest };
        let counters = retain(&self.frame, &self.offsets, triangles, &mut found, &mut samples);
        Outcome { found, samples, counters }
    }

    fn on_device(&self, kernel: &Kernel) -> Outcome {
        let mut bound = [
            data(&[self.frame]),
            data(&self.offsets),
            data(&self.corners),
            data(&self.rest),
            data(&self.found),
            data(&self.samples),
            data(&[Counters { reused: 5, occluded: 1000, ..Counters::zeroed() }]),
        ];
        kernel.run(&mut bound, &[], [self.frame.size[0], self.frame.size[1], 1]);
        let mut counters: Counters = values(&bound[6])[0];
        assert_eq!(counters.reused, 5);
        counters.reused = 0;
        counters.occluded -= 1000;
        Outcome { found: values(&bound[4]), samples: values(&bound[5]), counters }
    }
}

fn same(a: &Outcome, b: &Outcome) -> bool {
    a.counters == b.counters
        && cast_slice::<Found, u8>(&a.found) == cast_slice::<Found, u8>(&b.found)
        && cast_slice::<Sample, u8>(&a.samples) == cast_slice::<Sample, u8>(&b.samples)
}

#[test]
fn outcomes_are_the_twins() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::retain::SHADER);
    for (seed, size) in SIZES.into_iter().enumerate() {
        for most in [0, 1, 5, 16] {
            let mut inputs = Inputs::random(seed as u32, size, most, &ALL);
            assert!(same(&inputs.on_device(&kernel), &inputs.twin()), "{size:?}, up to {most}");
            inputs.frame.flags = FRAME_SETTLED;
            let device = inputs.on_device(&kernel);
            assert!(same(&device, &inputs.twin()), "{size:?}, up to {most}, settled");
            assert_eq!((device.samples == inputs.samples, device.counters.replaced), (true, 0));
        }
        for kind in ALL {
            let inputs = Inputs::random(seed as u32, size, 4, &[kind]);
            assert!(same(&inputs.on_device(&kernel), &inputs.twin()), "{size:?}");
        }
    }
    let config = Config { cases: 16, failure_persistence: None, ..Config::default() };
    let cases = (any::<u32>(), 1_u32..60, 1_u32..60, 0_u32..=16);
    let outcome = TestRunner::new(config).run(&cases, |(seed, width, height, most)| {
        let inputs = Inputs::random(seed, [width, height], most, &ALL);
        prop_assert!(same(&inputs.on_device(&kernel), &inputs.twin()));
        Ok(())
    });
    outcome.unwrap();
    support::assert_clean(&context);
}

#[test]
fn wrong_rules_are_caught() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::retain::SHADER);
    let inputs = Inputs::random(3, [30, 30], 6, &ALL);
    let device = inputs.on_device(&kernel);
    let mut last_ulp = inputs.twin();
    let replaced = (0..last_ulp.samples.len()).find(|&i| last_ulp.samples[i] != inputs.samples[i]).unwrap();
    last_ulp.samples[replaced].position[1] = last_ulp.samples[replaced].position[1].next_up();
    assert!(!same(&device, &last_ulp), "a position that is off by an ulp");
    let mut wrong = inputs.clone();
    wrong.found.iter_mut().filter(|f| f.primitive == FOUND_LOST).for_each(|f| f.primitive = 0);
    assert!(!same(&device, &wrong.twin()), "lost samples taken for others");
    let mut wrong = inputs.clone();
    wrong.offsets.iter_mut().skip(1).for_each(|o| *o = (*o + 1).min(inputs.found.len() as u32));
    assert!(!same(&device, &wrong.twin()), "offsets that are off by one");
    support::assert_clean(&context);
}

#[test]
fn a_pixel_is_rescued_only_if_nothing_in_it_is_visible() {
    use Kind::{Lost, Occluded, Sky, Visible};
    let random = &mut Random::new(1);
    let cases: [(&[Kind], Option<usize>); 9] = [
        (&[], None),
        (&[Occluded], Some(0)),
        (&[Lost], None),
        (&[Lost, Occluded, Occluded], Some(1)),
        (&[Occluded, Visible], None),
        (&[Occluded, Sky], None),
        (&[Visible], None),
        (&[Lost, Visible, Occluded], None),
        (&[Occluded; 16], Some(0)),
    ];
    for (kinds, rescued) in cases {
        let mut inputs = Inputs::random(1, [1, 1], 0, &ALL);
        inputs.found = kinds.iter().map(|&kind| found(random, kind)).collect();
        inputs.samples = vec![Sample { position: [1e9; 3], instance: 1 << 20 }; kinds.len()];
        inputs.offsets = vec![0, kinds.len() as u32];
        let outcome = inputs.twin();
        let changed: Vec<usize> = (0..kinds.len()).filter(|&i| outcome.samples[i] != inputs.samples[i]).collect();
        assert_eq!(changed, Vec::from_iter(rescued));
        assert_eq!(outcome.counters.replaced, u32::from(rescued.is_some()));
        if let Some(slot) = rescued {
            assert_eq!(outcome.samples[slot].instance & OCCLUDED_BIT, 0);
            assert_eq!(outcome.found[slot].instance, inputs.found[slot].instance & !OCCLUDED_BIT);
        }
    }
}
