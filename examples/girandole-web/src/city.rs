//! The city on the page: what JavaScript calls.

use girandole::gpu::{GpuLights, GpuOptions};
use girandole::{CutOptions, FrameBudget, FrameReport, wgpu};
use wasm_bindgen::prelude::*;
use wasm_bindgen_futures::future_to_promise;
use web_sys::HtmlCanvasElement;

use crate::device::{self, Gpu};
use crate::light_list::LightList;
use crate::pipelines::{Listed, Pipelines, Variant};
use crate::present::Presenter;
use crate::resolve::{Resolver, Since};
use crate::tour;
use testbed::fly::{Flight, Motion};
use testbed::render::geometry::{Geometry, GeometryChange};
use testbed::render::gpu::pipeline::{LIGHT_GROUP, WORKGROUP};
use testbed::render::gpu::records::{FrameUniform, PictureOptions};
use testbed::render::gpu::scene_buffers::SceneBuffers;
use testbed::render::sequence::frame_seed;
use testbed::scene::dusk::{self, Dusk};
use testbed::scene::procedural::{CityOptions, Size, stage};
use testbed::scene::{Camera, Stage};

/// Candidates of which each sample keeps one.
const CANDIDATES: u32 = 4;
/// Seed of the city and of the noise.
const SEED: u64 = 1;
/// The longest step of the scene's time, in seconds: a page that was hidden does not leap ahead.
const MAX_STEP: f64 = 0.1;
/// Bytes of a pixel: its sums of radiance, and its numbers of shadow rays and its distance.
const PIXEL_BYTES: u64 = 32;

/// Buffers and passes that depend on the size of the picture.
pub struct Picture {
    pub size: [u32; 2],
    pub sums: wgpu::Buffer,
    group: wgpu::BindGroup,
    resolver: Resolver,
    presenter: Presenter,
}

impl Picture {
    fn new(gpu: &Gpu, buffers: &SceneBuffers, size: [u32; 2]) -> Self {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let sums = gpu.buffer("city image", pixels * PIXEL_BYTES, usage);
        let (_, group) = buffers.bind(&gpu.device, &sums, None);
        let resolver = Resolver::new(gpu, pixels, &sums);
        let presenter = Presenter::new(gpu, size, &resolver.pictures);
        gpu.configure(size);
        Self { size, sums, group, resolver, presenter }
    }
}

/// A browser frees a buffer when it collects garbage, which may be late.
impl Drop for Picture {
    fn drop(&mut self) {
        self.sums.destroy();
        self.resolver.pictures.iter().for_each(wgpu::Buffer::destroy);
    }
}

/// The totals of all frames.
#[derive(Clone, Copy, Debug, Default)]
struct Totals {
    frames: u64,
    rebuilt_trees: usize,
    refit_trees: usize,
}

