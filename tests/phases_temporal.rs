//! Temporal integration and the box filter agree with their CPU twins within the error that Vulkan's precision allows, and
//! keep what they must: the mean, finite values, nothing of a firefly.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use ash::vk;
use bytemuck::{Zeroable, bytes_of};
use half::f16;
use stillray::gpu::submit::Submitter;
use stillray::gpu::{Buffer, Context, Image, ImageDesc, Place};
use stillray::oracle::bounded::Bounded;
use stillray::oracle::temporal::{self, Color, average, displayed, integrate, to_ycocg};
use stillray::settings::{History, HistoryFilter, Precision};
use stillray::shaders::{self, FRAME_RESET, Frame, MOTION_UNKNOWN};
use support::kernel::{Bound, Kernel, blank, data, values};
use support::random::{Random, SIZES};

/// A variant of a shader: what its history and its image are made of.
struct Device {
    context: Context,
    kernel: Kernel,
    precision: Precision,
    float_output: bool,
}

impl Device {
    fn new(context: &Context, precision: Precision, float_output: bool) -> Self {
        let shader = match (precision, float_output) {
            (Precision::Half, false) => shaders::temporal::SHADER,
            (Precision::Half, true) => shaders::temporal_float::SHADER,
            (Precision::Float, false) => shaders::temporal_precise::SHADER,
            (Precision::Float, true) => shaders::temporal_precise_float::SHADER,
        };
        Self { context: context.clone(), kernel: Kernel::new(context, shader), precision, float_output }
    }

    fn largest(&self) -> f32 {
        if self.float_output { f32::MAX } else { 65504.0 }
    }

    /// The new picture and the frame.
    fn run(&self, inputs: &Inputs) -> (Vec<[f32; 3]>, Vec<[f32; 4]>) {
        let image = color_image(&self.context, inputs.frame.size, self.float_output);
        let count = inputs.film.len();
        let history = match self.precision {
            Precision::Half => blank::<[u16; 4]>(count),
            Precision::Float => blank::<[f32; 4]>(count),
        };
        let mut bound = [
            data(&[inputs.frame]),
            data(&inputs.film),
            data(&inputs.motion),
            store(&inputs.previous, self.precision),
            history,
            Bound::Image(&image),
        ];
        let push = shaders::temporal::Push {
            alpha: inputs.history.alpha,
            clamp_width: inputs.history.clamp,
            cubic: u32::from(inputs.history.filter == HistoryFilter::CatmullRom),
        };
        self.kernel.run(&mut bound, bytes_of(&push), [inputs.frame.size[0], inputs.frame.size[1], 1]);
        (restore(&bound[4], self.precision), pixels(&self.context, &image, self.float_output))
    }
}

fn store<'a>(picture: &[[f32; 3]], precision: Precision) -> Bound<'a> {
    match precision {
        Precision::Half => {
            data(&picture.iter().map(|c| [c[0], c[1], c[2], 0.0].map(f16::from_f32)).collect::<Vec<_>>())
        }
        Precision::Float => data(&picture.iter().map(|c| [c[0], c[1], c[2], 0.0]).collect::<Vec<_>>()),
    }
}

fn restore(bound: &Bound<'_>, precision: Precision) -> Vec<[f32; 3]> {
    let texels: Vec<[f32; 4]> = match precision {
        Precision::Half => values::<[f16; 4]>(bound).into_iter().map(|t| t.map(f16::to_f32)).collect(),
        Precision::Float => values(bound),
    };
    // Nothing is left of what was there before: the gap is written too.
    assert!(texels.iter().all(|t| t[3] == 0.0));
    texels.into_iter().map(|[a, b, c, _]| [a, b, c]).collect()
}

fn color_image(context: &Context, size: [u32; 2], float: bool) -> Image {
    let format = if float { vk::Format::R32G32B32A32_SFLOAT } else { vk::Format::R16G16B16A16_SFLOAT };
    let usage = vk::ImageUsageFlags::STORAGE;
    let image =
        Image::new(context, "color", ImageDesc { format, extent: size, layers: 1, array: false, usage }).unwrap();
    image.clear(context).unwrap();
    image
}

