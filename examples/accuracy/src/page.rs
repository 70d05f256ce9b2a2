//! The page: `page.html` with the answers filled in.

use super::answers::{Answers, DEFAULT_FRAME_MS, Knob, Purchase, Ratio};
use super::measured::{Measured, REFERENCE_CANDIDATES, REFERENCE_SAMPLES};
use super::options::Options;
use super::pictures::Errors;
use super::settings::{Change, DEFAULT, KNOB_SAMPLES, MOST_LIGHTS, Sampler};
use super::table::{COLUMNS, Row};
use testbed::common::table::short;
use testbed::direct_light::cells::TAUGHT;
use testbed::measuring::crops::{Crop, Crops};
use testbed::measuring::score::Estimate;

const TEMPLATE: &str = include_str!("page.html");

/// The plots of the page, as SVG texts.
pub struct Plots {
    pub error_over_time: String,
    pub alternatives: String,
    pub stages: String,
}

/// The text of the page.
pub fn page(options: &Options, measured: &Measured, answers: &Answers, plots: &Plots, crops: &Crops) -> String {
    let rows = &measured.rows;
    let fills = [
        ("scene", escape(&options.scene.name())),
        ("summary", summary(options, measured)),
        ("units", units(measured, answers)),
        ("budgets", answers.purchases.iter().map(|purchase| budget(purchase, answers)).collect()),
        ("front_columns", FRONT_COLUMNS.map(|column| format!("<th>{column}</th>")).concat()),
        ("front_rows", front(answers).iter().map(|fields| cells(fields)).collect()),
        ("halving", halving(answers)),
        ("halving_rows", answers.purchases.iter().map(halving_row).collect()),
        ("knob", first_knob(answers)),
        ("knob_samples", KNOB_SAMPLES.to_string()),
        ("knob_rows", answers.knobs.iter().map(knob_row).collect()),
        ("world", world(measured)),
        ("world_rows", world_rows(rows)),
        ("alternatives_text", alternatives(measured)),
        ("equal_time_rows", measured.equal_time.iter().map(|panel| equal_time_row(&panel.row)).collect()),
        ("crops", crops.all.iter().map(crop).collect()),
        ("effect_rows", effect_rows(answers)),
        ("count", rows.len().to_string()),
        ("columns", COLUMNS.map(|column| format!("<th>{column}</th>")).concat()),
        ("rows", rows.iter().map(|row| cells(&row.fields())).collect()),
        ("method", method(options, measured)),
        ("error_over_time", plots.error_over_time.clone()),
        ("alternatives", plots.alternatives.clone()),
        ("stages", plots.stages.clone()),
    ];
    // Plots and tables come last: what they contain is not searched for names.
    fills.iter().fold(TEMPLATE.to_owned(), |page, (name, text)| page.replacen(&format!("{{{{{name}}}}}"), text, 2))
}

/// A text inside HTML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn cells(fields: &[String]) -> String {
    let cells: String = fields.iter().map(|field| format!("<td>{}</td>", escape(field))).collect();
    format!("<tr>{cells}</tr>\n")
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn factor(value: f64) -> String {
    if value >= 10.0 { format!("{value:.0}") } else { format!("{value:.2}") }
}

fn interval(ratio: &Ratio) -> String {
    format!("{} to {}", factor(ratio.low), factor(ratio.high))
}

/// The interval of an error.
fn interval_of(error: &Estimate) -> String {
    let [low, high] = error.positive_interval();
    format!("{} to {}", short(low), short(high))
}

/// The sampler and the samples of a setting, for people.
fn describe(row: &Row) -> String {
    let samples = row.setting.samples;
    let samples = if samples == 1.0 { "1 sample".into() } else { format!("{samples} samples") };
    format!("{}, {samples} per pixel", escape(&row.setting.sampler.name()))
}

fn summary(options: &Options, measured: &Measured) -> String {
    let height = measured.reference.len() / measured.view.view.width;
    format!(
        "{}: {} lights in {} instances. Direct light with shadows, on {} surfaces, in a picture of {} × {} \
         pixels after {} frames of motion.",
        capital(&escape(&options.scene.name())),
        measured.lights,
        measured.instances,
        if options.matte { "diffuse" } else { "diffuse and glossy" },
        measured.view.view.width,
        height,
        options.plan().frames,
    )
}

fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or(String::new(), |first| first.to_uppercase().chain(chars).collect())
}

fn units(measured: &Measured, answers: &Answers) -> String {
    let default = DEFAULT_FRAME_MS / answers.scale;
    format!(
        "The default is {}. A frame with one sample of it at every pixel takes {default:.0} ms on one core of the \
         measured machine. The page scales all times so that this frame takes {DEFAULT_FRAME_MS} ms, and speaks of any device that is as fast as that. \
         Only ratios of times mean anything. Errors are those of pictures against a reference whose own relMSE is {}. \
         Ranges after errors are 95 % confidence intervals over {} pictures, of the logarithm of the error.",
        escape(&DEFAULT.name()),
        short(measured.reference_error),
        measured.pictures,
    )
}

