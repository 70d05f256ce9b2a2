//! The window itself: events, the picture, and keys.

use super::app::options::Options;
use super::controls::{Controls, ViewKind};
use super::overlay::Overlay;
use super::panel::{self, MAX_LEVEL, Press, Status};
use super::presenter::Presenter;
use super::recording::Recording;
use super::save::save_picture;
use super::viewer::{Shown, Wish};
use super::worker::{Reply, Request, Worker};
use egui::{Color32, ColorImage, Key, Pos2, Rect, Sense, Stroke, TextureHandle, TextureOptions, Ui};
use egui_winit::winit::application::ApplicationHandler;
use egui_winit::winit::dpi::PhysicalSize;
use egui_winit::winit::event::WindowEvent;
use egui_winit::winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use egui_winit::winit::window::{Window, WindowId};
use girandole::glam::Vec2;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use testbed::fly::{Flight, Motion};
use testbed::scene::SceneError;

/// Width and height of the window at first, pixels.
const WINDOW_SIZE: (u32, u32) = (1280, 720);
/// Pixels of the window along each side of a pixel of the picture at first: pictures are rendered
/// with a sixteenth of the window's pixels, so that two threads keep up.
const PIXEL_SIZE: u32 = 4;
/// Brightness of a picture under an overlay.
const DIMMED: Color32 = Color32::from_gray(70);

/// Runs until the user closes the window. `print` receives lines for the user.
pub fn run(options: &Options, print: &mut dyn FnMut(&str)) -> Result<(), SceneError> {
    let refuse = |error: &dyn std::fmt::Display| SceneError(format!("cannot open a window: {error}"));
    let event_loop = EventLoop::new().map_err(|error| refuse(&error))?;
    let mut shell = Shell::new(options, event_loop.create_proxy());
    event_loop.run_app(&mut shell).map_err(|error| refuse(&error))?;
    shell.warnings.iter().for_each(|warning| print(&format!("warning: {warning}")));
    if let Some(error) = shell.error {
        return Err(error);
    }
    print(&format!("{}; {} frame(s) shown, {} lost device(s) replaced", shell.backend, shell.frames, shell.replaced));
    Ok(())
}

/// The controls at first.
fn first_controls(options: &Options) -> Controls {
    let is_dump = options.open.is_some();
    Controls {
        view: if is_dump { ViewKind::Trees } else { ViewKind::Picture },
        level: options.level,
        has_lights: is_dump,
        sampler: options.sampler,
        budget_ms: options.budget_ms,
        splits: options.splits,
        candidates: options.candidates,
        spp: 1,
        cars: options.scene.procedural_cars(),
        exposure_ev: 0.0,
        pixel_size: PIXEL_SIZE,
        is_filtered: !is_dump,
        is_reused: true,
        is_accumulated: !is_dump,
        is_frozen: false,
    }
}

/// The state of the window.
struct Shell {
    /// Of the window at first, pixels.
    window_size: (u32, u32),
    /// Receives saved pictures.
    folder: PathBuf,
    is_dump: bool,
    worker: Worker,
    presenter: Option<Presenter>,
    controls: Controls,
    /// `None` until the scene is loaded.
    flight: Option<Flight>,
    /// The last wish that was sent; `None` while the window is hidden.
    wish: Option<Wish>,
    shown: Option<Shown>,
    texture: Option<TextureHandle>,
    recording: Recording,
    last_draw: Instant,
    backend: String,
    message: String,
    warnings: Vec<String>,
    error: Option<SceneError>,
    frames: u64,
    replaced: u32,
    saved: u32,
    /// The view that the title of the window names.
    titled: Option<ViewKind>,
}

/// The title of the window.
fn title(view: ViewKind) -> String {
    format!("Girandole: {}", view.name().to_lowercase())
}

impl Shell {
    fn new(options: &Options, proxy: egui_winit::winit::event_loop::EventLoopProxy<()>) -> Self {
        let window_size = options.window_size.unwrap_or(WINDOW_SIZE);
        let controls = first_controls(options);
        // Beside the panel.
        let size = (window_size.0.saturating_sub(panel::WIDTH as u32).max(1), window_size.1);
        let options = &Options { size, ..options.clone() };
        let wake = move || {
            // The event loop may have ended already; then nobody waits.
            let _ = proxy.send_event(());
        };
        Self {
            window_size,
            folder: options.folder().unwrap_or(Path::new(".")).to_owned(),
            is_dump: options.open.is_some(),
            worker: Worker::start(options, controls, wake),
            presenter: None,
            controls,
            flight: None,
            wish: None,
            shown: None,
            texture: None,
            recording: Recording::default(),
            last_draw: Instant::now(),
            backend: String::new(),
            message: String::new(),
            warnings: Vec::new(),
            error: None,
            frames: 0,
            replaced: 0,
            saved: 0,
            titled: None,
        }
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, error: SceneError) {
        self.error.get_or_insert(error);
        event_loop.exit();
    }