fn pixels(context: &Context, image: &Image, float: bool) -> Vec<[f32; 4]> {
    let [width, height] = image.desc().extent;
    let bytes = u64::from(width * height) * if float { 16 } else { 8 };
    let back = Buffer::new(context, "back", bytes, Place::Readback).unwrap();
    // SAFETY: `run` hands over a command buffer that is recording and waits for it.
    let copy = |commands| unsafe { image.record_copy(commands, &back) };
    Submitter::new(context).unwrap().run("copy", copy).unwrap();
    let bytes = &back.bytes()[..bytes as usize];
    if float {
        return bytemuck::pod_collect_to_vec(bytes);
    }
    bytemuck::pod_collect_to_vec::<u8, [f16; 4]>(bytes).into_iter().map(|t| t.map(f16::to_f32)).collect()
}

#[derive(Clone)]
struct Inputs {
    frame: Frame,
    history: History,
    film: Vec<[f32; 4]>,
    motion: Vec<u32>,
    previous: Vec<[f32; 3]>,
}

fn pack(motion: [f32; 2]) -> u32 {
    let [x, y] = motion.map(|m| u32::from(f16::from_f32(m).to_bits()));
    x | y << 16
}

fn entry(color: [f32; 3], weight: f32) -> [f32; 4] {
    let [r, g, b] = color.map(|c| c * weight);
    [r, g, b, weight]
}

fn ycocg(color: [f32; 3]) -> [f32; 3] {
    to_ycocg(color.map(Bounded::exact)).map(|c| f16::from_f64(c.value).to_f32())
}

impl Inputs {
    /// A smooth picture, noise of all strengths, fireflies and pixels without a sample; motions of all lengths, off the frame
    /// and unknown.
    fn random(random: &mut Random, size: [u32; 2]) -> Self {
        let count = (size[0] * size[1]) as usize;
        let noise = random.pick(&[0.0, 0.01, 1.0]);
        let missing = random.pick(&[0.0, 0.05, 0.9]);
        let film = |random: &mut Random| {
            let weight = if random.chance(missing) { 0.0 } else { random.between(-6.0, 3.0).exp() };
            let firefly = if random.chance(0.01) { 20000.0 } else { 1.0 };
            entry([0.2, 0.5, 0.3].map(|c| firefly * (c + noise * random.between(0.0, 1.0))), weight)
        };
        let motion = |random: &mut Random| {
            let reach = random.pick(&[0.0, 1e-4, 1.0, 5.0, 200.0]);
            let moved = pack([random.between(-reach, reach), random.between(-reach, reach)]);
            if random.chance(0.05) { MOTION_UNKNOWN } else { moved }
        };
        Self {
            frame: Frame { size, flags: if random.chance(0.1) { FRAME_RESET } else { 0 }, ..Frame::zeroed() },
            history: History {
                alpha: random.pick(&[0.01, 0.1, 0.25, 1.0]),
                clamp: random.pick(&[0.0, 0.5, 1.0, 4.0, 16.0]),
                filter: random.pick(&HistoryFilter::ALL),
                precision: Precision::Half,
            },
            film: (0..count).map(|_| film(random)).collect(),
            motion: (0..count).map(|_| motion(random)).collect(),
            previous: (0..count).map(|_| ycocg([0; 3].map(|_| random.between(0.0, 1.0 + noise)))).collect(),
        }
    }

    /// Nothing moves, everything has this colour, and so has the history.
    fn constant(size: [u32; 2], history: History, color: [f32; 3]) -> Self {
        let count = (size[0] * size[1]) as usize;
        Self {
            frame: Frame { size, ..Frame::zeroed() },
            history,
            film: vec![entry(color, 1.0); count],
            motion: vec![0; count],
            previous: vec![ycocg(color); count],
        }
    }

