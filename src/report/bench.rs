//! What `bench` found out, as data, as a table like paper 1's Table 1, and against paper 3's Table 1.

use serde::Serialize;
use std::collections::BTreeMap;

use super::costs;
use super::statistics::{Summary, mean, ratio};
use super::table::{Table, bytes, grouped};
use crate::headless::DeviceReport;
use crate::renderer::{FrameStats, Method, PhaseTime, RayCosts};
use crate::settings::knob::{self, Value};

/// A whole benchmark, in the form of its JSON file.
#[derive(Debug, Clone, Serialize)]
pub struct Bench {
    /// Version of this form; 1.
    pub schema: u32,
    /// What it ran on.
    pub device: DeviceReport,
    /// What was run.
    pub build: Build,
    /// The scene as the user named it.
    pub scene: String,
    /// How the scene was looked at.
    pub settings: Settings,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// One entry a method, in the order asked for.
    pub methods: Vec<MethodResult>,
    /// One entry a method that reprojects, if there is a `supersample` method to compare with.
    pub ratios: Vec<Ratio>,
}

/// The program that was run.
#[derive(Debug, Clone, Serialize)]
pub struct Build {
    /// Of the crate.
    pub version: &'static str,
    /// Source revision, if the build was told it.
    pub commit: Option<&'static str>,
    /// `release` or `debug`.
    pub profile: &'static str,
    /// Operating system and processor.
    pub target: String,
}

/// What the methods have in common.
#[derive(Debug, Clone, Serialize)]
pub struct Settings {
    /// Name of the camera motion.
    pub motion: String,
    /// Name of the camera.
    pub camera: String,
    /// Frames measured.
    pub frames: u32,
    /// Frames rendered before, unmeasured.
    pub warmup: u32,
    /// Frames a second of the motion.
    pub fps: f64,
    /// Seed of all random choices.
    pub seed: u32,
}

/// What one method cost and did.
#[derive(Debug, Clone, Serialize)]
pub struct MethodResult {
    /// `stable:1`, `supersample:2`, …
    pub name: String,
    /// Which kind it is.
    pub kind: Method,
    /// The knobs that mean something to it.
    pub knobs: BTreeMap<&'static str, Value>,
    /// Milliseconds on the device of each phase, in order.
    pub phases: Vec<PhaseSummary>,
    /// Milliseconds on the device of whole frames.
    pub total_ms: Summary,
    /// Wall-clock milliseconds of the first frame: the driver compiles then. Not part of the others.
    pub first_frame_ms: f64,
    /// Mean camera rays a frame.
    pub rays_per_frame: f64,
    /// Mean shadow rays a frame.
    pub shadow_rays_per_frame: f64,
    /// Mean shaded samples a pixel.
    pub samples_per_pixel: f64,
    /// Mean share of the camera rays that belong to reprojected samples.
    pub reused_fraction: f64,
    /// Mean share of the pixels onto which 0, 1, 2, 3, and 4 or more samples were reprojected; none for methods that
    /// reproject nothing.
    pub reprojected: Option<[f64; 5]>,
    /// Device memory of this method's buffers in bytes, without the scene.
    pub memory_bytes: u64,
    /// What the rays of all measured frames cost, if that was counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub costs: Option<RayCosts>,
}

/// A phase over all measured frames.
#[derive(Debug, Clone, Serialize)]
pub struct PhaseSummary {
    /// The phase's label.
    pub label: String,
    /// Milliseconds on the device.
    pub ms: Summary,
}

/// How much more a method that reprojects costs than supersampling with as many camera rays.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ratio {
    /// The method.
    pub method: String,
    /// Its median frame time over that of supersampling at equal camera rays a frame.
    pub over_supersample: f64,
    /// Where the time of supersampling comes from, in words.
    pub basis: String,
}

/// Collects the frames of one method.
#[derive(Debug, Clone, Default)]
pub struct Collector {
    phases: Vec<(String, Vec<f64>)>,
    totals: Vec<f64>,
    stats: Vec<FrameStats>,
    costs: Option<RayCosts>,
}

impl Collector {
    /// Adds a measured frame.
    pub fn add(&mut self, stats: FrameStats, times: &[PhaseTime]) {
        for time in times {
            match self.phases.iter_mut().find(|(label, _)| label == time.label) {
                Some((_, ms)) => ms.push(time.ms),
                None => self.phases.push((time.label.to_owned(), vec![time.ms])),
            }
        }
        self.totals.push(times.iter().map(|t| t.ms).sum());
        self.stats.push(stats);
    }

