//! Daylight: a clear or hazy sky as a map, and the sun as a light with an extent.
//!
//! The model is A. J. Preetham, P. Shirley and B. Smits, "A Practical Analytic Model for Daylight" (SIGGRAPH 1999): luminance
//! and chromaticity of the sky after Perez, with the coefficients of its appendix, and sunlight through air, haze and ozone.
//! What it is good for, and what not:
//!
//! - The fits were made for turbidities of 2 to 6. Below 2 the sky's luminance would pile up at the horizon, since the factor of
//!   the zenith that all is divided by goes to zero near 1.6: the distribution is then that of 2, its height that of the
//!   turbidity asked for. Above 6 it is an extrapolation that stays finite up to 10.
//! - It knows no night: the sun is at the horizon or above it. There is no sky below the horizon; the map shows a level ground
//!   there, diffuse, grey and lit by all of it.
//! - Sunlight is attenuated at the dominant wavelengths of the Rec. 709 primaries instead of all over the spectrum, and what
//!   water vapour and mixed gases absorb, some hundredths, is left out.
//! - The sun's disc is a light; the map does not show it.
//! - Pollution, which paper 2 (section 3.6) has as a control of its own beside turbidity and does not define, is none of the model's: here
//!   it is nitrogen dioxide, what makes smog brown, in a layer near the ground under everything that scatters. Sunlight and the light of
//!   the sky both cross all of it, by the mass of the air in their direction; what the layer scatters itself is haze, and turbidity.

use super::{Environment, EnvironmentMap, Light, LightKind, LightShape, LocalTransform, Node, Scene};
use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Radiance and irradiance in a scene for a kilocandela a square metre, and for a kilolux: a white diffuse surface in the
/// midday sun has then a radiance of about 2.
pub const EXPOSURE: f64 = 0.05;
/// Radians across the sun.
pub const SUN_WIDTH: f64 = 0.53 * PI / 180.0;
/// Turbidities that the model is taken for.
pub const TURBIDITIES: [f64; 2] = [1.7, 10.0];
/// Below this the fits of the distribution fail.
const LEAST_FITTED: f64 = 2.0;
/// Kilolux from the sun above the atmosphere.
const SOLAR: f64 = 128.0;
/// Texels of the map.
const SIZE: [u32; 2] = [512, 256];

/// A sky with its sun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sky {
    /// Haze: the optical thickness of the air with it over that without, 1.7 (very clear) to 10 (hazy).
    pub turbidity: f64,
    /// Nitrogen dioxide in the air above, as the depth in centimetres that it would have as a layer of its own at 0 °C and 1 atm, 0 to 0.1:
    /// some 0.002 over a town in traffic, 0.02 in the worst smog.
    pub pollution: f64,
    /// Radians from -Z towards +X at which the sun stands.
    pub azimuth: f64,
    /// Radians above the horizon at which the sun stands, 0 to π/2.
    pub elevation: f64,
    /// Part of the light that the ground below the horizon reflects, 0 to 1.
    pub ground: f64,
}

impl Default for Sky {
    /// A clear afternoon, with the sun to the right behind a camera that looks along -Z.
    fn default() -> Self {
        Self {
            turbidity: 3.0,
            pollution: 0.0,
            azimuth: 130f64.to_radians(),
            elevation: 35f64.to_radians(),
            ground: 0.2,
        }
    }
}