    fn twin(&self) -> Vec<Color> {
        integrate(&temporal::Inputs {
            frame: &self.frame,
            history: &self.history,
            film: &self.film,
            motion: &self.motion,
            previous: &self.previous,
        })
    }
}

/// With what storing it as the nearest half adds to its error: half of a unit in the last place of 11 bits, or of 2^-24.
fn nearest_half(c: Bounded) -> Bounded {
    Bounded { error: c.error + ((c.value.abs() + c.error) * 2f64.powi(-11)).max(2f64.powi(-25)), ..c }
}

/// With what an image of halves adds: rounding to either neighbour.
fn half_texel(c: Bounded) -> Bounded {
    Bounded { error: c.error + ((c.value.abs() + c.error) * 2f64.powi(-10)).max(2f64.powi(-24)), ..c }
}

fn problem(device: &Device, inputs: &Inputs) -> Option<String> {
    problem_of(device, &device.run(inputs), &inputs.twin())
}

fn problem_of(device: &Device, (history, color): &(Vec<[f32; 3]>, Vec<[f32; 4]>), twin: &[Color]) -> Option<String> {
    for (i, want) in twin.iter().enumerate() {
        let shown = displayed(*want, device.largest());
        for c in 0..3 {
            let kept = if device.precision == Precision::Half { nearest_half(want[c]) } else { want[c] };
            let shown = if device.float_output { shown[c] } else { half_texel(shown[c]) };
            if !kept.allows(history[i][c]) {
                return Some(format!("history of {i}.{c}: {} against {kept:?}", history[i][c]));
            }
            if !(shown.allows(color[i][c]) && color[i][c].is_finite() && color[i][3] == 1.0) {
                return Some(format!("colour of {i}.{c}: {} against {shown:?}", color[i][c]));
            }
        }
    }
    None
}

#[test]
fn pictures_are_the_twins() {
    let context = support::validated_context();
    let mut widest = 0.0_f64;
    for precision in Precision::ALL {
        for float_output in [false, true] {
            let device = Device::new(&context, precision, float_output);
            let random = &mut Random::new(21);
            for size in SIZES.into_iter().cycle().take(40) {
                let inputs = Inputs::random(random, size);
                assert_eq!(problem(&device, &inputs), None, "{size:?} {:?} {precision:?}", inputs.history);
                let brightest = inputs.film.iter().filter(|s| s[3] > 0.0).map(|s| s[1] / s[3]).fold(1.0, f32::max);
                let errors = inputs.twin().into_iter().flatten().map(|c| c.error / f64::from(brightest));
                widest = errors.fold(widest, f64::max);
            }
        }
    }
    // What the bounds are worth. A difference from the middle is off by some 20 u of the brightest colour, and the mean of
    // squares by as much of its square: where deviations are as small as that, their root is off by the root of it, times
    // the width of the clamp, 4 at most.
    println!("bounds are at most {widest:.1e} of the brightest colour");
    assert!(widest < 4.0 * (20.0 * 2f64.powi(-24)).sqrt());
    support::assert_clean(&context);
}

