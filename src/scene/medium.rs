//! Participating media (paper 2, section 3.6): fog everywhere, or mist in a box.

use crate::scene::EnvironmentMap;
use crate::shaders;
use crate::{Error, Result};
use glam::{DVec3, Vec3};

/// What fills space and scatters light. Scattering is single: light that is scattered twice is lost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Medium {
    /// Light scattered, RGB, 1/metre where the density is 1, from 0 to [`DENSEST`].
    pub scattering: Vec3,
    /// Light absorbed, as above.
    pub absorption: Vec3,
    /// Mean cosine of the angle that light is scattered by (Henyey and Greenstein 1941), above -1 and below 1; 0: to all sides.
    pub anisotropy: f32,
    /// Where it is.
    pub region: Region,
}

/// Where a medium is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Region {
    /// Everywhere, of density 1. What comes from infinity, directional lights and light from all around, is told as it arrives
    /// and is not attenuated on its way: endless fog would leave nothing of it.
    Everywhere,
    /// In a box.
    Mist(Mist),
}

/// A box whose density falls from 1 in its middle to 0 at its sides, as (1 - x²)² along each axis, perturbed by noise that
/// displaces where it is looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mist {
    /// Lowest corner in world space, metres, each coordinate within [`FARTHEST`] of 0.
    pub low: DVec3,
    /// Highest corner, above the lowest one.
    pub high: DVec3,
    /// How far noise displaces at most along each axis, metres, from 0 to [`FARTHEST`].
    pub amplitude: f64,
    /// After how many metres the noise repeats, from 0.001 to [`FARTHEST`].
    pub size: f64,
    /// Metres a second that the noise moves by, each coordinate within [`FARTHEST`] of 0.
    pub drift: DVec3,
}

/// The largest coefficient, 1/metre.
pub const DENSEST: f32 = 1e9;
/// The largest length, metres.
pub const FARTHEST: f64 = 1e9;
/// Cells of the noise along each side.
pub const NOISE_SIDE: u32 = shaders::MEDIUM_NOISE_SIDE;
/// What white fog absorbs of the light that it takes away, as an albedo.
pub const FOG_ALBEDO: f32 = 0.9;

impl Medium {
    /// White fog everywhere that takes away `density` of the light a metre, of which it absorbs a tenth.
    pub fn fog(density: f32) -> Self {
        let [scattering, absorption] = [FOG_ALBEDO, 1.0 - FOG_ALBEDO].map(|part| Vec3::splat(density * part));
        Self { scattering, absorption, anisotropy: 0.0, region: Region::Everywhere }
    }

    /// Whether anything of it is seen.
    pub fn is_seen(&self) -> bool {
        (self.scattering + self.absorption).max_element() > 0.0
    }

    /// How far its noise has moved after so many seconds, metres; a time that is not finite stands for 0.
    pub fn drifted(&self, time: f64) -> DVec3 {
        match self.region {
            Region::Mist(mist) if time.is_finite() => mist.drift * time,
            _ => DVec3::ZERO,
        }
    }

    /// Whether all is in range.
    ///
    /// # Errors
    /// [`Error::Setting`] with what is not.
    pub fn check(&self) -> Result<()> {
        let wrong =
            |name, value: String, expected: &str| Err(Error::Setting { name, value, expected: expected.to_owned() });
        for (name, rgb) in [("medium.scattering", self.scattering), ("medium.absorption", self.absorption)] {
            if !rgb.to_array().iter().all(|x| (0.0..=DENSEST).contains(x)) {
                return wrong(name, rgb.to_string(), "from 0 to 1e9, in 1/metre");
            }
        }
        if !(self.anisotropy > -1.0 && self.anisotropy < 1.0) {
            return wrong("medium.anisotropy", self.anisotropy.to_string(), "above -1 and below 1");
        }
        let Region::Mist(mist) = self.region else { return Ok(()) };
        let near = |p: DVec3| p.is_finite() && p.abs().max_element() <= FARTHEST;
        if !(near(mist.low) && near(mist.high) && mist.low.cmplt(mist.high).all()) {
            let value = format!("{} to {}", mist.low, mist.high);
            return wrong("medium.box", value, "a highest corner above the lowest one, within 1e9 metres of 0");
        }
        if !(0.0..=FARTHEST).contains(&mist.amplitude) {
            return wrong("medium.noise.amplitude", mist.amplitude.to_string(), "from 0 to 1e9, in metres");
        }
        if !(1e-3..=FARTHEST).contains(&mist.size) {
            return wrong("medium.noise.size", mist.size.to_string(), "from 0.001 to 1e9, in metres");
        }
        if !near(mist.drift) {
            return wrong("medium.noise.drift", mist.drift.to_string(), "within 1e9 of 0, in metres a second");
        }
        Ok(())
    }

