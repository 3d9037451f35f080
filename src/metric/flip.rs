//! FLIP: how different two images look when they are shown in turn. Range 0 (equal) to 1, a pixel and in the mean; no unit;
//! lower is better.
//!
//! LDR-FLIP (Andersson et al. 2020, *FLIP: A Difference Evaluator for Alternating Images*) filters both images by the eye's
//! contrast sensitivity, takes the distance of colours, and raises it where edges or points differ. It is symmetric.
//! HDR-FLIP (Andersson et al. 2021, *Visualizing Errors in Rendered High Dynamic Range Images*) is the greatest LDR-FLIP
//! over exposures, chosen from the reference so that its brightest and its median pixel are shown just below white by the
//! ACES tone map; it is not symmetric. Filters are separated as in NVIDIA's `flip-evaluator`, with which the numbers agree.
//!
//! The unit of the filters is a degree of visual angle, so it matters how many pixels one has.

use rayon::prelude::*;

use super::convolve::{Border, columns, rows};
use super::image::{DynamicRange, Frame, Plane, Rgb, luminance};

/// Pixels a degree of visual angle: a 3840 pixels and 0.7 m wide display, 0.7 m away.
pub const PIXELS_PER_DEGREE: f64 = 67.0;

/// Names and values of the paper's section 4.
const Q_C: f32 = 0.7;
const P_C: f32 = 0.4;
const P_T: f32 = 0.95;
const Q_F: f32 = 0.5;
/// Width of the feature detectors in degrees.
const W: f64 = 0.082;

/// Contrast sensitivity as sums of Gaussians, a √(π/b) exp(-π² x² / b) with x in degrees: achromatic, red-green, and the two
/// of blue-yellow (Table 1 of the paper).
const SENSITIVITY: [(f64, f64); 4] = [(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04), (13.5, 0.025)];

/// FLIP for one distance from the display.
#[derive(Debug, Clone)]
pub struct Flip {
    /// Achromatic, red-green, and the square roots of the two parts of blue-yellow.
    spatial: [Vec<f32>; 4],
    /// A Gaussian with its first and second derivative.
    feature: [Vec<f32>; 3],
    /// Distance of green and blue, the greatest that two colours have.
    farthest: f32,
}

/// An image as the eye has it.
struct Seen {
    /// L*, and a* and b* less saturated the darker they are.
    lab: Rgb,
    /// Strength of edges, 0..=√2.
    edges: Vec<f32>,
    /// Strength of points, 0..=√2.
    points: Vec<f32>,
}

impl Flip {
    /// Filters for this many pixels a degree, above 0.
    pub fn new(pixels_per_degree: f64) -> Self {
        let green = hunt(lab(xyz([0.0, 1.0, 0.0])));
        let blue = hunt(lab(xyz([0.0, 0.0, 1.0])));
        let farthest = distance(green, blue).powf(Q_C);
        Self { spatial: spatial_filters(pixels_per_degree), feature: feature_filters(pixels_per_degree), farthest }
    }

    /// The error of each pixel: LDR-FLIP, or HDR-FLIP if the reference is scene-linear. Both must be of one size.
    pub fn compare(&self, frame: &Frame, reference: &Frame) -> Plane {
        let [width, height] = reference.size();
        let data = match reference.range() {
            DynamicRange::Standard => self.standard(frame.linear(), reference.linear(), width),
            DynamicRange::High => self.high(frame.linear(), reference.linear(), width),
        };
        Plane { width, height, data }
    }

    /// LDR-FLIP of linear values in 0..=1.
    fn standard(&self, frame: &Rgb, reference: &Rgb, width: usize) -> Vec<f32> {
        let (f, r) = rayon::join(|| self.seen(frame, width), || self.seen(reference, width));
        (0..f.edges.len()).into_par_iter().with_min_len(4096).map(|i| self.error(&f, &r, i)).collect()
    }

    /// HDR-FLIP; negative values count as 0.
    fn high(&self, frame: &Rgb, reference: &Rgb, width: usize) -> Vec<f32> {
        let mut worst = vec![0.0_f32; reference[0].len()];
        for stops in exposures(reference) {
            let scale = stops.exp2();
            let errors = self.standard(&shown(frame, scale), &shown(reference, scale), width);
            worst.iter_mut().zip(errors).for_each(|(worst, error)| *worst = worst.max(error));
        }
        worst
    }

