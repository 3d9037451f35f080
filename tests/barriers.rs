//! Barriers are stated once, as data; each is dropped in turn, and the validation layer notices those that it can notice.
//!
//! What the layer can notice follows from what the passes touch ([`Hazard::is_noticeable`]); why, from how synchronisation validation
//! 1.3 works:
//!
//! - A binding is a read if its block is `readonly`, else a write, whatever the shader does with it besides.
//! - A write after a write by shaders is not reported: which bytes a shader writes the layer does not know, and two
//!   dispatches that write different parts of one buffer are in order. So a barrier that orders only bindings that are
//!   both read and written (claims, masks, counters, found, samples) can be dropped in silence.
//! - Everything else is: read after write and write after read by shaders, and any conflict with a fill, a copy or indirect
//!   arguments.
//! - A hazard is held against the last write of the bytes and the reads since.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use ash::vk;

use stillray::gpu::Threads;
use stillray::gpu::pass::{Barrier, Pass, Resource, Work};
use stillray::method::plan::Plan;
use stillray::renderer::{Aov, FrameInputs, Method, Renderer, Settings};
use stillray::scene::Scene;
use stillray::shaders::Access;
use support::host::Host;
use support::rig::load;

// --- What a pass does to memory, as the layer sees it ---

/// Stage and kind of an access. Shaders' accesses are of one kind a binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Touch {
    ShaderRead,
    ShaderWrite,
    TransferRead,
    TransferWrite,
    IndirectRead,
}

impl Touch {
    fn writes(self) -> bool {
        matches!(self, Self::ShaderWrite | Self::TransferWrite)
    }

    fn scope(self) -> (vk::PipelineStageFlags2, vk::AccessFlags2) {
        let shader = vk::PipelineStageFlags2::COMPUTE_SHADER;
        let transfer = vk::PipelineStageFlags2::ALL_TRANSFER;
        match self {
            Self::ShaderRead => (shader, vk::AccessFlags2::SHADER_STORAGE_READ),
            Self::ShaderWrite => (shader, vk::AccessFlags2::SHADER_STORAGE_WRITE),
            Self::TransferRead => (transfer, vk::AccessFlags2::TRANSFER_READ),
            Self::TransferWrite => (transfer, vk::AccessFlags2::TRANSFER_WRITE),
            Self::IndirectRead => (vk::PipelineStageFlags2::DRAW_INDIRECT, vk::AccessFlags2::INDIRECT_COMMAND_READ),
        }
    }
}

/// One step of a sequence: what it touches, and the barrier before it. Holds nothing of the device.
struct Step {
    label: &'static str,
    touches: Vec<(Resource, Touch)>,
    barrier: Option<Barrier>,
}

fn touches(pass: &Pass) -> Vec<(Resource, Touch)> {
    let shader = matches!(pass.work, Work::Dispatch { .. });
    let touch = |access: Access| match (shader, access) {
        (true, Access::Read) => Touch::ShaderRead,
        (true, _) => Touch::ShaderWrite,
        (false, Access::Read) => Touch::TransferRead,
        (false, _) => Touch::TransferWrite,
    };
    let mut all: Vec<_> = pass.uses.iter().map(|(r, access)| (*r, touch(*access))).collect();
    if let Work::Dispatch { threads: Threads::Indirect(range), .. } = &pass.work {
        all.push((Resource::Buffer(*range), Touch::IndirectRead));
    }
    all
}

fn overlap(a: &Resource, b: &Resource) -> bool {
    match (a, b) {
        (Resource::Buffer(a), Resource::Buffer(b)) => {
            a.buffer == b.buffer && a.offset.max(b.offset) < (a.offset + a.size).min(b.offset + b.size)
        }
        (Resource::Storage(_, a), Resource::Storage(_, b)) => a == b,
        _ => false,
    }
}

/// Whether one of the barriers makes the first access safe for the second.
fn ordered(between: &[Step], first: Touch, second: Touch) -> bool {
    let ((from, written), (to, accessed)) = (first.scope(), second.scope());
    between.iter().filter_map(|s| s.barrier).any(|b| {
        let available = !first.writes() || b.src_access.contains(written);
        b.src_stage.contains(from) && available && b.dst_stage.contains(to) && b.dst_access.contains(accessed)
    })
}

/// A conflict that no barrier orders.
#[derive(Debug, Clone, Copy)]
struct Hazard {
    what: &'static str,
    earlier: &'static str,
    later: &'static str,
    first: Touch,
    second: Touch,
}

impl Hazard {
    /// Whether the layer can notice it: not between two writes of shaders.
    fn is_noticeable(&self) -> bool {
        (self.first, self.second) != (Touch::ShaderWrite, Touch::ShaderWrite)
    }
}

