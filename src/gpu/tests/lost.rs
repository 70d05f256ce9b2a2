//! A lost device, without a handler of uncaptured errors: wgpu's own panics.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use glam::DVec3;

use crate::gpu::measure::build_top_timed;
use crate::gpu::testing::{limited_gpu, mixed_world};
use crate::gpu::*;
use crate::scheduler::FrameBudget;
use crate::tree::LightTree;
use crate::world::LightWorld;
use crate::{Light, Placement, Policy, TreeKey, TreeSource};

/// What a call gets.
struct Scene {
    device: wgpu::Device,
    queue: wgpu::Queue,
    lights: GpuLights,
    world: LightWorld,
    tree: TreeKey,
    encoder: wgpu::CommandEncoder,
}

impl Scene {
    /// On a device that works. A used scene has made everything that is made at first use.
    fn new((device, queue): &(wgpu::Device, wgpu::Queue), is_used: bool) -> Self {
        let mut world = mixed_world();
        let lamps = (0..40).map(|i| Light::point(glam::Vec3::X * i as f32, glam::Vec3::ONE)).collect();
        let tree = world.add_tree(LightTree::new(lamps).expect("valid"));
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
        world.set_light_source(tree, TreeSource::GpuMesh).expect("no profiles");
        let lights = GpuLights::new(device, queue).expect("default limits are enough");
        let mut scene = Self {
            device: device.clone(),
            queue: queue.clone(),
            lights,
            world,
            tree,
            encoder: device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default()),
        };
        if is_used {
            scene.lights.upload(&scene.world).expect("room enough");
            // Those that make something new take long.
            for (name, call) in CALLS.iter().filter(|(name, _)| !name.ends_with("new")) {
                assert!(call(&mut scene).is_none_or(|made| made.is_ok()), "{name}");
            }
            scene.submit();
            // Something to send.
            let moved = scene.world.instances().next().expect("there are some");
            scene.world.move_instance(moved, Placement::at(DVec3::Y)).expect("valid");
        }
        scene
    }

    /// Submits what was recorded.
    fn submit(&mut self) {
        let next = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.queue.submit([std::mem::replace(&mut self.encoder, next).finish()]);
    }
}

/// What a call returns; `None` if it has no result.
type Answer = Option<Result<(), GpuError>>;

fn nothing<T>(_: T) -> Answer {
    None
}

fn result<T>(result: Result<T, GpuError>) -> Answer {
    Some(result.map(drop))
}

type Call = fn(&mut Scene) -> Answer;

/// All public calls, by name.
// Calls without a result have a row like all others.
#[allow(clippy::unit_arg)]
const CALLS: &[(&str, Call)] = &[
    ("new", |s| result(GpuLights::new(&s.device, &s.queue))),
    ("with_options", |s| result(GpuLights::with_options(&s.device, &s.queue, GpuOptions::default()))),
    ("set_cut_view", |s| nothing(s.lights.set_cut_view(DVec3::ZERO, 0.001))),
    ("forget_visibility", |s| nothing(s.lights.forget_visibility())),
    ("set_tree_memory", |s| nothing(s.lights.set_tree_memory(None))),
    ("set_frame_bytes", |s| nothing(s.lights.set_frame_bytes(None))),
    ("upload", |s| result(s.lights.upload(&s.world))),
    ("sync", |s| result(s.lights.sync(&mut s.world, FrameBudget::NONE, &mut s.encoder))),
    ("follow_sources", |s| nothing(s.lights.follow_sources(&mut s.world))),
    ("source_group", |s| nothing(s.lights.source_group())),
    ("source_layout", |s| nothing(s.lights.source_layout())),
    ("source_shader", |s| nothing(s.lights.source_shader(1))),
    ("build_top", |s| {
        s.lights.top_status.invalidate();
        nothing(s.lights.build_top(&mut s.encoder))
    }),
    ("build_top_timed", |s| nothing(build_top_timed(&mut s.lights, &mut s.encoder, None))),
    ("build_cuts", |s| nothing(s.lights.build_cuts(&mut s.encoder))),
    ("shader", |s| nothing(s.lights.shader(1, Effects::all()))),
    ("bind_group", |s| nothing(s.lights.bind_group())),
    ("bind_group_layout", |s| nothing(s.lights.bind_group_layout())),
    ("cut_report", |s| nothing(s.lights.cut_report())),
    ("effects", |s| nothing(s.lights.effects())),
    ("revision", |s| nothing(s.lights.revision())),
    ("memory", |s| nothing(s.lights.memory())),
    ("stands_in", |s| nothing(s.lights.stands_in(s.tree))),
    ("is_waiting", |s| nothing(s.lights.is_waiting(s.tree))),
];

/// The names of the public functions of [`GpuLights`] below a folder, as they are in the text.
fn public_calls(folder: &Path, names: &mut Vec<String>) {
    for entry in folder.read_dir().expect("the sources are here").map(|entry| entry.expect("readable").path()) {
        if entry.is_dir() {
            public_calls(&entry, names);
        } else {
            let text = std::fs::read_to_string(&entry).expect("a source file");
            let blocks = text.split("\nimpl GpuLights {\n").skip(1).filter_map(|block| block.split("\n}\n").next());
            let lines = blocks.flat_map(|block| block.lines().filter_map(|line| line.strip_prefix("    pub fn ")));
            names.extend(lines.filter_map(|line| Some(line.split_once('(')?.0.to_owned())));
        }
    }
}

#[test]
fn every_call_on_a_lost_device_returns_that_it_is_lost_or_does_nothing() {
    let limits = wgpu::Limits::default();
    let gpu = limited_gpu(&limits, wgpu::Features::empty());
    let unused = Scene::new(&gpu, false);
    let used = Scene::new(&gpu, true);
    gpu.0.destroy();
    gpu.0.poll(wgpu::PollType::Poll).expect("nothing to wait for");
    // Each call records into an encoder from before the loss, and into one that is made later.
    let mut panics = Vec::new();
    for (mut scene, which) in [(unused, "unused"), (used, "used")] {
        for encoder in ["its encoder", "a later encoder"] {
            for (name, call) in CALLS {
                match catch_unwind(AssertUnwindSafe(|| call(&mut scene))) {
                    Ok(None | Some(Err(GpuError::DeviceLost))) => {}
                    Ok(other) => panics.push(format!("{name} ({which}, {encoder}): {other:?}")),
                    Err(_) => panics.push(format!("{name} ({which}, {encoder}) panics")),
                }
            }
            if catch_unwind(AssertUnwindSafe(|| scene.submit())).is_err() {
                panics.push(format!("submit ({which}, {encoder}) panics"));
            }
        }
    }
    assert_eq!(panics, [""; 0]);
}

#[test]
fn the_test_of_a_lost_device_makes_every_call() {
    let mut names = Vec::new();
    public_calls(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src/gpu"), &mut names);
    assert!(names.len() > 20, "{names:?}");
    names.retain(|name| !CALLS.iter().any(|(call, _)| call == name));
    assert_eq!(names, [""; 0], "they are in no row of CALLS");
}