fn budget(purchase: &Purchase, answers: &Answers) -> String {
    let budget = purchase.budget;
    let Some(row) = &purchase.row else {
        return format!("<div><b>{budget} ms</b><br>No setting is fast enough.</div>");
    };
    let Errors { rel_mse, mape, .. } = &row.errors;
    format!(
        "<div><b>{budget} ms</b><br>{}<br>relMSE <strong>{}</strong> ({})<br>MAPE {} ({})<br><span class=\"soft\">takes {} ms</span></div>",
        describe(row),
        short(rel_mse.mean),
        interval_of(rel_mse),
        short(mape.mean),
        interval_of(mape),
        short(row.time_ms() * answers.scale),
    )
}

/// The columns of [`front`].
pub const FRONT_COLUMNS: [&str; 4] = ["setting", "time, ms of the page", "relMSE", "95 % interval"];

/// The points of the front, by rising time.
pub fn front(answers: &Answers) -> Vec<[String; 4]> {
    let line = |row: &Row| {
        let error = &row.errors.rel_mse;
        [row.setting.name(), short(row.time_ms() * answers.scale), short(error.mean), interval_of(error)]
    };
    answers.front.iter().map(line).collect()
}

fn halving(answers: &Answers) -> String {
    let known = |half: fn(&Purchase) -> Option<f64>| {
        let all: Vec<f64> = answers.purchases.iter().filter_map(half).collect();
        let range = all.iter().fold(f64::INFINITY..0.0_f64, |range, x| range.start.min(*x)..range.end.max(*x));
        (!all.is_empty()).then(|| match format!("{:.1}", range.start) == format!("{:.1}", range.end) {
            true => format!("{:.1}", range.start),
            false => format!("{:.1} to {:.1}", range.start, range.end),
        })
    };
    match (known(|purchase| purchase.half_rel_mse), known(|purchase| purchase.half_mape)) {
        (Some(rel_mse), Some(mape)) => {
            format!("Half of relMSE takes <strong>{rel_mse} times</strong> the time, half of MAPE {mape} times.")
        }
        (Some(rel_mse), None) => format!("Half of relMSE takes <strong>{rel_mse} times</strong> the time."),
        _ => "The measured settings do not reach half of these errors.".into(),
    }
}

fn halving_row(purchase: &Purchase) -> String {
    let times =
        |factor: Option<f64>| factor.map_or("beyond the settings".into(), |factor| format!("{factor:.1} × time"));
    cells(&[format!("{} ms", purchase.budget), times(purchase.half_rel_mse), times(purchase.half_mape)])
}

/// The knob that gains most.
fn first_knob(answers: &Answers) -> String {
    match answers.knobs.first() {
        Some(knob) if knob.is_difference() && knob.gain.value > 1.0 => format!(
            "<strong>{}</strong>: {} times the time, {} times the error. Plain samples of the default have {} times that \
             error in the same time.",
            escape(&knob.name),
            factor(knob.time),
            factor(knob.error.value),
            factor(knob.gain.value),
        ),
        _ => "More samples: no other knob gains more than they do.".into(),
    }
}

fn knob_row(knob: &Knob) -> String {
    let gain = if knob.is_difference() { factor(knob.gain.value) } else { "no difference".into() };
    cells(&[knob.name.clone(), factor(knob.time), factor(knob.error.value), gain, interval(&knob.gain)])
}

fn effect_rows(answers: &Answers) -> String {
    let row = |effect: &super::answers::LeftOut| {
        cells(&[effect.name.clone(), factor(effect.time), factor(effect.error.value), interval(&effect.error)])
    };
    answers.left_out.iter().map(row).collect()
}

fn default_row(rows: &[Row]) -> Option<&Row> {
    rows.iter().find(|row| row.setting.sampler == DEFAULT && row.setting.change == Change::Nothing)
}

fn world(measured: &Measured) -> String {
    let Some(row) = default_row(&measured.rows) else { return String::new() };
    let total = row.samples.total();
    let share = |part: f64| percent(part / total);
    let dead = row.noise.map_or(String::new(), |noise| {
        format!(" {} of its draws end without a light, which is noise and lost time.", percent(noise.dead))
    });
    format!(
        "Of a default sample, choosing takes {}, the shadow ray {} and shading {}.{dead} In addition, the world takes {:.2} ms \
         of one core per frame and uploads {:.0} KiB.",
        share(row.samples.choosing),
        share(row.samples.shadow_rays),
        share(row.samples.shading),
        row.world.total(),
        measured.upload_bytes / 1024.0,
    )
}

