//! Barriers are stated once, as data; each is dropped in turn, and the validation layer notices those that it can notice.
//!
//! What the layer can notice follows from what the passes touch ([`Hazard::is_noticeable`]), by how synchronisation
//! validation 1.3 works:
//!
//! - It looks at a command buffer while it is recorded, dispatch by dispatch, and takes a binding of a `readonly` block for
//!   a read of all of it and one of a `writeonly` block for a write.
//! - A binding that is both read and written it takes for one of the two; for which, the declaration does not say
//!   (1.3.239 takes one with atomics only for a read). So such a hazard is only sure to be noticed if it is one either way.
//! - A write after a write by shaders is not reported: it does not know which elements a dispatch writes, and two that
//!   write different ones are in order.
//! - All else is noticed: read after write and write after read by shaders, and conflicts with fills, copies and indirect
//!   arguments.
//!
//! What it can not notice is left to the plan's own check: every conflict between two passes is ordered by some barrier.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)] // a panic is a failing test
mod support;

use ash::vk;

use ash::vk::Handle;
use proptest::prelude::*;
use stillray::gpu::Threads;
use stillray::gpu::pass::{Barrier, Pass, Range, Resource, Work, barriers};
use stillray::method::plan::Plan;
use stillray::renderer::{Aov, Fill, FrameInputs, Method, Renderer, Settings};
use stillray::scene::Scene;
use stillray::settings::Indirect;
use stillray::shaders::Access;
use support::host::Host;
use support::rig::load;

// --- What a pass does to memory, as the layer sees it ---

/// Stage and kind of an access. Shaders' accesses are of one kind a binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Touch {
    ShaderRead,
    ShaderWrite,
    ShaderReadWrite,
    TransferRead,
    TransferWrite,
    IndirectRead,
}

impl Touch {
    fn writes(self) -> bool {
        matches!(self, Self::ShaderWrite | Self::ShaderReadWrite | Self::TransferWrite)
    }

    fn scope(self) -> (vk::PipelineStageFlags2, vk::AccessFlags2) {
        let shader = vk::PipelineStageFlags2::COMPUTE_SHADER;
        let transfer = vk::PipelineStageFlags2::ALL_TRANSFER;
        match self {
            Self::ShaderRead => (shader, vk::AccessFlags2::SHADER_STORAGE_READ),
            Self::ShaderWrite => (shader, vk::AccessFlags2::SHADER_STORAGE_WRITE),
            Self::ShaderReadWrite => {
                (shader, vk::AccessFlags2::SHADER_STORAGE_READ | vk::AccessFlags2::SHADER_STORAGE_WRITE)
            }
            Self::TransferRead => (transfer, vk::AccessFlags2::TRANSFER_READ),
            Self::TransferWrite => (transfer, vk::AccessFlags2::TRANSFER_WRITE),
            Self::IndirectRead => (vk::PipelineStageFlags2::DRAW_INDIRECT, vk::AccessFlags2::INDIRECT_COMMAND_READ),
        }
    }

    /// What the layer may take it for.
    fn taken_for(self) -> Vec<Self> {
        if self == Self::ShaderReadWrite { vec![Self::ShaderRead, Self::ShaderWrite] } else { vec![self] }
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
        (true, Access::Write) => Touch::ShaderWrite,
        (true, Access::ReadWrite) => Touch::ShaderReadWrite,
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
        let writes = vk::AccessFlags2::SHADER_STORAGE_WRITE | vk::AccessFlags2::TRANSFER_WRITE;
        let available = b.src_access.contains(written & writes);
        b.src_stage.contains(from) && available && b.dst_stage.contains(to) && b.dst_access.contains(accessed)
    })
}

/// A conflict that no barrier orders.
struct Hazard {
    what: &'static str,
    earlier: &'static str,
    later: &'static str,
    first: Touch,
    second: Touch,
}

impl std::fmt::Debug for Hazard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { what, earlier, later, first, second } = self;
        write!(f, "{what}: {first:?} by {earlier}, {second:?} by {later}")
    }
}

