//! The program that measures. `measure --help` lists its questions, `measure QUESTION --help` their options; the
//! modules of the library say what each writes and what to expect.
//!
//! ```text
//! cargo run --release -p measure -- noise --out noise.csv
//! ```

use std::process::ExitCode;

use clap::Parser;
use measure::{documents, gpu, gpu_lights, kernels, noise, paper, pictures, rebuilds, scale, stability};

/// Measures the library: its accuracy, its cost, and both beside those of published samplers
#[derive(Debug, Parser)]
#[command(name = "measure", version)]
enum Question {
    Noise(noise::options::Options),
    Pictures(pictures::options::Options),
    Rebuilds(rebuilds::options::Options),
    Paper(paper::options::Options),
    Scale(scale::options::Options),
    Stability(stability::options::Options),
    GpuLights(gpu_lights::run::Options),
    Kernels(kernels::options::Options),
    Gpu(gpu::run::Options),
    Documents(documents::options::Options),
}

fn run(question: &Question) -> Result<(), String> {
    let text = |error: testbed::scene::SceneError| error.to_string();
    match question {
        Question::Noise(options) => noise::options::run(options).map_err(text),
        Question::Pictures(options) => pictures::options::run(options).map_err(text),
        Question::Rebuilds(options) => rebuilds::options::run(options).map_err(text),
        Question::Paper(options) => paper::options::run(options).map_err(text),
        Question::Scale(options) => scale::options::run(options),
        Question::Stability(options) => stability::options::run(options),
        Question::GpuLights(options) => gpu_lights::run::run(options).map_err(text),
        Question::Kernels(options) => kernels::options::run(options),
        Question::Gpu(options) => gpu::run::run(options).map_err(text),
        Question::Documents(options) => documents::options::run(options),
    }
}

fn main() -> ExitCode {
    testbed::common::exit::run_program(run)
}
