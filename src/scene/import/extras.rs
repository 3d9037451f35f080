//! What glTF has no words for: `extras.stillray` of cameras, materials, punctual lights and scenes.
//!
//! ```json
//! "cameras": [{ ..., "extras": { "stillray": { "aperture": 0.05, "focus": 4.0, "blades": 6, "shutter": 0.5 } } }]
//! "materials": [{ ..., "extras": { "stillray": { "exponent": 2048 } } }]
//! "lights": [{ ..., "extras": { "stillray": { "shape": "rectangle", "width": 1.2, "height": 0.6 } } }]
//! "scenes": [{ ..., "extras": { "stillray": { "environment": { "file": "sky.exr", "scale": 1.0, "turn": 90 } } } }]
//! "scenes": [{ ..., "extras": { "stillray": { "medium": { "scattering": [0.1, 0.1, 0.12], "absorption": 0.01, "anisotropy": 0.3,
//!     "box": [[-9, 0, -9], [9, 2, 9]], "noise": { "amplitude": 0.5, "size": 6, "drift": [0.2, 0, 0] } } } } }]
//! ```
//!
//! Coefficients of a medium are 1/metre, one number or three; without a box it is everywhere. Lengths are metres; the sizes of directional lights are degrees of the sky, and so is the turn of a map about +Y. A key that is not known is refused, as is a
//! value out of range: both are most likely mistakes.

use std::path::Path;

use glam::DVec3;
use serde_json::{Map, Value};

use super::document::Document;
use crate::Result;
use crate::scene::medium::{DENSEST, FARTHEST, Medium, Mist, Region};
use crate::scene::{EnvironmentMap, Lens, LightKind, LightShape, Scene};

/// The lens of a camera, and its shutter.
pub(super) fn camera(document: &Document, camera: usize) -> Result<(Lens, f64)> {
    let Some(extras) = Extras::of(document, &["cameras"], camera)? else { return Ok((Lens::PINHOLE, 0.0)) };
    extras.only(&["aperture", "focus", "blades", "shutter"])?;
    let aperture = extras.number("aperture", "at least 0, in metres", |n| n >= 0.0)?.unwrap_or(0.0);
    let focus = extras.number("focus", "above 0, in metres", |n| n > 0.0)?.unwrap_or(f64::INFINITY);
    let is_blades = |n: f64| n == 0.0 || (n.fract() == 0.0 && (3.0..=16.0).contains(&n));
    let blades = extras.number("blades", "0 or a whole number from 3 to 16", is_blades)?.unwrap_or(0.0);
    let shutter = extras.number("shutter", "from 0 to 1, in frames", |n| (0.0..=1.0).contains(&n))?.unwrap_or(0.0);
    Ok((Lens { aperture, focus, blades: blades as u32 }, shutter))
}

/// Exponent of a material's Phong lobe; 0 if it has none.
pub(super) fn exponent(document: &Document, material: usize) -> Result<f32> {
    let Some(extras) = Extras::of(document, &["materials"], material)? else { return Ok(0.0) };
    extras.only(&["exponent"])?;
    let exponent = extras.number("exponent", "from 1 to 1000000", |n| (1.0..=1e6).contains(&n))?;
    Ok(exponent.unwrap_or(0.0) as f32)
}

/// The extent of a punctual light.
pub(super) fn light_shape(document: &Document, light: usize, kind: LightKind) -> Result<LightShape> {
    let path = ["extensions", "KHR_lights_punctual", "lights"];
    let Some(extras) = Extras::of(document, &path, light)? else { return Ok(LightShape::Sharp) };
    extras.only(&["shape", "width", "height"])?;
    let directional = kind == LightKind::Directional;
    let (range, most) =
        if directional { ("from 0 to 90, in degrees", 90.0) } else { ("at least 0, in metres", f64::from(f32::MAX)) };
    let side = |key| extras.number(key, range, |n| (0.0..=most).contains(&n));
    let width = side("width")?.unwrap_or(0.0);
    let height = side("height")?.unwrap_or(width);
    let size = [width, height].map(|n| (if directional { n.to_radians() } else { n }) as f32);
    match extras.entries.get("shape").and_then(Value::as_str) {
        Some("rectangle") => Ok(LightShape::Rectangle(size)),
        Some("disc") => Ok(LightShape::Disc(size)),
        _ => Err(extras.bad("shape", "\"rectangle\" or \"disc\"")),
    }
}

/// Light from all around, and a medium, of the file's scene `wanted`, or the default one.
pub(super) fn environment(document: &Document, wanted: Option<usize>, scene: &mut Scene) -> Result<()> {
    let index = wanted.or(document.root.scene.map(|scene| scene.value())).unwrap_or(0);
    let Some(extras) = Extras::of(document, &["scenes"], index)? else { return Ok(()) };
    extras.only(&["environment", "medium"])?;
    scene.medium = extras.object("medium")?.map(|medium| self::medium(&medium)).transpose()?;
    let Some(map) = extras.object("environment")? else { return Ok(()) };
    map.only(&["file", "scale", "turn"])?;
    let Some(file) = map.entries.get("file").and_then(Value::as_str) else {
        return Err(map.bad("file", "the path of an OpenEXR picture"));
    };
    let most = f64::from(f32::MAX);
    let scale = map.number("scale", "at least 0", |n| (0.0..=most).contains(&n))?.unwrap_or(1.0);
    let turn = map.number("turn", "from -360 to 360, in degrees", |n| n.abs() <= 360.0)?.unwrap_or(0.0);
    let bytes = document.resolve(file, &format!("{}.file", map.place))?;
    let name = if file.starts_with("data:") { "environment" } else { file };
    let read = super::environment::decode(&bytes, Path::new(name), name.to_owned(), &mut scene.notices);
    let read = read.map_err(|error| document.bad(format!("{}.file: {error}", map.place)))?;
    scene.environment_map = Some(EnvironmentMap { scale: scale as f32, turn: turn.to_radians(), ..read });
    Ok(())
}

