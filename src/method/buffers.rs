//! The device memory of a renderer, and what each of two alternating frames binds of it.

use super::SLOTS;
use super::storage::Storage;
use crate::gpu::buffer::check_range;
use crate::gpu::{Buffer, Context, Image, ImageDesc, Place, Range, Resource};
use crate::phase::{
    AovResources, FrameResources, HistoryResources, IndirectResources, Memory, PathResources, SeedResources,
};
use crate::sampler::Sampler;
use crate::settings::{Aov, Sampling, Settings};
use crate::shaders::{Counters, Frame, Instance, Light, PATH_STEPS, PathCounters};
use crate::{Error, Result};
use ash::vk;

/// Buffers and images whose size depends on the frame's.
#[derive(Debug)]
pub struct FrameBuffers {
    storage: Storage,
    size: [u32; 2],
    stable: bool,
    /// Claims, found, lit, shaded, film and motion: see [`super::storage`].
    shared: Buffer,
    film: Option<Buffer>,
    histories: Vec<Buffer>,
    caches: Vec<Buffer>,
    ages: Vec<Buffer>,
    seeds: Vec<Buffer>,
    sampler_table: Option<Buffer>,
    sources: Option<Buffer>,
    reached: Vec<Buffer>,
    counters: Buffer,
    masks: Buffer,
    plan: Buffer,
    tiles: Buffer,
    offsets: Buffer,
    aims: Buffer,
    extras: Buffer,
    frame: Buffer,
    instances: Buffer,
    lights: Buffer,
    previous_corners: Option<Buffer>,
    /// Origins, directions, weights, list and counters.
    paths: Vec<Buffer>,
    /// What diffuse paths bring; what the rays of paths find, and the lights that reach it.
    indirect: Option<[Buffer; 3]>,
    gathered: Vec<Buffer>,
    medium: Option<Buffer>,
    traversals: Option<Buffer>,
    /// The frame.
    pub color: Image,
    /// All of [`Aov::ALL`], or none.
    pub aovs: Vec<Image>,
}

impl FrameBuffers {
    /// Allocates everything, for so many triangles that deform, if that is modelled; the counters and images start cleared.
    ///
    /// # Errors
    /// [`Error::TooLarge`] and [`Error::OutOfMemory`] with what to lower, [`Error::Setting`] for a size beyond what images
    /// of the device can have.
    pub fn new(
        context: &Context,
        settings: &Settings,
        storage: &Storage,
        instances: usize,
        lights: usize,
        deforming: Option<usize>,
    ) -> Result<Self> {
        // All sizes are checked before any memory is asked for.
        check_image(context, settings)?;
        storage.check(u64::from(context.fit().properties.limits.max_storage_buffer_range))?;
        let make = |purpose: &str, size: u64| {
            check_range(context, purpose, size, "use a scene with fewer instances or lights")?;
            Buffer::new(context, purpose, size, Place::Device)
        };
        let many = |purpose: &str, size: u64, count: u64| -> Result<Vec<Buffer>> {
            (0..count).map(|_| make(purpose, size)).collect()
        };
        let buffers = Self {
            storage: *storage,
            size: settings.size,
            stable: settings.method.keeps_samples(),
            shared: Buffer::new(context, "claims; then rays, shading, film", storage.shared, Place::Device)?,
            film: if storage.own_film { Some(make("film", storage.film)?) } else { None },
            histories: many("history", storage.history, storage.histories)?,
            caches: many("sample caches", storage.samples, storage.caches)?,
            ages: many("sample ages", storage.ages, if storage.ages > 0 { storage.caches } else { 0 })?,
            seeds: many("sample seeds", storage.seeds, if storage.seeds > 0 { storage.caches } else { 0 })?,
            sampler_table: if storage.seeds > 0 { Some(sampler_table(context, settings)?) } else { None },
            sources: if storage.sources > 0 { Some(make("sample sources", storage.sources)?) } else { None },
            reached: many("sample changes", storage.memory, if storage.memory > 0 { storage.caches } else { 0 })?,
            counters: make("counters", size_of::<Counters>() as u64)?,
            masks: make("masks and plan", storage.masks)?,
            plan: make("masks and plan", storage.masks)?,
            tiles: make("offsets", storage.tile_sums)?,
            offsets: make("offsets", storage.offsets)?,
            aims: make("aims", storage.aims)?,
            extras: make("offsets", storage.extras)?,
            frame: make("frame constants", size_of::<Frame>() as u64)?,
            instances: make("instances", (instances * size_of::<Instance>()) as u64)?,
            lights: make("lights", (lights * size_of::<Light>()) as u64)?,
            // Something has to be bound where nothing deforms and is modelled all the same.
            previous_corners: deforming
                .map(|triangles| make("previous corners", 36 * triangles.max(1) as u64))
                .transpose()?,
            paths: if storage.paths > 0 {
                let counters = u64::from(PATH_STEPS + 1) * size_of::<PathCounters>() as u64;
                let sizes = [storage.paths, storage.paths, storage.paths, storage.paths / 2, counters];
                sizes.into_iter().map(|size| make("paths", size)).collect::<Result<_>>()?
            } else {
                Vec::new()
            },
            indirect: if storage.gathered > 0 {
                let sizes = [storage.gathered, storage.found, storage.lit];
                let [brought, found, lit] = sizes.map(|size| make("indirect light", size));
                Some([brought?, found?, lit?])
            } else {
                None
            },
            gathered: many("indirect light", storage.gathered, gathered_buffers(storage))?,
            medium: if storage.medium > 0 { Some(make("medium", storage.medium)?) } else { None },
            traversals: if storage.traversals > 0 { Some(make("counters", storage.traversals)?) } else { None },
            color: color_image(context, settings)?,
            aovs: aov_images(context, settings)?,
        };
        buffers.counters.upload(context, 0, bytemuck::bytes_of(&first_counters(storage, buffers.stable)))?;
        Ok(buffers)
    }

