//! Draws egui's output into the window, and survives the loss of the device that draws.

use egui::{Context, FullOutput, ViewportId};
use egui_wgpu::winit::Painter;
use egui_wgpu::{RendererOptions, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use egui_winit::State;
use egui_winit::winit::event::WindowEvent;
use egui_winit::winit::event_loop::ActiveEventLoop;
use egui_winit::winit::window::Window;
use girandole::wgpu;
use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use testbed::scene::SceneError;

/// The colour of the window where nothing is drawn: until the first picture arrives.
const BACKGROUND: [f32; 4] = [0.02, 0.02, 0.02, 1.0];

/// The window, egui's state, and the device that draws both.
pub struct Presenter {
    window: Arc<Window>,
    context: Context,
    state: State,
    painter: Painter,
    /// Set when the device is lost or reports an error.
    is_lost: Arc<AtomicBool>,
}

impl Presenter {
    /// Opens a device for a window.
    pub fn new(window: Arc<Window>, event_loop: &ActiveEventLoop) -> Result<Self, SceneError> {
        let refuse = |error: String| SceneError(format!("cannot draw into a window: {error}"));
        let mut setup = WgpuSetupCreateNew::from_display_handle(event_loop.owned_display_handle());
        setup.instance_descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
        // Validation layers only print warnings about the drivers of others.
        setup.instance_descriptor.flags = wgpu::InstanceFlags::empty();
        let config = WgpuConfiguration { wgpu_setup: WgpuSetup::CreateNew(setup), ..Default::default() };
        let context = Context::default();
        let mut painter = pollster::block_on(Painter::new(context.clone(), config, false, RendererOptions::default()));
        pollster::block_on(painter.set_window(ViewportId::ROOT, Some(window.clone())))
            .map_err(|error| refuse(error.to_string()))?;
        let render_state = painter.render_state().ok_or_else(|| refuse("no adapter found".into()))?;
        let is_lost = Arc::new(AtomicBool::new(false));
        let mark = is_lost.clone();
        render_state.device.set_device_lost_callback(move |_, _| mark.store(true, Ordering::Relaxed));
        let mark = is_lost.clone();
        render_state.device.on_uncaptured_error(Arc::new(move |_| mark.store(true, Ordering::Relaxed)));
        let scale = window.scale_factor() as f32;
        let max_side = painter.max_texture_side();
        let state = State::new(context.clone(), ViewportId::ROOT, event_loop, Some(scale), None, max_side);
        Ok(Self { window, context, state, painter, is_lost })
    }

    /// The window.
    pub fn window(&self) -> &Arc<Window> {
        &self.window
    }

    /// Whether the device is lost, so that a new presenter must take the place of this one.
    pub fn is_lost(&self) -> bool {
        self.is_lost.load(Ordering::Relaxed)
    }

    /// Destroys the device on purpose, as a driver that crashed would.
    pub fn lose_device(&self) {
        if let Some(state) = self.painter.render_state() {
            state.device.destroy();
        }
        self.is_lost.store(true, Ordering::Relaxed);
    }

    /// Passes an event on to egui, and follows changes of the window's size.
    pub fn on_event(&mut self, event: &WindowEvent) {
        let response = self.state.on_window_event(&self.window, event);
        if response.repaint {
            self.window.request_redraw();
        }
        if let WindowEvent::Resized(size) = event
            && let (Some(width), Some(height)) = (NonZeroU32::new(size.width), NonZeroU32::new(size.height))
        {
            self.painter.on_window_resized(ViewportId::ROOT, width, height);
        }
    }

    /// Whether there is nothing to draw on: a minimised window has no size.
    pub fn is_hidden(&self) -> bool {
        let size = self.window.inner_size();
        size.width == 0 || size.height == 0 || self.window.is_minimized() == Some(true)
    }

    /// Runs egui and draws its output.
    pub fn draw(&mut self, run: impl FnMut(&mut egui::Ui)) {
        let input = self.state.take_egui_input(&self.window);
        let FullOutput { platform_output, mut textures_delta, shapes, pixels_per_point, .. } =
            self.context.run_ui(input, run);
        self.state.handle_platform_output(&self.window, platform_output);
        let shapes = self.context.tessellate(shapes, pixels_per_point);
        self.painter.paint_and_update_textures(
            ViewportId::ROOT,
            pixels_per_point,
            BACKGROUND,
            &shapes,
            &mut textures_delta,
            Vec::new(),
            &self.window,
        );
    }
}