    /// Adds what the rays of a measured frame cost.
    pub fn count(&mut self, stats: &FrameStats) {
        self.costs = costs::sum([self.costs, stats.costs]);
    }

    /// Summarises the frames of a method called `name` at `size` pixels.
    pub fn finish(
        self,
        name: String,
        settings: &crate::Settings,
        size: [u32; 2],
        first_frame_ms: f64,
        memory: u64,
    ) -> MethodResult {
        let kind = settings.method;
        let average = |part: fn(&FrameStats) -> f64| mean(self.stats.iter().map(part));
        let pixels = f64::from(size[0]) * f64::from(size[1]);
        let summary = |(label, ms): &(String, Vec<f64>)| PhaseSummary { label: label.clone(), ms: Summary::of(ms) };
        MethodResult {
            phases: self.phases.iter().map(summary).collect(),
            total_ms: Summary::of(&self.totals),
            first_frame_ms,
            rays_per_frame: average(|s| f64::from(s.rays)),
            shadow_rays_per_frame: average(|s| f64::from(s.shadow_rays)),
            samples_per_pixel: ratio(average(|s| f64::from(s.shaded)), pixels),
            reused_fraction: average(FrameStats::reused_fraction),
            reprojected: kind.reprojects().then(|| mean_shares(&self.stats)),
            memory_bytes: memory,
            costs: self.costs,
            name,
            kind,
            knobs: knob::used(settings),
        }
    }
}

/// Paper 3, Table 1: what it measured with point tracking on its three scenes.
const PAPER_3: [(&str, [f64; 5]); 3] = [
    ("Hogum", [0.219, 0.582, 0.182, 0.016, 0.0]),
    ("Range-400", [0.196, 0.647, 0.142, 0.013, 0.001]),
    ("Spheres", [0.206, 0.606, 0.171, 0.016, 0.0]),
];

/// Share of a frame's pixels onto which 0, 1, 2, 3, and 4 or more samples were reprojected (paper 3, Table 1).
pub fn reprojected_shares(stats: &FrameStats) -> [f64; 5] {
    let pixels: f64 = stats.histogram.iter().map(|&n| f64::from(n)).sum();
    let mut shares = [0.0; 5];
    for (points, &count) in stats.histogram.iter().enumerate() {
        shares[points.min(4)] += ratio(f64::from(count), pixels);
    }
    shares
}

fn mean_shares(stats: &[FrameStats]) -> [f64; 5] {
    let shares: Vec<[f64; 5]> = stats.iter().map(reprojected_shares).collect();
    std::array::from_fn(|points| mean(shares.iter().map(|s| s[points])))
}

/// Compares each method that reprojects with supersampling at equal camera rays a frame: on the line through the two
/// `supersample` methods that are nearest in rays, or in proportion to the rays if there is only one. Empty if there is
/// none.
pub fn ratios(methods: &[MethodResult]) -> Vec<Ratio> {
    let rivals: Vec<&MethodResult> =
        methods.iter().filter(|m| m.kind == Method::Supersample && m.rays_per_frame > 0.0).collect();
    let compared = methods.iter().filter(|m| m.kind.reprojects());
    compared.filter_map(|m| compare(m, &rivals)).collect()
}

fn compare(stable: &MethodResult, rivals: &[&MethodResult]) -> Option<Ratio> {
    let rays = stable.rays_per_frame;
    let mut nearest = rivals.to_vec();
    nearest.sort_by(|a, b| (a.rays_per_frame - rays).abs().total_cmp(&(b.rays_per_frame - rays).abs()));
    let first = *nearest.first()?;
    let second = nearest.iter().find(|m| m.rays_per_frame != first.rays_per_frame);
    let (ms, basis) = match second {
        Some(second) => {
            let at = (rays - first.rays_per_frame) / (second.rays_per_frame - first.rays_per_frame);
            let ms = first.total_ms.median + at * (second.total_ms.median - first.total_ms.median);
            let how = if (0.0..=1.0).contains(&at) { "interpolated between" } else { "on the line through" };
            let ordered = first.rays_per_frame < second.rays_per_frame;
            let (fewer, more) = if ordered { (first, *second) } else { (*second, first) };
            (ms, format!("{how} {} and {}", fewer.name, more.name))
        }
        None => {
            let ms = first.total_ms.median * rays / first.rays_per_frame;
            (ms, format!("{} in proportion to its rays", first.name))
        }
    };
    (ms > 0.0).then(|| Ratio { method: stable.name.clone(), over_supersample: stable.total_ms.median / ms, basis })
}

