//! All figures, and all runs that they are drawn from. Adding a figure takes a line here and a block in its page.

mod pictures;
mod runs;
mod tables;

use super::figure::{Figure, rows};

pub use runs::RUNS;

/// All figures: those of pages, in order, and then the rows that programs wrote.
pub const FIGURES: &[Figure] = &[
    tables::README,
    pictures::README_PICTURE,
    tables::README_REUSE,
    tables::SUMMARY,
    tables::LOSSES,
    tables::LOSSES_WITH_SHADOWS,
    tables::KERNEL_NOISE,
    tables::KERNEL_COST,
    pictures::BUDGET_PLOT,
    tables::GPU_GOALS,
    pictures::FRONT_PLOT,
    pictures::PICTURE,
    tables::EQUAL_TIME,
    tables::RIVALS,
    pictures::PAPER_COST,
    pictures::PAPER_FRAMES,
    rows("docs/data/noise.csv", "noise/noise.csv"),
    rows("docs/data/noise-m.csv", "noise-m/noise.csv"),
    rows("docs/data/torture.csv", "torture/torture.csv"),
    rows("docs/data/cliffs.csv", "cliffs/cliffs.csv"),
    rows("docs/data/gloss.csv", "gloss/gloss.csv"),
    rows("docs/data/segments.csv", "segments/segments.csv"),
    rows("docs/data/candidates.csv", "candidates/candidates.csv"),
    rows("docs/data/learning.csv", "learn/learn.csv"),
    rows("docs/data/sky.csv", "sky/sky.csv"),
    rows("docs/data/signs.csv", "signs/signs.csv"),
    rows("docs/data/deform.csv", "deform/deform.csv"),
    rows("docs/data/budget.csv", "budget/budget.csv"),
    rows("docs/data/cases.csv", "cases/cases.csv"),
    rows("docs/data/scheduler.csv", "scheduler/criterion"),
    rows("docs/data/trees.csv", "trees/criterion"),
    rows("docs/data/bake.csv", "bake/criterion"),
    rows("docs/data/edits.csv", "edits/criterion"),
    rows("docs/data/flight.csv", "flight/summary.csv"),
    rows("docs/data/scale.csv", "scale/scale.csv"),
    rows("docs/data/gpu-upload.csv", "gpu/gpu.json#/upload"),
    rows("docs/data/gpu-top-level.csv", "gpu/gpu.json#/top_level"),
    rows("docs/data/gpu-samples.csv", "gpu/gpu.json#/sampling"),
    rows("docs/data/shader-functions.csv", "shaders/shaders.csv"),
    rows("docs/data/pipelines.csv", "pipelines/stdout.md"),
    rows("docs/data/effects.csv", "effects/stdout.md"),
    rows("docs/data/pictures-diffuse.csv", "matte/accuracy.csv"),
    rows("docs/data/pictures-glossy.csv", "glossy/accuracy.csv"),
    rows("docs/data/pictures-rivals.csv", "rivals/rivals.csv"),
    rows("docs/data/reuse.csv", "reuse/reuse.csv"),
    rows("docs/data/paper-bistro.csv", "paper/paper.csv"),
    rows("docs/data/paper-city.csv", "paper-city/paper.csv"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_every_run_is_drawn() {
        for (index, figure) in FIGURES.iter().enumerate() {
            assert!(FIGURES[..index].iter().all(|other| other.name != figure.name), "{} is there twice", figure.name);
            for run in figure.runs() {
                let is_known = run == crate::documents::measure::GPU || RUNS.iter().any(|own| own.name == run);
                assert!(is_known, "{} has no run \"{run}\"", figure.name);
            }
        }
        for (index, run) in RUNS.iter().enumerate() {
            assert!(RUNS[..index].iter().all(|other| other.name != run.name), "{} is there twice", run.name);
            assert!(FIGURES.iter().any(|figure| figure.runs().contains(&run.name)), "nothing shows {}", run.name);
        }
    }
}