    /// Takes over what the worker has sent.
    fn receive(&mut self, event_loop: &ActiveEventLoop) {
        let replies: Vec<Reply> = self.worker.replies().collect();
        for reply in replies {
            match reply {
                Reply::Ready { backend, camera, warnings } => {
                    self.flight = Some(Flight::new(&camera));
                    self.message = warnings.join("\n");
                    (self.backend, self.warnings) = (backend, warnings);
                }
                Reply::Picture(shown) => {
                    self.frames += 1;
                    self.recording.add(&shown.stats);
                    if let Some(notice) = &shown.notice {
                        self.message.clone_from(notice);
                    }
                    self.shown = Some(*shown);
                    self.texture = None;
                }
                Reply::Failed(error) => return self.fail(event_loop, error),
            }
        }
        if let Some(presenter) = &self.presenter {
            presenter.window().request_redraw();
        }
    }

    /// Draws the window, and sends what the user wishes.
    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        let Some(mut presenter) = self.presenter.take() else { return };
        if presenter.is_lost() {
            // The window stays; egui and its device start anew.
            let window = presenter.window().clone();
            drop(presenter);
            self.texture = None;
            self.replaced += 1;
            presenter = match Presenter::new(window, event_loop) {
                Ok(presenter) => presenter,
                Err(error) => return self.fail(event_loop, error),
            };
        }
        if presenter.is_hidden() {
            if self.wish.take().is_some() {
                self.worker.send(Request::Hide);
            }
            self.presenter = Some(presenter);
            return;
        }
        let seconds = std::mem::replace(&mut self.last_draw, Instant::now()).elapsed().as_secs_f32().min(0.1);
        let mut asked = Asked::default();
        presenter.draw(|ui| {
            let frame = egui::Frame::side_top_panel(ui.style());
            let panel = egui::Panel::right("panel").resizable(false).exact_size(panel::WIDTH).frame(frame);
            panel.show(ui, |ui| asked.press = self.panel(ui).or(asked.press));
            egui::CentralPanel::no_frame().show(ui, |ui| self.picture(ui, seconds, &mut asked));
        });
        if self.titled != Some(self.controls.view) {
            presenter.window().set_title(&title(self.controls.view));
            self.titled = Some(self.controls.view);
        }
        if asked.loses_device {
            presenter.lose_device();
        }
        if asked.quits {
            event_loop.exit();
        }
        // A key that is held moves the camera in each redraw, without further events.
        if asked.moves || presenter.is_lost() {
            presenter.window().request_redraw();
        }
        self.presenter = Some(presenter);
        self.ask(&asked);
    }

    fn panel(&mut self, ui: &mut Ui) -> Option<Press> {
        let status = Status {
            backend: &self.backend,
            shown: self.shown.as_ref(),
            recording: &self.recording,
            speed: self.flight.map_or(0.0, |flight| flight.speed()),
            message: &self.message,
            is_dump: self.is_dump,
        };
        panel::show(ui, &mut self.controls, &status)
    }

    /// Shows the picture, and reads the pointer and the keys.
    fn picture(&mut self, ui: &mut Ui, seconds: f32, asked: &mut Asked) {
        let response = ui.allocate_response(ui.available_size(), Sense::click_and_drag());
        let area = response.rect;
        let pixels = area.size() * ui.ctx().pixels_per_point() / self.controls.pixel_size as f32;
        asked.size = ((pixels.x as u32).clamp(16, 4096), (pixels.y as u32).clamp(16, 4096));
        if let Some(shown) = &self.shown {
            let texture = self.texture.get_or_insert_with(|| {
                let size = [shown.width as usize, shown.height as usize];
                ui.ctx().load_texture("picture", ColorImage::from_rgb(size, &shown.pixels), TextureOptions::LINEAR)
            });
            let tint = if shown.overlay.is_some() { DIMMED } else { Color32::WHITE };
            let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
            ui.painter().image(texture.id(), area, whole, tint);
            if let Some(overlay) = &shown.overlay {
                paint(overlay, ui, area);
            }
        }
        if let Some(flight) = &mut self.flight {
            let drag = response.drag_delta() / area.height().max(1.0);
            if drag != egui::Vec2::ZERO {
                flight.turn(Vec2::new(drag.x, drag.y));
                asked.moves = true;
            }
            if response.hovered() {
                flight.change_speed(ui.input(|input| input.smooth_scroll_delta().y) / 50.0);
            }
            if !ui.ctx().egui_wants_keyboard_input() {
                let motion = motion(ui);
                asked.moves |= motion != Motion { hurries: motion.hurries, ..Motion::default() };
                flight.travel(motion, seconds);
            }
        }
        if !ui.ctx().egui_wants_keyboard_input() {
            self.keys(ui, asked);
        }
    }

    fn keys(&mut self, ui: &Ui, asked: &mut Asked) {
        let pressed = |key| ui.input(|input| input.key_pressed(key));
        for (view, key) in ViewKind::ALL.into_iter().zip([Key::Num1, Key::Num2, Key::Num3]) {
            if pressed(key) {
                self.controls.view = view;
            }
        }
        if pressed(Key::Plus) || pressed(Key::Equals) {
            self.controls.level = (self.controls.level + 1).min(MAX_LEVEL);
        }
        if pressed(Key::Minus) {
            self.controls.level = (self.controls.level - 1).max(-MAX_LEVEL);
        }
        if pressed(Key::L) {
            self.controls.has_lights = !self.controls.has_lights;
        }
        if pressed(Key::Space) {
            self.controls.is_frozen = !self.controls.is_frozen;
        }
        if pressed(Key::N) {
            (self.controls.is_frozen, asked.press) = (true, Some(Press::Step));
        }
        if pressed(Key::R) {
            asked.press = Some(Press::Rewind);
        }
        if pressed(Key::P) {
            asked.press = Some(Press::Save);
        }
        asked.quits |= pressed(Key::Escape);
        asked.loses_device |= pressed(Key::F10);
    }

    /// Sends what the user wishes, if it is new.
    fn ask(&mut self, asked: &Asked) {
        let Some(flight) = &self.flight else { return };
        let wish = Wish { controls: self.controls, camera: Some(flight.camera()), size: asked.size };
        if self.wish != Some(wish) {
            self.worker.send(Request::Show(wish));
            self.wish = Some(wish);
        }
        if asked.loses_device {
            self.worker.send(Request::LoseDevice);
        }
        match asked.press {
            Some(Press::Step) => self.worker.send(Request::Step),
            Some(Press::Rewind) => {
                self.recording.clear();
                self.worker.send(Request::Rewind);
            }
            Some(Press::Save) => self.save(),
            None => {}
        }
    }

    /// Saves the picture that is shown.
    fn save(&mut self) {
        let Some(shown) = &self.shown else { return };
        let place = |number| self.folder.join(format!("window_{number:04}.png"));
        // Pictures of earlier sessions stay.
        while place(self.saved).exists() {
            self.saved += 1;
        }
        let path = place(self.saved);
        self.message = match save_picture(&path, shown) {
            Ok(()) => format!("saved {}", path.display()),
            Err(error) => error.to_string(),
        };
        self.saved += 1;
    }
}

