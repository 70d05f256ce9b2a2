//! The command line of `measure noise`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use testbed::common::table::Table;
use testbed::scene::SceneError;
use testbed::scene::procedural::Size;

use super::effort::Effort;
use super::{candidates, deform, gloss, kept, learning, measure, report, segments, signs, sky, stages, torture};

/// What to measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Question {
    /// The noise of one sample, beside that of published samplers
    Samplers,
    /// Time and noise of trees whose lights move
    Deform,
    /// Samples that are chosen from several candidates
    Candidates,
    /// The light that glossy surfaces reflect, by roughness
    Gloss,
    /// Scenes that are hard for a choice of lights
    Torture,
    /// Scenes in which two levels were far worse than one tree
    Cliffs,
    /// The light that fog scatters into segments of camera rays, by their length
    Segments,
    /// What a table of learnt visibility gains
    Learn,
    /// A sky beside lamps, and a room with a window
    Sky,
    /// Surfaces that emit an image
    Signs,
    /// Rows of cells that are kept while traffic drives
    Kept,
}

/// Measures the noise of one light sample, without noise of its own
#[derive(Debug, Args)]
pub struct Options {
    #[arg(value_enum, default_value_t = Question::Samplers)]
    pub question: Question,
    /// The table, as CSV
    #[arg(long, value_name = "FILE.csv")]
    pub out: PathBuf,
    /// A glTF scene to measure as well
    #[arg(long, value_name = "FILE")]
    pub gltf: Option<PathBuf>,
    /// Size of the procedural city [default: S]
    #[arg(long, value_name = "SIZE", value_enum, ignore_case = true)]
    pub world: Option<Size>,
    /// Number of shading points
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub shading_points: u32,
    /// Few scenes, frames and timed choices: seconds, to try it out
    #[arg(long)]
    pub quick: bool,
}

impl Options {
    /// An option that does not apply to the question.
    fn superfluous(&self) -> Option<&'static str> {
        use Question::{Candidates, Deform, Gloss, Kept, Samplers, Segments};
        let takes_file = matches!(self.question, Samplers | Deform | Candidates | Segments);
        let takes_world = matches!(self.question, Samplers | Candidates | Gloss | Segments | Kept);
        match () {
            () if self.gltf.is_some() && !takes_file => Some("--gltf"),
            () if self.world.is_some() && !takes_world => Some("--world"),
            () => None,
        }
    }
}

/// Measures, and writes the table.
///
/// # Errors
/// For an option that does not apply to the question, a scene that cannot be read, and a table that cannot be
/// written.
pub fn run(options: &Options) -> Result<(), SceneError> {
    if let Some(option) = options.superfluous() {
        return Err(SceneError(format!("{option} does not apply to {:?}", options.question)));
    }
    let (count, world) = (options.shading_points as usize, options.world.unwrap_or(Size::S));
    let effort = if options.quick { Effort::Quick } else { Effort::Full };
    let (file, out) = (options.gltf.as_deref(), &options.out);
    match options.question {
        Question::Samplers => samplers(options, world, effort),
        Question::Deform => deform::run(file, count, effort, out),
        Question::Candidates => candidates::run(world, file, (count, effort), out),
        Question::Gloss => gloss::run(world, count, effort, out),
        Question::Torture => torture::run(effort, out),
        Question::Cliffs => torture::run_cliffs(effort, out),
        Question::Segments => segments::run(world, file, (count, effort), out),
        Question::Learn => learning::run(count, effort, out),
        Question::Sky => sky::run(count, effort, out),
        Question::Signs => signs::run(count, effort, out),
        Question::Kept => kept::run(world, count, effort, out),
    }
}

fn samplers(options: &Options, world: Size, effort: Effort) -> Result<(), SceneError> {
    let count = options.shading_points as usize;
    let mut scenes = Vec::from(stages::city(world, count)?);
    if let Some(path) = &options.gltf {
        scenes.push(stages::gltf(path, count)?);
    }
    let mut table = Table::create(&options.out, &report::COLUMNS).map_err(SceneError)?;
    scenes.iter().try_for_each(|scene| {
        let measured = measure::measure(scene, effort)?;
        report::print(&measured);
        measured.rows.iter().try_for_each(|row| table.add(report::fields(row))).map_err(SceneError)
    })
}
