//! Renders what the controls ask for, one picture after the other.

use super::accumulation::Accumulation;
use super::app::options::Options;
use super::app::session::{FrameStats, Pace, Session};
use super::app::stage_times::Laps;
use super::controls::{Controls, ViewKind};
use super::drawing::{Drawn, draw};
use super::looseness::looseness;
use super::noise_view::noise_picture;
use super::overlay::Overlay;
use girandole::{FrameBudget, TreeKey};
use std::collections::HashMap;
use std::time::Duration;
use testbed::render::backend::{self, BackendChoice};
use testbed::render::image::Image;
use testbed::render::settings::Settings;
use testbed::render::shading::View;
use testbed::scene::{Camera, SceneError};
use testbed::tone_mapping::tone_map;

/// A picture and what is drawn over it.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Three sRGB bytes per pixel, row by row from the top.
    pub pixels: Vec<u8>,
    /// Drawn over the picture, which is darkened for it.
    pub overlay: Option<Overlay>,
    /// What the frame did and cost.
    pub stats: FrameStats,
    /// Frames that are accumulated in a pixel, on average.
    pub frames: f32,
    /// What the user should know: why a wish was not granted, or where frames are rendered since a
    /// device was lost.
    pub notice: Option<String>,
}

/// What the window asks a viewer for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// The controls.
    pub controls: Controls,
    /// The camera; `None` for that of the scene.
    pub camera: Option<Camera>,
    /// Width and height of the picture in pixels.
    pub size: (u32, u32),
}

/// The last filtered picture, and the boxes over it. They are shown until rendering has taken as long as
/// the filter did.
struct Filtered {
    size: (u32, u32),
    view: ViewKind,
    image: Image,
    overlay: Option<Overlay>,
    /// Time that the filter took.
    cost: Duration,
    /// Time that rendering has taken since then.
    rendering: Duration,
}

impl Filtered {
    /// The same after a frame, whose rendering took some time; `None` if the next filter is due.
    fn unless_due(self, rendering: Duration) -> Option<Self> {
        let rendering = self.rendering + rendering;
        (rendering < self.cost).then_some(Self { rendering, ..self })
    }
}

/// Renders a scene that the user flies through.
pub struct Viewer {
    options: Options,
    session: Session,
    /// Where frames are rendered, for the user.
    backend: String,
    accumulation: Accumulation,
    filtered: Option<Filtered>,
    /// How loose the trees of a dump are.
    looseness: Option<HashMap<TreeKey, f32>>,
    /// The controls of the last picture, and its camera.
    last: Controls,
    seen_from: Option<Camera>,
}

impl Viewer {
    /// Loads the scene of the options.
    pub fn new(options: &Options, controls: &Controls) -> Result<Self, SceneError> {
        Self::with_backend(options, controls, options.backend)
    }

    fn with_backend(options: &Options, controls: &Controls, choice: BackendChoice) -> Result<Self, SceneError> {
        let mut options = options.clone();
        if let Some(cars) = controls.cars {
            options.scene.cars = Some(cars);
        }
        let chosen = backend::choose(choice)?;
        let backend = chosen.to_string();
        let session = Session::new(options.scene.load(options.size)?, options.settings(), options.pace(), chosen)?;
        let accumulation = Accumulation::default();
        let looseness = options.open.is_some().then(|| looseness(session.world()));
        Ok(Self {
            options,
            session,
            backend,
            accumulation,
            filtered: None,
            looseness,
            last: *controls,
            seen_from: None,
        })
    }

    /// Where frames are rendered.
    pub fn backend(&self) -> &str {
        &self.backend
    }

    /// The present camera.
    pub fn camera(&self) -> Camera {
        self.session.scene().camera
    }

    /// What the user should know about the scene's files.
    pub fn warnings(&self) -> Vec<String> {
        self.session.scene().warnings.clone()
    }

    /// Goes back to the start of the scene, with the same seed. The camera and the exposure stay.
    pub fn rewind(&mut self, controls: &Controls) -> Result<(), SceneError> {
        self.restart(controls, self.options.backend)
    }

