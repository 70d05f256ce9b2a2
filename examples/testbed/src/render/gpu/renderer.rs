//! The frames of the GPU backend.

use super::backend::Gpu;
use super::geometry::{Geometry, GeometryChange, Occluders};
use super::image::{Image, ShadowRays};
use super::scene::{Scene, SceneError};
use super::settings::{LightChoice, Settings, cut_options, pixel_size};
use super::shading::View;
use crate::common::gpu::{read, wait};
use girandole::glam::Vec4;
use girandole::gpu::{GpuLights, GpuOptions, LightShader};
use girandole::wgpu;
use girandole::{Effects, LightWorld};

use super::buffers::Buffers;
use super::festival::FestivalKernels;
use super::pipeline::{LIGHT_GROUP, Needs, WORKGROUP, Work, pipeline};
use super::records::{FrameUniform, PictureOptions};

/// Most pixels of a band.
const BAND_PIXELS: u32 = 1 << 20;
/// Samples per dispatch: a fraction of a second on the slowest driver, which runs on the CPU.
const DISPATCH_SAMPLES: u32 = 1 << 18;

/// The storage buffers of a shader: five of the scene, and seven of the lights.
const STORAGE_BUFFERS: u32 = 12;

/// What an update of the device cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct GpuUpdate {
    /// Bytes of light data that the library uploaded.
    pub light_bytes: u64,
    /// Bytes of objects and of the upper hierarchy that the renderer uploaded.
    pub geometry_bytes: u64,
}

/// Renders frames on a device.
pub struct GpuRenderer {
    gpu: Box<Gpu>,
    lights: GpuLights,
    buffers: Buffers,
    layout: wgpu::BindGroupLayout,
    bind_group: wgpu::BindGroup,
    /// The library's text that the pipelines were compiled with.
    shader: LightShader,
    /// What they were compiled for.
    needs: Needs,
    pipelines: Pipelines,
    /// If the scene has a festival.
    festival: Option<FestivalKernels>,
    /// Rows of a band.
    band_rows: u32,
    /// The frame whose pixels have kept lights.
    last: Option<KeptFrame>,
}

/// A frame whose pixels have kept lights.
#[derive(Clone, Copy)]
struct KeptFrame {
    view: View,
    size: [u32; 2],
    /// The first of its records.
    first: u32,
    top_root: u32,
    occluders: Occluders,
}

struct Pipelines {
    mark: wgpu::ComputePipeline,
    render: wgpu::ComputePipeline,
}

impl Pipelines {
    /// Compiles both. `layout` is that of the scene's bind group.
    fn new(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, shader: &LightShader, needs: Needs) -> Self {
        Self {
            mark: pipeline(device, layout, shader, needs, Work::Mark),
            render: pipeline(device, layout, shader, needs, Work::Render),
        }
    }
}

/// The rows of a band.
fn band_rows(settings: &Settings) -> u32 {
    (BAND_PIXELS / settings.width).clamp(1, settings.height)
}

impl GpuRenderer {
    /// Uploads the geometry and compiles a shader for a light world with these effects.
    ///
    /// Refuses a scene that exceeds the limits or the memory of the device.
    pub fn new(
        gpu: Box<Gpu>,
        scene: &Scene,
        geometry: &Geometry,
        effects: Effects,
        settings: &Settings,
    ) -> Result<Self, SceneError> {
        let device = &gpu.device;
        let band_rows = band_rows(settings);
        let buffers = Buffers::new(&gpu, scene, geometry, u64::from(settings.width) * u64::from(band_rows))?;
        let (layout, bind_group) = buffers.bind(device);
        let options = GpuOptions::default().with_cuts(cut_options(settings)).with_previous();
        let lights = GpuLights::with_options(device, &gpu.queue, options).map_err(|e| SceneError(e.to_string()))?;
        let effects = effects - Effects::MOVING;
        let shader = lights.shader(LIGHT_GROUP, effects);
        let needs = Needs::new(scene, geometry);
        let offered = device.limits().max_storage_buffers_per_shader_stage;
        if offered < STORAGE_BUFFERS {
            let error = format!("the city needs {STORAGE_BUFFERS} storage buffers in a shader; this GPU has {offered}");
            return Err(SceneError(error));
        }
        let pipelines = Pipelines::new(device, &layout, &shader, needs);
        let festival = scene.festival.as_ref().map(|festival| FestivalKernels::new(device, &lights, festival));
        let mut renderer = Self {
            gpu,
            lights,
            buffers,
            layout,
            bind_group,
            shader,
            needs,
            pipelines,
            festival,
            band_rows,
            last: None,
        };
        renderer.set_settings(settings)?;
        Ok(renderer)
    }

