//! Twin of `glsl/medium.comp` and `glsl/include/medium.glsl`: a march through fog or mist, in f64.

use super::random::{hash_combine, hash_uint, unit_float};
use super::shade::light::light_at;
use crate::shaders::{Frame, Light, MEDIUM_FOG, MEDIUM_MIST, MEDIUM_NOISE_SIDE, MEDIUM_NONE, Medium};
use glam::DVec3;
use std::f64::consts::PI;

/// Below it in all channels a march gathers no more.
const TRANSMITTANCE_LEAST: f64 = 1.0 / 4096.0;
const SMALLEST_NORMAL: f64 = f32::MIN_POSITIVE as f64;

/// A medium in a frame.
#[derive(Debug, Clone, Copy)]
pub struct Air<'a> {
    /// Its constants.
    pub medium: &'a Medium,
    /// [`crate::scene::medium::noise`].
    pub noise: &'a [f32],
}

/// A visible sample of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Metres; infinity for the sky.
    pub depth: f64,
    /// Radiance.
    pub color: DVec3,
}

fn vector(v: [f32; 3]) -> DVec3 {
    v.map(f64::from).into()
}

fn each(a: DVec3, f: impl Fn(f64) -> f64) -> DVec3 {
    DVec3::new(f(a.x), f(a.y), f(a.z))
}

/// Henyey and Greenstein's phase function, per steradian.
pub fn phase(g: f64, cosine: f64) -> f64 {
    let base = (1.0 + g * g - 2.0 * g * cosine).max((1.0 - g.abs()).powi(2));
    (1.0 - g * g) / (4.0 * PI * base.powf(1.5))
}

/// Optical depth of a length, of which nothing is left to infinity.
fn depth_of(extinction: DVec3, metres: f64) -> DVec3 {
    each(extinction, |e| if e < SMALLEST_NORMAL { 0.0 } else { e * metres })
}

fn opacity(depth: DVec3) -> DVec3 {
    each(depth, |x| -(-x).exp_m1())
}

