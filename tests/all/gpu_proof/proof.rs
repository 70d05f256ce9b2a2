//! Coverage, sums and frequencies on the GPU, after hundreds of frames of random deltas.

use std::collections::HashMap;

use girandole::gpu::GpuLights;
use girandole::{LightId, LightWorld, ShadingPoint};

use super::edits::Edited;
use super::{Picked, Question, Text, about_all, named_lights};
use crate::gpu::{gpu, gpu_lights, uploaded};
use testbed::testing::plan_device::Played;
use testbed::testing::support::Rng;

/// Frames of edits before each proof.
const FRAMES: usize = 300;

/// Frames from one build of the top level to the next. All frames are uploaded.
const BUILD_EVERY: usize = 10;

/// Draws at a shading point.
const DRAWS: usize = 1 << 13;

/// Shading points of a proof.
const POINTS: usize = 4;

/// Rounding of a sum over thousands of probabilities.
const SUM_TOLERANCE: f64 = 1.0e-4;

/// The answers at all shading points.
struct Answers {
    /// Of all lights, at one shading point after the other.
    pmfs: Vec<f32>,
    /// `DRAWS` of each shading point.
    picks: Vec<Picked>,
}

fn answers(lights: &mut GpuLights, names: &[(LightId, [u32; 2])], points: &[ShadingPoint], u: &[[f32; 2]]) -> Answers {
    let pmfs = Text::AsItIs.pmfs(lights, &about_all(names, points));
    let draw = |(i, u): (usize, &[f32; 2])| Question { u: [u[0], u[1], 0.0, 0.0], ..Question::at(&points[i / DRAWS]) };
    let drawn: Vec<Question> = u.iter().enumerate().map(draw).collect();
    Answers { pmfs, picks: Text::AsItIs.ask(lights, "pick", &drawn) }
}

/// Checks the answers at one shading point. Returns the number of lights that send something there.
fn check(world: &LightWorld, point: &ShadingPoint, probabilities: &[f32], drawn: &[Picked], rng: &mut Rng) -> usize {
    let sampler = world.sampler();
    let lights = named_lights(world);
    let mut by_name: HashMap<[u32; 2], (f32, u32)> = HashMap::new();
    let (mut sum, mut contributions) = (0.0, 0);
    for ((light, name), pmf) in lights.iter().zip(probabilities) {
        assert!(pmf.is_finite() && (0.0..=1.0).contains(pmf), "{name:?} has the probability {pmf} at {point:?}");
        let sends = [[0.0; 2], [0.999_999; 2], [rng.unit(), rng.unit()], [rng.unit(), rng.unit()]]
            .into_iter()
            .any(|u| sampler.sample_light(point, *light, u).is_some());
        assert!(*pmf > 0.0 || !sends, "{name:?} sends something to {point:?} and is never chosen");
        contributions += usize::from(sends);
        sum += f64::from(*pmf);
        by_name.insert(*name, (*pmf, 0));
    }
    assert!(sum <= 1.0 + SUM_TOLERANCE, "probabilities add up to {sum} at {point:?}");

    let mut none = 0;
    for pick in drawn {
        assert!(pick.pmf.is_finite() && (0.0..=1.0).contains(&pick.pmf), "{pick:?}");
        if pick.pmf == 0.0 {
            none += 1;
            continue;
        }
        let (pmf, count) = by_name.get_mut(&[pick.instance, pick.light]).expect("the light exists");
        *count += 1;
        assert!((pick.pmf / *pmf - 1.0).abs() < 1.0e-4, "{pick:?} {pmf} at {point:?}");
    }
    let draws = drawn.len() as f64;
    let missing = (1.0 - sum).clamp(0.0, 1.0);
    // Six standard deviations and six draws: a false alarm in less than one of 10^8 shading points.
    let slack = 6.0 * (draws * missing * (1.0 - missing)).sqrt() + 6.0 + draws * SUM_TOLERANCE;
    assert!((f64::from(none) - draws * missing).abs() <= slack, "{none} draws without a light, {missing} at {point:?}");

    // Lights that are rarely drawn share a cell.
    let (mut chi_sq, mut cells) = (0.0, 0.0);
    let mut add = |observed: f64, expected: f64| {
        if expected >= 5.0 {
            chi_sq += (observed - expected).powi(2) / expected;
            cells += 1.0;
        }
    };
    let (mut rest, mut rest_expected) = (0.0, 0.0);
    for (pmf, count) in by_name.values() {
        let expected = draws * f64::from(*pmf);
        if expected >= 5.0 {
            add(f64::from(*count), expected);
        } else {
            rest += f64::from(*count);
            rest_expected += expected;
        }
    }
    add(rest, rest_expected);
    add(f64::from(none), draws * missing);
    // A single cell of five expected draws exceeds this with a probability of 7e-5, and more or larger cells with a
    // lower one. There are 72 shading points: a false alarm in less than one of 190 seeds, and the seeds are fixed.
    assert!(chi_sq < cells + 5.0 * (2.0_f64 * cells).sqrt() + 15.0, "{chi_sq} over {cells} at {point:?}");
    contributions
}