fn hazards(steps: &[Step]) -> Vec<Hazard> {
    let mut found = Vec::new();
    for (i, later) in steps.iter().enumerate() {
        for (j, earlier) in steps[..i].iter().enumerate() {
            for (resource, second) in &later.touches {
                for (other, first) in &earlier.touches {
                    let conflict = overlap(resource, other) && (first.writes() || second.writes());
                    if conflict && !ordered(&steps[j + 1..=i], *first, *second) {
                        let (what, first, second) = (resource.name(), *first, *second);
                        found.push(Hazard { what, earlier: earlier.label, later: later.label, first, second });
                    }
                }
            }
        }
    }
    found
}

/// Two frames, one after the other, of which the second lacks the barrier before pass `dropped`.
fn two_frames(plans: &[Plan; 2], dropped: Option<usize>) -> Vec<Step> {
    let mut steps = Vec::new();
    for (plan, dropped) in plans.iter().zip([None, dropped]) {
        for (i, (pass, barrier)) in plan.passes.iter().zip(&plan.barriers).enumerate() {
            let barrier = barrier.filter(|_| dropped != Some(i));
            steps.push(Step { label: pass.label, touches: touches(pass), barrier });
        }
    }
    steps
}

// --- The layer ---

/// What dropping one barrier does.
struct Trial {
    messages: Vec<String>,
    hazards: Vec<Hazard>,
}

/// Records two frames into one command buffer, which is never run: the layer looks while it is recorded. A layer may be
/// set to stop repeating itself, so that every trial has an instance of its own.
fn trial(scene: &Scene, settings: &Settings, dropped: Option<usize>) -> Trial {
    let host = Host::new();
    let context = host.adopted();
    let mut renderer = Renderer::new(&context, scene, settings).unwrap();
    let steps = two_frames(renderer.plans(), dropped);
    let pose = scene.pose(0.0);
    let inputs = FrameInputs { view: pose.cameras[0], pose: &pose, reset: false };
    let before = host.messages().len();
    let commands = host.begin();
    // SAFETY: the command buffer is recorded and never submitted; nothing is in flight.
    unsafe {
        renderer.record(commands, &inputs).unwrap();
        match dropped {
            None => renderer.record(commands, &inputs).unwrap(),
            Some(pass) => renderer.record_without(commands, &inputs, pass).unwrap(),
        };
        host.device.end_command_buffer(commands).unwrap();
        host.device.free_command_buffers(host.pool, &[commands]);
    }
    drop((renderer, context));
    let messages = host.close().split_off(before);
    Trial { messages, hazards: hazards(&steps) }
}

/// The passes before which there is a barrier.
fn barriers_of(scene: &Scene, settings: &Settings) -> Vec<(usize, &'static str)> {
    let context = support::validated_context();
    let renderer = Renderer::new(&context, scene, settings).unwrap();
    let plan = &renderer.plans()[1];
    let there = |i: &usize| plan.barriers[*i].is_some();
    (0..plan.passes.len()).filter(there).map(|i| (i, plan.passes[i].label)).collect()
}

/// Drops each barrier in turn; returns how many there are, and how many of them the layer must notice.
fn drop_each(scene: &Scene, settings: &Settings) -> (usize, usize) {
    let whole = trial(scene, settings, None);
    assert!(whole.messages.is_empty(), "no barrier dropped: {:?}", whole.messages);
    assert!(whole.hazards.is_empty(), "no barrier dropped: {:?}", whole.hazards);
    let barriers = barriers_of(scene, settings);
    let mut heard = 0;
    for (pass, label) in &barriers {
        let Trial { messages, hazards } = trial(scene, settings, Some(*pass));
        let must = hazards.iter().find(|h| h.is_noticeable());
        let because = must.or(hazards.first()).expect("a barrier that orders something");
        let told = messages.iter().any(|m| m.contains("SYNC-HAZARD"));
        let name = format!("{:?}, pass {pass} ({label})", settings.method);
        println!("{name}: must be noticed: {}, is noticed: {told}; {because:?}", must.is_some());
        assert!(messages.iter().all(|m| m.contains("SYNC-HAZARD")), "{messages:?}");
        assert!(told || must.is_none(), "{name}: not noticed: {because:?}");
        heard += usize::from(must.is_some());
    }
    (barriers.len(), heard)
}

#[test]
fn the_layer_notices_dropped_barriers_of_stable() {
    let scene = load("builtin:cornell");
    let settings = Settings { size: [16, 16], aovs: vec![Aov::Age], ..Settings::default() };
    println!("barriers, of which noticed: {:?}", drop_each(&scene, &settings));
}

#[test]
fn the_layer_notices_dropped_barriers_of_supersample_and_reference() {
    let scene = load("builtin:cornell");
    for method in [Method::Supersample, Method::Reference] {
        let settings = Settings { method, size: [16, 16], ..Settings::default() };
        println!("barriers, of which noticed: {:?}", drop_each(&scene, &settings));
    }
}