    /// As the device has it in a frame seen from `camera`, when the noise has drifted so far. Light from all around, which may
    /// be none, lights it evenly.
    pub fn record(&self, camera: DVec3, drifted: DVec3, ambient: Vec3) -> shaders::Medium {
        let uniform = shaders::Medium {
            scattering: self.scattering.to_array(),
            anisotropy: self.anisotropy,
            absorption: self.absorption.to_array(),
            kind: shaders::MEDIUM_FOG,
            ambient: ambient.to_array(),
            ..Default::default()
        };
        let Region::Mist(mist) = self.region else { return uniform };
        let half = (mist.high - mist.low) * 0.5;
        let periods = (camera - drifted) / mist.size;
        shaders::Medium {
            kind: shaders::MEDIUM_MIST,
            centre: (mist.low.midpoint(mist.high) - camera).as_vec3().to_array(),
            amplitude: mist.amplitude as f32,
            // A side thinner than a float tells is one that is just not flat.
            half_extent: half.as_vec3().max(Vec3::splat(1e-9)).to_array(),
            per_period: (1.0 / mist.size) as f32,
            noise_origin: (periods - periods.floor()).as_vec3().to_array(),
            ..uniform
        }
    }
}

/// Mean radiance of a map, which a medium scatters as if it came evenly from all around.
pub fn mean_radiance(map: &EnvironmentMap) -> Vec3 {
    let row = |(row, texels): (usize, &[[f32; 3]])| {
        texels.iter().map(|t| DVec3::from(t.map(f64::from))).sum::<DVec3>() * map.solid_angle(row as u32)
    };
    let sum: DVec3 = texel_rows(map).map(row).sum();
    (sum * f64::from(map.scale) / (4.0 * std::f64::consts::PI)).as_vec3()
}

fn texel_rows(map: &EnvironmentMap) -> impl Iterator<Item = (usize, &[[f32; 3]])> {
    map.texels.chunks(map.width.max(1) as usize).enumerate()
}

/// The noise, three floats a cell from -1 to 1, x fastest: value noise of three octaves that tiles. Without mist one cell of 0.
pub fn noise(medium: Option<&Medium>) -> Vec<f32> {
    if !matches!(medium, Some(Medium { region: Region::Mist(_), .. })) {
        return vec![0.0; 3];
    }
    let n = NOISE_SIDE;
    let cells = (0..n).flat_map(|z| (0..n).flat_map(move |y| (0..n).map(move |x| [x, y, z])));
    cells.flat_map(|cell| (0..3).map(move |axis| octaves(cell, axis))).collect()
}

fn octaves(cell: [u32; 3], axis: u32) -> f32 {
    let octave = |o: u32| 0.5f64.powi(o as i32) * lattice(cell, 8 >> o, axis * 4 + o);
    ((0..3).map(octave).sum::<f64>() / 1.75) as f32
}

/// Random values `step` cells apart with cubic steps between them, -1..1.
fn lattice(cell: [u32; 3], step: u32, seed: u32) -> f64 {
    let low = cell.map(|c| c / step);
    let part = cell.map(|c| {
        let t = f64::from(c % step) / f64::from(step);
        t * t * (3.0 - 2.0 * t)
    });
    let period = NOISE_SIDE / step;
    let corner = |i: u32| {
        let at = [0, 1, 2].map(|axis| (low[axis] + (i >> axis & 1)) % period);
        let weight: f64 = (0..3).map(|axis| if i >> axis & 1 == 1 { part[axis] } else { 1.0 - part[axis] }).product();
        weight * random(at, seed)
    };
    (0..8).map(corner).sum()
}

fn random(at: [u32; 3], seed: u32) -> f64 {
    let hash = at.into_iter().fold(seed.wrapping_mul(0x9e37_79b9), crate::oracle::random::hash_combine);
    f64::from(hash >> 8) / f64::from(1u32 << 23) - 1.0
}