    fn restart(&mut self, controls: &Controls, choice: BackendChoice) -> Result<(), SceneError> {
        let (camera, exposure) = (self.camera(), self.session.exposure());
        *self = Self::with_backend(&self.options, controls, choice)?;
        self.session.set_camera(camera);
        if let Some(exposure) = exposure {
            self.session.set_exposure(exposure);
        }
        Ok(())
    }

    /// Destroys the device that renders, if there is one, as a driver that crashed would.
    pub fn lose_device(&self) {
        self.session.lose_device();
    }

    /// Renders the next frame. `step` lets the scene's time go on by one frame although it stands
    /// still. After a lost device, the scene starts again on a new one, or else on the CPU.
    pub fn frame(&mut self, wish: &Wish, step: bool) -> Result<Shown, SceneError> {
        let mut notice = None;
        if wish.controls.cars != self.last.cars
            && let Err(error) = self.rewind(&wish.controls)
        {
            // The scene stays as it is, and this number of cars is not tried again.
            (self.last.cars, notice) = (wish.controls.cars, Some(error.to_string()));
        }
        let shown = self.try_frame(wish, step).or_else(|error| {
            self.rewind(&wish.controls).or_else(|_| self.restart(&wish.controls, BackendChoice::Cpu))?;
            notice = Some(format!("{error}; {}", self.backend));
            self.try_frame(wish, step).or_else(|_| {
                self.restart(&wish.controls, BackendChoice::Cpu)?;
                notice = Some(format!("{error}; {}", self.backend));
                self.try_frame(wish, step)
            })
        })?;
        Ok(Shown { notice, ..shown })
    }

    fn try_frame(&mut self, wish: &Wish, step: bool) -> Result<Shown, SceneError> {
        let Wish { controls, camera, size } = wish;
        self.apply(controls, *size)?;
        if let Some(camera) = camera {
            self.session.set_camera(*camera);
        }
        self.session.set_frozen(controls.is_frozen && !step);
        let is_still = self.session.is_still();
        // Frames that add up to one picture are independent.
        let is_moving = !is_still || self.seen_from != Some(self.camera());
        let reused_frames = if is_moving && controls.is_reused { self.options.reused_frames } else { 0 };
        self.session.set_settings(Settings { reused_frames, ..self.session.settings().clone() })?;
        self.seen_from = Some(self.camera());
        let frame = self.session.frame(&|_| {})?;
        let is_other_sampler = controls.sampler != self.last.sampler;
        if is_other_sampler || !controls.is_accumulated {
            self.accumulation.clear();
        }
        self.last = *controls;

        let mut laps = Laps::start();
        let mut stats = frame.stats;
        let scene = self.session.scene();
        let accumulated = self.accumulation.add(&frame.image, scene, self.session.geometry(), is_still);
        stats.times.denoising = laps.lap();
        let is_filtered = controls.is_filtered && controls.view != ViewKind::Noise;
        let is_same = |last: &Filtered| (last.size, last.view) == (*size, controls.view) && !is_other_sampler && !step;
        let last = self.filtered.take().filter(|last| is_filtered && is_same(last));
        let exposure = scene.exposure * controls.exposure_ev.exp2();
        let (pixels, overlay) = if let Some(last) = last.and_then(|last| last.unless_due(stats.times.rendering)) {
            let last = self.filtered.insert(last);
            (tone_map(&last.image, exposure), last.overlay.clone())
        } else if is_filtered {
            let image = self.session.denoise(&accumulated);
            let (cost, view, overlay) = (laps.lap(), controls.view, self.overlay(controls, *size));
            stats.times.denoising += cost;
            let pixels = tone_map(&image, exposure);
            let rendering = Duration::ZERO;
            self.filtered = Some(Filtered { size: *size, view, image, overlay: overlay.clone(), cost, rendering });
            (pixels, overlay)
        } else {
            let pixels = match controls.view {
                ViewKind::Noise => noise_picture(&accumulated, &self.accumulation.clear_pixels()),
                _ => tone_map(&accumulated, exposure),
            };
            (pixels, self.overlay(controls, *size))
        };
        stats.times.tone_mapping = laps.lap();
        let frames = self.accumulation.mean_frames();
        Ok(Shown { width: size.0, height: size.1, pixels, overlay, stats, frames, notice: None })
    }