/// Fog or mist.
fn medium(extras: &Extras<'_>) -> Result<Medium> {
    extras.only(&["scattering", "absorption", "anisotropy", "box", "noise"])?;
    let densest = f64::from(DENSEST);
    let coefficients = |key| {
        let expected = "one number or three, from 0 to 1e9, in 1/metre";
        Ok(extras.vector(key, expected, |n| (0.0..=densest).contains(&n))?.unwrap_or_default().as_vec3())
    };
    // Also as a float it is not 1.
    let anisotropic = |g: f64| (g as f32).abs() < 1.0;
    let anisotropy = extras.number("anisotropy", "above -1 and below 1", anisotropic)?.unwrap_or(0.0) as f32;
    let region = if extras.entries.contains_key("box") { Region::Mist(mist(extras)?) } else { Region::Everywhere };
    if region == Region::Everywhere && extras.entries.contains_key("noise") {
        return Err(extras.bad("box", "a box for the noise to be in"));
    }
    Ok(Medium { scattering: coefficients("scattering")?, absorption: coefficients("absorption")?, anisotropy, region })
}

/// Mist in a box.
fn mist(extras: &Extras<'_>) -> Result<Mist> {
    let corners = "two corners in metres within 1e9 of 0, the lowest and then the highest";
    let list = extras.entries.get("box").and_then(Value::as_array).filter(|list| list.len() == 2);
    let corner = |i: usize| triple(&list?[i]).filter(|p| p.abs().max_element() <= FARTHEST);
    let (Some(low), Some(high)) = (corner(0), corner(1)) else { return Err(extras.bad("box", corners)) };
    if !low.cmplt(high).all() {
        return Err(extras.bad("box", corners));
    }
    let still = Mist { low, high, amplitude: 0.0, size: 1.0, drift: DVec3::ZERO };
    let Some(noise) = extras.object("noise")? else { return Ok(still) };
    noise.only(&["amplitude", "size", "drift"])?;
    let amplitude = noise.number("amplitude", "from 0 to 1e9, in metres", |n| (0.0..=FARTHEST).contains(&n))?;
    let size = noise.number("size", "from 0.001 to 1e9, in metres", |n| (1e-3..=FARTHEST).contains(&n))?;
    let drift = noise.vector("drift", "three numbers within 1e9 of 0, in metres a second", |n| n.abs() <= FARTHEST)?;
    Ok(Mist {
        amplitude: amplitude.unwrap_or(0.0),
        size: size.unwrap_or(1.0),
        drift: drift.unwrap_or_default(),
        ..still
    })
}

/// Three finite numbers.
fn triple(value: &Value) -> Option<DVec3> {
    let numbers: Vec<f64> = value.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    let triple: [f64; 3] = numbers.try_into().ok()?;
    Some(DVec3::from(triple)).filter(|v| v.is_finite())
}

/// `extras.stillray` of an element of the file.
struct Extras<'a> {
    document: &'a Document,
    place: String,
    entries: &'a Map<String, Value>,
}

impl<'a> Extras<'a> {
    /// Of element `index` of the array at a path; none if it has none.
    fn of(document: &'a Document, path: &[&str], index: usize) -> Result<Option<Self>> {
        let array = path.iter().try_fold(&document.tree, |tree, key| tree.get(key));
        let element = array.and_then(|array| array.get(index));
        let Some(ours) = element.and_then(|e| e.get("extras")?.get("stillray")) else { return Ok(None) };
        let place = format!("{}[{index}].extras.stillray", path.last().copied().unwrap_or_default());
        match ours.as_object() {
            Some(entries) => Ok(Some(Self { document, place, entries })),
            None => Err(document.bad(format!("{place} is {ours}; expected an object"))),
        }
    }

    fn bad(&self, key: &str, expected: &str) -> crate::Error {
        let found = self.entries.get(key).map_or_else(|| "missing".to_owned(), Value::to_string);
        self.document.bad(format!("{}.{key} is {found}; expected {expected}", self.place))
    }

    fn only(&self, known: &[&str]) -> Result<()> {
        match self.entries.keys().find(|key| !known.contains(&key.as_str())) {
            Some(key) => Err(self.bad(key, &format!("only the keys {}", known.join(", ")))),
            None => Ok(()),
        }
    }

    /// An object in the object.
    fn object(&self, key: &str) -> Result<Option<Self>> {
        let Some(value) = self.entries.get(key) else { return Ok(None) };
        let entries = value.as_object().ok_or_else(|| self.bad(key, "an object"))?;
        Ok(Some(Self { document: self.document, place: format!("{}.{key}", self.place), entries }))
    }

    /// Three numbers, or one for all three.
    fn vector(&self, key: &str, expected: &str, allowed: impl Fn(f64) -> bool) -> Result<Option<DVec3>> {
        let Some(value) = self.entries.get(key) else { return Ok(None) };
        let vector = triple(value).or_else(|| value.as_f64().filter(|n| n.is_finite()).map(DVec3::splat));
        let vector = vector.filter(|v| v.to_array().into_iter().all(allowed));
        vector.map(Some).ok_or_else(|| self.bad(key, expected))
    }

    fn number(&self, key: &str, expected: &str, allowed: impl Fn(f64) -> bool) -> Result<Option<f64>> {
        let Some(value) = self.entries.get(key) else { return Ok(None) };
        let number = value.as_f64().filter(|n| n.is_finite() && allowed(*n));
        number.map(Some).ok_or_else(|| self.bad(key, expected))
    }
}