    /// The constants, the instances and the list of samples of a slot's last frame.
    pub fn sample_buffers(&self, slot: usize) -> [&Buffer; 3] {
        [&self.frame, &self.instances, &self.caches[slot % self.caches.len()]]
    }

    /// What the frames of a slot bind: the caches swap roles from one to the other.
    pub fn resources(&self, slot: usize) -> FrameResources {
        let shared = |name, offset, size: u64| {
            let size = size.max(16);
            Range { name, offset, size, ..Range::whole(name, &self.shared) }
        };
        let s = &self.storage;
        let offsets = Range::whole("offsets", &self.offsets);
        let cache = |name, slot: usize| Range::whole(name, &self.caches[slot % self.caches.len()]);
        let ages = |name, slot: usize| self.ages.get(slot).map(|buffer| Range::whole(name, buffer));
        FrameResources {
            size: self.size,
            frame: Range::whole("frame", &self.frame),
            instances: Range::whole("instances", &self.instances),
            lights: Range::whole("lights", &self.lights),
            counters: Range::whole("counters", &self.counters),
            previous: cache("previous samples", SLOTS - 1 - slot),
            samples: cache("samples", slot),
            previous_ages: ages("previous ages", SLOTS - 1 - slot),
            ages: ages("ages", slot),
            sources: self.sources.as_ref().map(|b| Range::whole("sources", b)),
            memory: self.memory(slot),
            seeds: self.seeds(slot),
            paths: self.path_resources(shared("found", 0, s.found), shared("lit", s.found, s.lit)),
            indirect: self.indirect_resources(slot),
            previous_corners: self.previous_corners.as_ref().map(|b| Range::whole("previous corners", b)),
            medium: self.medium.as_ref().map(|b| Range::whole("medium", b)),
            traversals: self.traversals.as_ref().map(|b| Range::whole("traversals", b)),
            claims: shared("claims", 0, s.claims),
            masks: Range::whole("masks", &self.masks),
            plan: Range::whole("plan", &self.plan),
            tiles: Range::whole("tiles", &self.tiles),
            offsets,
            aims: Range::whole("aims", &self.aims),
            // Never read without a fill; but something has to be bound.
            extras: if s.extras > 0 { Range::whole("extras", &self.extras) } else { offsets },
            found: shared("found", 0, s.found),
            lit: shared("lit", s.found, s.lit),
            shaded: shared("shaded", s.shaded_offset, s.shaded),
            film: self.film.as_ref().map_or_else(|| shared("film", 0, s.film), |film| Range::whole("film", film)),
            history: self.history_resources(slot),
            color: Resource::storage("color", &self.color),
            aovs: self.aov_resources(),
        }
    }

    fn history_resources(&self, slot: usize) -> Option<HistoryResources> {
        let s = &self.storage;
        match &self.histories[..] {
            [] => None,
            [frames] => Some(HistoryResources::Frames(Range::whole("history", frames))),
            pictures => Some(HistoryResources::Integrated {
                motion: Range {
                    name: "motion",
                    offset: s.film,
                    size: s.motion,
                    ..Range::whole("motion", &self.shared)
                },
                previous: Range::whole("previous history", &pictures[SLOTS - 1 - slot]),
                current: Range::whole("history", &pictures[slot]),
            }),
        }
    }

    fn seeds(&self, slot: usize) -> Option<SeedResources> {
        let seeds = |name, slot: usize| Some(Range::whole(name, self.seeds.get(slot % self.seeds.len().max(1))?));
        Some(SeedResources {
            previous: seeds("previous seeds", SLOTS - 1 - slot)?,
            now: seeds("seeds", slot)?,
            table: Range::whole("sampler table", self.sampler_table.as_ref()?),
        })
    }

