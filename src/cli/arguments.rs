//! Options that subcommands share, and the values that they take.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use stillray::metric::sequence::Metric;
use stillray::renderer::{Aov, Method, Settings};
use stillray::report::bench::Build;
use stillray::scene::motion::Motion;
use stillray::scene::sky::{POLLUTIONS, Sky, TURBIDITIES};
use stillray::scene::{Environment, EnvironmentMap, Lens, Scene, import};
use stillray::settings::knob::Knob;
use stillray::settings::{Modelling, Sampling, file as settings_file};

use super::{Failure, Outcome};

/// What is rendered, how it is looked at, and on what.
#[derive(Debug, Args)]
pub struct Source {
    /// A .gltf or .glb file, or builtin:NAME (`stillray info` lists the names)
    #[arg(value_name = "SCENE", default_value = "builtin:hairball")]
    pub scene: OsString,
    /// Width and height in pixels, each from 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size)]
    pub size: [u32; 2],
    /// The scene's camera to look through, by name or number, or two points to look from and to, in metres, such as
    /// 8,2,0:0,3,0 [default: the scene's first]
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    pub camera: Option<String>,
    #[command(flatten)]
    pub optics: Optics,
    #[command(flatten)]
    pub surroundings: Surroundings,
    /// White fog everywhere, instead of the scene's own, that takes away this part of the light a metre, from 0 to 1000000
    #[arg(long, value_name = "DENSITY", value_parser = density, allow_negative_numbers = true)]
    pub fog: Option<f32>,
    /// Frames a second of the motion, from 0.001 to 1000
    #[arg(long, value_name = "F", default_value = "30", value_parser = ranged(0.001, 1000.0), allow_negative_numbers = true)]
    pub fps: f64,
    /// Seed of all random choices
    #[arg(long, value_name = "S", default_value = "0", allow_negative_numbers = true)]
    pub seed: u32,
    /// The device to run on: its number or a part of its name [default: the best one]
    #[arg(long, value_name = "X")]
    pub device: Option<String>,
    /// Write what was measured into this file
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// No progress and no summary; errors and notes are still told
    #[arg(long)]
    pub quiet: bool,
}

/// The lens to look through.
#[derive(Debug, Args)]
pub struct Optics {
    /// Diameter of the lens in metres, from 0 (all is in focus) to 1000 [default: the camera's]
    #[arg(long, value_name = "M", value_parser = ranged(0.0, 1000.0), allow_negative_numbers = true)]
    pub aperture: Option<f64>,
    /// Distance in metres that is in focus, from 0.000001 to 1000000000 [default: the camera's, or else infinity]
    #[arg(long, value_name = "M", value_parser = ranged(1e-6, 1e9), allow_negative_numbers = true)]
    pub focus: Option<f64>,
    /// Straight edges of the aperture, from 3 to 16, or 0 for a round one [default: the camera's]
    #[arg(long, value_name = "N", value_parser = blades, allow_negative_numbers = true)]
    pub blades: Option<u32>,
    /// Part of the time between frames for which the shutter is open, from 0 (nothing blurs) to 1 [default: the camera's]
    #[arg(long, value_name = "F", value_parser = ranged(0.0, 1.0), allow_negative_numbers = true)]
    pub shutter: Option<f64>,
}

impl Optics {
    /// A camera's lens, but for what was asked for.
    pub fn of(&self, lens: Lens) -> Lens {
        Lens {
            aperture: self.aperture.unwrap_or(lens.aperture),
            focus: self.focus.unwrap_or(lens.focus),
            blades: self.blades.unwrap_or(lens.blades),
        }
    }
}