/// What the user asked for in one drawing of the window.
#[derive(Default)]
struct Asked {
    press: Option<Press>,
    /// The size of pictures that fits the window.
    size: (u32, u32),
    moves: bool,
    quits: bool,
    loses_device: bool,
}

/// Where the keys that are held take the camera.
fn motion(ui: &Ui) -> Motion {
    ui.input(|input| {
        let axis = |plus: [Key; 2], minus: [Key; 2]| {
            let any = |keys: [Key; 2]| f32::from(keys.into_iter().any(|key| input.key_down(key)));
            any(plus) - any(minus)
        };
        Motion {
            forward: axis([Key::W, Key::ArrowUp], [Key::S, Key::ArrowDown]),
            right: axis([Key::D, Key::ArrowRight], [Key::A, Key::ArrowLeft]),
            up: axis([Key::E, Key::PageUp], [Key::Q, Key::PageDown]),
            hurries: input.modifiers.shift,
        }
    })
}

fn paint(overlay: &Overlay, ui: &Ui, area: Rect) {
    let painter = ui.painter().with_clip_rect(area);
    let at = |place: Vec2| area.min + egui::vec2(place.x, place.y) * area.size();
    let color = |[r, g, b]: [u8; 3]| Color32::from_rgb(r, g, b);
    for line in &overlay.lines {
        painter.line_segment(line.ends.map(at), Stroke::new(1.0, color(line.color)));
    }
}

impl ApplicationHandler for Shell {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.presenter.is_some() {
            return;
        }
        event_loop.set_control_flow(ControlFlow::Wait);
        let (width, height) = self.window_size;
        let attributes = Window::default_attributes()
            .with_title(title(ViewKind::Picture))
            .with_inner_size(PhysicalSize::new(width, height));
        let window = event_loop.create_window(attributes).map(Arc::new);
        let presenter = match window {
            Ok(window) => Presenter::new(window, event_loop),
            Err(error) => Err(SceneError(format!("cannot open a window: {error}"))),
        };
        match presenter {
            Ok(presenter) => {
                presenter.window().request_redraw();
                self.presenter = Some(presenter);
            }
            Err(error) => self.fail(event_loop, error),
        }
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, (): ()) {
        self.receive(event_loop);
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if let Some(presenter) = &mut self.presenter {
            presenter.on_event(&event);
        }
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::RedrawRequested => self.draw(event_loop),
            // A window that is hidden gets these events, but no request to redraw.
            WindowEvent::Resized(_) | WindowEvent::Occluded(_) => self.draw(event_loop),
            _ => {}
        }
    }
}
