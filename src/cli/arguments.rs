//! Options that subcommands share, and the values that they take.

use std::ffi::OsString;
use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use stillray::renderer::{Aov, Method};
use stillray::report::bench::Build;
use stillray::scene::motion::Motion;

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

/// The name of a method.
pub fn method() -> impl TypedValueParser<Value = Method> {
    named([("stable", Method::Stable), ("supersample", Method::Supersample), ("reference", Method::Reference)])
}

/// The name of an AOV.
pub fn aov() -> impl TypedValueParser<Value = Aov> {
    named([("depth", Aov::Depth), ("motion", Aov::Motion), ("density", Aov::Density), ("age", Aov::Age)])
}

/// The name of a camera motion.
pub fn motion() -> impl TypedValueParser<Value = Motion> {
    named(Motion::ALL.map(|m| (m.name(), m)))
}

/// One of a few names, each for a value.
pub fn named<T: Copy + Send + Sync + 'static, const N: usize>(
    values: [(&'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(values.map(|(name, _)| name)).try_map(move |name| {
        values.iter().find(|(known, _)| *known == name).map(|(_, value)| *value).ok_or("an unknown name")
    })
}

/// A method with its number of samples, as `bench` takes it: `stable:0.5`, `supersample:2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Contender {
    /// Samples a pixel to aim at.
    Stable(f32),
    /// Samples a pixel.
    Supersample(u32),
}

impl Contender {
    /// The name that it is told by.
    pub fn name(self) -> String {
        match self {
            Self::Stable(density) => format!("stable:{density}"),
            Self::Supersample(spp) => format!("supersample:{spp}"),
        }
    }
}

impl FromStr for Contender {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, number) = text.split_once(':').unwrap_or((text, "1"));
        match kind {
            "stable" => ranged(0.0625, 16.0)(number).map(|d| Self::Stable(d as f32)),
            "supersample" => counted(1, 16)(number).map(Self::Supersample),
            _ => Err("expected stable:DENSITY or supersample:SAMPLES, such as stable:1".to_owned()),
        }
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
        assert_eq!("stable:0.5".parse(), Ok(Contender::Stable(0.5)));
        assert_eq!("supersample:2".parse(), Ok(Contender::Supersample(2)));
        assert_eq!("stable".parse(), Ok(Contender::Stable(1.0)));
        for wrong in ["stable:0", "supersample:0.5", "reference:1", "stable:", ":1", ""] {
            assert!(wrong.parse::<Contender>().is_err(), "{wrong}");
        }
        assert_eq!(Contender::Stable(0.5).name(), "stable:0.5");
        assert_eq!(Contender::Supersample(2).name(), "supersample:2");
    }
}
