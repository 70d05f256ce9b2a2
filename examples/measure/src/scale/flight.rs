//! The frames of a flight.

use super::blocks::{Builder, KINDS};
use super::loader::Loader;
use super::route::Route;
use super::settings::Settings;
use super::stream::Stream;
use super::traffic::Traffic;
use girandole::glam::DVec3;
use girandole::plan::{FramePlan, LightPlanner, PlanError};
use girandole::scheduler::VirtualClock;
use girandole::{FrameBudget, FrameReport, LightWorld, WorldError};
use std::sync::Arc;
use std::time::{Duration, Instant};
use testbed::common::stopwatch::thread_time;

/// What the library did in a frame, and how long it took.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameCosts {
    /// CPU time of the thread: all of the following parts.
    pub frame: Duration,
    /// The same as wall-clock time.
    pub wall: Duration,
    /// Removing and adding regions.
    pub regions: Duration,
    /// Moves of vehicles and edits of lights, and the viewpoint.
    pub edits: Duration,
    pub update: Duration,
    /// Planning the frame.
    pub plan: Duration,
    pub arrived: usize,
    pub left: usize,
    pub report: FrameReport,
}

/// The time of a rebuild for each light by the world's clock, about as on the machine of the
/// figures. With a real clock, each run would rebuild other trees in other frames.
const LIGHT_TIME: Duration = Duration::from_nanos(400);

/// The number of trees that belong to no block: the houses, and the car.
pub const SHARED_TREES: usize = KINDS + 1;

/// A world, its planner, and a camera above it.
#[derive(Debug)]
pub struct Flight {
    settings: Settings,
    route: Route,
    pub world: LightWorld,
    pub planner: LightPlanner,
    pub builder: Builder,
    pub stream: Stream,
    loader: Loader,
    traffic: Traffic,
    frame: u32,
    /// The number of frames flown along the path.
    flown: u32,
    pub camera: DVec3,
}

/// Why a flight ends early.
#[derive(Debug)]
pub struct FlightError(pub String);

impl From<WorldError> for FlightError {
    fn from(error: WorldError) -> Self {
        Self(error.to_string())
    }
}

impl From<PlanError> for FlightError {
    fn from(error: PlanError) -> Self {
        Self(error.to_string())
    }
}

impl Flight {
    /// Loads the blocks around the start of the path, as behind a loading screen. `play` gets the
    /// first plan.
    pub fn start(settings: Settings, play: impl FnOnce(&FramePlan)) -> Result<Self, FlightError> {
        let clock = VirtualClock::new(|work| LIGHT_TIME * work.lights as u32);
        let mut world = LightWorld::with_clock(Arc::new(clock));
        let builder = Builder::new(&settings, &mut world)?;
        let traffic = Traffic::new(&settings, &mut world)?;
        let loader = Loader::start(builder.clone()).map_err(FlightError)?;
        let mut planner = LightPlanner::new(settings.limits);
        let route = Route::new(&settings);
        let camera = route.camera(0.0);
        let mut stream = Stream::new(&settings);
        let blocks = stream.missing(camera);
        blocks.iter().for_each(|block| loader.fill(*block));
        for block in blocks {
            let key = world.add_region(&mut loader.take()?)?;
            stream.resident.insert(block, key);
        }
        world.set_viewpoint(camera)?;
        world.set_origin_near(camera)?;
        world.update(FrameBudget::UNLIMITED);
        planner.set_frame_bytes(None);
        play(&planner.reserve(&world)?.plan());
        planner.set_frame_bytes(settings.limits.frame_bytes);
        Ok(Self { settings, route, world, planner, builder, stream, loader, traffic, frame: 0, flown: 0, camera })
    }

    /// The next frame, with the camera at the next place of the path.
    pub fn fly(&mut self, play: impl FnOnce(&FramePlan)) -> Result<FrameCosts, FlightError> {
        self.flown += 1;
        self.camera = self.route.camera(f64::from(self.flown) / f64::from(self.settings.frames));
        self.advance(self.settings.block_size, play)
    }

    /// The next frame, with the camera where it is. Blocks that are not wanted there leave without
    /// a margin.
    pub fn hover(&mut self, play: impl FnOnce(&FramePlan)) -> Result<FrameCosts, FlightError> {
        self.advance(0.0, play)
    }

    /// Blocks leave when they are farther away than the radius by `margin`, in metres.
    fn advance(&mut self, margin: f64, play: impl FnOnce(&FramePlan)) -> Result<FrameCosts, FlightError> {
        self.frame += 1;
        let camera = self.camera;
        // The engine's own work, and waiting for the loader, are not measured.
        let leaving = self.stream.departures(camera, margin);
        let leaving: Vec<_> = leaving.iter().filter_map(|block| self.stream.resident.remove(block)).collect();
        self.stream.request(self.frame, camera).into_iter().for_each(|block| self.loader.fill(block));
        let arriving = self.stream.arrivals(self.frame);
        let mut regions = Vec::new();
        for _ in &arriving {
            regions.push(self.loader.take()?);
        }
        let around = self.stream.around(camera, self.settings.flickering);
        self.traffic.advance(self.frame, camera, &around, (&self.world, &self.builder));

        let mut costs = FrameCosts { arrived: arriving.len(), left: leaving.len(), ..FrameCosts::default() };
        let wall = Instant::now();
        let mut parts = [thread_time(); 5];
        for key in leaving {
            self.loader.free(self.world.remove_region(key)?);
        }
        let mut keys = Vec::with_capacity(regions.len());
        for mut region in regions {
            keys.push(self.world.add_region(&mut region)?);
        }
        parts[1] = thread_time();
        self.world.move_instances(&self.traffic.moves)?;
        for (tree, lights) in &self.traffic.edits {
            self.world.set_lights(*tree, lights)?;
        }
        self.world.set_viewpoint(camera)?;
        self.world.set_origin_near(camera)?;
        parts[2] = thread_time();
        costs.report = self.world.update(FrameBudget::new(self.settings.budget));
        parts[3] = thread_time();
        let plan = self.planner.reserve(&self.world)?.plan();
        parts[4] = thread_time();
        costs.wall = wall.elapsed();
        costs.frame = parts[4] - parts[0];
        [costs.regions, costs.edits, costs.update, costs.plan] = std::array::from_fn(|i| parts[i + 1] - parts[i]);

        play(&plan);
        self.stream.resident.extend(arriving.into_iter().zip(keys));
        Ok(costs)
    }

    /// Removes all blocks, and plans a frame.
    pub fn remove_all(&mut self, play: impl FnOnce(&FramePlan)) -> Result<(), FlightError> {
        for (_, key) in self.stream.resident.drain() {
            self.loader.free(self.world.remove_region(key)?);
        }
        self.world.update(FrameBudget::NONE);
        play(&self.planner.reserve(&self.world)?.plan());
        Ok(())
    }
}
