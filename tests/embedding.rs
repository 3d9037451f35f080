//! A host can embed the renderer: its handles stay its own, sizes and errors leave everything usable, recording allocates
//! nothing, two frames may be in flight, and nothing is left behind.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use ash::vk;
use std::ffi::{CStr, c_char};
use std::sync::OnceLock;
use stillray::Error;
use stillray::gpu::pass::Work;
use stillray::gpu::{Buffer, Context, HostHandles, Place, fit};
use stillray::renderer::{Aov, FrameInputs, FrameOutputs, Method, Renderer, Settings, Ticket};
use stillray::scene::motion::Motion;
use stillray::scene::{Pose, Scene, View};
use stillray::settings::History;
use stillray::shaders::Kind;
use support::host::Host;
use support::rig::{Rig, load};

fn settings(size: [u32; 2]) -> Settings {
    Settings { size, float_output: true, ..Settings::default() }
}

fn view(scene: &Scene, index: u32) -> View {
    let pose = scene.pose(0.0);
    let (low, high) = scene.bounds(&pose).unwrap();
    let (middle, radius) = ((low + high) * 0.5, (high - low).length() * 0.5);
    Motion::Orbit.view(&pose.cameras[0], middle, radius, f64::from(index) / 30.0)
}

/// A host that renders one scene into command buffers of its own.
struct Engine<'a> {
    host: &'a Host,
    context: Context,
    scene: Scene,
    pose: Pose,
}

impl<'a> Engine<'a> {
    fn new(host: &'a Host, scene: &str) -> Self {
        let scene = load(scene);
        let pose = scene.pose(0.0);
        Self { host, context: host.adopted(), scene, pose }
    }

    fn renderer(&self, settings: &Settings) -> Renderer {
        Renderer::new(&self.context, &self.scene, settings).unwrap()
    }

    /// Where frames of this renderer are read back to.
    fn target(&self, renderer: &Renderer) -> Buffer {
        let [width, height] = renderer.settings().size;
        Buffer::new(&self.context, "host's own", 16 * u64::from(width * height), Place::Readback).unwrap()
    }

    /// Records a frame, copies it and submits both.
    fn submit(&self, renderer: &mut Renderer, index: u32, target: &Buffer) -> (vk::Fence, FrameOutputs) {
        let inputs = FrameInputs { view: view(&self.scene, index), pose: &self.pose, reset: false };
        let commands = self.host.begin();
        // SAFETY: the command buffer is the host's and recording; callers wait for the frame before the last.
        let outputs = unsafe { renderer.record(commands, &inputs) }.unwrap();
        // SAFETY: the host's command buffer is recording; the target holds the image and is waited for.
        unsafe { renderer.color().record_copy(commands, target) };
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COPY)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the command buffer is recording.
        unsafe { self.host.device.cmd_pipeline_barrier2(commands, &info) };
        (self.host.submit(commands), outputs)
    }

    /// Renders a frame, waits, and reads it.
    fn frame(&self, renderer: &mut Renderer, index: u32) -> (Vec<u8>, Ticket) {
        let target = self.target(renderer);
        let (fence, outputs) = self.submit(renderer, index, &target);
        self.host.wait(fence);
        (target.bytes().to_vec(), outputs.ticket)
    }

    fn frames(&self, renderer: &mut Renderer, indices: std::ops::Range<u32>) -> Vec<Vec<u8>> {
        indices.map(|i| self.frame(renderer, i).0).collect()
    }
}

fn assert_finite(image: &[u8]) {
    let values = || image.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()));
    assert!(values().all(f32::is_finite) && values().any(|v| v > 0.0 && v != 1.0), "an image with something in it");
}

#[test]
fn what_a_host_lends_stays_its_own() {
    let host = Host::new();
    let engine = Engine::new(&host, "builtin:cornell");
    let mut renderer = engine.renderer(&settings([24, 16]));
    assert_finite(&engine.frame(&mut renderer, 0).0);
    drop(renderer);
    drop(engine);
    // The host goes on: adopts once more, submits once more, and then destroys what is its own.
    let engine = Engine::new(&host, "builtin:cornell");
    assert_finite(&engine.frame(&mut engine.renderer(&settings([24, 16])), 0).0);
    drop(engine);
    host.wait(host.submit(host.begin()));
    host.close_clean();
}

