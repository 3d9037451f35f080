//! The phases of the fill agree with their CPU twins exactly: what is visible after verification, where additions begin, and
//! what the list becomes.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::{Zeroable, bytes_of, cast_slice};
use stillray::oracle::analyze;
use stillray::oracle::append::{Appended, append};
use stillray::oracle::scan::{scan_fill, thinned};
use stillray::oracle::seed::appended_seeds;
use stillray::oracle::survey::survey;
use stillray::shaders::{
    self, Counters, FOUND_LOST, FRAME_QUARTERS, Found, Frame, MODEL_AGE, MODEL_SEED, MODEL_SOURCE, NEW_INSTANCE,
    NO_SOURCE, OCCLUDED_BIT, SKY_INSTANCE, Sample,
};
use support::kernel::{Bound, Kernel, blank, data, values};
use support::masks::random_masks;
use support::random::{Random, SIZES};

/// A frame after verification: a sample of each occupied subpixel, in order.
#[derive(Clone)]
struct Inputs {
    frame: Frame,
    masks: Vec<u32>,
    offsets: Vec<u32>,
    samples: Vec<Sample>,
    found: Vec<Found>,
}

impl Inputs {
    fn random(seed: u32, size: [u32; 2]) -> Self {
        let random = &mut Random::new(seed);
        let masks = random_masks(random, size);
        let mut offsets = vec![0];
        for mask in &masks {
            offsets.push(offsets[offsets.len() - 1] + (mask & 0xffff).count_ones());
        }
        let count = offsets[masks.len()];
        let samples = (0..count).map(|i| Sample { position: [i as f32, 1.0, 2.0], instance: random.bits() }).collect();
        let found = |random: &mut Random| Found {
            instance: random.pick(&[3, 4 | OCCLUDED_BIT, SKY_INSTANCE]),
            primitive: random.pick(&[7, 8, FOUND_LOST]),
            u: 0.25,
            v: 0.5,
        };
        let found = (0..count).map(|_| found(random)).collect();
        let frame = Frame {
            size,
            frame: random.bits(),
            seed: random.bits(),
            d_target: random.pick(&[0.5, 1.0, 3.0, 16.0]),
            d_tolerance: random.pick(&[0.25, 1.0]),
            occluded_limit: random.below(4),
            flags: random.pick(&[0, FRAME_QUARTERS]),
            ..Frame::zeroed()
        };
        Self { frame, masks, offsets, samples, found }
    }

    /// With the analysis' decision, in a cache with room for `share` of what it adds.
    fn decided(&self, share: f64) -> Decided {
        let analysis = analyze::fill(&self.frame, &self.masks);
        let listed = self.samples.len() as u32;
        let added: u32 = analysis.tiles.iter().sum();
        let frame = Frame { capacity: listed + (f64::from(added) * share) as u32, ..self.frame };
        let (tiles, counters) = scan_fill(&frame, listed, &analysis.tiles);
        let mut inputs = Self { frame, ..self.clone() };
        inputs.samples.resize(counters.samples as usize, Sample::zeroed());
        inputs.found.resize(counters.samples as usize, Found::zeroed());
        Decided { inputs, plan: analysis.plan, counted: analysis.tiles, tiles, counters }
    }
}

struct Decided {
    inputs: Inputs,
    plan: Vec<u32>,
    /// What each tile adds, and the sums.
    counted: Vec<u32>,
    tiles: Vec<u32>,
    counters: Counters,
}

impl Decided {
    fn twin(&self) -> Appended {
        let i = &self.inputs;
        append(&i.frame, &self.counters, &i.masks, &self.plan, &i.offsets, &i.samples, &i.found)
    }

    /// What the first further binding holds afterwards.
    fn words(&self, kernel: &Kernel) -> Vec<u32> {
        let mut bound = self.bound(1);
        let [width, height] = self.inputs.frame.size;
        kernel.run(&mut bound, &[], [width, height, 1]);
        values(&bound[9])
    }