/// The city, and how it is drawn.
#[wasm_bindgen]
pub struct City {
    pub(crate) gpu: Gpu,
    pub(crate) stage: Stage,
    geometry: Geometry,
    pub(crate) lights: GpuLights,
    buffers: SceneBuffers,
    pub(crate) picture: Picture,
    pipelines: Pipelines,
    start: Camera,
    flight: Flight,
    /// Seconds of the flight by itself; `None` once the user flies.
    tour: Option<f64>,
    /// The scene's time in seconds.
    time: f64,
    last_now: Option<f64>,
    is_frozen: bool,
    is_uniform: bool,
    /// The lights among which the uniform sampler has chosen last.
    list: Option<LightList>,
    budget: FrameBudget,
    spp: u32,
    since: Since,
    /// Frames since anything moved.
    still_frames: u32,
    report: FrameReport,
    totals: Totals,
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

#[wasm_bindgen]
impl City {
    /// Opens the device and builds a city of the size `S` or `M`, at night or at dusk. A cell that `min_marks` pixels
    /// show gets a cut. Fails with a sentence for the user.
    pub async fn open(canvas: HtmlCanvasElement, size: String, is_dusk: bool, min_marks: u32) -> Result<City, String> {
        let gpu = device::open(canvas).await?;
        let size = match &*size {
            "S" => Size::S,
            "M" => Size::M,
            other => return Err(format!("There is no city of the size {other}: choose S or M.")),
        };
        let lamp_profile = is_dusk.then(|| Dusk::default().profile()).transpose().map_err(text)?;
        let mut stage = stage(&CityOptions { size, cars: None, seed: SEED, lamp_profile }).map_err(text)?;
        if is_dusk {
            dusk::set(&mut stage).map_err(text)?;
        }
        stage.world.set_glossy_sampling(true);
        let geometry = Geometry::new(&stage.scene).map_err(text)?;
        let buffers = SceneBuffers::new(&gpu.device, &gpu.queue, &stage.scene, &geometry).map_err(text)?;
        let options = GpuOptions::default().with_cuts(CutOptions::default().with_min_marks(min_marks));
        let lights = GpuLights::with_options(&gpu.device, &gpu.queue, options).map_err(text)?;
        let picture = Picture::new(&gpu, &buffers, [1, 1]);
        let (layout, _) = buffers.bind(&gpu.device, &picture.sums, None);
        let pipelines = Pipelines::new(&gpu.device, &layout, &lights, (&stage.scene, &geometry));
        let start = stage.scene.camera;
        Ok(Self {
            gpu,
            stage,
            geometry,
            lights,
            buffers,
            picture,
            pipelines,
            start,
            flight: Flight::new(&start),
            tour: Some(0.0),
            time: 0.0,
            last_now: None,
            is_frozen: false,
            is_uniform: false,
            list: None,
            budget: FrameBudget::default(),
            spp: 1,
            since: Since::Restart,
            still_frames: 0,
            report: FrameReport::default(),
            totals: Totals::default(),
        })
    }

    /// Sets the size of the picture in pixels. Call it before the first frame, and when the canvas has
    /// another size.
    pub fn set_size(&mut self, width: u32, height: u32) {
        let size = [width.max(1), height.max(1)];
        if size != self.picture.size {
            self.picture = Picture::new(&self.gpu, &self.buffers, size);
            self.restart();
        }
    }

    /// The longest side of a picture, in pixels.
    pub fn max_side(&self) -> u32 {
        self.gpu.device.limits().max_texture_dimension_2d
    }

    /// The most pixels of a picture.
    pub fn max_pixels(&self) -> u32 {
        let limits = self.gpu.device.limits();
        let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        (bytes / PIXEL_BYTES).min(u32::MAX.into()) as u32
    }

    /// Sets the budget for rebuilds, in milliseconds of each frame.
    pub fn set_budget(&mut self, millis: f64) -> Result<(), String> {
        self.budget = FrameBudget::from_millis(millis).map_err(text)?;
        Ok(())
    }

    /// Sets the samples of each pixel in a frame.
    pub fn set_samples(&mut self, spp: u32) {
        self.spp = spp.max(1);
    }

    /// Stops the scene's time, or lets it go on.
    pub fn set_frozen(&mut self, is_frozen: bool) {
        self.is_frozen = is_frozen;
    }

    /// Chooses among all lights with the same probability, or by the light trees.
    pub fn set_uniform(&mut self, is_uniform: bool) {
        self.is_uniform = is_uniform;
        self.restart();
    }

    /// Turns the view by a drag, in heights of the picture. The user flies from now on.
    pub fn turn(&mut self, x: f32, y: f32) {
        self.take_over();
        self.flight.turn([x, y].into());
    }

    /// Flies for some seconds; directions are from -1 to 1. The user flies from now on.
    pub fn travel(&mut self, forward: f32, right: f32, up: f32, hurries: bool, seconds: f32) {
        self.take_over();
        self.flight.travel(Motion { forward, right, up, hurries }, seconds);
    }