impl Hazard {
    /// Whether the layer is sure to notice it.
    fn is_noticeable(&self) -> bool {
        let told =
            |a: Touch, b: Touch| (a.writes() || b.writes()) && (a, b) != (Touch::ShaderWrite, Touch::ShaderWrite);
        let seconds = self.second.taken_for();
        self.first.taken_for().iter().all(|a| seconds.iter().all(|b| told(*a, *b)))
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

/// Drops each barrier in turn.
fn drop_each(scene: &Scene, settings: &Settings) {
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
    println!("{:?}: the layer must notice {heard} of {} barriers", settings.method, barriers.len());
    assert!(2 * heard > barriers.len(), "a check that sees little shows little");
}

#[test]
fn the_layer_notices_dropped_barriers_of_stable() {
    let scene = load("builtin:cornell");
    for filter_fill in [Fill::None, Fill::Edge] {
        let aovs = vec![Aov::Age, Aov::Changes];
        let settings = Settings { size: [16, 16], aovs, filter_fill, ..Settings::default() };
        drop_each(&scene, &settings);
    }
}

#[test]
fn the_layer_notices_dropped_barriers_of_the_other_methods() {
    let scene = load("builtin:cornell");
    for method in Method::ALL.iter().copied().filter(|m| *m != Method::Stable) {
        let settings = Settings { method, size: [16, 16], ..Settings::default() };
        drop_each(&scene, &settings);
    }
}

#[test]
fn the_layer_notices_dropped_barriers_of_integrated_and_averaged_frames() {
    let scene = load("builtin:cornell");
    let small = |method| Settings { size: [16, 16], ..Settings::of(method) };
    for settings in [
        Settings { aovs: vec![Aov::Motion], ..small(Method::StableTi) },
        small(Method::Taa),
        Settings { box_frames: 3, ..small(Method::Supersample) },
    ] {
        drop_each(&scene, &settings);
    }
}

#[test]
fn the_layer_notices_dropped_barriers_of_indirect_light() {
    let indirect = Indirect { depth: 2, ..Indirect::default() };
    drop_each(&load("builtin:cornell"), &Settings { size: [16, 16], path_depth: 1, indirect, ..Settings::default() });
}

/// The picture of a frame is the next one's history, and its own place is that of the picture before the last: the first
/// barrier of a frame orders both.
#[test]
fn a_frame_waits_for_the_history_of_the_last() {
    let context = support::validated_context();
    let scene = load("builtin:cornell");
    for (method, names) in [(Method::StableTi, ["previous history", "history"]), (Method::Stable, ["history"; 2])] {
        let settings = Settings { size: [16, 16], box_frames: 2, ..Settings::of(method) };
        let renderer = Renderer::new(&context, &scene, &settings).unwrap();
        assert!(hazards(&two_frames(renderer.plans(), None)).is_empty());
        // Nothing else orders the two: all barriers of the second frame left out.
        let mut steps = two_frames(renderer.plans(), None);
        let second = renderer.plans()[0].passes.len();
        steps[second..].iter_mut().for_each(|step| step.barrier = None);
        let across = hazards(&steps);
        let seen =
            |name: &str| across.iter().any(|h| h.what == name && (h.earlier, h.later) == ("temporal", "temporal"));
        assert!(names.iter().all(|name| seen(name)), "{across:?}");
    }
    support::assert_clean(&context);
}

// --- The function that places them ---

/// Bytes `offset..offset + size` of a buffer that exists in name only.
fn range(buffer: u64, offset: u64, size: u64) -> Range {
    Range { name: "range", buffer: vk::Buffer::from_raw(buffer), offset, size }
}

fn whole(buffer: u64) -> Range {
    range(buffer, 0, 64)
}

fn fill(target: Range) -> Pass {
    Pass::fill("fill", target, 0)
}

fn copy(source: Range, target: Range) -> Pass {
    Pass::copy("copy", source, target)
}

/// Whether there is a barrier before each pass but the first, which always has one.
fn placed(passes: &[Pass]) -> Vec<bool> {
    let all = barriers(passes);
    assert_eq!(all.len(), passes.len());
    assert!(all.first().is_none_or(Option::is_some), "a frame follows what came before it");
    all.iter().skip(1).map(Option::is_some).collect()
}

#[test]
fn there_is_no_barrier_without_a_conflict() {
    assert!(placed(&[]).is_empty());
    assert_eq!(placed(&[fill(whole(1)), fill(whole(2))]), [false]);
    assert_eq!(placed(&[copy(whole(1), whole(2)), copy(whole(1), whole(3))]), [false], "two reads");
}

#[test]
fn there_is_one_for_each_kind_of_conflict() {
    assert_eq!(placed(&[fill(whole(1)), copy(whole(1), whole(2))]), [true], "read after write");
    assert_eq!(placed(&[copy(whole(1), whole(2)), fill(whole(1))]), [true], "write after read");
    assert_eq!(placed(&[fill(whole(1)), fill(whole(1))]), [true], "write after write");
}

#[test]
fn one_barrier_orders_all_that_came_before_it() {
    let passes = [fill(whole(1)), fill(whole(2)), copy(whole(2), whole(3)), copy(whole(1), whole(4))];
    assert_eq!(placed(&passes), [false, true, false], "the second copy is behind the first one's barrier");
    let again = [fill(whole(1)), copy(whole(1), whole(2)), copy(whole(1), whole(3)), copy(whole(3), whole(4))];
    assert_eq!(placed(&again), [true, false, true]);
}

#[test]
fn ranges_of_one_buffer_conflict_where_they_overlap() {
    assert_eq!(placed(&[fill(range(1, 0, 32)), fill(range(1, 32, 32))]), [false], "side by side");
    assert_eq!(placed(&[fill(range(1, 0, 33)), fill(range(1, 32, 32))]), [true], "by a byte");
    assert_eq!(placed(&[fill(range(1, 0, 64)), fill(range(1, 16, 4))]), [true], "inside");
    assert_eq!(placed(&[fill(range(1, 0, 64)), fill(range(2, 0, 64))]), [false], "of two buffers");
}

#[test]
fn a_barrier_names_what_it_orders() {
    let [_, Some(barrier)] = barriers(&[fill(whole(1)), copy(whole(1), whole(2))])[..] else { panic!("one barrier") };
    let transfer = vk::PipelineStageFlags2::ALL_TRANSFER;
    assert_eq!((barrier.src_stage, barrier.dst_stage), (transfer, transfer));
    assert_eq!(barrier.src_access, vk::AccessFlags2::TRANSFER_WRITE);
    assert!(barrier.dst_access.contains(vk::AccessFlags2::TRANSFER_READ | vk::AccessFlags2::TRANSFER_WRITE));
}

fn any_range() -> impl Strategy<Value = Range> {
    (1_u64..4, 0_u64..4, 1_u64..4).prop_map(|(buffer, at, size)| range(buffer, 16 * at, 16 * size))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn every_conflict_is_ordered_and_no_barrier_is_idle(
        passes in prop::collection::vec((any_range(), prop::option::of(any_range())), 1..12),
    ) {
        let pass = |(to, from): &(Range, Option<Range>)| from.map_or_else(|| fill(*to), |from| copy(from, *to));
        let passes: Vec<Pass> = passes.iter().map(pass).collect();
        let placed = barriers(&passes);
        let steps = |dropped: Option<usize>| -> Vec<Step> {
            let step = |(i, pass): (usize, &Pass)| {
                Step { label: pass.label, touches: touches(pass), barrier: placed[i].filter(|_| dropped != Some(i)) }
            };
            passes.iter().enumerate().map(step).collect()
        };
        prop_assert!(hazards(&steps(None)).is_empty());
        for i in (1..passes.len()).filter(|i| placed[*i].is_some()) {
            prop_assert!(!hazards(&steps(Some(i))).is_empty(), "the barrier before pass {} orders nothing", i);
        }
    }
}