/// Perez' five coefficients of luminance, x and y: slope in the turbidity, and what they are without.
const PEREZ: [[[f64; 2]; 5]; 3] = [
    [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
    [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
    [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
];
/// Chromaticities x and y of the zenith: rows for the square of the turbidity, itself and one; columns for the cube of the
/// sun's angle from the zenith, its square, itself and one.
const ZENITH: [[[f64; 4]; 3]; 2] = [
    [[0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]],
    [[0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]],
];
/// CIE XYZ to Rec. 709 with its white, D65 (IEC 61966-2-1), by columns.
const FROM_XYZ: DMat3 = DMat3::from_cols(
    DVec3::new(3.2406, -0.9689, 0.0557),
    DVec3::new(-1.5372, 1.8758, -0.2040),
    DVec3::new(-0.4986, 0.0415, 1.0570),
);
/// Micrometres: dominant wavelengths of the primaries.
const WAVELENGTHS: [f64; 3] = [0.611, 0.549, 0.464];
/// What ozone absorbs there, per centimetre (the paper's table 2), of which there are 0.35.
const OZONE: [f64; 3] = [0.12, 0.085, 0.0075];
/// What nitrogen dioxide absorbs there, per centimetre: 0.25, 0.93 and 4.5e-19 cm² a molecule (Vandaele et al. 1998, smoothed; to some 15 %), of
/// which a centimetre has 2.687e19 to the square centimetre.
const NITROGEN_DIOXIDE: [f64; 3] = [0.67, 2.5, 12.1];
/// Centimetres of it.
pub const POLLUTIONS: [f64; 2] = [0.0, 0.1];
/// Rec. 709 of sunlight above the atmosphere, a black body of 5778 K, with a luminance of 1.
const SUN_COLOR: [f64; 3] = [1.10, 0.98, 0.91];

impl Sky {
    /// Whether everything is in range.
    ///
    /// # Errors
    /// [`Error::Setting`] with what is wrong.
    pub fn check(&self) -> Result<()> {
        let [least, most] = TURBIDITIES;
        let wrong =
            |name, value: f64, expected: String| Err(Error::Setting { name, value: value.to_string(), expected });
        if !(least..=most).contains(&self.turbidity) {
            return wrong("turbidity", self.turbidity, format!("from {least} to {most}"));
        }
        let [clean, foul] = POLLUTIONS;
        if !(clean..=foul).contains(&self.pollution) {
            return wrong("pollution", self.pollution, format!("from {clean} to {foul} cm of nitrogen dioxide"));
        }
        if !(0.0..=FRAC_PI_2).contains(&self.elevation) || !self.azimuth.is_finite() {
            return wrong("sun", self.elevation, "an elevation from 0 to 90 degrees, and a finite azimuth".to_owned());
        }
        if !(0.0..=1.0).contains(&self.ground) {
            return wrong("ground", self.ground, "from 0 to 1".to_owned());
        }
        Ok(())
    }

    /// Unit vector to the sun.
    pub fn towards_sun(&self) -> DVec3 {
        let level = self.elevation.cos();
        DVec3::new(level * self.azimuth.sin(), self.elevation.sin(), -level * self.azimuth.cos())
    }

    /// The sun's angle from the zenith.
    fn zenith_angle(&self) -> f64 {
        FRAC_PI_2 - self.elevation.clamp(0.0, FRAC_PI_2)
    }

    /// Luminance of the zenith in kilocandela a square metre, above 0.
    pub fn zenith_luminance(&self) -> f64 {
        let t = self.turbidity;
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * self.zenith_angle());
        (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192
    }

    /// Chromaticities x and y of the zenith.
    fn zenith_chromaticity(&self) -> [f64; 2] {
        let (t, s) = (self.turbidity, self.zenith_angle());
        let row = |r: [f64; 4]| ((r[0] * s + r[1]) * s + r[2]) * s + r[3];
        ZENITH.map(|[a, b, c]| (row(a) * t + row(b)) * t + row(c))
    }

    /// Perez' function for a direction with this cosine from the zenith, and this angle from the sun.
    fn perez(&self, what: usize, cosine: f64, gamma: f64) -> f64 {
        let t = self.turbidity.max(LEAST_FITTED);
        let [a, b, c, d, e] = PEREZ[what].map(|[slope, offset]| slope * t + offset);
        (1.0 + a * (b / cosine).exp()) * (1.0 + c * (d * gamma).exp() + e * gamma.cos().powi(2))
    }

    /// Radiance of the sky from a direction, a unit vector, in Rec. 709 and kilocandela a square metre; finite and not negative.
    /// What is below the horizon has the radiance of the horizon.
    pub fn radiance(&self, direction: DVec3) -> DVec3 {
        // The exponent's limit is no nearer a half degree above the horizon than this.
        let cosine = direction.y.max(0.01);
        let gamma = direction.dot(self.towards_sun()).clamp(-1.0, 1.0).acos();
        let relative = |what| self.perez(what, cosine, gamma) / self.perez(what, 1.0, self.zenith_angle());
        let [x, y] = self.zenith_chromaticity();
        let luminance = self.zenith_luminance().max(0.0) * relative(0);
        // Colours that no light has are none of the model's, but a guard is cheaper than a proof.
        let (x, y) = ((x * relative(1)).clamp(0.05, 0.8), (y * relative(2)).clamp(0.05, 0.8));
        let xyz = DVec3::new(x / y, 1.0, ((1.0 - x - y) / y).max(0.0)) * luminance;
        (FROM_XYZ * xyz).max(DVec3::ZERO) * self.left_by_pollution(air_mass(direction.y.clamp(0.0, 1.0).acos()))
    }

    /// What is left of light from above the polluted layer that comes through so many times the air that is overhead.
    fn left_by_pollution(&self, mass: f64) -> DVec3 {
        DVec3::from(NITROGEN_DIOXIDE.map(|absorbed| (-absorbed * self.pollution * mass).exp()))
    }

    /// Irradiance from the sun on a surface that faces it, in Rec. 709 and kilolux.
    pub fn sunlight(&self) -> DVec3 {
        let mass = air_mass(self.zenith_angle());
        let haze = 0.04608 * self.turbidity - 0.04586;
        let left = |channel: usize| {
            let wavelength = WAVELENGTHS[channel];
            let thickness = 0.008735 * wavelength.powf(-4.08) + haze * wavelength.powf(-1.3) + OZONE[channel] * 0.35;
            SOLAR * SUN_COLOR[channel] * (-thickness * mass).exp()
        };
        DVec3::new(left(0), left(1), left(2)) * self.left_by_pollution(mass)
    }

    /// Irradiance on level ground from sky and sun, in Rec. 709 and kilolux.
    pub fn on_the_ground(&self) -> DVec3 {
        const RINGS: u32 = 64;
        let step = |i: u32, of: u32| (f64::from(i) + 0.5) / f64::from(of);
        let ring = |i: u32| {
            // Rings of the same projected solid angle, each a part of pi.
            let level = step(i, RINGS).sqrt();
            let around = |j: u32| {
                let longitude = TAU * step(j, 2 * RINGS);
                DVec3::new(level * longitude.sin(), (1.0 - level * level).sqrt(), -level * longitude.cos())
            };
            (0..2 * RINGS).map(|j| self.radiance(around(j))).sum::<DVec3>()
        };
        let sky = (0..RINGS).map(ring).sum::<DVec3>() * PI / f64::from(2 * RINGS * RINGS);
        sky + self.sunlight() * self.elevation.sin()
    }

    /// Sky and ground as a map, at [`EXPOSURE`].
    pub fn map(&self) -> EnvironmentMap {
        let ground = self.on_the_ground() * (self.ground / PI);
        let [width, height] = SIZE;
        let texel = |i: u32| {
            let (x, y) = (f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
            let (longitude, polar) = (TAU * x / f64::from(width) - PI, PI * y / f64::from(height));
            let direction = DVec3::new(polar.sin() * longitude.sin(), polar.cos(), -polar.sin() * longitude.cos());
            let radiance = if direction.y > 0.0 { self.radiance(direction) } else { ground };
            (radiance * EXPOSURE).as_vec3().to_array()
        };
        let foul = if self.pollution > 0.0 { format!(" and pollution {}", self.pollution) } else { String::new() };
        let name = format!("sky of turbidity {}{foul}", self.turbidity);
        EnvironmentMap { name, width, height, texels: (0..width * height).map(texel).collect(), scale: 1.0, turn: 0.0 }
    }

    /// Puts a scene under this sky, scaled: instead of the light from all around that it has, and of a light that stood in.
    ///
    /// # Errors
    /// Those of [`check`](Self::check).
    pub fn apply(&self, scene: &mut Scene, scale: f32) -> Result<()> {
        self.check()?;
        scene.drop_default_light();
        scene.environment = Environment::default();
        scene.environment_map = Some(EnvironmentMap { scale, ..self.map() });
        let rotation = DQuat::from_rotation_arc(DVec3::NEG_Z, -self.towards_sun());
        let local = LocalTransform::Trs { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
        scene.nodes.push(Node { name: "sun".to_owned(), parent: None, local });
        let light = self.sunlight() * EXPOSURE;
        let intensity = light.max_element();
        scene.lights.push(Light {
            name: "sun".to_owned(),
            node: scene.nodes.len() - 1,
            kind: LightKind::Directional,
            color: (light / intensity.max(f64::MIN_POSITIVE)).as_vec3(),
            intensity: intensity as f32 * scale,
            range: None,
            shape: LightShape::Disc([SUN_WIDTH as f32; 2]),
        });
        Ok(())
    }
}

/// Kasten's optical mass of the air at an angle from the zenith in radians, 0 to π/2, as in the paper: 1 overhead, 38 at the horizon.
fn air_mass(angle: f64) -> f64 {
    1.0 / (angle.cos() + 0.15 * (93.885 - angle.to_degrees()).powf(-1.253))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn skies() -> impl Iterator<Item = Sky> {
        let turbidities = [1.7, 1.99, 2.0, 2.5, 4.0, 6.0, 8.0, 10.0];
        let elevations = [0.0, 1e-6, 0.05, 0.3, 0.8, 1.2, FRAC_PI_2];
        let pairs = turbidities.into_iter().flat_map(move |t| elevations.map(|e| (t, e)));
        pairs.map(|(turbidity, elevation)| Sky { turbidity, elevation, ..Sky::default() })
    }

    fn luminance(c: DVec3) -> f64 {
        c.dot(DVec3::new(0.2126, 0.7152, 0.0722))
    }

    #[test]
    fn it_is_light_everywhere_and_never_too_much() {
        for sky in skies() {
            sky.check().unwrap();
            for i in 0..2000 {
                // Spirals from the zenith to the nadir, and the sun itself.
                let y = 1.0 - 2.0 * f64::from(i) / 1999.0;
                let r = (1.0 - y * y).sqrt();
                let (sin, cos) = (f64::from(i) * 2.4).sin_cos();
                for d in [DVec3::new(r * cos, y, r * sin), sky.towards_sun()] {
                    let c = sky.radiance(d);
                    assert!(c.is_finite() && c.min_element() >= 0.0, "{sky:?} {d}: {c}");
                    assert!(luminance(c) > 0.01 && luminance(c) < 300.0, "{sky:?} {d}: {c} kcd/m2");
                }
            }
            let sun = sky.sunlight();
            assert!(sun.is_finite() && sun.min_element() >= 0.0 && luminance(sun) < SOLAR, "{sky:?}: {sun}");
            assert!((sky.towards_sun().length() - 1.0).abs() < 1e-12);
        }
    }

    /// The paper's formula for the zenith, worked out by hand for turbidity 3 and the sun at 45 degrees: chi = (4/9 - 1/40)
    /// pi / 2 = 0.658862, its tangent 0.774637; 7.1649 * 0.774637 - 0.6465 + 2.4192.
    #[test]
    fn the_zenith_is_as_bright_as_the_paper_says() {
        let at = |turbidity: f64, degrees: f64| Sky { turbidity, elevation: degrees.to_radians(), ..Sky::default() };
        let by_hand = 7.1649 * 0.658_862_f64.tan() - 0.6465 + 2.4192;
        assert!((at(3.0, 45.0).zenith_luminance() - by_hand).abs() < 1e-4);
        let up = luminance(at(3.0, 45.0).radiance(DVec3::Y));
        assert!((up / by_hand - 1.0).abs() < 1e-3, "colours are converted without a loss: {up} {by_hand}");
        // A high sun: the zenith brightens with haze. At the horizon the same formula has it darken.
        for pair in [2.0, 3.0, 4.0, 5.0, 6.0].windows(2) {
            assert!(at(pair[0], 30.0).zenith_luminance() < at(pair[1], 30.0).zenith_luminance());
            assert!(at(pair[0], 0.0).zenith_luminance() > at(pair[1], 0.0).zenith_luminance());
        }
        // It rises with the sun.
        assert!((0..9).all(
            |i| at(3.0, f64::from(10 * i)).zenith_luminance() < at(3.0, f64::from(10 * i + 10)).zenith_luminance()
        ));
    }

    #[test]
    fn sun_and_sky_are_as_they_are_outdoors() {
        let at = |turbidity: f64, degrees: f64| Sky { turbidity, elevation: degrees.to_radians(), ..Sky::default() };
        // Some 100 kilolux at noon, and less of it, and redder, through more air and more haze.
        let noon = at(2.0, 60.0).sunlight();
        assert!((80.0..115.0).contains(&luminance(noon)), "{noon}");
        assert!((0..6).all(|i| luminance(at(2.0, f64::from(15 * i)).sunlight())
            < luminance(at(2.0, f64::from(15 * i + 15)).sunlight())));
        let hazy = at(6.0, 60.0).sunlight();
        assert!(luminance(hazy) < luminance(noon) && hazy.x / hazy.z > noon.x / noon.z);
        let low = at(2.0, 5.0).sunlight();
        assert!(low.x > low.y && low.y > low.z && low.x / low.z > 2.0 * noon.x / noon.z);
        // The sky is blue away from the sun, bluer when it is clear, and bright around the sun.
        let clear = at(2.0, 40.0);
        let [blue, pale] = [clear, at(6.0, 40.0)].map(|sky| sky.radiance(DVec3::Y));
        assert!(blue.z > 1.5 * blue.x && blue.z / blue.x > pale.z / pale.x, "{blue} {pale}");
        assert!(luminance(clear.radiance(clear.towards_sun())) > 2.0 * luminance(clear.radiance(DVec3::Y)));
        // The sky alone lights level ground with 5 to 40 kilolux.
        let sky = clear.on_the_ground() - clear.sunlight() * clear.elevation.sin();
        assert!((5.0..40.0).contains(&luminance(sky)), "{sky}");
    }

    /// Beer's law, worked out by hand: overhead 0.02 cm leave exp(-0.0134), exp(-0.05) and exp(-0.242), at 60 degrees from the zenith,
    /// where the mass is 1 / (0.5 + 0.15 * 33.885^-1.253) = 1.99276, that to its power; overhead it is 0.99949.
    #[test]
    fn pollution_turns_sun_and_sky_brown() {
        let at = |pollution: f64, degrees: f64| Sky { pollution, elevation: degrees.to_radians(), ..Sky::default() };
        let overhead = DVec3::new(0.986_689, 0.951_229, 0.785_056);
        let sky = |pollution| at(pollution, 40.0).radiance(DVec3::Y);
        assert!(
            (sky(0.02) / sky(0.0) - overhead.powf(0.999_49)).abs().max_element() < 1e-5,
            "{}",
            sky(0.02) / sky(0.0)
        );
        let sun = at(0.02, 30.0).sunlight() / at(0.0, 30.0).sunlight();
        let mass = 1.992_76;
        assert!((sun - overhead.powf(mass)).abs().max_element() < 1e-5, "{sun}");
        // The horizon is the brownest, and nothing is lost where nothing is in the air.
        let level = at(0.02, 40.0).radiance(DVec3::X) / at(0.0, 40.0).radiance(DVec3::X);
        assert!(level.z < 0.01 && level.x > 0.5, "{level}");
        for sky in skies() {
            let foul = Sky { pollution: 0.1, ..sky };
            foul.check().unwrap();
            assert!((0..200).all(|i| {
                let (sin, cos) = (f64::from(i) * 0.0157).sin_cos();
                let c = foul.radiance(DVec3::new(cos, sin, 0.0));
                c.is_finite() && c.min_element() >= 0.0 && c.cmple(sky.radiance(DVec3::new(cos, sin, 0.0))).all()
            }));
        }
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        let sky = Sky::default();
        for wrong in [
            Sky { turbidity: 1.6, ..sky },
            Sky { turbidity: f64::NAN, ..sky },
            Sky { pollution: -0.001, ..sky },
            Sky { pollution: 0.11, ..sky },
            Sky { pollution: f64::NAN, ..sky },
            Sky { elevation: -0.1, ..sky },
            Sky { elevation: 1.6, ..sky },
            Sky { azimuth: f64::INFINITY, ..sky },
            Sky { ground: 1.5, ..sky },
        ] {
            assert!(wrong.check().is_err() && wrong.apply(&mut Scene::default(), 1.0).is_err(), "{wrong:?}");
        }
        // The sun straight above, where a light has no side, and at the horizon.
        for elevation in [0.0, FRAC_PI_2] {
            let mut scene = Scene::default();
            Sky { elevation, ..sky }.apply(&mut scene, 1.0).unwrap();
            let pose = scene.pose(0.0);
            assert!((pose.lights[0].direction + Sky { elevation, ..sky }.towards_sun()).length() < 1e-9);
            assert!(scene.environment_map.is_some_and(|map| map.is_whole() && map.shines()));
        }
    }
}