    /// Makes the flight faster, or slower for a negative number of steps.
    pub fn change_speed(&mut self, steps: f32) {
        self.flight.change_speed(steps);
    }

    /// Lets the camera fly by itself again, from its start.
    pub fn start_tour(&mut self) {
        self.tour = Some(0.0);
    }

    /// Destroys the device, as a driver that crashed would.
    pub fn lose_device(&self) {
        self.gpu.device.destroy();
    }

    /// Moves the city to a time in milliseconds, brings everything up to date and submits the picture.
    /// Waits for nothing. Fails with a sentence for the user.
    pub fn frame(&mut self, now: f64) -> Result<(), String> {
        self.gpu.trouble.check()?;
        let seconds = self.last_now.map_or(0.0, |last| (now - last) / 1000.0).clamp(0.0, MAX_STEP);
        self.last_now = Some(now);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.advance(seconds, &mut encoder)?;
        self.fly(seconds);
        // The picture of a still scene is complete after enough frames.
        if self.since != Since::Nothing || self.still_frames < self.since.most_frames() {
            let frame_number = self.totals.frames as u32;
            let mut frame = self.frame_uniform(self.spp, frame_seed(SEED, frame_number));
            frame.sample_end = self.spp;
            let list = self.is_uniform.then(|| self.uniform_list());
            self.record(&mut encoder, &frame, list.as_ref().map(|list| (Listed::Uniform, list)));
            self.list = list.or(self.list.take());
            self.picture.resolver.record(&self.gpu, &mut encoder, &frame, self.spp, self.since);
        }
        let Self { gpu, picture, stage, .. } = self;
        picture.presenter.record(gpu, &mut encoder, picture.resolver.newest, stage.scene.exposure);
        gpu.queue.submit([encoder.finish()]);
        self.totals.frames += 1;
        self.since = Since::Motion;
        Ok(())
    }

    /// A promise that is kept once all submitted work is done.
    pub fn done(&self) -> js_sys::Promise {
        let done = self.gpu.done();
        future_to_promise(async move {
            done.await;
            Ok(JsValue::UNDEFINED)
        })
    }

    /// What the page shows, as JSON: numbers of things, the last frame's rebuilds with times in
    /// milliseconds, and totals since the start.
    pub fn status(&self) -> String {
        let world = &self.stage.world;
        let FrameReport { moved_instances, refit_trees, rebuilt_trees, waiting_trees, spent, refit_time, .. } =
            self.report;
        let millis = |time: std::time::Duration| time.as_secs_f64() * 1e3;
        format!(
            r#"{{"lights": {}, "instances": {}, "moved": {moved_instances}, "refitted": {refit_trees}, "rebuilt": {rebuilt_trees}, "waiting": {waiting_trees}, "spent": {:.3}, "refit": {:.3}, "frames": {}, "rebuiltSoFar": {}, "refittedSoFar": {}, "variants": {}, "hasVariant": {}, "software": {}, "stillFrames": {}, "adapter": "{}"}}"#,
            world.light_count(),
            world.instances().len(),
            millis(spent),
            millis(refit_time),
            self.totals.frames,
            self.totals.rebuilt_trees,
            self.totals.refit_trees,
            self.pipelines.variant_count(),
            self.pipelines.has(self.lights.effects()),
            self.gpu.is_software,
            self.still_frames,
            self.gpu.name.replace(['"', '\\'], "'"),
        )
    }
}

impl City {
    /// Begins a picture that has nothing in common with the last one.
    fn restart(&mut self) {
        self.since = Since::Restart;
        self.still_frames = 0;
    }

    /// The present lights, in a new list if the last one is out of date.
    fn uniform_list(&mut self) -> LightList {
        let Self { gpu, stage, .. } = self;
        match self.list.take() {
            Some(list) if list.is_of(&stage.world) => list,
            _ => LightList::new(&gpu.device, &gpu.queue, &stage.world),
        }
    }