/// The light from all around.
#[derive(Debug, Args)]
pub struct Surroundings {
    /// Light from all around, instead of the scene's own: an equirectangular OpenEXR picture, whose middle is towards -Z
    #[arg(long, value_name = "FILE", group = "surroundings")]
    pub environment: Option<PathBuf>,
    /// What its radiances are multiplied by, from 0 to 1000000
    #[arg(long, value_name = "F", default_value = "1", value_parser = ranged(0.0, 1e6), allow_negative_numbers = true, requires = "surroundings")]
    pub environment_scale: f64,
    /// Degrees that it is turned by, counterclockwise as seen from above, from -360 to 360
    #[arg(long, value_name = "D", default_value = "0", value_parser = ranged(-360.0, 360.0), allow_negative_numbers = true, requires = "environment")]
    pub environment_turn: f64,
    /// Daylight, instead of the scene's own light from all around, of this turbidity, from 1.7 (clear) to 10 (hazy)
    #[arg(long, value_name = "T", group = "surroundings", value_parser = ranged(TURBIDITIES[0], TURBIDITIES[1]), allow_negative_numbers = true)]
    pub sky: Option<f64>,
    /// Where its sun stands, in degrees: clockwise from -Z as seen from above, from -360 to 360, and above the horizon, from 0
    /// to 90 [default: 130,35]
    #[arg(long, value_name = "A,E", value_parser = sun, allow_hyphen_values = true, requires = "sky")]
    pub sun: Option<[f64; 2]>,
    /// Nitrogen dioxide in the air above, which makes smog brown, in centimetres, from 0 to 0.1: 0.002 over a town in traffic [default: 0]
    #[arg(long, value_name = "CM", value_parser = ranged(POLLUTIONS[0], POLLUTIONS[1]), allow_negative_numbers = true, requires = "sky")]
    pub pollution: Option<f64>,
}

impl Surroundings {
    /// Whether anything was asked for.
    pub fn is_given(&self) -> bool {
        self.environment.is_some() || self.sky.is_some()
    }

    /// Puts a scene into them.
    pub fn apply(&self, scene: &mut Scene) -> stillray::Result<()> {
        let scale = self.environment_scale as f32;
        if let Some(path) = &self.environment {
            let map = import::environment_map(path, &mut scene.notices)?;
            scene.environment_map = Some(EnvironmentMap { scale, turn: self.environment_turn.to_radians(), ..map });
            scene.environment = Environment::default();
            scene.drop_default_light();
        }
        if let Some(turbidity) = self.sky {
            let usual = Sky::default();
            let [azimuth, elevation] =
                self.sun.map_or([usual.azimuth, usual.elevation], |degrees| degrees.map(f64::to_radians));
            let pollution = self.pollution.unwrap_or(usual.pollution);
            Sky { turbidity, pollution, azimuth, elevation, ..usual }.apply(scene, scale)?;
        }
        Ok(())
    }
}

fn sun(text: &str) -> Result<[f64; 2], String> {
    let angles = text.split_once(',').and_then(|(azimuth, elevation)| {
        Some([ranged(-360.0, 360.0)(azimuth.trim()).ok()?, ranged(0.0, 90.0)(elevation.trim()).ok()?])
    });
    angles.ok_or_else(|| "expected two angles in degrees, from -360 to 360 and from 0 to 90, such as 130,35".to_owned())
}

fn density(text: &str) -> Result<f32, String> {
    ranged(0.0, 1e6)(text).map(|n| n as f32)
}

fn blades(text: &str) -> Result<u32, String> {
    let number = counted(0, 16)(text).ok().filter(|n| *n == 0 || *n >= 3);
    number.ok_or_else(|| "expected 0 or a whole number from 3 to 16".to_owned())
}

/// A number from `min` to `max`.
pub fn ranged(min: f64, max: f64) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync + 'static {
    move |text| match f64::from_str(text) {
        Ok(n) if (min..=max).contains(&n) => Ok(n),
        _ => Err(format!("expected a number from {min} to {max}")),
    }
}

/// A whole number from `min` to `max`.
pub fn counted(min: u32, max: u32) -> impl Fn(&str) -> Result<u32, String> + Clone + Send + Sync + 'static {
    move |text| match u32::from_str(text) {
        Ok(n) if (min..=max).contains(&n) => Ok(n),
        _ => Err(format!("expected a whole number from {min} to {max}")),
    }
}

