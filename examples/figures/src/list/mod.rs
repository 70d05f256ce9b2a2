//! All figures, and all runs that they are drawn from. Adding a figure takes a line here and a block in its document.

mod accuracy;
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
    accuracy::README_PICTURE,
    accuracy::README_REUSE,
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
    noise::SHADOWS,
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
    accuracy::FRONT_PLOT,
    accuracy::FRONT,
    accuracy::PICTURE,
    accuracy::EQUAL_TIME,
    accuracy::GLOSS,
    accuracy::UPKEEP,
    accuracy::RIVALS,
    accuracy::REUSE,
    accuracy::REUSE_ERRORS,
    accuracy::REUSE_FRAMES,
    accuracy::LEFT_OUT,
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
                let is_known = run == crate::measure::GPU || RUNS.iter().any(|own| own.name == run);
                assert!(is_known, "{} has no run \"{run}\"", figure.name);
            }
        }
        for (index, run) in RUNS.iter().enumerate() {
            assert!(RUNS[..index].iter().all(|other| other.name != run.name), "{} is there twice", run.name);
            assert!(FIGURES.iter().any(|figure| figure.runs().contains(&run.name)), "nothing shows {}", run.name);
        }
    }

    #[test]
    fn the_script_builds_every_program() {
        let script = include_str!("../../../../scripts/figures.sh");
        let line = script.lines().find(|line| line.starts_with("packages=(")).expect("it has a list");
        let packages: Vec<_> = line.split(['(', ' ', ')']).collect();
        for run in RUNS.iter().filter(|run| !run.program.starts_with("bench_")) {
            assert!(packages.contains(&run.program), "{} is not built", run.program);
        }
    }
}
