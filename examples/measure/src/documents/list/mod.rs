//! All figures, and all runs that they are drawn from. Adding a figure takes a line here and a block in its document.

mod pictures;
mod gpu;
mod noise;
mod paper;
mod runs;
mod world;

use super::figure::Figure;

pub use runs::RUNS;

/// All figures, in the order of the documents.
pub const FIGURES: &[Figure] = &[
    noise::README,
    pictures::README_PICTURE,
    pictures::README_REUSE,
    noise::SUMMARY,
    noise::ALL,
    noise::SHARED_CUTS,
    noise::LOSSES,
    noise::LOSSES_WITH_SHADOWS,
    noise::TORTURE,
    noise::CLIFFS,
    noise::GLOSS,
    noise::SEGMENTS,
    noise::CANDIDATES,
    noise::LEARNING,
    noise::SKY,
    noise::SIGNS,
    noise::KERNEL_NOISE,
    noise::KERNEL_COST,
    world::DEFORM,
    world::BUDGET_PLOT,
    world::BUDGET,
    world::CASES,
    world::SCHEDULER,
    world::TREES,
    world::BAKE,
    world::EDITS,
    world::REGIONS,
    world::FLIGHT,
    world::SCALE,
    gpu::GOALS,
    gpu::UPLOAD,
    gpu::TOP_LEVEL,
    gpu::SAMPLES,
    gpu::FUNCTIONS,
    gpu::PIPELINES,
    gpu::EFFECTS,
    pictures::FRONT_PLOT,
    pictures::FRONT,
    pictures::PICTURE,
    pictures::EQUAL_TIME,
    pictures::GLOSS,
    pictures::UPKEEP,
    pictures::RIVALS,
    pictures::REUSE,
    pictures::REUSE_ERRORS,
    pictures::REUSE_FRAMES,
    pictures::LEFT_OUT,
    paper::BISTRO,
    paper::COST,
    paper::FRAMES,
    paper::CITY,
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