    fn bound(&self, further: usize) -> Vec<Bound<'static>> {
        let i = &self.inputs;
        let mut bound = vec![
            data(&[i.frame]),
            data(&i.masks),
            data(&self.plan),
            data(&self.tiles),
            data(&[self.counters]),
            data(&i.offsets),
            blank::<u32>(i.masks.len() + 1),
            data(&i.samples),
            data(&i.found),
        ];
        bound.extend((0..further).map(|_| data(&vec![9_u32; i.samples.len()])));
        bound
    }

    /// With ages, with sources, or with both if there are `further` bindings.
    fn on_device(&self, kernel: &Kernel, further: usize) -> Appended {
        let i = &self.inputs;
        let mut bound = self.bound(further);
        kernel.run(&mut bound, &[], [i.frame.size[0], i.frame.size[1], 1]);
        for words in &bound[9..] {
            let words: Vec<u32> = values(words);
            let (old, new) = words.split_at(self.counters.first as usize);
            let unborn = new.iter().all(|age| *age == 0) || new.iter().all(|source| *source == NO_SOURCE);
            assert!(unborn && old.iter().all(|word| *word == 9));
        }
        Appended { samples: values(&bound[7]), found: values(&bound[8]), extras: values(&bound[6]) }
    }
}

fn same(a: &Appended, b: &Appended) -> bool {
    a.extras == b.extras
        && cast_slice::<Sample, u8>(&a.samples) == cast_slice::<Sample, u8>(&b.samples)
        && cast_slice::<Found, u8>(&a.found) == cast_slice::<Found, u8>(&b.found)
}

fn survey_on_device(kernel: &Kernel, inputs: &Inputs) -> (Vec<u32>, Counters) {
    let counted = Counters { reused: 5, occluded: 100, ..Counters::zeroed() };
    let mut bound =
        [data(&[inputs.frame]), data(&inputs.offsets), data(&inputs.found), data(&inputs.masks), data(&[counted])];
    kernel.run(&mut bound, &[], [inputs.frame.size[0], inputs.frame.size[1], 1]);
    let counters: Counters = values(&bound[4])[0];
    assert_eq!(counters.reused, 5);
    (values(&bound[3]), Counters { reused: 0, occluded: counters.occluded - 100, ..counters })
}

#[test]
fn what_is_visible_is_the_twins() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::survey::SHADER);
    for (seed, size) in SIZES.into_iter().enumerate() {
        let inputs = Inputs::random(seed as u32, size);
        let device = survey_on_device(&kernel, &inputs);
        assert!(device == survey(&inputs.offsets, &inputs.found, &inputs.masks), "{size:?}");
        // What was so in the last frame does not matter.
        let forgotten: Vec<u32> = inputs.masks.iter().map(|mask| mask & 0xffff).collect();
        assert!(device == survey(&inputs.offsets, &inputs.found, &forgotten));
        // Negative control: one sample more that is hidden.
        let mut wrong = inputs.clone();
        if let Some(visible) = wrong.found.iter_mut().find(|f| f.instance == 3 && f.primitive == 7) {
            visible.instance |= OCCLUDED_BIT;
            assert!(device != survey(&wrong.offsets, &wrong.found, &wrong.masks), "{size:?}");
        }
    }
    support::assert_clean(&context);
}

#[test]
fn sums_behind_a_list_are_the_twins() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::scan_fill::SHADER);
    for (seed, listed) in [(1, 0), (2, 1000), (3, 3_000_000)] {
        for share in [1.0, 0.5, 0.0] {
            let decided = Inputs::random(seed, [97, 61]).decided(1.0);
            let added: u32 = decided.counted.iter().sum();
            let capacity = listed + (f64::from(added) * share) as u32;
            let frame = Frame { capacity, ..Frame::zeroed() };
            let counted = Counters { samples: listed, ..Counters::zeroed() };
            let mut bound = [data(&[frame]), data(&decided.counted), data(&[counted])];
            let push = shaders::scan_fill::Push { tile_count: decided.counted.len() as u32 };
            kernel.run(&mut bound, bytes_of(&push), [256, 1, 1]);
            let twin = scan_fill(&frame, listed, &decided.counted);
            let device: (Vec<u32>, Counters) = (values(&bound[1]), values(&bound[2])[0]);
            assert!(device == twin, "{:?} {:?}", device.1, twin.1);
            assert!(twin.1.samples <= capacity && twin.1.samples == listed + thinned(added, twin.1.thin));
            assert!(device != scan_fill(&frame, listed, &[&decided.counted[..], &[1]].concat()));
        }
    }
    support::assert_clean(&context);
}

