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
    rows("noise", "noise/noise.csv"),
    rows("noise-m", "noise-m/noise.csv"),
    rows("torture", "torture/torture.csv"),
    rows("cliffs", "cliffs/cliffs.csv"),
    rows("gloss", "gloss/gloss.csv"),
    rows("segments", "segments/segments.csv"),
    rows("candidates", "candidates/candidates.csv"),
    rows("learning", "learn/learn.csv"),
    rows("sky", "sky/sky.csv"),
    rows("signs", "signs/signs.csv"),
    rows("deform", "deform/deform.csv"),
    rows("budget", "budget/budget.csv"),
    rows("cases", "cases/cases.csv"),
    rows("scheduler", "scheduler/criterion"),
    rows("trees", "trees/criterion"),
    rows("bake", "bake/criterion"),
    rows("edits", "edits/criterion"),
    rows("flight", "flight/summary.csv"),
    rows("scale", "scale/scale.csv"),
    rows("gpu-upload", "gpu/gpu.json#/upload"),
    rows("gpu-top-level", "gpu/gpu.json#/top_level"),
    rows("gpu-samples", "gpu/gpu.json#/sampling"),
    rows("shader-functions", "shaders/shaders.csv"),
    rows("pipelines", "pipelines/stdout.md"),
    rows("effects", "effects/stdout.md"),
    rows("pictures-diffuse", "matte/accuracy.csv"),
    rows("pictures-glossy", "glossy/accuracy.csv"),
    rows("pictures-rivals", "rivals/rivals.csv"),
    rows("reuse", "reuse/reuse.csv"),
    rows("paper-bistro", "paper/paper.csv"),
    rows("paper-city", "paper-city/paper.csv"),
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
