//! The panel at the side of the window: views, sliders, switches and plots.

use super::app::stage_times::StageTimes;
use super::colors::{NOTHING, Rgb, TOP_LEVEL, WAITING, inferno, viridis};
use super::controls::{Controls, SAMPLERS, ViewKind};
use super::noise_view::RANGE;
use super::recording::{Record, Recording};
use super::tree_boxes::{LOOSE, OLD, loose_color};
use super::viewer::Shown;
use egui::style::ScrollStyle;
use egui::{Button, Checkbox, Color32, Rangef, Slider, SliderClamping, TextStyle, Ui};
use egui_plot::{AxisHints, Line, Plot, PlotPoints};
use girandole::MAX_SPLITS;
use testbed::render::settings::MAX_CANDIDATES;

/// Width of the panel, points.
pub const WIDTH: f32 = 300.0;
/// Colour of text: lighter than egui's, whose grey is hard to read.
const TEXT: Color32 = Color32::from_gray(225);
/// Side of a square that shows a colour, points.
const KEY_SIDE: f32 = 10.0;
/// Height of a plot, points.
const PLOT_HEIGHT: f32 = 110.0;
/// Distances of the numbers beside a plot at which they begin to show and are clear, points.
const LABEL_SPACING: Rangef = Rangef { min: 11.0, max: 14.0 };
/// Colours of the stages of a frame: those of Okabe and Ito (2008) with a lighter blue, and a
/// grey and a green.
const STAGE_COLORS: [Color32; 9] = [
    Color32::from_gray(150),
    Color32::from_rgb(230, 159, 0),
    Color32::from_rgb(86, 180, 233),
    Color32::from_rgb(0, 158, 115),
    Color32::from_rgb(240, 228, 66),
    Color32::from_rgb(90, 160, 255),
    Color32::from_rgb(213, 94, 0),
    Color32::from_rgb(204, 121, 167),
    Color32::from_rgb(120, 200, 120),
];
/// Most samples per pixel and frame.
const MAX_SPP: u32 = 16;
/// Most cars that the slider offers.
const MAX_CARS: usize = 2000;

/// The farthest levels of trees from 0 that the panel offers.
pub const MAX_LEVEL: i32 = 12;

/// What the user did with a button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Press {
    /// One frame of the scene's time.
    Step,
    /// Back to the start.
    Rewind,
    /// Save the picture.
    Save,
}

/// What the panel tells.
pub struct Status<'a> {
    /// Where frames are rendered.
    pub backend: &'a str,
    /// The picture, if there is one.
    pub shown: Option<&'a Shown>,
    /// The last frames.
    pub recording: &'a Recording,
    /// The speed of the camera, metres per second.
    pub speed: f32,
    /// A message: a file that was saved, a warning.
    pub message: &'a str,
    /// Whether a dump is shown.
    pub is_dump: bool,
}

/// Shows the panel, changes the controls, and returns the button that was pressed.
pub fn show(ui: &mut Ui, controls: &mut Controls, status: &Status<'_>) -> Option<Press> {
    let mut press = None;
    ui.visuals_mut().override_text_color = Some(TEXT);
    // The bar shows that there is more below.
    ui.spacing_mut().scroll = ScrollStyle::solid();
    egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.horizontal_wrapped(|ui| {
            for (view, key) in ViewKind::ALL.into_iter().zip(1..) {
                ui.selectable_value(&mut controls.view, view, view.name()).on_hover_text(format!("Key {key}"));
            }
        });
        legend(ui, controls.view, status.is_dump);
        if controls.view == ViewKind::Trees {
            let level = Slider::new(&mut controls.level, -MAX_LEVEL..=MAX_LEVEL).clamping(SliderClamping::Edits);
            ui.add(level.text("level")).on_hover_text("- and +; 0 are instances, below it is the top level");
            ui.checkbox(&mut controls.has_lights, "lights").on_hover_text("L");
        }
        ui.separator();
        sliders(ui, controls);
        ui.separator();
        press = time_buttons(ui, controls);
        if ui.button("Save picture").on_hover_text("P").clicked() {
            press = Some(Press::Save);
        }
        ui.separator();
        numbers(ui, status);
        plots(ui, status.recording);
        ui.separator();
        ui.label(
            "W A S D fly, E and Q up and down, Shift faster, mouse wheel changes the speed; drag to look \
             around. Space stops the time, N steps, R rewinds, Esc closes.",
        );
    });
    press
}