impl Air<'_> {
    fn extinction(&self) -> DVec3 {
        vector(self.medium.scattering) + vector(self.medium.absorption)
    }

    fn albedo(&self) -> DVec3 {
        let part = |s: f64, e: f64| if e < SMALLEST_NORMAL { 0.0 } else { s / e };
        let (s, e) = (vector(self.medium.scattering), self.extinction());
        DVec3::new(part(s.x, e.x), part(s.y, e.y), part(s.z, e.z))
    }

    /// Mist without its noise.
    pub fn base_density(&self, point: DVec3) -> f64 {
        let x = (point - vector(self.medium.centre)) / vector(self.medium.half_extent);
        each(x, |x| (1.0 - x * x).max(0.0).powi(2)).to_array().into_iter().product()
    }

    fn cell(&self, at: [u32; 3]) -> DVec3 {
        let n = MEDIUM_NOISE_SIDE;
        let [x, y, z] = at.map(|c| c % n);
        let first = 3 * ((z * n + y) * n + x) as usize;
        DVec3::new(self.noise[first].into(), self.noise[first + 1].into(), self.noise[first + 2].into())
    }

    fn noise_at(&self, point: DVec3) -> DVec3 {
        let period = point * f64::from(self.medium.per_period) + vector(self.medium.noise_origin);
        let place = (period - period.floor()) * f64::from(MEDIUM_NOISE_SIDE);
        let low = place.floor();
        let part = place - low;
        let low = low.to_array().map(|c| c as u32);
        let corner = |i: u32| {
            let bit = |axis: u32| i >> axis & 1;
            let weight = |axis: u32, t: f64| if bit(axis) == 1 { t } else { 1.0 - t };
            let at = [low[0] + bit(0), low[1] + bit(1), low[2] + bit(2)];
            self.cell(at) * (weight(0, part.x) * weight(1, part.y) * weight(2, part.z))
        };
        (0..8).map(corner).sum()
    }

    /// Density at a point, 0..=1.
    pub fn density(&self, point: DVec3) -> f64 {
        let displaced = || point + self.noise_at(point) * f64::from(self.medium.amplitude);
        if self.medium.kind == MEDIUM_MIST { self.base_density(displaced()) } else { 1.0 }
    }

    fn interval(&self, extent: DVec3, origin: DVec3, direction: DVec3) -> [f64; 2] {
        let guarded = each(direction, |d| if d.abs() < 1e-20 { 1e-20 } else { d });
        let centre = vector(self.medium.centre) - origin;
        let (a, b) = ((centre - extent) / guarded, (centre + extent) / guarded);
        [a.min(b).max_element().max(0.0), a.max(b).min_element()]
    }

    /// Metres of density 1 that are as much as the mist, without its noise, from a point on: by small steps, where the shader
    /// has Gauss' rule.
    pub fn base_length(&self, origin: DVec3, direction: DVec3, distance: f64) -> f64 {
        let [near, far] = self.interval(vector(self.medium.half_extent), origin, direction);
        let far = far.min(distance);
        const STEPS: u32 = 2000;
        let step = (far - near) / f64::from(STEPS);
        let density = |i: u32| self.base_density(origin + direction * (near + (f64::from(i) + 0.5) * step));
        if near < far { (0..STEPS).map(density).sum::<f64>() * step } else { 0.0 }
    }

    /// What is left of a light on its way to a point.
    pub fn light_transmittance(&self, point: DVec3, direction: DVec3, distance: f64) -> DVec3 {
        let metres = match self.medium.kind {
            MEDIUM_MIST => self.base_length(point, direction, distance),
            _ if distance.is_infinite() => 0.0,
            _ => distance,
        };
        each(depth_of(self.extinction(), metres), |x| (-x).exp())
    }

    fn at(&self, [near, far]: [f64; 2], part: f64) -> f64 {
        if self.medium.kind == MEDIUM_MIST {
            return near + (far - near) * part;
        }
        let pace = self.extinction().element_sum() / 3.0;
        if pace * far < 0.01 {
            return far * part;
        }
        let left = (1.0 - part * (1.0 - (-pace * far).exp())).max(2f64.powi(-24));
        (-left.ln() / pace).min(1e30)
    }

    fn source(&self, point: DVec3, direction: DVec3, light: Option<(&Light, usize)>, reaches: bool) -> DVec3 {
        let mut source = vector(self.medium.ambient);
        if let Some((light, count)) = light.filter(|_| reaches) {
            let incident = light_at(light, point.as_vec3().to_array());
            let phase = phase(self.medium.anisotropy.into(), incident.direction.dot(direction));
            let left = self.light_transmittance(point, incident.direction, incident.distance);
            source += incident.irradiance * left * (phase * count as f64);
        }
        self.albedo() * source
    }

    /// What the samples of the pixel of this index in list order look like, whose middle is seen along a unit vector; `reaches`
    /// says whether light gets to a point.
    pub fn march(
        &self,
        frame: &Frame,
        (index, direction): (u32, DVec3),
        lights: &[Light],
        samples: &[Seen],
        reaches: impl Fn(DVec3, &Light) -> bool,
    ) -> Vec<DVec3> {
        let mut colors: Vec<DVec3> = samples.iter().map(|s| s.color).collect();
        let far = samples.iter().fold(-1.0, |far: f64, s| far.max(s.depth));
        let mut way = [0.0, far];
        if self.medium.kind == MEDIUM_MIST {
            let extent = vector(self.medium.half_extent) + f64::from(self.medium.amplitude);
            let [enter, leave] = self.interval(extent, DVec3::ZERO, direction);
            way = [enter, leave.min(far)];
        }
        let extinction = self.extinction();
        let none = self.medium.kind == MEDIUM_NONE || extinction.max_element() < SMALLEST_NORMAL;
        if none || way[0] >= way[1] {
            return colors;
        }
        let hash = hash_combine(hash_combine(frame.seed, index), frame.jitter);
        let (jitter, turn) = (f64::from(unit_float(hash)), hash_uint(hash) % lights.len().max(1) as u32);
        let steps = self.medium.steps;
        let fog = self.medium.kind == MEDIUM_FOG;
        let (mut gathered, mut through, mut at, mut ended) = (DVec3::ZERO, DVec3::ONE, way[0], false);
        for k in 0..steps {
            let last = ended || k + 1 == steps;
            let to = if last { way[1] } else { self.at(way, f64::from(k + 1) / f64::from(steps)) };
            let point = direction * self.at(way, (f64::from(k) + jitter) / f64::from(steps));
            let density = if ended { 0.0 } else { self.density(point) };
            let light = lights.get((turn + k) as usize % lights.len().max(1)).map(|l| (l, lights.len()));
            let lit = light.is_some_and(|(l, _)| frame.shadow_rays == 0 || reaches(point, l));
            let source = if density > 0.0 { self.source(point, direction, light, lit) } else { DVec3::ZERO };
            let thick = extinction * density;
            for (sample, color) in samples.iter().zip(&mut colors) {
                if sample.depth > at && (sample.depth <= to || last) {
                    let passed = depth_of(thick, sample.depth.min(to) - at);
                    let exact = each(depth_of(extinction, sample.depth), |x| (-x).exp());
                    let left = if fog { exact } else { through * each(passed, |x| (-x).exp()) };
                    *color = left * sample.color + gathered + through * source * opacity(passed);
                }
            }
            if last {
                break;
            }
            let passed = depth_of(thick, to - at);
            gathered += through * source * opacity(passed);
            through = each(if fog { depth_of(extinction, to) } else { passed }, |x| (-x).exp())
                * if fog { DVec3::ONE } else { through };
            at = to;
            ended = through.max_element() < TRANSMITTANCE_LEAST;
        }
        colors
    }
}