/// `WxH`.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let side = counted(1, 16384);
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some([side(w).ok()?, side(h).ok()?]));
    sides.ok_or_else(|| "expected width x height in pixels, each from 1 to 16384, such as 640x480".to_owned())
}

/// What is modelled, by name.
pub fn modelling() -> impl TypedValueParser<Value = Modelling> {
    named(Modelling::ALL.map(|(modelling, name)| (name, modelling)))
}

/// The name of a method.
pub fn method() -> impl TypedValueParser<Value = Method> {
    PossibleValuesParser::new(Method::ALL.iter().map(|m| m.name())).try_map(|name| method_named(&name))
}

fn method_named(name: &str) -> Result<Method, String> {
    let known = Method::ALL.iter().find(|m| m.name() == name);
    known.copied().ok_or_else(|| {
        let names: Vec<&str> = Method::ALL.iter().map(|m| m.name()).collect();
        format!("'{name}' is no method: expected one of {}", names.join(", "))
    })
}

/// The name of an AOV.
pub fn aov() -> impl TypedValueParser<Value = Aov> {
    named(Aov::ALL.map(|aov| (aov.name(), aov)))
}

/// The name of a camera motion.
pub fn motion() -> impl TypedValueParser<Value = Motion> {
    named(Motion::ALL.map(|m| (m.name(), m)))
}

/// The name of something to measure.
pub fn metric() -> impl TypedValueParser<Value = Metric> {
    named(Metric::ALL.map(|m| (m.name(), m)))
}

/// One of a few names, each for a value.
pub fn named<T: Copy + Send + Sync + 'static, const N: usize>(
    values: [(&'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(values.map(|(name, _)| name)).try_map(move |name| {
        values.iter().find(|(known, _)| *known == name).map(|(_, value)| *value).ok_or("an unknown name")
    })
}

/// Knobs from a file, and by their names.
#[derive(Debug, Args)]
pub struct Tuning {
    /// Settings to begin with: a TOML file as `stillray settings` prints it
    #[arg(long, value_name = "FILE")]
    pub settings: Option<PathBuf>,
    /// What is modelled: what the scene requires, or everything that a scene may require; the frames are the same. Short for
    /// --set model=WHAT
    #[arg(long, value_name = "WHAT", value_parser = modelling())]
    pub model: Option<Modelling>,
    /// Set a knob, as in density=2, however often; `stillray settings` lists all knobs
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub assignments: Vec<String>,
}

impl Tuning {
    /// The defaults, or what the file makes of them.
    pub fn base(&self) -> stillray::Result<Settings> {
        let mut settings = Settings::default();
        if let Some(path) = &self.settings {
            settings_file::read(path, &mut settings)?;
        }
        Ok(settings)
    }

    /// What is set by name. A knob that the method has no use for is a mistake, unlike in a file, which has them all.
    pub fn assign(&self, settings: &mut Settings) -> Outcome {
        settings.modelling = self.model.unwrap_or(settings.modelling);
        for knob in settings_file::assign_all(&self.assignments, settings)? {
            refuse_idle(knob, settings.method, &format!("--set {}", knob.name))?;
        }
        Ok(())
    }
}

/// A knob that means nothing to a method is not turned by mistake.
pub fn refuse_idle(knob: &Knob, method: Method, option: &str) -> Outcome {
    if (knob.applies)(method) {
        return Ok(());
    }
    let methods: Vec<&str> = Method::ALL.iter().filter(|m| (knob.applies)(**m)).map(|m| m.name()).collect();
    let needs = methods.join(", ");
    Err(Failure::Usage(format!("{option} has a meaning for --method {needs} only, not for {}", method.name())))
}

/// Settings to be compared with others, as `bench` takes them: `stable:0.5`, `supersample:2`, `fast.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct Contender {
    /// The name that it is told by.
    pub name: String,
    /// Its settings.
    pub settings: Settings,
}