    /// Destroys the device, as a driver that crashed would.
    pub fn lose_device(&self) {
        self.gpu.device.destroy();
    }

    /// Prepares for pictures with other settings. Fails if the device has no memory for their size.
    pub fn set_settings(&mut self, settings: &Settings) -> Result<(), SceneError> {
        self.band_rows = band_rows(settings);
        let band_pixels = u64::from(settings.width) * u64::from(self.band_rows);
        let mut is_bound = !self.buffers.set_band(&self.gpu, band_pixels)?;
        let pixels = u64::from(settings.width) * u64::from(settings.height);
        // Once they keep lights, pixels go on, so that no pipeline is compiled when a camera stops.
        if settings.reused() > 0 || self.needs.reuse {
            is_bound &= !self.buffers.set_kept(&self.gpu, pixels)?;
        }
        if !is_bound {
            (self.layout, self.bind_group) = self.buffers.bind(&self.gpu.device);
        }
        let reuse = self.buffers.kept.is_some();
        if reuse != self.needs.reuse {
            self.needs.reuse = reuse;
            self.pipelines = Pipelines::new(&self.gpu.device, &self.layout, &self.shader, self.needs);
        }
        Ok(())
    }

    /// Tells the world what the GPU has found out about lights that kernels move: before it is updated.
    pub fn follow(&mut self, world: &mut LightWorld) {
        self.lights.follow_sources(world);
    }

    /// Uploads what changed, has kernels move their lights, and builds the top level of the light trees.
    pub fn update(
        &mut self,
        scene: &Scene,
        geometry: &Geometry,
        change: &GeometryChange,
        world: &LightWorld,
    ) -> Result<GpuUpdate, SceneError> {
        if self.last.is_some() {
            self.buffers.scene.keep(&self.gpu.device, &self.gpu.queue);
        }
        let geometry_bytes = self.buffers.scene.upload(&self.gpu.queue, geometry, change);
        let light_bytes = self.lights.upload(world).map_err(|e| SceneError(e.to_string()))?.bytes;
        // The effect MOVING changes no shader. An interactive program would compile on another thread
        // and use a more general pipeline until then. This one blocks on purpose, so that the same seed
        // always gives the same picture.
        let effects = world.effects() - Effects::MOVING;
        if self.needs.grow(geometry) || effects != self.shader.effects {
            self.shader = self.shader.with_effects(effects);
            self.pipelines = Pipelines::new(&self.gpu.device, &self.layout, &self.shader, self.needs);
        }
        self.build_top(scene, world);
        Ok(GpuUpdate { light_bytes, geometry_bytes })
    }