impl Bench {
    /// Everything as text: the table of times, the table of counts, the comparison.
    pub fn text(&self) -> String {
        let mut text = format!("{}\n{}\n", self.times(), self.counts());
        if self.methods.iter().any(|m| m.reprojected.is_some()) {
            text += &format!("{}\n", self.shares());
        }
        let counted = self.methods.iter().filter_map(|m| Some((m.name.clone(), m.costs?)));
        let counted: Vec<(String, RayCosts)> = counted.collect();
        if !counted.is_empty() {
            text += &format!("{}\n", costs::table(counted, u64::from(self.settings.frames)));
        }
        for ratio in &self.ratios {
            let Ratio { method, over_supersample, basis } = ratio;
            text += &format!("{method}: {over_supersample:.2} x supersample at equal camera rays a frame ({basis})\n");
        }
        text
    }

    /// A row a method, a column a phase, medians in milliseconds. The total is the median of whole frames, which need
    /// not be the sum of the medians.
    fn times(&self) -> Table {
        let mut labels: Vec<&str> = Vec::new();
        for phase in self.methods.iter().flat_map(|m| &m.phases) {
            if !labels.contains(&phase.label.as_str()) {
                labels.push(&phase.label);
            }
        }
        let title = "median ms a frame".to_owned();
        let titles = labels.iter().map(|&l| l.to_owned());
        let mut table = Table::new([title].into_iter().chain(titles).chain(["total".into(), "p95".into()]));
        for m in &self.methods {
            let cell = |&label: &&str| {
                m.phases.iter().find(|p| p.label == label).map_or("-".to_owned(), |p| format!("{:.2}", p.ms.median))
            };
            let ends = [format!("{:.2}", m.total_ms.median), format!("{:.2}", m.total_ms.p95)];
            table.row([m.name.clone()].into_iter().chain(labels.iter().map(cell)).chain(ends));
        }
        table
    }

    fn counts(&self) -> Table {
        let titles = ["mean a frame", "camera rays", "shadow rays", "samples/pixel", "reused", "memory", "first frame"];
        let mut table = Table::new(titles);
        for m in &self.methods {
            table.row([
                m.name.clone(),
                grouped(m.rays_per_frame.round() as u64),
                grouped(m.shadow_rays_per_frame.round() as u64),
                format!("{:.2}", m.samples_per_pixel),
                percent(m.reused_fraction),
                bytes(m.memory_bytes),
                format!("{:.0} ms", m.first_frame_ms),
            ]);
        }
        table
    }

    fn shares(&self) -> Table {
        let mut table = Table::new(["pixels with n reprojected points", "0", "1", "2", "3", "4+"]);
        for m in &self.methods {
            if let Some(shares) = m.reprojected {
                table.row([m.name.clone()].into_iter().chain(shares.map(percent)));
            }
        }
        for (scene, shares) in PAPER_3 {
            table.row([format!("paper 3, {scene}")].into_iter().chain(shares.map(percent)));
        }
        table
    }
}

