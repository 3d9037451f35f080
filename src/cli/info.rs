//! `stillray info`: what there is to render on, and what a scene holds and needs.

use std::collections::BTreeMap;
use std::ffi::OsString;

use clap::Args;
use stillray::headless::{Device, DeviceReport, LoadedScene, MemoryRow, Session};
use stillray::method::model::Model;
use stillray::renderer::Settings;
use stillray::report::table::{Table, bytes, grouped};
use stillray::scene::Scene;
use stillray::scene::requirements::{Contents, Requirements, inspect};
use stillray::settings::Modelling;

use super::arguments::{modelling, size};
use super::{Outcome, console, progress, scenes};

/// List the devices and why each fits or not; of a scene, what it holds and what it needs
#[derive(Debug, Args)]
pub struct Info {
    /// A .gltf or .glb file, or builtin:NAME
    #[arg(value_name = "SCENE")]
    scene: Option<OsString>,
    /// Width and height in pixels that the memory table is for, each from 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size)]
    size: [u32; 2],
    /// The device that the memory table is for [default: the best one]
    #[arg(long, value_name = "X")]
    device: Option<String>,
    /// Seed of built-in scenes
    #[arg(long, value_name = "S", default_value = "0", allow_negative_numbers = true)]
    seed: u32,
    /// What is modelled: what the scene requires, or everything that a scene may require
    #[arg(long, value_name = "WHAT", default_value = "required", value_parser = modelling())]
    model: Modelling,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

impl Info {
    /// Prints.
    pub fn run(self) -> Outcome {
        let Some(spec) = &self.scene else {
            return console::print(&format!("{}\n{}", devices()?, scenes::list()));
        };
        let scene = scenes::load(spec, self.seed)?;
        console::notes(&scene.notices);
        let found = inspect(&scene);
        let model = Model::of(&found, &self.settings());
        let about = format!("{}\n{}\n{}", contents(&scene, &found.contents), features(&found), parts(&model));
        match self.memory(&scene) {
            Ok(memory) => console::print(&format!("{}\n{about}\n{memory}", devices()?)),
            // What the scene holds is known on any machine; that nothing can render it is said after it.
            Err(failure) => console::print(&about).and(Err(failure)),
        }
    }

    fn settings(&self) -> Settings {
        Settings { size: self.size, modelling: self.model, ..Settings::default() }
    }

    /// The memory that the scene and a `stable` session at 1 sample a pixel take on a real device.
    fn memory(&self, scene: &Scene) -> Outcome<String> {
        let listener = progress::for_user(self.quiet);
        let device = Device::open(self.device.as_deref())?;
        let loaded = LoadedScene::new(&device, scene, &*listener)?;
        let scene_alone: BTreeMap<String, u64> = device.context().memory_table().into_iter().collect();
        let session = Session::new(&device, &loaded, &self.settings())?;
        Ok(memory_table(&session.memory(), &scene_alone, self.size))
    }
}

fn parts(model: &Model) -> Table {
    let mut table = Table::new(["a frame models", "at the price of", "because of"]).left();
    for part in &model.parts {
        let cause = part.cause.clone().unwrap_or_else(|| "nothing: left out".to_owned());
        table.row([part.name.to_owned(), part.price.to_owned(), cause]);
    }
    table
}

fn devices() -> Outcome<String> {
    let mut table = Table::new(["device", "kind", "Vulkan", "driver", "fits"]).left();
    for device in Device::list()? {
        let DeviceReport { index, name, kind, driver, api, rejected } = device;
        let fits = if rejected.is_empty() { "yes".to_owned() } else { format!("no: {}", rejected.join("; ")) };
        table.row([format!("{index}: {name}"), kind.to_owned(), api, driver, fits]);
    }
    Ok(table.to_string())
}

fn contents(scene: &Scene, found: &Contents) -> Table {
    let mut table = Table::new([format!("scene {}", scene.name), String::new()]).left();
    let mut triangles = grouped(found.triangles as u64);
    if found.instanced_triangles != found.triangles {
        triangles += &format!(", {} with instances", grouped(found.instanced_triangles as u64));
    }
    table.row(["triangles".to_owned(), triangles]);
    let counts = [
        ("vertices", found.vertices),
        ("meshes", found.meshes),
        ("instances", found.instances),
        ("nodes", found.nodes),
        ("materials", found.materials),
        ("textures", found.textures),
        ("texels", found.texels),
        ("lights", found.lights),
    ];
    counts.iter().for_each(|(what, n)| table.row([(*what).to_owned(), grouped(*n as u64)]));
    let seconds = if found.animations > 0 { format!(", {:.2} s", found.duration) } else { String::new() };
    table.row(["animations".to_owned(), format!("{}{seconds}", found.animations)]);
    let cameras: Vec<&str> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    table.row(["cameras".to_owned(), cameras.join(", ")]);
    if let Some((low, high)) = scene.bounds(&scene.pose(0.0)) {
        let side = |axis: usize| format!("{:.3} to {:.3} m", low[axis], high[axis]);
        ["x", "y", "z"].iter().enumerate().for_each(|(axis, name)| table.row([(*name).to_owned(), side(axis)]));
    }
    table
}

/// What the scene uses, and for whose sake.
fn features(found: &Requirements) -> Table {
    let mut table = Table::new(["the scene uses", "for"]).left();
    for requirement in &found.features {
        // The name that JSON has for it, in words.
        let name = serde_json::to_value(requirement.feature).unwrap_or_default();
        table.row([name.as_str().unwrap_or_default().replace('-', " "), requirement.cause.clone()]);
    }
    table
}

/// Only what the session adds to the scene's memory grows with the pixels.
fn memory_table(rows: &[MemoryRow], scene: &BTreeMap<String, u64>, [width, height]: [u32; 2]) -> String {
    let pixels = f64::from(width) * f64::from(height);
    let mut table = Table::new([format!("memory at {width}x{height}, density 1"), "size".into(), "bytes/pixel".into()]);
    let mut line = |what: &str, size: u64, session: u64| {
        let share = if session > 0 { format!("{:.1}", session as f64 / pixels) } else { "-".to_owned() };
        table.row([what.to_owned(), bytes(size), share]);
    };
    let mut session_total = 0;
    for row in rows {
        let session = row.bytes.saturating_sub(scene.get(&row.purpose).copied().unwrap_or(0));
        session_total += session;
        line(&row.purpose, row.bytes, session);
    }
    line("total", rows.iter().map(|row| row.bytes).sum(), session_total);
    table.to_string()
}
