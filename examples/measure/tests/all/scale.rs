//! The flight of `examples/measure/src/scale` at a small scale: regions come and go, vehicles move, lights
//! flicker and memory is scarce, and all invariants hold.

use girandole::glam::DVec3;
use girandole::plan::{FramePlan, LightPlanner, PlanLimits};
use girandole::{LightTree, LightWorld, ShadingPoint};

use testbed::testing::plan_device::{Device, Played};
use testbed::testing::plan_records::check;
use testbed::testing::support::{Rng, SPLITS, all_pmfs};

use measure::scale::flight::{Flight, FrameCosts, SHARED_TREES};
use measure::scale::settings::Settings;

/// Frames between two checks.
const INTERVAL: u32 = 100;
const FRAMES: u32 = 600;

/// The most bytes of a tree on the CPU for each of its lights: 60 of the light, and of a node, which
/// holds at least five of them on average in these worlds, 220 and up to 610 for refits.
const BYTES_PER_LIGHT: usize = 60 + (220 + 610) / 5;
/// Of a tree besides: its lists of instances, its share of those of regions, and its logs, 770 here.
const BYTES_PER_TREE: usize = 1_000;

/// Few blocks with few lights. Only points, since `check` reads these.
fn settings(limits: PlanLimits) -> Settings {
    Settings {
        seed: 7,
        blocks: 14,
        lights_per_block: 660.0,
        is_plain: true,
        radius: 320.0,
        frames: FRAMES,
        speed: 150.0,
        vehicles: 12,
        flickering: 2,
        limits,
        ..Settings::full(7)
    }
}

/// The world in flight with a device that plays its plans.
struct Soak {
    flight: Flight,
    device: Device,
}

impl Soak {
    fn start(limits: PlanLimits) -> Self {
        let mut device = Device::default();
        let flight = Flight::start(settings(limits), |plan| device.play(plan).expect("in order")).expect("valid");
        Self { flight, device }
    }

    fn fly(&mut self) -> (FrameCosts, FramePlan) {
        let mut played = None;
        let play = |plan: &FramePlan| {
            self.device.play(plan).expect("in order");
            played = Some(plan.clone());
        };
        let costs = self.flight.fly(play).expect("valid");
        (costs, played.expect("each frame has a plan"))
    }

    /// What shaders read is sound.
    fn check_device(&mut self) -> usize {
        let planner = std::mem::replace(&mut self.flight.planner, LightPlanner::new(PlanLimits::default()));
        let played = Played { planner, device: std::mem::take(&mut self.device) };
        let found = check(&played, &self.flight.world);
        assert_eq!(played.device.bytes_of_all(), played.planner.memory().buffers);
        Played { planner: self.flight.planner, device: self.device } = played;
        found.stand_ins
    }
}

/// Every light has a positive pmf at shading points near the camera, and all of them and the
/// probability of no light add up to 1.
fn check_pmfs(world: &LightWorld, camera: DVec3, rng: &mut Rng) {
    for splits in SPLITS {
        let sampler = world.sampler().with_splits(splits);
        for _ in 0..2 {
            let ground = (camera - world.origin()).as_vec3() + rng.position(150.0);
            let at = ShadingPoint::volume(ground);
            let pmfs = all_pmfs(&sampler, &at);
            assert_eq!(pmfs.len(), world.light_count());
            let mut sum = 0.0;
            for (light, pmf) in pmfs {
                assert!(pmf > 0.0, "{light:?} is lost at {at:?}");
                sum += f64::from(pmf);
            }
            assert!((sum - 1.0).abs() < 1.0e-3, "the probabilities add up to {sum}");
        }
    }
}

fn check_memory(world: &LightWorld, planner: &LightPlanner, most_instances: usize) {
    let (lights, trees) = world
        .trees()
        .fold((0, 0), |(lights, trees), key| (lights + world.tree(key).expect("it lives").light_count(), trees + 1));
    let (cpu, gpu) = (world.memory(), planner.memory());
    let bound = BYTES_PER_LIGHT * lights + BYTES_PER_TREE * trees;
    assert!(cpu.total() - cpu.tables <= bound, "{cpu:?} of {lights} lights in {trees} trees");
    // Records of instances and trees, in tables that double.
    assert!(cpu.tables <= 2 * 2_500 * most_instances, "{cpu:?} with {most_instances} instances");
    assert!(gpu.used + gpu.gaps <= gpu.trees && gpu.trees <= gpu.buffers, "{gpu:?}");
}

#[test]
fn a_flight_in_which_regions_come_and_go_keeps_all_invariants_and_leaves_nothing() {
    for (memory, frame_bytes, needs_stand_ins) in [(4 << 20, 256 << 10, false), (640 << 10, 24 << 10, true)] {
        let mut soak = Soak::start(PlanLimits::default().with_tree_memory(memory).with_frame_bytes(frame_bytes));
        let mut rng = Rng(3);
        let (mut came, mut went, mut rebuilt, mut most_instances, mut stand_ins) = (0, 0, 0, 0, 0);
        for frame in 1..=FRAMES {
            let (costs, plan) = soak.fly();
            let world = &soak.flight.world;
            came += costs.arrived;
            went += costs.left;
            rebuilt += costs.report.rebuilt_trees;
            most_instances = most_instances.max(world.instances().len());
            // The limit is for new trees; stand-ins, edits, planes and records come on top, of each light of a loose tree too.
            assert!(plan.report.bytes <= frame_bytes + 96 * 1024, "{:?}", plan.report);
            if frame % INTERVAL != 0 {
                continue;
            }
            for key in world.trees() {
                world.tree(key).expect("it lives").check().expect("a sound tree");
            }
            check_pmfs(world, soak.flight.camera, &mut rng);
            check_memory(world, &soak.flight.planner, most_instances);
            assert!(soak.flight.planner.memory().trees <= memory);
            stand_ins += soak.check_device();
        }
        assert!(came > 30 && went > 30 && rebuilt > 50, "{came} arrived, {went} left, {rebuilt} trees were built");
        assert_eq!(stand_ins > 0, needs_stand_ins, "{stand_ins} stand-ins in {memory} bytes");

        let Soak { flight, device } = &mut soak;
        flight.remove_all(|plan| device.play(plan).expect("in order")).expect("valid");
        soak.check_device();
        let Soak { flight, .. } = &soak;
        assert_eq!((flight.world.regions().len(), flight.world.trees().len()), (0, SHARED_TREES));
        let shared: u64 = flight.world.trees().filter_map(|key| flight.world.tree(key)).map(bytes).sum();
        assert_eq!(flight.planner.memory().used, shared, "only the shared trees are left on the GPU");
        check_memory(&flight.world, &flight.planner, most_instances);
    }
}

/// Bytes of nodes and lights on the GPU, of points.
fn bytes(tree: &LightTree) -> u64 {
    tree.nodes().len() as u64 * 224 + tree.lights().len() as u64 * 64
}