    fn error(&self, f: &Seen, r: &Seen, i: usize) -> f32 {
        let at = |lab: &Rgb| [lab[0][i], lab[1][i], lab[2][i]];
        let color = self.remap(distance(at(&f.lab), at(&r.lab)).powf(Q_C));
        let feature = (f.edges[i] - r.edges[i]).abs().max((f.points[i] - r.points[i]).abs());
        let feature = (feature * std::f32::consts::FRAC_1_SQRT_2).powf(Q_F).min(1.0);
        color.powf(1.0 - feature)
    }

    /// Maps a colour difference to 0..=1: the smaller ones, up to 40 % of the greatest, get 95 % of the range.
    fn remap(&self, difference: f32) -> f32 {
        let knee = P_C * self.farthest;
        if difference < knee {
            return difference * P_T / knee;
        }
        (P_T + (difference - knee) / (self.farthest - knee) * (1.0 - P_T)).min(1.0)
    }

    fn seen(&self, linear: &Rgb, width: usize) -> Seen {
        let opponent = map3(linear, |rgb| ycxcz(xyz(rgb)));
        let (lab, (edges, points)) =
            rayon::join(|| self.colors(&opponent, width), || self.features(&opponent[0], width));
        Seen { lab, edges, points }
    }

    fn colors(&self, opponent: &Rgb, width: usize) -> Rgb {
        let blur = |plane: &[f32], weights: &[f32]| {
            columns(&rows(plane, width, weights, Border::Clamp), width, weights, Border::Clamp)
        };
        let mut cz = blur(&opponent[2], &self.spatial[2]);
        let second = blur(&opponent[2], &self.spatial[3]);
        cz.iter_mut().zip(second).for_each(|(sum, part)| *sum += part);
        let filtered = [blur(&opponent[0], &self.spatial[0]), blur(&opponent[1], &self.spatial[1]), cz];
        map3(&filtered, |c| hunt(lab(xyz(rgb_of(xyz_of(c)).map(|v| v.clamp(0.0, 1.0))))))
    }

    /// Strength of edges and of points in the achromatic channel.
    fn features(&self, achromatic: &[f32], width: usize) -> (Vec<f32>, Vec<f32>) {
        let [smooth, first, second] = &self.feature;
        let grey: Vec<f32> = achromatic.iter().map(|y| (y + 16.0) / 116.0).collect();
        let across = |weights: &[f32]| rows(&grey, width, weights, Border::Clamp);
        let down = |plane: &[f32], weights: &[f32]| columns(plane, width, weights, Border::Clamp);
        let smoothed = across(smooth);
        let length = |x: Vec<f32>, y: Vec<f32>| x.iter().zip(&y).map(|(x, y)| (x * x + y * y).sqrt()).collect();
        let edges = length(down(&across(first), smooth), down(&smoothed, first));
        (edges, length(down(&across(second), smooth), down(&smoothed, second)))
    }
}

/// Exposures in stops at which HDR images are shown: the first puts the reference's brightest pixel where the tone map
/// gives 0.85, the last its median pixel; a step is at most a stop.
///
/// Where more than half of the reference is black, the median is taken of the rest: the published code divides by 0 there.
fn exposures(reference: &Rgb) -> Vec<f32> {
    let [r, g, b] = reference;
    let lit = |i: usize| luminance([r[i], g[i], b[i]].map(|v| v.max(0.0))) as f32;
    let mut all: Vec<f32> = (0..r.len()).map(lit).collect();
    let brightest = all.iter().copied().fold(0.0, f32::max);
    if brightest <= 0.0 {
        return vec![0.0];
    }
    let mut median = middle(&mut all);
    if median <= 0.0 {
        all.retain(|v| *v > 0.0);
        median = middle(&mut all);
    }
    let white = tone_map_inverse(0.85);
    let (start, stop) = ((white / brightest).log2(), (white / median).log2());
    let count = (stop - start).ceil().max(2.0);
    (0..count as usize).map(|i| start + i as f32 * (stop - start) / (count - 1.0)).collect()
}