#[test]
fn what_leaks_is_heard_of() {
    let host = Host::new();
    // SAFETY: the device is alive. The fence is leaked on purpose.
    unsafe { host.device.create_fence(&vk::FenceCreateInfo::default(), None) }.unwrap();
    let messages = host.close();
    assert!(messages.iter().any(|m| m.contains("VK_OBJECT_TYPE_FENCE")), "{messages:?}");
}

#[test]
fn recording_allocates_nothing_and_two_frames_in_flight_change_nothing() {
    two_in_flight(&settings([40, 30]));
}

#[test]
fn two_frames_in_flight_share_the_history() {
    two_in_flight(&Settings { method: Method::StableTi, ..settings([40, 30]) });
    two_in_flight(&Settings { box_frames: 3, ..settings([40, 30]) });
}

fn two_in_flight(settings: &Settings) {
    let host = Host::new();
    let engine = Engine::new(&host, "builtin:spheres");
    let alone = engine.frames(&mut engine.renderer(settings), 0..10);
    assert!(alone.windows(2).all(|w| w[0] != w[1]), "the camera moves");

    let mut renderer = engine.renderer(settings);
    let targets: Vec<Buffer> = (0..10).map(|_| engine.target(&renderer)).collect();
    let before = engine.context.memory_table();
    let mut flying: Option<vk::Fence> = None;
    let mut tickets = Vec::new();
    for (index, target) in (0..).zip(&targets) {
        let (fence, outputs) = engine.submit(&mut renderer, index, target);
        if let Some(earlier) = flying.replace(fence) {
            host.wait(earlier);
        }
        tickets.push(outputs.ticket);
    }
    host.wait(flying.unwrap());
    assert_eq!(engine.context.memory_table(), before, "device memory by purpose");
    for (index, (together, alone)) in targets.iter().zip(&alone).enumerate() {
        assert!(together.bytes() == alone, "frame {index} differs");
        assert_finite(alone);
    }
    let known: Vec<bool> = tickets.iter().map(|t| renderer.stats(*t).is_some()).collect();
    assert_eq!(known, [[false; 8].as_slice(), &[true; 2]].concat(), "all but the last two tickets are spent");
    assert!(renderer.phase_times(tickets[7]).is_empty() && !renderer.phase_times(tickets[8]).is_empty());
    assert!(renderer.stats(tickets[9]).unwrap().reused > 0);
    drop((renderer, targets, engine));
    host.close_clean();
}

#[test]
fn a_resized_renderer_is_a_new_one() {
    let host = Host::new();
    for (method, box_frames) in [(Method::Stable, 1), (Method::StableTi, 1), (Method::Supersample, 3)] {
        resized_again_and_again(&host, |size| Settings { method, box_frames, ..settings(size) });
    }
    host.close_clean();
}

fn resized_again_and_again(host: &Host, settings: impl Fn([u32; 2]) -> Settings) {
    let engine = Engine::new(host, "builtin:cornell");
    let mut renderer = engine.renderer(&settings([32, 24]));
    let mut ticket = engine.frame(&mut renderer, 0).1;
    for size in [[48, 40], [9, 5], [1, 1], [1, 67], [61, 1], [37, 29]] {
        assert!(renderer.stats(ticket).is_some());
        renderer.resize(size).unwrap();
        assert!(renderer.stats(ticket).is_none() && renderer.phase_times(ticket).is_empty(), "spent by the resize");
        let resized = engine.frames(&mut renderer, 3..6);
        let fresh = engine.frames(&mut engine.renderer(&settings(size)), 3..6);
        assert!(resized == fresh, "{size:?}");
        ticket = engine.frame(&mut renderer, 6).1;
    }
    drop(renderer);
    let left: u64 = engine.context.memory_table().values().sum();
    assert_eq!(left, 0, "{:?}", engine.context.memory_table());
}

#[test]
fn what_fails_leaves_everything_as_it_was() {
    let host = Host::new();
    let engine = Engine::new(&host, "builtin:cornell");
    let size = [24, 16];
    let expected = engine.frames(&mut engine.renderer(&settings(size)), 0..4);
    let mut renderer = engine.renderer(&settings(size));
    let mut got = engine.frames(&mut renderer, 0..2);
    let before = engine.context.memory_table();

    assert!(matches!(renderer.resize([0, 5]), Err(Error::Setting { name: "size", .. })));
    assert!(matches!(renderer.resize([16384, 16384]), Err(Error::TooLarge { .. } | Error::Setting { .. })));
    let large = Renderer::new(&engine.context, &engine.scene, &settings([16384, 16384]));
    assert!(matches!(large, Err(Error::TooLarge { .. } | Error::Setting { .. })));
    let empty = Pose::default();
    let commands = host.begin();
    for pose in [&empty, &engine.pose] {
        let view = View { yfov: f64::NAN, ..view(&engine.scene, 9) };
        // SAFETY: the command buffer is recording, and no frame is in flight.
        let refused = unsafe { renderer.record(commands, &FrameInputs { view, pose, reset: true }) };
        assert!(matches!(refused, Err(Error::Setting { .. })));
    }
    host.wait(host.submit(commands));

    assert_eq!(engine.context.memory_table(), before);
    assert_eq!(renderer.settings().size, size);
    got.extend(engine.frames(&mut renderer, 2..4));
    assert!(got == expected, "the frames that follow are those of an undisturbed run");
    drop((renderer, engine));
    host.close_clean();
}

