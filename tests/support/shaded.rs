//! Shaded samples in the lists of pixels: what reconstruction reads.

use super::kernel::{Bound, Kernel, blank, data, values};
use super::random::Random;
use bytemuck::Zeroable;
use half::f16;
use stillray::oracle::bounded::Bounded;
use stillray::oracle::camera::pixels_in_order;
use stillray::oracle::slots::Slots;
use stillray::shaders::{FRAME_FILL, Frame, MOTION_UNKNOWN, Shaded};

#[derive(Clone)]
pub struct Inputs {
    pub frame: Frame,
    pub offsets: Vec<u32>,
    /// Empty, or the pixels' second runs.
    pub extras: Vec<u32>,
    pub shaded: Vec<Shaded>,
}

pub fn shaded(color: [f32; 3], offset: [u32; 2], depth: f32) -> Shaded {
    let [r, g, b] = color.map(|c| u32::from(f16::from_f32(c).to_bits()));
    Shaded { color_rg: r | g << 16, color_b_offset: b | offset[0] << 16 | offset[1] << 24, motion: 0, depth }
}

impl Inputs {
    pub fn new(size: [u32; 2], mut samples: impl FnMut([u32; 2]) -> Vec<Shaded>) -> Self {
        let frame = Frame { size, filter_width: 0.5, ..Frame::zeroed() };
        let mut inputs = Self { frame, offsets: vec![0], extras: Vec::new(), shaded: Vec::new() };
        for pixel in pixels_in_order(size) {
            inputs.shaded.extend(samples(pixel));
            inputs.offsets.push(inputs.shaded.len() as u32);
        }
        inputs
    }

    /// Crowded, sparse and empty regions; a quarter of the samples is not visible, some are of the sky.
    pub fn random(seed: u32, size: [u32; 2]) -> Self {
        let random = &mut Random::new(seed);
        let densities: Vec<u32> = (0..64).map(|_| random.pick(&[0, 0, 10, 100, 400, 1600])).collect();
        let mut inputs = Self::new(size, |[x, y]| {
            let density = densities[(x / 9 % 8 + y / 9 % 8 * 8) as usize];
            let count = (0..16).filter(|_| random.below(1600) < density).count();
            let one = |_| {
                let brightest = random.pick(&[1e-4, 1.0, 100.0, 65504.0]);
                let color = [0, 1, 2].map(|_| random.between(0.0, brightest));
                let depth = random.pick(&[-1.0, 0.5, 1e6, f32::INFINITY]);
                shaded(color, [random.below(256), random.below(256)], depth)
            };
            (0..count).map(one).collect()
        });
        inputs.frame.filter_width = [0.5, 0.25, 0.7, 1.0][seed as usize % 4];
        inputs
    }

    /// The same samples of the same pixels in the same order, but that the later ones of each pixel are listed behind all
    /// the earlier ones.
    pub fn split(&self, random: &mut Random) -> Self {
        let cuts: Vec<u32> = self.offsets.windows(2).map(|o| o[0] + random.below(o[1] - o[0] + 1)).collect();
        let mut out = Self { offsets: vec![0], extras: Vec::new(), shaded: Vec::new(), ..self.clone() };
        out.frame.flags |= FRAME_FILL;
        for (first, cut) in self.offsets.iter().zip(&cuts) {
            out.shaded.extend(&self.shaded[*first as usize..*cut as usize]);
            out.offsets.push(out.shaded.len() as u32);
        }
        out.extras.push(out.shaded.len() as u32);
        for (cut, end) in cuts.iter().zip(&self.offsets[1..]) {
            out.shaded.extend(&self.shaded[*cut as usize..*end as usize]);
            out.extras.push(out.shaded.len() as u32);
        }
        out
    }

    pub fn slots(&self) -> Slots<'_> {
        Slots { offsets: &self.offsets, extras: &self.extras }
    }

    pub fn run(&self, kernel: &Kernel, film: Bound<'_>) -> Vec<[f32; 4]> {
        let mut bound = [data(&[self.frame]), data(&self.offsets), data(&self.shaded), film, self.bound_extras()];
        kernel.run(&mut bound, &[], [self.frame.size[0], self.frame.size[1], 1]);
        values(&bound[3])
    }

    /// The film, and the motion of each pixel, of a kernel that makes both.
    pub fn with_motions(&self, kernel: &Kernel) -> (Vec<[f32; 4]>, Vec<u32>) {
        let pixels = self.offsets.len() - 1;
        let mut bound = [
            data(&[self.frame]),
            data(&self.offsets),
            data(&self.shaded),
            blank::<[f32; 4]>(pixels),
            self.bound_extras(),
            blank::<u32>(pixels),
        ];
        kernel.run(&mut bound, &[], [self.frame.size[0], self.frame.size[1], 1]);
        (values(&bound[3]), values(&bound[5]))
    }

    /// As in a frame, where something else is bound that must not be read.
    fn bound_extras(&self) -> Bound<'static> {
        if self.extras.is_empty() { blank::<u32>(1) } else { data(&self.extras) }
    }

    pub fn on_device(&self, kernel: &Kernel) -> Vec<[f32; 4]> {
        self.run(kernel, blank::<[f32; 4]>(self.offsets.len() - 1))
    }
}

/// Any motion, of halves of a quarter pixel so that there are ties, and unknown ones.
pub fn random_motion(random: &mut Random) -> u32 {
    let mut step = || u32::from(f16::from_f32((random.below(33) as f32 - 16.0) * 0.25).to_bits());
    let moved = step() | step() << 16;
    if random.chance(0.1) { MOTION_UNKNOWN } else { moved }
}

/// Every value of a film within its bound.
pub fn compare(device: &[[f32; 4]], twin: &[[Bounded; 4]]) -> Result<(), String> {
    let wrong = |(d, t): (&[f32; 4], &[Bounded; 4])| d.iter().zip(t).any(|(d, t)| !t.allows(*d));
    match device.iter().zip(twin).position(wrong) {
        None => Ok(()),
        Some(i) => Err(format!("{:?} at {i}, expected {:?}", device[i], twin[i])),
    }
}