impl FromStr for Contender {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut settings = Settings::default();
        if text.ends_with(".toml") {
            settings_file::read(Path::new(text), &mut settings).map_err(|e| e.to_string())?;
            return Ok(Self { name: text.to_owned(), settings });
        }
        let (kind, number) = text.split_once(':').unwrap_or((text, "1"));
        let method = method_named(kind).map_err(|e| format!("{e}; as in stable:0.5, supersample:2, fast.toml"))?;
        settings.switch(method);
        let name = match method.sampling() {
            Sampling::Reprojected => {
                settings.density = ranged(0.0625, 16.0)(number)? as f32;
                format!("{kind}:{}", settings.density)
            }
            Sampling::Fresh => {
                settings.spp = counted(1, 16)(number)?;
                format!("{kind}:{}", settings.spp)
            }
            Sampling::Tracked if number == "1" => kind.to_owned(),
            Sampling::Tracked => return Err(format!("{kind} has one sample a pixel: expected {kind} or {kind}:1")),
        };
        Ok(Self { name, settings })
    }
}

/// The program that runs.
pub fn build() -> Build {
    Build {
        version: env!("CARGO_PKG_VERSION"),
        commit: option_env!("STILLRAY_COMMIT"),
        profile: if cfg!(debug_assertions) { "debug" } else { "release" },
        target: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(size("640x480"), Ok([640, 480]));
        assert_eq!(size("1X16384"), Ok([1, 16384]));
        for wrong in ["", "640", "0x480", "640x16385", "-1x4", "640x480x2", "640 x 480", "axb", "640x"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn ranges_include_their_ends_and_no_nan() {
        let density = ranged(0.0625, 16.0);
        assert_eq!((density("0.0625"), density("16")), (Ok(0.0625), Ok(16.0)));
        for wrong in ["0.0624", "16.001", "nan", "inf", "-1", "", "1,5"] {
            assert!(density(wrong).is_err(), "{wrong}");
        }
        assert_eq!(counted(1, 16)("16"), Ok(16));
        assert!(counted(1, 16)("17").is_err() && counted(1, 16)("1.0").is_err());
    }

    #[test]
    fn contenders() {
        let read = |text: &str| text.parse::<Contender>();
        let stable = read("stable:0.5").unwrap();
        assert_eq!((stable.name.as_str(), stable.settings.density), ("stable:0.5", 0.5));
        let supersample = read("supersample:2").unwrap();
        assert_eq!((supersample.name.as_str(), supersample.settings.spp), ("supersample:2", 2));
        assert_eq!(read("stable"), read("stable:1.0"));
        let integrated = read("stable+ti:2").unwrap();
        assert_eq!((integrated.settings.density, integrated.settings.history.alpha), (2.0, 0.25));
        let antialiased = read("taa:1").unwrap();
        assert_eq!((antialiased.settings.spp, antialiased.settings.history.alpha), (1, 0.1));
        assert_eq!(read("point-tracking"), read("point-tracking:1"));
        assert!(read("point-tracking:2").unwrap_err().contains("one sample a pixel"));
        for wrong in ["stable:0", "supersample:0.5", "nothing:1", "stable:", ":1", "", "absent.toml"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn knobs_are_set_in_order_and_only_where_they_mean_something() {
        let tuned = |words: &[&str]| {
            let tuning =
                Tuning { settings: None, model: None, assignments: words.iter().map(|w| (*w).to_owned()).collect() };
            let mut settings = tuning.base().unwrap();
            tuning.assign(&mut settings).map(|()| settings)
        };
        let settings = tuned(&["density=2", "density=3"]).unwrap();
        assert_eq!(settings.density, 3.0);
        // The method may come after what it needs.
        assert_eq!(tuned(&["spp=3", "method=supersample"]).unwrap().spp, 3);
        for wrong in [&["spp=3"] as &[_], &["method=supersample", "density=2"], &["density=99"], &["densty=1"]] {
            assert!(matches!(tuned(wrong), Err(Failure::Usage(_))), "{wrong:?}");
        }
    }
}
