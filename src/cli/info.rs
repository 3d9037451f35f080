//! `stillray info`: what there is to render on, and what a scene holds and needs.

use std::ffi::OsString;

use clap::Args;
use stillray::headless::{Device, DeviceReport, LoadedScene, MemoryRow, Session};
use stillray::renderer::Settings;
use stillray::report::table::{Table, bytes, grouped};
use stillray::scene::Scene;

use super::arguments::size;
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
        let about = format!("{}\n{}", contents(&scene), scenes::requirements(&scene));
        match self.memory(&scene) {
            Ok(memory) => console::print(&format!("{}\n{about}\n{memory}", devices()?)),
            // What the scene holds is known on any machine; that nothing can render it is said after it.
            Err(failure) => console::print(&about).and(Err(failure)),
        }
    }

    /// The memory that a `stable` session takes on a real device.
    fn memory(&self, scene: &Scene) -> Outcome<String> {
        let listener = progress::for_user(self.quiet);
        let device = Device::open(self.device.as_deref())?;
        let loaded = LoadedScene::new(&device, scene, &*listener)?;
        let settings = Settings { size: self.size, ..Settings::default() };
        let rows = Session::new(&device, &loaded, &settings)?.memory();
        Ok(memory_table(&rows, self.size))
    }
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

fn contents(scene: &Scene) -> Table {
    let mut table = Table::new([format!("scene {}", scene.name), String::new()]).left();
    let triangles = |mesh: &stillray::scene::Mesh| mesh.triangles.len() as u64;
    let placed: u64 = scene.instances.iter().map(|i| triangles(&scene.meshes[i.mesh])).sum();
    let texels: u64 = scene.images.iter().map(|i| u64::from(i.width) * u64::from(i.height)).sum();
    let mut count = |what: &str, n: u64| table.row([what.to_owned(), grouped(n)]);
    count("meshes", scene.meshes.len() as u64);
    count("triangles in meshes", scene.meshes.iter().map(triangles).sum());
    count("instances", scene.instances.len() as u64);
    count("triangles in instances", placed);
    count("materials", scene.materials.len() as u64);
    count("textures", scene.textures.len() as u64);
    count("texels in images", texels);
    count("lights", scene.lights.len() as u64);
    count("animated properties", scene.animations.iter().map(|a| a.channels.len() as u64).sum());
    if let Some((low, high)) = scene.bounds(&scene.pose(0.0)) {
        let side = |axis: usize| format!("{:.3} to {:.3} m", low[axis], high[axis]);
        ["x", "y", "z"].iter().enumerate().for_each(|(axis, name)| table.row([(*name).to_owned(), side(axis)]));
    }
    table.row(["cameras".to_owned(), scene.cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ")]);
    table
}

fn memory_table(rows: &[MemoryRow], [width, height]: [u32; 2]) -> String {
    let pixels = f64::from(width) * f64::from(height);
    let mut table = Table::new([format!("memory at {width}x{height}"), "size".into(), "bytes/pixel".into()]);
    let mut line = |what: &str, n: u64| table.row([what.to_owned(), bytes(n), format!("{:.1}", n as f64 / pixels)]);
    rows.iter().for_each(|row| line(&row.purpose, row.bytes));
    line("total", rows.iter().map(|row| row.bytes).sum());
    table.to_string()
}
