//! The command line, and the whole run.

use super::cases::Extent;
use super::costs::Costs;
use super::motion::Motion;
use super::run::{Plan, measure};
use super::stage::SceneKind;
use super::strategies::Strategy;
use super::{cases, plots, report};
use clap::Parser;
use girandole::Attribute;
use std::path::PathBuf;
use std::sync::Arc;
use testbed::common::table::markdown_head;
use testbed::scene::SceneError;

/// Measures what a time budget for rebuilds gains.
#[derive(Clone, Debug, Parser)]
pub struct Options {
    /// The folder of the tables and plots
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Only play the scenes that broke earlier schedulers
    #[arg(long)]
    pub cases: bool,
    /// A small scene, two motions, few strategies and budgets: less than a minute
    #[arg(long)]
    pub quick: bool,
    /// The costs of a former run, instead of measuring them
    #[arg(long, value_name = "FILE.csv")]
    pub costs: Option<PathBuf>,
    /// Only these scenes
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub scene: Vec<String>,
    /// Only these motions
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub motion: Vec<String>,
    /// Only these strategies, by the start of their names
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub strategies: Vec<String>,
    /// Only these budgets, as shares of the time of always rebuilding
    #[arg(long, value_name = "SHARE", value_delimiter = ',', value_parser = parse_share)]
    pub shares: Vec<f64>,
    /// Seeds the city, the trees, their motion and the shading points
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Number of frames, 60 per second
    #[arg(long, value_parser = clap::value_parser!(u32).range(8..=100_000))]
    pub frames: Option<u32>,
    /// Number of shading points
    #[arg(long, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub shading_points: Option<u32>,
}

/// Parses a budget.
fn parse_share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|error| format!("{error}"))?;
    let is_valid = share.is_finite() && (0.0..=MAX_SHARE).contains(&share);
    if is_valid { Ok(share) } else { Err(format!("a share is a number from 0 to {MAX_SHARE}")) }
}

/// The greatest budget, as a share of the time of always rebuilding.
const MAX_SHARE: f64 = 1_000.0;

/// The strategies of `--quick`.
const QUICK: [Strategy; 4] =
    [Strategy::RoundRobin, Strategy::Ratio(Attribute::SplittingCost), Strategy::Girandole, Strategy::Oracle];

/// How closely a scene is measured. Frames of larger scenes take more time, so fewer are measured.
fn plan(kind: SceneKind, is_quick: bool) -> Plan {
    let plan = |shares: &[f64], ss_shares: &[f64], frames, every, shading_points| Plan {
        strategies: Strategy::ALL.to_vec(),
        shares: shares.to_vec(),
        ss_shares: ss_shares.to_vec(),
        frames,
        every,
        shading_points,
        seed: 1,
    };
    if is_quick {
        return Plan { strategies: QUICK.to_vec(), ..plan(&[0.02, 0.1, 0.5], &[0.1], 96, 12, 32) };
    }
    match kind {
        SceneKind::S10 => plan(&[0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0], &[0.02, 0.1], 240, 16, 60),
        SceneKind::M100 => plan(&[0.02, 0.05, 0.1, 0.2, 0.5], &[0.1], 160, 20, 32),
        SceneKind::L1000 => {
            let is_kept = |strategy: &Strategy| {
                let attribute = match strategy {
                    Strategy::Deviation(attribute) | Strategy::Ratio(attribute) => *attribute,
                    _ => Attribute::SplittingCost,
                };
                attribute == Attribute::SplittingCost
            };
            let mut plan = plan(&[0.02, 0.1], &[0.1], 100, 20, 20);
            plan.strategies.retain(is_kept);
            plan
        }
    }
}

/// The items whose names begin with one of `prefixes`; all items if there are no prefixes. A prefix
/// that fits no item is an error.
fn chosen<T: Copy>(
    what: &str,
    prefixes: &[String],
    all: &[T],
    name: impl Fn(T) -> String,
) -> Result<Vec<T>, SceneError> {
    if prefixes.is_empty() {
        return Ok(all.to_vec());
    }
    let starts = |item: T, prefix: &String| name(item).to_lowercase().starts_with(&prefix.to_lowercase());
    if let Some(unknown) = prefixes.iter().find(|prefix| !all.iter().any(|item| starts(*item, prefix))) {
        let names: Vec<String> = all.iter().map(|item| name(*item)).collect();
        return Err(SceneError(format!("there is no {what} {unknown:?}; there are {}", names.join(", "))));
    }
    Ok(all.iter().copied().filter(|item| prefixes.iter().any(|prefix| starts(*item, prefix))).collect())
}

/// Measures, prints the table and writes all files. An error is one line for the user.
pub fn run(options: &Options) -> Result<(), SceneError> {
    let out = &options.out;
    let is_quick = options.quick;
    if options.cases {
        let scenes = chosen("scene", &options.scene, &cases::SCENES, str::to_owned)?;
        return cases::run(out, if is_quick { Extent::Quick } else { Extent::Full }, &scenes);
    }
    let some = |all: &[SceneKind]| chosen("scene", &options.scene, all, |kind| kind.name().to_owned());
    let scenes = some(if is_quick && options.scene.is_empty() { &SceneKind::ALL[..1] } else { &SceneKind::ALL })?;
    let some = |all: &[Motion]| chosen("motion", &options.motion, all, |motion| motion.name().to_owned());
    let motions = some(if is_quick && options.motion.is_empty() { &Motion::ALL[..2] } else { &Motion::ALL })?;
    let strategies = chosen("strategy", &options.strategies, &Strategy::ALL, Strategy::name)?;
    let mut tables = report::Tables::create(out)?;
    let costs = match &options.costs {
        Some(path) => Costs::read(path)?,
        None => Costs::measure(is_quick)?,
    };
    costs.write(&out.join("costs.csv"))?;
    let costs = Arc::new(costs);
    testbed::say!("{}", markdown_head(&report::COLUMNS));
    for kind in scenes {
        let mut plan = plan(kind, is_quick);
        if !options.strategies.is_empty() {
            plan.strategies.clone_from(&strategies);
        }
        if !options.shares.is_empty() {
            plan.shares.clone_from(&options.shares);
            plan.ss_shares.clone_from(&options.shares);
        }
        plan.seed = options.seed;
        plan.frames = options.frames.unwrap_or(plan.frames);
        plan.every = plan.every.min(plan.frames);
        plan.shading_points = options.shading_points.map_or(plan.shading_points, |count| count as usize);
        let mut of_scene = Vec::new();
        for motion in &motions {
            let (scene, rows) = measure(kind, *motion, &plan, &costs)?;
            tables.add(&scene, &rows)?;
            rows.iter().for_each(|row| testbed::say!("| {} |", row.fields().join(" | ")));
            of_scene.extend(rows);
        }
        let name = kind.name();
        plots::gap(&out.join(format!("gap_{name}.svg")), name, &of_scene)?;
    }
    Ok(())
}