#[test]
fn wrong_inputs_are_refused_by_name() {
    let rig = Rig::new(load("builtin:cornell"));
    let mut session = rig.session(&Settings { size: [8, 8], aovs: vec![Aov::Depth], ..Settings::default() });
    let pose = rig.scene.pose(0.0);
    let good = FrameInputs { view: pose.cameras[0], pose: &pose, reset: false };
    session.frame(&good).unwrap();
    assert_eq!(session.aov(Aov::Depth).unwrap().data.len(), 64);
    assert!(matches!(session.aov(Aov::Motion), Err(Error::Setting { name: "aov", .. })));

    let mut one_more = pose.clone();
    one_more.instances.push(pose.instances[0]);
    let mut dark = pose.clone();
    dark.lights.clear();
    let mut lost = pose.clone();
    lost.instances[0].translation.x = f64::NAN;
    let mut thrown = pose.clone();
    thrown.lights[0].position.y = f64::INFINITY;
    for (bad, says) in [(one_more, "instances"), (dark, "0 lights"), (lost, "instance 0"), (thrown, "light 0")] {
        let error = session.frame(&FrameInputs { pose: &bad, ..good }).unwrap_err();
        assert!(matches!(error, Error::Setting { name: "pose", .. }) && error.to_string().contains(says), "{error}");
    }
    for yfov in [0.0, -0.5, std::f64::consts::PI, f64::NAN, f64::INFINITY] {
        let view = View { yfov, ..good.view };
        let error = session.frame(&FrameInputs { view, ..good }).unwrap_err();
        assert!(matches!(error, Error::Setting { name: "view", .. }), "{error}");
    }
    let mut view = good.view;
    view.position.z = f64::NAN;
    assert!(session.frame(&FrameInputs { view, ..good }).is_err());
    session.frame(&good).unwrap();
    rig.assert_clean();
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let good = Settings { size: [8, 8], ..Settings::default() };
    good.validate().unwrap();
    let mut bad = Vec::new();
    for value in [f32::NAN, f32::INFINITY, -1.0, 0.0, 1.1] {
        bad.push(("history.alpha", Settings { history: History { alpha: value, ..good.history }, ..good.clone() }));
    }
    for value in [f32::NAN, f32::INFINITY, -1.0, 16.1] {
        bad.push(("history.clamp", Settings { history: History { clamp: value, ..good.history }, ..good.clone() }));
    }
    bad.extend([0, 4].map(|frames| ("box_frames", Settings { box_frames: frames, ..good.clone() })));
    for value in [f32::NAN, f32::INFINITY, -1.0, 0.0, 0.0624, 16.1] {
        bad.push(("density", Settings { density: value, ..good.clone() }));
        bad.push(("tolerance", Settings { tolerance: value, ..good.clone() }));
    }
    bad.extend([0, 17, u32::MAX].map(|spp| ("spp", Settings { spp, ..good.clone() })));
    bad.extend([[0, 8], [8, 0], [16385, 1], [u32::MAX; 2]].map(|size| ("size", Settings { size, ..good.clone() })));
    let rig = Rig::new(load("builtin:cornell"));
    let before = rig.device.context().memory_table();
    for (expected, settings) in &bad {
        match Renderer::new(rig.device.context(), &rig.scene, settings) {
            Err(Error::Setting { name, .. }) => assert_eq!(name, *expected),
            other => panic!("{settings:?}: {other:?}"),
        }
    }
    assert_eq!(rig.device.context().memory_table(), before);
    rig.assert_clean();
}

#[test]
fn a_renderer_may_move_to_another_thread() {
    fn moves<T: Send>() {}
    moves::<Renderer>();
    moves::<Context>();
}

