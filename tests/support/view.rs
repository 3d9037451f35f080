//! A random camera among random instances, and samples of what it sees.

use super::random::Random;
use bytemuck::Zeroable;
use stillray::shaders::{Frame, Instance, NEW_INSTANCE, OCCLUDED_BIT, SKY_INSTANCE, Sample};

/// Three unit vectors at right angles.
type Axes = [[f64; 3]; 3];

pub struct View {
    pub frame: Frame,
    pub instances: Vec<Instance>,
    camera: Axes,
    turns: Vec<Axes>,
}

fn axes(random: &mut Random) -> Axes {
    let forward = random.direction().map(f64::from);
    let helper = if forward[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let unit = |v: [f64; 3]| v.map(|c| c / v.iter().map(|c| c * c).sum::<f64>().sqrt());
    let right = unit(cross(forward, helper));
    [right, unit(cross(right, forward)), forward]
}

fn row(axis: [f64; 3], w: f64) -> [f32; 4] {
    [axis[0], axis[1], axis[2], w].map(|v| v as f32)
}

fn combine(axes: &Axes, weights: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| (0..3).map(|k| axes[k][i] * weights[k]).sum())
}

impl View {
    /// A camera that looks anywhere, and instances turned and scaled at random some metres around it.
    pub fn new(random: &mut Random, size: [u32; 2], instances: usize) -> Self {
        let camera = axes(random);
        let tangent = f64::from(random.between(0.1, 1.5));
        let frame = Frame {
            right: row(camera[0], tangent * f64::from(size[0]) / f64::from(size[1])),
            up: row(camera[1], tangent),
            forward: row(camera[2], 0.0),
            size,
            instance_count: instances as u32,
            ..Frame::zeroed()
        };
        let turns: Vec<Axes> = (0..instances).map(|_| axes(random)).collect();
        let place = |turn: &Axes| {
            let scale = f64::from(random.between(0.1, 4.0));
            let to_relative = turn.map(|axis| row(axis.map(|v| v * scale), f64::from(random.between(-5.0, 5.0))));
            Instance { to_relative, ..Instance::zeroed() }
        };
        let instances = turns.iter().map(place).collect();
        Self { frame, instances, camera, turns }
    }

    /// A camera-relative point at this place of the frame, in -1..1 from edge to edge, x right and y up.
    pub fn point(&self, [x, y]: [f32; 2], depth: f64) -> [f64; 3] {
        let [x, y] = [x * self.frame.right[3], y * self.frame.up[3]].map(|v| f64::from(v) * depth);
        combine(&self.camera, [x, y, depth])
    }

    /// A sample of this instance at this camera-relative point.
    pub fn sample(&self, instance: u32, relative: [f64; 3]) -> Sample {
        let rows = self.instances[instance as usize].to_relative;
        let scale = rows[0][..3].iter().map(|&v| f64::from(v).powi(2)).sum::<f64>().sqrt();
        let offset = [0, 1, 2].map(|i| (relative[i] - f64::from(rows[i][3])) / scale);
        Sample { position: combine(&self.turns[instance as usize], offset).map(|v| v as f32), instance }
    }

    pub fn sky(relative: [f64; 3]) -> Sample {
        let length = relative.iter().map(|v| v * v).sum::<f64>().sqrt();
        Sample { position: relative.map(|v| (v / length) as f32), instance: SKY_INSTANCE }
    }

    /// A sample anywhere in the frame or a little beyond, sometimes behind, of the sky, or lost.
    pub fn random_sample(&self, random: &mut Random, occluded: f32) -> Sample {
        let behind = if random.chance(0.05) { -1.0 } else { 1.0 };
        let depth = f64::from(random.between(-1.0, 3.0).exp() * behind);
        let at = [0, 1].map(|_| random.between(-1.05, 1.05));
        let relative = self.point(at, depth);
        let mut sample = if random.chance(0.2) {
            Self::sky(relative)
        } else {
            self.sample(random.below(self.instances.len() as u32), relative)
        };
        if random.chance(0.01) {
            sample.instance = random.pick(&[NEW_INSTANCE, self.frame.instance_count, 1 << 20]);
        }
        sample.instance |= if random.chance(occluded) { OCCLUDED_BIT } else { 0 };
        sample
    }
}