#[test]
fn wrong_twins_are_caught() {
    let context = support::validated_context();
    let device = Device::new(&context, Precision::Half, true);
    let random = &mut Random::new(22);
    let mut inputs = Inputs::random(random, [40, 30]);
    inputs.frame.flags = 0;
    inputs.history = History { alpha: 0.1, clamp: 1.0, filter: HistoryFilter::CatmullRom, precision: Precision::Half };
    inputs.film.iter_mut().for_each(|s| *s = entry([0; 3].map(|_| random.between(0.0, 1.0)), 1.0));
    inputs.motion.iter_mut().for_each(|m| *m = pack([random.between(-3.0, 3.0), random.between(-3.0, 3.0)]));
    let ran = device.run(&inputs);
    assert_eq!(problem_of(&device, &ran, &inputs.twin()), None);
    let caught = |what: &str, change: &dyn Fn(&mut Inputs)| {
        let mut wrong = inputs.clone();
        change(&mut wrong);
        assert!(problem_of(&device, &ran, &wrong.twin()).is_some(), "{what}");
    };
    caught("a weight of the new frame off by 1 %", &|i| i.history.alpha *= 1.01);
    caught("a clamp off by 1 %", &|i| i.history.clamp *= 1.01);
    caught("no clamp", &|i| i.history.clamp = 16.0);
    caught("another filter", &|i| i.history.filter = HistoryFilter::Bilinear);
    caught("a reset", &|i| i.frame.flags = FRAME_RESET);
    caught("one pixel's history lost", &|i| i.motion[17 * 40 + 20] = MOTION_UNKNOWN);
    caught("one motion off by a hundredth of a pixel", &|i| {
        i.history.clamp = 16.0;
        let moved = stillray::oracle::reconstruct::motion_of(i.motion[600]);
        i.motion[600] = pack([moved[0] + 0.01, moved[1]]);
    });
    caught("motion the wrong way", &|i| i.motion.iter_mut().for_each(|m| *m ^= 0x8000_8000));
    caught("one pixel brighter by 1 %", &|i| i.film[333][1] *= 1.01);
    support::assert_clean(&context);
}

const NOT_CLAMPED: History =
    History { alpha: 0.1, clamp: 16.0, filter: HistoryFilter::CatmullRom, precision: Precision::Half };

#[test]
fn a_picture_that_moves_by_whole_pixels_is_moved_exactly() {
    let context = support::validated_context();
    let device = Device::new(&context, Precision::Half, true);
    let size = [23, 17];
    for filter in HistoryFilter::ALL {
        let history = History { alpha: 0.25, filter, ..NOT_CLAMPED };
        let mut inputs = Inputs::constant(size, history, [0.0; 3]);
        let random = &mut Random::new(5);
        inputs.previous = inputs.previous.iter().map(|_| ycocg([0; 3].map(|_| random.between(0.0, 8.0)))).collect();
        inputs.motion.iter_mut().for_each(|m| *m = pack([3.0, -2.0]));
        let picture = device.run(&inputs).0;
        for (i, got) in picture.iter().enumerate() {
            let [x, y] = [i as i64 % 23 - 3, i as i64 / 23 + 2];
            let inside = x >= 0 && y < 17;
            let source = if inside { inputs.previous[(y * 23 + x) as usize] } else { [0.0; 3] };
            // Three quarters of a half: two bits more, rounded once.
            let want = source.map(|c| f16::from_f32(0.75 * c).to_f32());
            assert_eq!(*got, want, "{filter:?} {x} {y}: what comes from outside the frame has no history");
        }
    }
    support::assert_clean(&context);
}

#[test]
fn a_firefly_leaves_nothing_in_a_clamped_history() {
    let context = support::validated_context();
    let device = Device::new(&context, Precision::Half, false);
    let (size, at) = ([15, 15], 7 * 15 + 7);
    let color = [0.5, 0.25, 1.0];
    for (clamp, poisoned) in [(1.0, false), (16.0, true)] {
        let history = History { clamp, ..NOT_CLAMPED };
        let quiet = Inputs::constant(size, history, color);
        let mut hit = quiet.clone();
        hit.film[at] = entry([65504.0; 3], 1.0);
        let lit = device.run(&hit).0;
        assert!(lit[at][0] > 5000.0 && lit.iter().flatten().all(|c| c.is_finite()), "it is shown, once");
        let after = device.run(&Inputs { previous: lit, ..quiet.clone() }).0;
        // All neighbours are alike: the clamp lets pass what rounding makes of no deviation, and a half rounds that away.
        assert_eq!(after != device.run(&quiet).0, poisoned, "clamp {clamp}: {:?}", after[at]);
        if poisoned {
            // 0.1 of it, of which 0.9 stays.
            assert!((f64::from(after[at][0]) / (0.09 * 65504.0) - 1.0).abs() < 0.01, "{:?}", after[at]);
        }
    }
    support::assert_clean(&context);
}