/// The upper one of the two middle values of a list that is not empty.
fn middle(values: &mut [f32]) -> f32 {
    let at = values.len() / 2;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

/// Numerator and denominator, highest power first, of the ACES approximation by Narkowicz, 0.6 of the exposure taken in.
const TONE_MAP: [[f32; 3]; 2] = [[0.36 * 2.51, 0.6 * 0.03, 0.0], [0.36 * 2.43, 0.6 * 0.59, 0.14]];

fn tone_map(x: f32) -> f32 {
    let [[a, b, c], [d, e, f]] = TONE_MAP;
    (a * x * x + b * x + c) / (d * x * x + e * x + f)
}

/// The positive radiance for which the tone map gives `y`, below 1.03.
fn tone_map_inverse(y: f32) -> f32 {
    let [a, b, c]: [f32; 3] = std::array::from_fn(|i| TONE_MAP[0][i] - y * TONE_MAP[1][i]);
    let half = -0.5 * b / a;
    half + (half * half - c / a).sqrt()
}

/// The image at an exposure, tone-mapped: linear values in 0..=1.
fn shown(linear: &Rgb, scale: f32) -> Rgb {
    // Beyond this the tone map has reached its limit; squares stay finite.
    let show = |v: f32| tone_map((v.max(0.0) * scale).min(1e9)).clamp(0.0, 1.0);
    map3(linear, |rgb| rgb.map(show))
}

fn spatial_filters(pixels_per_degree: f64) -> [Vec<f32>; 4] {
    let pi2 = std::f64::consts::PI.powi(2);
    let widest = SENSITIVITY.iter().map(|(_, b)| *b).fold(0.0, f64::max);
    let radius = (3.0 * (widest / (2.0 * pi2)).sqrt() * pixels_per_degree).ceil() as i32;
    let profile = |a: f64, b: f64| -> Vec<f64> {
        let at = |i: i32| a * (-pi2 * (f64::from(i) / pixels_per_degree).powi(2) / b).exp();
        (-radius..=radius).map(at).collect()
    };
    let sum = |weights: &[f64]| weights.iter().sum::<f64>();
    let [y, cx, cz1, cz2] = SENSITIVITY;
    let (y, cx) = (profile(1.0, y.1), profile(1.0, cx.1));
    // A sum of two Gaussians is not separable, but each is: one pass each way with the root of its height.
    let height = |(a, b): (f64, f64)| (a * (std::f64::consts::PI / b).sqrt()).sqrt();
    let (cz1, cz2) = (profile(height(cz1), cz1.1), profile(height(cz2), cz2.1));
    let whole = sum(&cz1).hypot(sum(&cz2));
    let scaled = |weights: &[f64], by: f64| weights.iter().map(|w| (w / by) as f32).collect::<Vec<f32>>();
    [scaled(&y, sum(&y)), scaled(&cx, sum(&cx)), scaled(&cz1, whole), scaled(&cz2, whole)]
}

fn feature_filters(pixels_per_degree: f64) -> [Vec<f32>; 3] {
    let sigma = 0.5 * W * pixels_per_degree;
    let radius = (3.0 * sigma).ceil() as i32;
    let bell = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
    let sample = |of: &dyn Fn(f64) -> f64| (-radius..=radius).map(|x| of(f64::from(x))).collect::<Vec<f64>>();
    let smooth = sample(&bell);
    let first = sample(&|x| -x * bell(x));
    let second = sample(&|x| (x * x / (sigma * sigma) - 1.0) * bell(x));
    [balanced(&smooth), balanced(&first), balanced(&second)]
}

/// The weights with the positive ones scaled to a sum of 1 and the negative ones to -1.
fn balanced(weights: &[f64]) -> Vec<f32> {
    let sum = |sign: f64| weights.iter().map(|w| (sign * w).max(0.0)).sum::<f64>();
    let (above, below) = (sum(1.0), sum(-1.0));
    weights.iter().map(|w| if *w > 0.0 { w / above } else if *w < 0.0 { w / below } else { 0.0 } as f32).collect()
}

fn map3(planes: &Rgb, map: impl Fn([f32; 3]) -> [f32; 3] + Sync) -> Rgb {
    let mut out = planes.clone();
    let [x, y, z] = &mut out;
    x.par_chunks_mut(4096).zip(y.par_chunks_mut(4096)).zip(z.par_chunks_mut(4096)).for_each(|((x, y), z)| {
        for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
            [*x, *y, *z] = map([*x, *y, *z]);
        }
    });
    out
}

/// Linear Rec. 709 to XYZ under D65 (the matrix of the published code).
const TO_XYZ: [[f32; 3]; 3] = [
    [
        (10_135_552.0 / 24_577_794.0_f64) as f32,
        (8_788_810.0 / 24_577_794.0_f64) as f32,
        (4_435_075.0 / 24_577_794.0_f64) as f32,
    ],
    [
        (2_613_072.0 / 12_288_897.0_f64) as f32,
        (8_788_810.0 / 12_288_897.0_f64) as f32,
        (887_015.0 / 12_288_897.0_f64) as f32,
    ],
    [
        (1_425_312.0 / 73_733_382.0_f64) as f32,
        (8_788_810.0 / 73_733_382.0_f64) as f32,
        (70_074_185.0 / 73_733_382.0_f64) as f32,
    ],
];