    /// Takes over the controls that are settings of the renderer.
    fn apply(&mut self, controls: &Controls, (width, height): (u32, u32)) -> Result<(), SceneError> {
        let settings = Settings {
            width,
            height,
            spp: controls.spp,
            splits: controls.splits,
            candidates: controls.candidates,
            light_choice: controls.sampler,
            ..self.session.settings().clone()
        };
        self.session.set_settings(settings)?;
        let budget = FrameBudget::new(Duration::from_secs_f64(controls.budget_ms.max(0.0) * 1e-3));
        self.session.set_pace(Pace { budget, ..self.options.pace() });
        Ok(())
    }

    fn overlay(&self, controls: &Controls, (width, height): (u32, u32)) -> Option<Overlay> {
        let view = View::new(&self.camera(), width, height);
        match controls.view {
            ViewKind::Picture | ViewKind::Noise => None,
            ViewKind::Trees => {
                let Controls { level, has_lights, .. } = *controls;
                let drawn = Drawn { level, has_lights, looseness: self.looseness.as_ref() };
                Some(draw(self.session.world(), &view, (width, height), &drawn))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::app::options::Parsed;
    use super::super::colors::NOTHING;
    use super::*;
    use girandole::glam::Vec3;
    use testbed::render::settings::LightChoice;

    const SIZE: (u32, u32) = (48, 27);

    fn controls() -> Controls {
        Controls {
            view: ViewKind::Picture,
            level: 0,
            has_lights: false,
            sampler: LightChoice::Girandole,
            budget_ms: 1.0,
            splits: 6,
            candidates: 4,
            spp: 1,
            cars: Some(40),
            exposure_ev: 0.0,
            pixel_size: 4,
            is_filtered: false,
            is_accumulated: false,
            is_reused: true,
            is_frozen: false,
        }
    }

    fn viewer(backend: &str) -> Viewer {
        let Ok(Parsed::Run(options)) = Options::read(["city", "--window", "--backend", backend]) else {
            panic!("valid options");
        };
        Viewer::new(&options, &controls()).expect("the city is valid")
    }

    fn wish(controls: Controls) -> Wish {
        Wish { controls, camera: None, size: SIZE }
    }

    /// The next picture.
    fn shown(viewer: &mut Viewer, controls: Controls) -> Shown {
        viewer.frame(&wish(controls), false).expect("a scene that renders")
    }

    #[test]
    fn a_rewound_scene_repeats_its_pictures() {
        let mut viewer = viewer("cpu");
        let first: Vec<Shown> = (0..3).map(|_| shown(&mut viewer, controls())).collect();
        assert_ne!(first[0].pixels, first[2].pixels);
        viewer.rewind(&controls()).expect("the city is valid");
        for picture in first {
            let again = shown(&mut viewer, controls());
            assert_eq!((again.stats.frame, again.pixels == picture.pixels), (picture.stats.frame, true));
        }
        viewer.session.set_exposure(0.125);
        viewer.rewind(&controls()).expect("the city is valid");
        assert_eq!(viewer.session.exposure(), Some(0.125));
    }

    #[test]
    fn time_stands_still_while_frozen_and_steps_on_request() {
        let mut viewer = viewer("cpu");
        let frozen = Controls { is_frozen: true, ..controls() };
        // The first frame brings the scene to its start, whatever the controls say.
        shown(&mut viewer, frozen);
        let transforms =
            |viewer: &Viewer| -> Vec<_> { viewer.session.scene().objects.iter().map(|o| o.transform).collect() };
        let start = transforms(&viewer);
        assert_eq!(shown(&mut viewer, frozen).stats.moved_instances, 0);
        assert!(transforms(&viewer) == start);
        viewer.frame(&wish(frozen), true).expect("a scene that renders");
        let stepped = transforms(&viewer);
        assert!(stepped != start);
        shown(&mut viewer, frozen);
        assert!(transforms(&viewer) == stepped);
    }

    #[test]
    fn each_view_and_each_sampler_shows_something_of_its_own() {
        let mut viewer = viewer("cpu");
        let bytes = (SIZE.0 * SIZE.1 * 3) as usize;
        for (sampler, _) in super::super::controls::SAMPLERS {
            let picture = shown(&mut viewer, Controls { sampler, ..controls() });
            assert!(picture.pixels.len() == bytes && picture.overlay.is_none());
            assert!(picture.pixels.iter().any(|byte| *byte > 100), "{sampler:?} is dark");
        }
        let with = |viewer: &mut Viewer, view| shown(viewer, Controls { view, ..controls() });
        let trees = with(&mut viewer, ViewKind::Trees).overlay.expect("an overlay");
        assert!(trees.lines.len() > 1000);
        let noise = with(&mut viewer, ViewKind::Noise);
        assert!(noise.overlay.is_none() && noise.pixels.iter().any(|byte| *byte > 200));
        // Above the middle of the street is the sky.
        let pixel = |x: usize, y: usize| &noise.pixels[(y * SIZE.0 as usize + x) * 3..][..3];
        assert!(pixel(24, 0) == NOTHING && pixel(24, 24) != NOTHING);
    }

    #[test]
    fn another_number_of_cars_loads_the_scene_anew_unless_it_is_refused() {
        let mut viewer = viewer("cpu");
        let before = shown(&mut viewer, controls()).stats.instances;
        let more = shown(&mut viewer, Controls { cars: Some(60), ..controls() });
        assert_eq!((more.stats.frame, more.notice), (0, None));
        assert!(more.stats.instances > before);
        let too_many = Controls { cars: Some(usize::MAX), ..controls() };
        let refused = shown(&mut viewer, too_many);
        assert!(refused.notice.is_some_and(|notice| notice.contains("cars")));
        assert_eq!((refused.stats.frame, refused.stats.instances), (1, more.stats.instances));
        assert_eq!(shown(&mut viewer, too_many).notice, None, "it is said once");
    }

    #[test]
    fn a_moved_camera_a_new_size_and_other_settings_apply_at_once() {
        for backend in ["cpu", "gpu"] {
            let mut viewer = viewer(backend);
            let first = shown(&mut viewer, Controls { is_accumulated: true, ..controls() });
            let mut camera = viewer.camera();
            (camera.eye, camera.target) = (camera.eye + Vec3::Y * 20.0, camera.target + Vec3::Y * 20.0);
            let controls =
                Controls { is_accumulated: true, is_filtered: true, splits: 2, candidates: 1, spp: 2, ..controls() };
            let wish = Wish { controls, camera: Some(camera), size: (33, 20) };
            let moved = viewer.frame(&wish, false).expect("a scene that renders");
            assert_eq!((moved.width, moved.height, moved.pixels.len()), (33, 20, 33 * 20 * 3));
            assert_eq!((first.frames, moved.frames), (1.0, 1.0));
            assert_eq!(viewer.camera(), camera);
        }
    }

    #[test]
    fn the_filter_takes_no_longer_than_rendering() {
        let with = |cost| Filtered {
            size: SIZE,
            view: ViewKind::Picture,
            image: Image { width: 1, height: 1, pixels: vec![Vec3::ZERO], variance: vec![0.0] },
            overlay: None,
            cost: Duration::from_millis(cost),
            rendering: Duration::ZERO,
        };
        let frames = |cost| {
            let mut last = Some(with(cost));
            (1..).find(|_| {
                last = last.take().and_then(|last| last.unless_due(Duration::from_millis(4)));
                last.is_none()
            })
        };
        assert_eq!([1, 4, 5, 10, 400].map(frames), [1, 1, 2, 3, 100].map(Some));
        // A picture of another size does not wait for its turn.
        let mut viewer = viewer("cpu");
        viewer.filtered = Some(with(u64::MAX));
        let controls = Controls { is_filtered: true, ..controls() };
        assert_eq!(shown(&mut viewer, controls).pixels.len(), 3, "the last filtered picture");
        let wish = Wish { size: (16, 9), ..wish(controls) };
        let shown = viewer.frame(&wish, false).expect("a scene that renders");
        assert_eq!(shown.pixels.len(), 16 * 9 * 3);
    }

    #[test]
    fn a_lost_device_is_replaced() {
        let mut viewer = viewer("gpu");
        assert_eq!(shown(&mut viewer, controls()).notice, None);
        viewer.lose_device();
        let again = shown(&mut viewer, controls());
        assert!(again.notice.is_some_and(|notice| notice.contains("backend: ")));
        assert_eq!(again.stats.frame, 0, "the scene starts again");
        assert_eq!(shown(&mut viewer, controls()).notice, None);
    }
}