/// Under what stands still, the history is the exponential average of the frames: nothing is lost, to half a unit in the last
/// place a frame.
#[test]
fn the_mean_is_kept() {
    let context = support::validated_context();
    for (precision, ulp) in [(Precision::Half, 2f64.powi(-11)), (Precision::Float, 2f64.powi(-24))] {
        let device = Device::new(&context, precision, true);
        let random = &mut Random::new(9);
        let mut inputs = Inputs::constant([16, 16], NOT_CLAMPED, [0.0; 3]);
        inputs.frame.flags = FRAME_RESET;
        let mut expected = vec![[0.0_f64; 3]; 256];
        for frame in 0..40 {
            let weight = if frame == 0 { 1.0 } else { f64::from(inputs.history.alpha) };
            let light = |random: &mut Random| entry([0; 3].map(|_| random.between(-4.0, 6.0).exp()), 1.0);
            inputs.film.iter_mut().for_each(|s| *s = light(random));
            for (e, s) in expected.iter_mut().zip(&inputs.film) {
                let now = to_ycocg([s[0], s[1], s[2]].map(Bounded::exact));
                (0..3).for_each(|c| e[c] += weight * (now[c].value - e[c]));
            }
            inputs.previous = device.run(&inputs).0;
            inputs.frame.flags = 0;
        }
        // Each frame rounds to half a unit in the last place of the luma, e^6 at most; 0.9 of that stays. The sums behind
        // it round to f32's units a few times.
        let bound = (ulp + 8.0 * 2f64.powi(-24)) * 6f64.exp() / 0.1;
        let differences =
            inputs.previous.iter().zip(&expected).flat_map(|(p, e)| [0, 1, 2].map(|c| f64::from(p[c]) - e[c]));
        let (sum, most) = differences.fold((0.0, 0.0_f64), |(s, m), d| (s + d, m.max(d.abs())));
        let energy: f64 = expected.iter().map(|e| e[0]).sum();
        println!("{precision:?}: at most {most:.2e} of {bound:.2e}, energy off by {:.1e}", sum / energy);
        assert!(most <= bound);
        // Rounding goes either way. 768 values with 10 roundings each that count, of at most half a unit: one in ten
        // thousand would need four standard deviations of their sum.
        let spread = 4.0 * (768.0 * 10.0_f64).sqrt() * (ulp + 8.0 * 2f64.powi(-24)) * 6f64.exp();
        assert!(sum.abs() <= spread, "{sum} {spread}");
    }
    support::assert_clean(&context);
}

#[test]
fn a_pixel_without_samples_takes_the_mean_around() {
    let context = support::validated_context();
    let device = Device::new(&context, Precision::Float, true);
    let mut inputs = Inputs::constant([9, 9], NOT_CLAMPED, [2.0, 1.0, 4.0]);
    inputs.film.iter_mut().for_each(|s| *s = [0.0; 4]);
    inputs.motion.iter_mut().for_each(|m| *m = MOTION_UNKNOWN);
    inputs.film[0] = entry([8.0, 4.0, 2.0], 0.5);
    inputs.film[2] = entry([4.0, 8.0, 0.0], 2.0);
    let color = device.run(&inputs).1;
    assert_eq!(color[1], [6.0, 6.0, 1.0, 1.0], "between two");
    assert_eq!(color[10], [6.0, 6.0, 1.0, 1.0]);
    assert_eq!(color[9], [8.0, 4.0, 2.0, 1.0], "beside one");
    assert_eq!(color[40], [0.0, 0.0, 0.0, 1.0], "beside none");
    support::assert_clean(&context);
}

/// What the box filter does with one frame after another.
struct Averager {
    context: Context,
    kernel: Kernel,
    float: bool,
    size: [u32; 2],
    frames: usize,
    history: Vec<u8>,
}