#[test]
fn the_list_is_the_twins() {
    let context = support::validated_context();
    let plain = Kernel::new(&context, shaders::append::SHADER);
    let aged = Kernel::new(&context, shaders::append::modelling(MODEL_AGE));
    let sourced = Kernel::new(&context, shaders::append::modelling(MODEL_SOURCE));
    let both = Kernel::new(&context, shaders::append::modelling(MODEL_AGE | MODEL_SOURCE));
    for (seed, size) in SIZES.into_iter().cycle().take(16).enumerate() {
        let decided = Inputs::random(seed as u32, size).decided([1.0, 0.6, 0.0][seed % 3]);
        let twin = decided.twin();
        for (kernel, further) in [(&plain, 0), (&aged, 1), (&sourced, 1), (&both, 2)] {
            assert!(same(&decided.on_device(kernel, further), &twin), "{size:?}, {further} further bindings");
        }
    }
    support::assert_clean(&context);
}

#[test]
fn seeds_behind_a_list_go_on_from_what_is_visible() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::append::modelling(MODEL_SEED));
    for (seed, size) in SIZES.into_iter().cycle().take(16).enumerate() {
        let decided = Inputs::random(seed as u32, size).decided([1.0, 0.6, 0.0][seed % 3]);
        let i = &decided.inputs;
        let kept = decided.plan.iter().zip(&i.masks).map(|(plan, mask)| (plan & 0xffff & mask >> 16).count_ones());
        let added = appended_seeds(&i.frame, &decided.twin().extras, &kept.collect::<Vec<_>>());
        let seeds = decided.words(&kernel);
        let (old, new) = seeds.split_at(decided.counters.first as usize);
        assert!(old.iter().all(|seed| *seed == 9), "those of what was listed before stay");
        assert_eq!(new[..added.len()], added, "{size:?}");
    }
    support::assert_clean(&context);
}

#[test]
fn wrong_lists_are_caught() {
    let context = support::validated_context();
    let kernel = Kernel::new(&context, shaders::append::SHADER);
    let mut decided = Inputs::random(2, [64, 40]).decided(1.0);
    let device = decided.on_device(&kernel, 0);
    assert!(same(&device, &decided.twin()));
    assert!(device.found != decided.inputs.found, "something is forgotten");
    let evicting = decided.plan.iter().zip(&decided.inputs.masks).position(|(p, m)| m & !p & 0xffff != 0).unwrap();
    decided.plan[evicting] |= decided.inputs.masks[evicting] & 0xffff;
    assert!(!same(&device, &decided.twin()), "a sample that is not forgotten");
    let mut other = Inputs::random(2, [64, 40]).decided(1.0);
    other.inputs.frame.seed ^= 1;
    assert!(!same(&device, &other.twin()), "samples elsewhere");
    support::assert_clean(&context);
}

#[test]
fn additions_are_new_and_in_their_subpixels() {
    let mut inputs = Inputs::random(4, [31, 17]);
    inputs.frame.flags = 0;
    let decided = inputs.decided(1.0);
    let twin = decided.twin();
    let all_new = twin.samples[decided.counters.first as usize..].iter().all(|s| s.instance == NEW_INSTANCE);
    assert!(all_new && twin.extras.last() == Some(&decided.counters.samples));
    for (index, pixel) in stillray::oracle::camera::pixels_in_order([31, 17]).enumerate() {
        let slots = twin.extras[index] as usize..twin.extras[index + 1] as usize;
        let bits = twin.samples[slots].iter().map(|s| {
            let [x, y] = [0, 1].map(|i| ((s.position[i] - pixel[i] as f32) * 4.0).floor() as u32);
            1 << (4 * y + x)
        });
        assert_eq!(bits.sum::<u32>(), decided.plan[index] >> 16);
    }
}