/// A share as a percentage with a decimal.
pub fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn method(name: &str, kind: Method, rays: f64, ms: f64) -> MethodResult {
        let mut histogram = [0; 17];
        histogram[..6].copy_from_slice(&[20, 60, 10, 5, 4, 1]);
        let stats = FrameStats {
            rays: rays as u32,
            reused: rays as u32 / 2,
            added: rays as u32 / 2,
            shaded: 200,
            histogram,
            ..Default::default()
        };
        let mut collector = Collector::default();
        for shift in [0.0, 1.0, -1.0] {
            let shading = PhaseTime { label: "shade", ms: ms / 2.0 + shift };
            let own = if kind == Method::Stable { "reproject" } else { "generate" };
            collector.add(stats, &[PhaseTime { label: own, ms: ms / 2.0 }, shading]);
        }
        let settings = crate::Settings { method: kind, ..crate::Settings::default() };
        collector.finish(name.to_owned(), &settings, [10, 10], 99.0, 4096)
    }

    fn bench(methods: Vec<MethodResult>) -> Bench {
        let device = DeviceReport {
            index: 0,
            name: "test".into(),
            kind: "cpu",
            driver: "test".into(),
            api: "1.3.0".into(),
            rejected: Vec::new(),
        };
        let build = Build { version: "0", commit: None, profile: "debug", target: "test".into() };
        let settings =
            Settings { motion: "static".into(), camera: "default".into(), frames: 3, warmup: 0, fps: 30.0, seed: 0 };
        let ratios = ratios(&methods);
        Bench { schema: 1, device, build, scene: "test".into(), settings, size: [10, 10], methods, ratios }
    }

    fn ratio_to(stable: MethodResult, rivals: &[(f64, f64)]) -> Option<(f64, String)> {
        let rival = |(i, &(rays, ms)): (usize, &(f64, f64))| {
            method(&format!("supersample:{}", i + 1), Method::Supersample, rays, ms)
        };
        let all: Vec<MethodResult> = [stable].into_iter().chain(rivals.iter().enumerate().map(rival)).collect();
        ratios(&all).pop().map(|r| (r.over_supersample, r.basis))
    }

    #[test]
    fn equal_rays_are_found_on_the_line_between_the_neighbours() {
        let stable = || method("stable:1", Method::Stable, 150.0, 30.0);
        let rivals = [(100.0, 10.0), (200.0, 20.0), (300.0, 90.0)];
        let (value, basis) = ratio_to(stable(), &rivals).unwrap();
        assert_eq!((value, basis.as_str()), (2.0, "interpolated between supersample:1 and supersample:2"));
        let (value, basis) = ratio_to(stable(), &rivals[..1]).unwrap();
        assert_eq!((value, basis.as_str()), (2.0, "supersample:1 in proportion to its rays"));
        let (value, basis) = ratio_to(stable(), &[(200.0, 20.0), (300.0, 30.0)]).unwrap();
        assert_eq!((value, basis.as_str()), (2.0, "on the line through supersample:1 and supersample:2"));
        let (_, basis) = ratio_to(method("stable:1", Method::Stable, 180.0, 30.0), &rivals).unwrap();
        assert_eq!(basis, "interpolated between supersample:1 and supersample:2");
        assert!(ratio_to(stable(), &[]).is_none());
    }

    #[test]
    fn a_line_below_zero_compares_nothing() {
        let stable = method("stable:1", Method::Stable, 100.0, 30.0);
        assert!(ratio_to(stable, &[(200.0, 20.0), (300.0, 90.0)]).is_none());
    }

    #[test]
    fn shares_add_up_and_the_last_holds_the_rest() {
        let shares = method("stable:1", Method::Stable, 100.0, 1.0).reprojected.unwrap();
        assert_eq!(shares.map(|s| (s * 100.0).round()), [20.0, 60.0, 10.0, 5.0, 5.0]);
        assert!(method("supersample:1", Method::Supersample, 100.0, 1.0).reprojected.is_none());
        assert_eq!(reprojected_shares(&FrameStats::default()), [0.0; 5]);
    }

    #[test]
    fn the_table_has_a_row_a_method_and_a_column_a_phase() {
        let methods = vec![
            method("stable:1", Method::Stable, 100.0, 30.0),
            method("supersample:1", Method::Supersample, 100.0, 20.0),
        ];
        let text = bench(methods).text();
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert_eq!(lines[0][4..], ["reproject", "shade", "generate", "total", "p95"]);
        assert_eq!(lines[1], ["stable:1", "15.00", "15.00", "-", "30.00", "31.00"]);
        assert_eq!(lines[2], ["supersample:1", "-", "10.00", "10.00", "20.00", "21.00"]);
        assert!(text.contains("stable:1: 1.50 x supersample"), "{text}");
    }

    #[test]
    fn the_json_has_the_promised_keys() {
        let json = serde_json::to_value(bench(vec![method("stable:1", Method::Stable, 100.0, 30.0)])).unwrap();
        assert_eq!(json["schema"], 1);
        assert_eq!(json["size"], serde_json::json!([10, 10]));
        let m = &json["methods"][0];
        assert_eq!(m["phases"][0]["label"], "reproject");
        assert_eq!(m["phases"][0]["ms"], serde_json::json!({"min": 15.0, "median": 15.0, "p95": 15.0}));
        assert_eq!(m["total_ms"], serde_json::json!({"min": 29.0, "median": 30.0, "p95": 31.0}));
        assert_eq!(m["rays_per_frame"], 100.0);
        assert_eq!(m["samples_per_pixel"], 2.0);
        assert_eq!(m["reused_fraction"], 0.5);
        assert_eq!(m["memory_bytes"], 4096);
    }
}