impl Averager {
    fn new(context: &Context, float: bool, size: [u32; 2], frames: usize) -> Self {
        let shader = if float { shaders::average_float::SHADER } else { shaders::average::SHADER };
        let texel = if float { 16 } else { 8 };
        // What was there before the first frame is no number.
        let history = vec![0xff; (size[0] * size[1]) as usize * (frames - 1) * texel];
        Self { context: context.clone(), kernel: Kernel::new(context, shader), float, size, frames, history }
    }

    /// The picture, and the youngest frame that is kept.
    fn run(&mut self, index: u32, film: &[[f32; 4]]) -> (Vec<[f32; 4]>, Vec<[f32; 3]>) {
        let image = color_image(&self.context, self.size, self.float);
        let frame = Frame { size: self.size, frame: index, ..Frame::zeroed() };
        let history = Bound::Data(std::mem::take(&mut self.history));
        let mut bound = [data(&[frame]), data(film), history, Bound::Image(&image)];
        let push = shaders::average::Push { frames: self.frames as u32 };
        self.kernel.run(&mut bound, bytes_of(&push), [self.size[0], self.size[1], 1]);
        self.history = values(&bound[2]);
        let texels: Vec<[f32; 4]> = if self.float {
            values(&bound[2])
        } else {
            values::<[f16; 4]>(&bound[2]).into_iter().map(|t| t.map(f16::to_f32)).collect()
        };
        let youngest = texels.chunks(self.frames - 1).map(|t| [t[0][0], t[0][1], t[0][2]]);
        (pixels(&self.context, &image, self.float), youngest.collect())
    }
}

/// Averages of a pixel's frame with those before, and with one fewer of them.
fn averages(float: bool, sum: [f32; 4], before: &[[f32; 3]]) -> [Color; 2] {
    let largest = if float { f32::MAX } else { 65504.0 };
    let fewer = &before[..before.len().saturating_sub(1)];
    [before, fewer].map(|frames| average(sum, frames, largest).map(|c| if float { c } else { half_texel(c) }))
}

fn check_box(context: &Context, float: bool, size: [u32; 2], frames: usize) {
    let mut averager = Averager::new(context, float, size, frames);
    let random = &mut Random::new(size[0]);
    let mut before: Vec<Vec<[f32; 3]>> = Vec::new();
    for index in 0..5 {
        let light = |random: &mut Random| entry([0; 3].map(|_| random.between(-6.0, 10.0).exp()), 0.75);
        let film: Vec<[f32; 4]> = (0..size[0] * size[1]).map(|_| light(random)).collect();
        let (picture, kept) = averager.run(index, &film);
        let mut noticed = 0;
        for (i, got) in picture.iter().enumerate() {
            let known: Vec<[f32; 3]> = before.iter().take(frames - 1).map(|f| f[i]).collect();
            let [want, fewer] = averages(float, film[i], &known);
            assert!((0..3).all(|c| want[c].allows(got[c])) && got[3] == 1.0, "{got:?} {want:?}");
            noticed += usize::from((0..3).any(|c| !fewer[c].allows(got[c])));
            // What is kept is the frame, not the average; it goes into the frames that follow as the device rounded it.
            let frame = average(film[i], &[], f32::MAX).map(|c| if float { c } else { nearest_half(c) });
            assert!((0..3).all(|c| frame[c].allows(kept[i][c])), "{:?} {frame:?}", kept[i]);
        }
        assert!(index == 0 || 10 * noticed >= 9 * picture.len(), "a frame that is left out is noticed");
        before.insert(0, kept);
    }
}

#[test]
fn the_box_averages_the_last_frames() {
    let context = support::validated_context();
    for float in [false, true] {
        for (size, frames) in SIZES.into_iter().flat_map(|size| [(size, 2), (size, 3)]) {
            check_box(&context, float, size, frames);
        }
    }
    support::assert_clean(&context);
}