    fn take_over(&mut self) {
        if self.tour.take().is_some() {
            self.flight = Flight::new(&self.stage.scene.camera);
        }
    }

    /// Moves the lights and the objects, updates the light trees within the budget, uploads what
    /// changed, and records the build of the top level.
    fn advance(&mut self, seconds: f64, encoder: &mut wgpu::CommandEncoder) -> Result<(), String> {
        let Self { gpu, stage: Stage { scene, world, animation }, geometry, lights, .. } = self;
        let moves = !self.is_frozen || self.totals.frames == 0;
        if moves {
            self.time += seconds;
            animation.advance(self.time, scene, world).map_err(text)?;
        }
        world.set_viewpoint(scene.camera.eye.as_dvec3()).map_err(text)?;
        self.report = world.update(self.budget);
        self.totals.rebuilt_trees += self.report.rebuilt_trees;
        self.totals.refit_trees += self.report.refit_trees;
        let change = if moves { geometry.update(scene).map_err(text)? } else { GeometryChange::default() };
        self.buffers.upload(&gpu.queue, geometry, &change);
        lights.upload(world).map_err(text)?;
        lights.build_top(encoder);
        self.pipelines.fit(geometry);
        Ok(())
    }

    /// Moves the camera, and finds out whether anything moved.
    fn fly(&mut self, seconds: f64) {
        let camera = match &mut self.tour {
            Some(time) => {
                *time += seconds;
                tour::camera(&self.start, *time)
            }
            None => self.flight.camera(),
        };
        let is_still = self.is_frozen && camera == self.stage.scene.camera;
        self.stage.scene.camera = camera;
        self.still_frames = if is_still && self.since != Since::Restart { self.still_frames + 1 } else { 0 };
        if is_still && self.since == Since::Motion {
            self.since = Since::Nothing;
        }
    }

    /// The uniform of a picture of the present scene, without samples.
    pub(crate) fn frame_uniform(&self, spp: u32, seed: u32) -> FrameUniform {
        let size = self.picture.size;
        let options = PictureOptions { size, spp, candidates: CANDIDATES, seed };
        let mut frame = FrameUniform::new(&self.stage.scene, &self.geometry, self.buffers.first_object(), &options);
        frame.row_end = size[1];
        frame
    }

    /// Records the passes that render, or one that shades by a list of lights. The uniform is written ahead
    /// of the next submission.
    pub(crate) fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        frame: &FrameUniform,
        listed: Option<(Listed, &LightList)>,
    ) {
        let Self { gpu, stage, lights, buffers, picture, pipelines, .. } = self;
        gpu.queue.write_buffer(&buffers.uniform, 0, bytemuck::bytes_of(frame));
        let groups = [frame.width.div_ceil(WORKGROUP), frame.height.div_ceil(WORKGROUP)];
        let dispatch = |encoder: &mut wgpu::CommandEncoder,
                        pipeline: &wgpu::ComputePipeline,
                        lights: &GpuLights,
                        list: Option<&LightList>| {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &picture.group, &[]);
            pass.set_bind_group(LIGHT_GROUP, lights.bind_group(), &[]);
            if let Some(list) = list {
                pass.set_bind_group(LIGHT_GROUP + 1, &list.group, &[]);
            }
            pass.dispatch_workgroups(groups[0], groups[1], 1);
        };
        let effects = lights.effects();
        if let Some((listed, list)) = listed {
            let pipeline = pipelines.get_listed(listed, effects, list);
            dispatch(encoder, pipeline, lights, Some(list));
            return;
        }
        let Variant { mark, render } = pipelines.get(effects);
        let camera = &stage.scene.camera;
        let pixel = 2.0 * (0.5 * camera.vertical_fov).tan() / frame.height as f32;
        lights.set_cut_view(camera.eye.as_dvec3(), pixel);
        dispatch(encoder, mark, lights, None);
        lights.build_cuts(encoder);
        dispatch(encoder, render, lights, None);
    }
}