fn sliders(ui: &mut Ui, controls: &mut Controls) {
    egui::ComboBox::from_label("sampler")
        .selected_text(SAMPLERS.iter().find(|(choice, _)| *choice == controls.sampler).map_or("", |(_, name)| name))
        .show_ui(ui, |ui| {
            for (choice, name) in SAMPLERS {
                ui.selectable_value(&mut controls.sampler, choice, name);
            }
        });
    ui.add(
        Slider::new(&mut controls.budget_ms, 0.0..=20.0)
            .logarithmic(true)
            .smallest_positive(0.01)
            .suffix(" ms")
            // Values of the command line beyond the range stay as they are.
            .clamping(SliderClamping::Edits)
            .text("budget"),
    );
    ui.add(Slider::new(&mut controls.splits, 0..=MAX_SPLITS).text("splits"));
    ui.add(Slider::new(&mut controls.candidates, 1..=MAX_CANDIDATES).text("candidates"));
    ui.add(Slider::new(&mut controls.spp, 1..=MAX_SPP).text("samples per pixel"));
    if let Some(cars) = &mut controls.cars {
        // The scene is loaded anew, so wait until the user lets go.
        let id = egui::Id::unique("cars");
        let mut wanted = ui.data(|data| data.get_temp(id)).unwrap_or(*cars);
        let slider = ui
            .add(Slider::new(&mut wanted, 0..=MAX_CARS).logarithmic(true).clamping(SliderClamping::Edits).text("cars"));
        if slider.dragged() || slider.has_focus() {
            ui.data_mut(|data| data.insert_temp(id, wanted));
        } else {
            *cars = wanted;
            ui.data_mut(|data| data.remove::<usize>(id));
        }
    }
    ui.add(Slider::new(&mut controls.exposure_ev, -8.0..=8.0).suffix(" EV").text("exposure"));
    ui.add(Slider::new(&mut controls.pixel_size, 1..=8).text("pixel size"));
    ui.checkbox(&mut controls.is_filtered, "filter the noise");
    let reuse = Checkbox::new(&mut controls.is_reused, "reuse lights in motion");
    ui.add_enabled(controls.spp == 1, reuse);
    ui.checkbox(&mut controls.is_accumulated, "accumulate frames");
}

fn time_buttons(ui: &mut Ui, controls: &mut Controls) -> Option<Press> {
    let mut press = None;
    ui.horizontal(|ui| {
        if ui.add(Button::new("Freeze").selected(controls.is_frozen)).on_hover_text("Space").clicked() {
            controls.is_frozen = !controls.is_frozen;
        }
        if ui.button("Step").on_hover_text("N").clicked() {
            (controls.is_frozen, press) = (true, Some(Press::Step));
        }
        if ui.button("Rewind").on_hover_text("R").clicked() {
            press = Some(Press::Rewind);
        }
    });
    press
}

fn legend(ui: &mut Ui, view: ViewKind, is_dump: bool) {
    let color = |[r, g, b]: Rgb| Color32::from_rgb(r, g, b);
    let scale = |ui: &mut Ui, map: fn(f32) -> Rgb, ends: [String; 2]| {
        ui.horizontal(|ui| {
            ui.label(&ends[0]);
            let (place, _) = ui.allocate_exact_size(egui::vec2(120.0, 10.0), egui::Sense::hover());
            let steps = 40;
            for step in 0..steps {
                let share = step as f32 / steps as f32;
                let left = place.left() + place.width() * share;
                let bar = egui::Rect::from_min_size(
                    egui::pos2(left, place.top()),
                    egui::vec2(place.width() / steps as f32 + 0.5, place.height()),
                );
                ui.painter().rect_filled(bar, 0.0, color(map(share)));
            }
            ui.label(&ends[1]);
        });
    };
    match view {
        ViewKind::Picture => {}
        ViewKind::Noise => {
            ui.label("Relative standard error of each pixel.");
            scale(ui, inferno, RANGE.map(percent));
            key(ui, color(NOTHING), "sky or emissive surface");
        }
        ViewKind::Trees if is_dump => {
            ui.label("Boxes of the light trees, by their size over that of a fresh build.");
            scale(ui, loose_color, ["1".into(), format!("{LOOSE}")]);
            key(ui, color(TOP_LEVEL), "top level");
        }
        ViewKind::Trees => {
            ui.label("Boxes of the light trees, by updates since the last build.");
            scale(ui, viridis, ["0".into(), format!("{OLD}")]);
            key(ui, color(WAITING), "waits for a rebuild");
            key(ui, color(TOP_LEVEL), "top level");
        }
    }
}