// --- Devices that lack something ---

/// What hosts are told that a limit has to be.
fn told(limit: &str) -> u32 {
    let need = fit::REQUIRED.iter().find_map(|n| n.name.strip_prefix(limit)?.strip_prefix(" >= ")).expect(limit);
    need.parse().unwrap()
}

#[test]
fn no_shader_of_any_plan_needs_more_than_hosts_are_told() {
    let context = support::validated_context();
    let [mut threads, mut across, mut buffers, mut push] = [0; 4];
    // The second scene has an alpha mask, whose tracing shaders bind the most.
    let mut masked = load("builtin:cornell");
    masked.materials[0].alpha = stillray::scene::AlphaMode::Mask { cutoff: 0.5 };
    for scene in [load("builtin:cornell"), masked] {
        let of = |(method, box_frames)| Settings { method, box_frames, aovs: Aov::ALL.to_vec(), ..settings([8, 8]) };
        let averaged = (Method::Supersample, 3);
        for settings in Method::ALL.iter().map(|method| (*method, 1)).chain([averaged]).map(of) {
            let renderer = Renderer::new(&context, &scene, &settings).unwrap();
            for pass in &renderer.plan().passes {
                let Work::Dispatch { pipeline, .. } = &pass.work else { continue };
                let shader = pipeline.shader;
                let of = |kind: Kind| shader.bindings.iter().filter(|b| b.kind == kind).count() as u32;
                // Vulkan promises 4 storage images and 16 textures a stage, and 64 threads in z.
                assert!(of(Kind::StorageImage) <= 4 && of(Kind::SampledImage) <= 16 && shader.local_size[2] == 1);
                threads = threads.max(shader.local_size.iter().product());
                across = across.max(shader.local_size[0]);
                buffers = buffers.max(of(Kind::StorageBuffer));
                push = push.max(shader.push_size);
            }
        }
    }
    println!("{threads} threads, {across} across, {buffers} storage buffers, {push} bytes of push constants");
    assert!(threads > 0 && buffers > 0);
    assert!(threads <= told("maxComputeWorkGroupInvocations") && across <= told("maxComputeWorkGroupSize[0]"));
    assert!(buffers <= told("maxPerStageDescriptorStorageBuffers") && push <= told("maxPushConstantsSize"));
    support::assert_clean(&context);
}

static REAL: OnceLock<ash::StaticFn> = OnceLock::new();

/// A loader whose devices have no synchronization2.
unsafe extern "system" fn poor_loader(instance: vk::Instance, name: *const c_char) -> vk::PFN_vkVoidFunction {
    // SAFETY: the caller passes a name that ends with a zero, as the real loader's caller must.
    unsafe {
        if CStr::from_ptr(name) == c"vkGetPhysicalDeviceFeatures2" {
            let poor: vk::PFN_vkGetPhysicalDeviceFeatures2 = poor_features;
            return Some(std::mem::transmute::<vk::PFN_vkGetPhysicalDeviceFeatures2, unsafe extern "system" fn()>(
                poor,
            ));
        }
        (REAL.get().unwrap().get_instance_proc_addr)(instance, name)
    }
}

unsafe extern "system" fn poor_features(_: vk::PhysicalDevice, features: *mut vk::PhysicalDeviceFeatures2<'_>) {
    // Nothing is set: the structures stay as their caller made them, with every feature off.
    // SAFETY: the caller passes a valid structure.
    unsafe { (*features).features = vk::PhysicalDeviceFeatures::default() };
}

#[test]
fn a_device_that_lacks_something_is_refused_with_the_reason() {
    let host = Host::new();
    let refusal = |handles: &HostHandles| {
        // SAFETY: the handles are the host's own and alive; what is wrong is told before any is used.
        let error = unsafe { Context::adopt(handles) }.expect_err("a refusal");
        assert!(matches!(error, Error::NoDevice { .. }), "{error}");
        error.to_string()
    };
    let no_family = refusal(&HostHandles { queue_family: 99, ..host.handles() });
    assert!(no_family.contains("queue family 99 does not compute"), "{no_family}");
    REAL.get_or_init(|| host.entry.static_fn().clone());
    let poor = refusal(&HostHandles { get_instance_proc_addr: poor_loader, ..host.handles() });
    for feature in ["synchronization2", "shaderStorageImageExtendedFormats"] {
        assert!(poor.contains(&format!("feature {feature} is missing")), "{poor}");
    }
    drop(host.adopted());
    host.close_clean();
}