/// The stages of divided nodes in a build that a plan of this world records.
fn stages(world: &LightWorld) -> usize {
    let mut played = Played::new();
    played.frame(world);
    played.device.dispatches.get("top_blocks").copied().unwrap_or(0)
}

/// Edits a world through worlds of these sizes, `FRAMES` frames for each, and proves each of them.
/// Returns the numbers of stages.
fn prove(seed: u64, sizes: &[usize]) -> Vec<usize> {
    let (device, queue) = gpu();
    let mut edited = Edited::new(seed);
    let mut lights = gpu_lights();
    let mut met = Vec::new();
    for size in sizes {
        for frame in 0..FRAMES {
            edited.step(*size, FRAMES - frame);
            lights.upload(&edited.world).expect("room enough");
            // Most builds are left out, because they take most of the time.
            if frame % BUILD_EVERY == 0 {
                let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                lights.build_top(&mut encoder);
                queue.submit([encoder.finish()]);
            }
        }
        met.push(stages(&edited.world));
        let points = edited.shading_points(POINTS);
        let rng = edited.rng();
        let u: Vec<[f32; 2]> = (0..POINTS * DRAWS).map(|_| [rng.unit(), rng.unit()]).collect();
        let mut rng = Rng(rng.bits());
        let world = &edited.world;
        let mut fresh = uploaded(world);
        let names = named_lights(world);
        let mut contributions = 0;
        let found = answers(&mut lights, &names, &points, &u);
        let again = answers(&mut fresh, &names, &points, &u);
        let bits = |pmfs: &[f32]| pmfs.iter().map(|pmf| pmf.to_bits()).collect::<Vec<_>>();
        assert!(bits(&found.pmfs) == bits(&again.pmfs), "{size} instances: a fresh upload has other probabilities");
        assert!(found.picks == again.picks, "{size} instances: a fresh upload has other picks");
        for (i, point) in points.iter().enumerate() {
            let probabilities = &found.pmfs[i * names.len()..][..names.len()];
            contributions += check(world, point, probabilities, &found.picks[i * DRAWS..][..DRAWS], &mut rng);
        }
        assert!(*size < 8 || contributions > 8, "{size} instances: {contributions} contributions");
    }
    met
}

#[test]
fn small_worlds_have_true_probabilities_on_the_gpu_after_300_frames_of_deltas() {
    assert_eq!(prove(1300, &[1, 2, 3, 8, 9, 65]), [0, 0, 0, 0, 0, 1]);
}

#[test]
fn worlds_of_one_and_of_more_stages_have_true_probabilities_on_the_gpu_after_300_frames_of_deltas() {
    assert_eq!(prove(1301, &[257, 1100, 5000]), [1, 2, 2]);
}