    /// What is found on the way takes the place of what the camera saw, unless diffuse paths start from there later.
    fn path_resources(&self, found: Range, lit: Range) -> Option<PathResources> {
        let own = self.indirect.as_ref();
        let [found, lit] = own
            .map_or([found, lit], |[_, found, lit]| [Range::whole("path found", found), Range::whole("path lit", lit)]);
        let [origins, directions, weights, list, counters] = &self.paths[..] else { return None };
        Some(PathResources {
            origins: Range::whole("path origins", origins),
            directions: Range::whole("path directions", directions),
            weights: Range::whole("path weights", weights),
            list: Range::whole("path list", list),
            counters: Range::whole("path counters", counters),
            found,
            lit,
        })
    }

    fn indirect_resources(&self, slot: usize) -> Option<IndirectResources> {
        let [brought, ..] = self.indirect.as_ref()?;
        let (now, then) = (self.gathered.get(slot % self.gathered.len().max(1))?, self.gathered.get(SLOTS - 1 - slot));
        let kept = self.gathered.len() == SLOTS;
        Some(IndirectResources {
            previous: then.filter(|_| kept).map(|b| Range::whole("previous gathered", b)),
            gathered: Range::whole("gathered", now),
            brought: Range::whole("brought", brought),
        })
    }

    fn memory(&self, slot: usize) -> Option<Memory> {
        let reached = |name, slot: usize| Some(Range::whole(name, self.reached.get(slot)?));
        Some(Memory {
            sources: Range::whole("sources", self.sources.as_ref()?),
            previous_reached: reached("previous reached", SLOTS - 1 - slot)?,
            reached: reached("reached", slot)?,
        })
    }

    fn aov_resources(&self) -> Option<AovResources> {
        let image = |aov: Aov| {
            let index = Aov::ALL.iter().position(|a| *a == aov)?;
            Some(Resource::storage(aov.name(), self.aovs.get(index)?))
        };
        Some(AovResources {
            depth: image(Aov::Depth)?,
            motion: image(Aov::Motion)?,
            density: image(Aov::Density)?,
            age: image(Aov::Age)?,
            changes: image(Aov::Changes)?,
        })
    }
}

/// Means live from frame to frame where samples do.
fn gathered_buffers(storage: &Storage) -> u64 {
    match storage.sampling {
        _ if storage.gathered == 0 => 0,
        Sampling::Reprojected => SLOTS as u64,
        Sampling::Fresh | Sampling::Tracked => 1,
    }
}

/// Where samples lie on lenses and lights: as many as a pixel has cooperate.
fn sampler_table(context: &Context, settings: &Settings) -> Result<Buffer> {
    let count = match settings.method.sampling() {
        Sampling::Reprojected => settings.density.ceil() as u32,
        Sampling::Fresh => settings.spp,
        Sampling::Tracked => 1,
    };
    let table = Sampler::new(settings.sampler, settings.tiling, count, settings.seed).table();
    Buffer::with_data(context, "sampler table", bytemuck::cast_slice(&table), "choose another sampler")
}

/// An empty cache; or, where every pixel has the same samples, the full list with its dispatch.
fn first_counters(storage: &Storage, stable: bool) -> Counters {
    if stable {
        return Counters { trace_z: 1, trace_y: 1, ..Counters::default() };
    }
    let groups = storage.capacity.div_ceil(64) as u32;
    Counters {
        trace_x: groups.min(32768),
        trace_y: groups.div_ceil(32768),
        trace_z: 1,
        samples: storage.capacity as u32,
        ..Counters::default()
    }
}

fn check_image(context: &Context, settings: &Settings) -> Result<()> {
    let most = context.fit().properties.limits.max_image_dimension2_d;
    let [width, height] = settings.size;
    if width.max(height) <= most {
        return Ok(());
    }
    let expected = format!("at most {most}x{most} on this device (maxImageDimension2D)");
    Err(Error::Setting { name: "size", value: format!("{width}x{height}"), expected })
}

fn color_image(context: &Context, settings: &Settings) -> Result<Image> {
    let format = if settings.float_output { vk::Format::R32G32B32A32_SFLOAT } else { vk::Format::R16G16B16A16_SFLOAT };
    storage_image(context, settings, "colour image", format)
}

fn aov_images(context: &Context, settings: &Settings) -> Result<Vec<Image>> {
    if settings.aovs.is_empty() {
        return Ok(Vec::new());
    }
    Aov::ALL.iter().map(|aov| storage_image(context, settings, "AOV images", aov.format())).collect()
}

fn storage_image(context: &Context, settings: &Settings, purpose: &str, format: vk::Format) -> Result<Image> {
    let usage = vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::SAMPLED;
    let desc = ImageDesc { format, extent: settings.size, layers: 1, array: false, usage };
    let image = Image::new(context, purpose, desc)?;
    image.clear(context)?;
    Ok(image)
}