/// XYZ, divided by that of white.
fn xyz([r, g, b]: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = TO_XYZ.map(|row| row[0] * r + row[1] * g + row[2] * b);
    [x / WHITE[0], y, z / WHITE[2]]
}

/// XYZ of white, Y = 1.
const WHITE: [f32; 3] = [0.950_428_54, 1.0, 1.088_900_4];

/// The inverse of [`xyz`].
fn rgb_of([x, y, z]: [f32; 3]) -> [f32; 3] {
    let (x, z) = (x * WHITE[0], z * WHITE[2]);
    [
        3.241_003_3 * x - 1.537_398_9 * y - 0.498_615_86 * z,
        -0.969_224_33 * x + 1.875_930_1 * y + 0.041_554_224 * z,
        0.055_639_423 * x - 0.204_011_2 * y + 1.057_148_9 * z,
    ]
}

/// Opponent colours that are linear in light, as filters need them.
fn ycxcz([x, y, z]: [f32; 3]) -> [f32; 3] {
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The inverse of [`ycxcz`].
fn xyz_of([y, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (y + 16.0) / 116.0;
    [y + cx / 500.0, y, y - cz / 200.0]
}

/// CIELAB.
fn lab(xyz: [f32; 3]) -> [f32; 3] {
    const KNEE: f32 = 6.0 / 29.0;
    let f = |v: f32| if v > KNEE * KNEE * KNEE { v.cbrt() } else { v / (3.0 * KNEE * KNEE) + 4.0 / 29.0 };
    let [x, y, z] = xyz.map(f);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The Hunt effect: dark colours look less saturated.
fn hunt([l, a, b]: [f32; 3]) -> [f32; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

/// Distance for large differences (HyAB, Abasi et al. 2020): city-block in lightness, Euclidean in chroma.
fn distance(p: [f32; 3], q: [f32; 3]) -> f32 {
    (p[0] - q[0]).abs() + ((p[1] - q[1]).powi(2) + (p[2] - q[2]).powi(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_white_and_conversions_come_back() {
        let white = lab(xyz([1.0; 3]));
        // Three sums of constants that are rounded to f32, times up to 500.
        assert!((white[0] - 100.0).abs() < 1e-3 && white[1].abs() < 1e-3 && white[2].abs() < 1e-3, "{white:?}");
        let color = [0.25, 0.5, 0.125];
        let back = rgb_of(xyz_of(ycxcz(xyz(color))));
        // The published inverse has seven digits.
        assert!(color.iter().zip(back).all(|(a, b)| (a - b).abs() < 2e-6), "{back:?}");
    }

    #[test]
    fn the_tone_map_inverts() {
        for y in [0.1, 0.5, 0.85, 0.99] {
            assert!((tone_map(tone_map_inverse(y)) - y).abs() < 1e-5, "{y}");
        }
    }

    #[test]
    fn filters_keep_what_is_even_and_derivatives_drop_it() {
        let flip = Flip::new(PIXELS_PER_DEGREE);
        let sum = |w: &[f32]| w.iter().map(|v| f64::from(*v)).sum::<f64>();
        // Each weight is rounded to f32, and none exceeds 1.
        let tolerance = 21.0 * f64::from(f32::EPSILON);
        assert!((sum(&flip.spatial[0]) - 1.0).abs() < tolerance);
        let cz = sum(&flip.spatial[2]).powi(2) + sum(&flip.spatial[3]).powi(2);
        assert!((cz - 1.0).abs() < 2.0 * tolerance, "{cz}");
        assert!((sum(&flip.feature[0]) - 1.0).abs() < tolerance);
        assert!(sum(&flip.feature[1]).abs() < tolerance && sum(&flip.feature[2]).abs() < tolerance);
    }

    #[test]
    fn exposures_reach_from_the_brightest_to_the_median_pixel() {
        let grey = |values: &[f32]| [values.to_vec(), values.to_vec(), values.to_vec()];
        let stops = exposures(&grey(&[0.25, 1.0, 1.0, 16.0, 0.5]));
        let white = tone_map_inverse(0.85).log2();
        assert_eq!(stops.len(), 4);
        assert!((stops[0] - (white - 4.0)).abs() < 1e-5 && (stops[3] - white).abs() < 1e-5, "{stops:?}");
        assert_eq!(exposures(&grey(&[0.0; 4])), [0.0]);
        assert!(exposures(&grey(&[0.0, 0.0, 0.0, 2.0])).iter().all(|e| e.is_finite()));
    }
}