fn world_rows(rows: &[Row]) -> String {
    let is_upkeep = |row: &&Row| matches!(row.setting.change, Change::Upkeep(_));
    let line = |name: String, row: &Row| {
        let upload = row.world.upload.map_or("no device".into(), |ms| format!("{ms:.2}"));
        let error = &row.errors.rel_mse;
        let [update, top_level] = [row.world.update, row.world.top_level].map(|ms| format!("{ms:.2}"));
        cells(&[name, update, upload, top_level, short(error.mean), interval_of(error)])
    };
    let default = rows.iter().find(|row| {
        row.setting.sampler == DEFAULT && row.setting.change == Change::Nothing && row.setting.samples == KNOB_SAMPLES
    });
    let default = default.map(|row| line("budget 300 us (default)".into(), row)).unwrap_or_default();
    let name = |row: &Row| row.setting.name().rsplit(" / ").next().unwrap_or_default().to_owned();
    default + &rows.iter().filter(is_upkeep).map(|row| line(name(row), row)).collect::<String>()
}

fn alternatives(measured: &Measured) -> String {
    let own = measured.equal_time.iter().find(|panel| panel.row.setting.sampler == DEFAULT);
    let Some(own) = own else { return String::new() };
    let mut parts = Vec::new();
    for panel in &measured.equal_time {
        if matches!(panel.row.setting.sampler, Sampler::TwoLevels { .. } | Sampler::SharedCuts { .. }) {
            continue;
        }
        let ratio = Ratio::of(&panel.row.errors.rel_mse, &own.row.errors.rel_mse);
        let name = escape(&panel.row.setting.sampler.name());
        parts.push(match ratio.is_difference() {
            true => format!("{name} {} ({})", factor(ratio.value), interval(&ratio)),
            false => format!("{name} no difference ({})", interval(&ratio)),
        });
    }
    format!(
        "In the time of {} default samples, the relMSE of the other samplers is that of the default times: {}.",
        own.row.setting.samples,
        parts.join(", ")
    )
}

fn equal_time_row(row: &Row) -> String {
    let Errors { rel_mse, mape, mean } = &row.errors;
    let noise =
        |value: fn(&super::noise::SamplerNoise) -> f64| row.noise.as_ref().map_or("–".into(), |n| short(value(n)));
    cells(&[
        row.setting.sampler.name(),
        format!("{:.2}", row.setting.samples),
        short(rel_mse.mean),
        interval_of(rel_mse),
        short(mape.mean),
        interval_of(mape),
        format!("{:.3} ± {:.3}", mean.mean, mean.half_width),
        noise(|noise| noise.sigma),
        noise(|noise| noise.sigma_visible),
        row.noise.as_ref().map_or("–".into(), |noise| percent(noise.dead)),
    ])
}

fn crop(crop: &Crop) -> String {
    format!(
        "<figure><img alt=\"{0}\" src=\"{2}\"><figcaption>{0}: {1}</figcaption></figure>\n",
        crop.title, crop.caption, crop.image
    )
}

fn method(options: &Options, measured: &Measured) -> String {
    let plan = options.plan();
    let items = [
        format!(
            "relMSE is the mean over pixels of ((I − R) / (0.01 mean(R) + R))², without the worst 0.1 % of the pixels; MAPE is \
             the mean of the sizes of these quotients over all pixels. {} pictures of each setting.",
            measured.pictures
        ),
        match measured.lights <= MOST_LIGHTS {
            true => format!(
                "The reference sums up all lights {} times at each of the four surfaces of a pixel, with 256 shadow rays each \
                 time. No sampler is part of it.",
                plan.passes
            ),
            false => format!(
                "The reference has {} samples per pixel, each resampled from {REFERENCE_CANDIDATES} candidates.",
                plan.passes * REFERENCE_SAMPLES as u32
            ),
        },
        format!(
            "sigma is the relative standard deviation of the illuminance that one sample estimates, at {} points of the view. \
             It is computed from the probabilities of all lights, with area lights reduced to their middle; with several \
             candidates it is estimated from {} draws at each point.",
            measured.noise_points, plan.noise_draws
        ),
        "Times of samples are those of one core: 15 rounds in turn, of which the fastest counts. Other samplers pay nothing \
         for keeping their trees fit, which favours them. Their formulas are on binary trees with one light per leaf. \
         Samples share what a sampler prepares for a frame; lists and grids that do not grow with the picture are shared \
         by as many samples as a frame of 1920 × 1080 has."
            .into(),
        format!(
            "Learnt cuts share cuts and know what {TAUGHT} frames of the same view with one sample per pixel have taught \
             about shadows. Their time includes that of records. With solid angles, the world has played again."
        ),
        "Lights at infinity are left out, because they belong to no tree. Every sample of a pixel meets one of four fixed \
         surfaces, so the errors are those of light alone."
            .into(),
    ];
    items.iter().map(|item| format!("<li>{}</li>\n", escape(item))).collect()
}