/// What a colour stands for: a square, and text in the colour that is easy to read.
fn key(ui: &mut Ui, color: Color32, name: &str) {
    let text = ui.painter().layout_no_wrap(name.into(), TextStyle::Body.resolve(ui.style()), TEXT);
    let size = egui::vec2(KEY_SIDE + 4.0 + text.size().x, text.size().y);
    let (place, _) = ui.allocate_exact_size(size, egui::Sense::hover());
    let square = egui::Rect::from_center_size(
        place.left_center() + egui::vec2(KEY_SIDE * 0.5, 0.0),
        egui::Vec2::splat(KEY_SIDE),
    );
    ui.painter().rect_filled(square, 1.0, color);
    ui.painter().galley(place.right_top() - egui::vec2(text.size().x, 0.0), text, TEXT);
}

/// A power of two as a percentage.
fn percent(power: f32) -> String {
    format!("{:.0} %", 100.0 * power.exp2())
}

fn numbers(ui: &mut Ui, status: &Status<'_>) {
    ui.label(status.backend);
    let Some(shown) = status.shown else {
        ui.label("Loading the scene ...");
        return;
    };
    let stats = &shown.stats;
    let total = stats.times.total().as_secs_f64() * 1e3;
    ui.label(format!("frame {}: {total:.0} ms, {} x {} pixels", stats.frame, shown.width, shown.height));
    ui.label(format!("{} lights in {} instances", stats.lights, stats.instances));
    ui.label(format!("{:.0} frames accumulated; {:.1} m/s", shown.frames, status.speed));
    ui.label(format!(
        "{} trees rebuilt, {} wait, for up to {} frames",
        stats.rebuilt_trees, stats.waiting_trees, stats.longest_wait
    ));
    if !status.message.is_empty() {
        ui.label(status.message);
    }
}

fn plots(ui: &mut Ui, recording: &Recording) {
    let stage = |index: usize| move |record: &Record| record.times.named()[index].1.as_secs_f64() * 1e3;
    let lines = StageTimes::default().named().into_iter().enumerate().zip(STAGE_COLORS);
    let lines = lines.map(|((index, (name, _)), color)| (name, color, recording.points(stage(index))));
    // Stages that never take a visible time would only lengthen the legend.
    let visible = lines.filter(|(_, _, points)| points.iter().any(|[_, y]| *y > 1.0)).collect();
    plot(ui, "Time by stage, ms", visible);
    let [budget, spent] = [|record: &Record| record.budget_us, |record: &Record| record.spent_us];
    let lines = [("budget", STAGE_COLORS[7], budget), ("spent", STAGE_COLORS[5], spent)];
    let lines = lines.into_iter().map(|(name, color, value)| (name, color, recording.points(value)));
    plot(ui, "Rebuilds, µs", lines.collect());
    let uploads = recording.points(|record| record.upload_bytes as f64 / 1024.0);
    plot(ui, "Upload of lights, KiB", vec![("", STAGE_COLORS[5], uploads)]);
}

/// A plot over the last frames, with its legend below: it has no room for both.
fn plot(ui: &mut Ui, title: &str, lines: Vec<(&str, Color32, Vec<[f64; 2]>)>) {
    ui.label(title);
    let names: Vec<(&str, Color32)> =
        lines.iter().filter(|(name, ..)| !name.is_empty()).map(|(name, color, _)| (*name, *color)).collect();
    Plot::new(title)
        .height(PLOT_HEIGHT)
        .include_y(0.0)
        .custom_y_axes(vec![AxisHints::new_y().label_spacing(LABEL_SPACING)])
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .show_x(false)
        .show(ui, |plot| {
            for (name, color, points) in lines {
                plot.line(Line::new(name, PlotPoints::from(points)).color(color));
            }
        });
    ui.horizontal_wrapped(|ui| {
        for (name, color) in names {
            key(ui, color, name);
        }
    });
}