    /// Renders a frame. `progress` receives the finished share, from 0 to 1.
    pub fn render(
        &mut self,
        scene: &Scene,
        geometry: &Geometry,
        settings: &Settings,
        seed: u32,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<(Image, ShadowRays), SceneError> {
        let options = PictureOptions {
            size: [settings.width, settings.height],
            spp: settings.spp,
            candidates: settings.candidates,
            seed,
        };
        let mut frame = FrameUniform::new(scene, geometry, self.buffers.scene.first_object(), &options);
        let kept = self.begin_reuse(scene, geometry, settings, &mut frame);
        self.build_cuts(scene, settings, &frame)?;
        let mut rays = ShadowRays::default();
        let mut sums: Vec<Vec4> = Vec::with_capacity(settings.width as usize * settings.height as usize);
        while frame.row_end < settings.height {
            frame.row_begin = frame.row_end;
            frame.row_end = (frame.row_begin + self.band_rows).min(settings.height);
            let band = settings.width * (frame.row_end - frame.row_begin);
            let step = (DISPATCH_SAMPLES / band).max(1);
            frame.sample_end = 0;
            while frame.sample_end < settings.spp {
                frame.sample_begin = frame.sample_end;
                frame.sample_end = frame.sample_begin.saturating_add(step).min(settings.spp);
                self.dispatch(&frame)?;
                let band_share = f64::from(frame.sample_end) / f64::from(settings.spp);
                let rows = f64::from(frame.row_begin) + band_share * f64::from(frame.row_end - frame.row_begin);
                progress(rows / f64::from(settings.height));
            }
            if let (Some(kernels), Some(festival)) = (&self.festival, &scene.festival) {
                kernels.draw(&self.gpu.device, &self.gpu.queue, &self.buffers.image, &frame, festival);
            }
            let pixels: Vec<Vec4> = read(&self.gpu.device, &self.gpu.queue, &self.buffers.image).map_err(SceneError)?;
            let (colors, counts) = pixels[..2 * band as usize].split_at(band as usize);
            sums.extend_from_slice(colors);
            // Whole numbers of at most the samples per pixel, which f32 holds exactly.
            let count = |pixel: &Vec4| ShadowRays { traced: pixel.x as u64, skipped: pixel.y as u64 };
            rays = counts.iter().map(count).fold(rays, |a, b| a + b);
        }
        self.last = kept;
        Ok((Image::from_sums(settings.width, settings.height, settings.spp, sums.into_iter()), rays))
    }

    /// Lets pixels take over lights of the last frame. Returns what the next one takes over.
    fn begin_reuse(
        &self,
        scene: &Scene,
        geometry: &Geometry,
        settings: &Settings,
        frame: &mut FrameUniform,
    ) -> Option<KeptFrame> {
        let size = [settings.width, settings.height];
        if settings.reused() == 0 || !self.needs.reuse {
            return None;
        }
        if let Some(last) = self.last.filter(|last| last.size == size) {
            frame.kept_draws = settings.reused() as f32;
            frame.kept_first_then = last.first;
            frame.kept_first = if last.first == 0 { size[0] * size[1] } else { 0 };
            (frame.eye_then, frame.forward_then) = (last.view.eye, last.view.forward);
            (frame.right_then, frame.up_then) = (last.view.right, last.view.up);
            frame.top_root_then = last.top_root;
            [frame.first_object_then, frame.top_first_then] = self.buffers.scene.first_then();
            (frame.occluder_min_then, frame.occluder_max_then) = (last.occluders.min, last.occluders.max);
        }
        let view = View::new(&scene.camera, size[0], size[1]);
        let (top_root, occluders) = (geometry.top.root, geometry.occluders);
        Some(KeptFrame { view, size, first: frame.kept_first, top_root, occluders })
    }

    /// Has kernels move their lights, then builds the top level of the light trees.
    fn build_top(&mut self, scene: &Scene, world: &LightWorld) {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        if let (Some(kernels), Some(festival)) = (&mut self.festival, &scene.festival) {
            kernels.record(&self.gpu.queue, &mut encoder, &mut self.lights, world, festival);
        }
        self.lights.build_top(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Marks the cells of the surfaces that the first sample of each pixel shows, and builds their cuts.
    /// [`LightChoice::Roots`] marks nothing, so no cell has a cut.
    fn build_cuts(&mut self, scene: &Scene, settings: &Settings, frame: &FrameUniform) -> Result<(), SceneError> {
        self.lights.set_cut_view(scene.camera.eye.as_dvec3(), pixel_size(scene, settings));
        let frame = FrameUniform { row_begin: 0, row_end: settings.height, ..*frame };
        self.gpu.queue.write_buffer(&self.buffers.scene.uniform, 0, bytemuck::bytes_of(&frame));
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        if settings.light_choice != LightChoice::Roots {
            self.pass(&mut encoder, &self.pipelines.mark, &frame);
        }
        self.lights.build_cuts(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
        wait(&self.gpu.device).map_err(SceneError)
    }

    /// Records the work on the pixels of some rows.
    fn pass(&self, encoder: &mut wgpu::CommandEncoder, pipeline: &wgpu::ComputePipeline, frame: &FrameUniform) {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &self.bind_group, &[]);
        pass.set_bind_group(LIGHT_GROUP, self.lights.bind_group(), &[]);
        let rows = frame.row_end - frame.row_begin;
        pass.dispatch_workgroups(frame.width.div_ceil(WORKGROUP), rows.div_ceil(WORKGROUP), 1);
    }

    fn dispatch(&self, frame: &FrameUniform) -> Result<(), SceneError> {
        self.gpu.queue.write_buffer(&self.buffers.scene.uniform, 0, bytemuck::bytes_of(frame));
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.pass(&mut encoder, &self.pipelines.render, frame);
        self.gpu.queue.submit([encoder.finish()]);
        // Waiting keeps the progress bar accurate and the queue short. It costs little beside a
        // dispatch.
        wait(&self.gpu.device).map_err(SceneError)
    }
}
