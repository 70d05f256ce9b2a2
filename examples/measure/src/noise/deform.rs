//! Trees whose lights move: the noise that refits add, the noise that rebuilds remove, and the time
//! of both. One flat tree holds all lights of a scene and follows
//! them frame by frame.

use super::effort::Effort;
use super::shading_points::shading_points;
use super::stages::{CITY_BOUNDS, swarm_at};
use girandole::cluster::Aabb;
use girandole::glam::{Vec3, vec3};
use girandole::{FrameBudget, Light, LightTree, ShadingPoint};
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;
use testbed::common::table::{Table, markdown_head};
use testbed::measuring::lights::{carried, illuminances};
use testbed::measuring::sigma::{Noise, Summary};
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::rng::Rng;
use testbed::scene::{SceneError, Stage, gltf_scene};

/// The number of frames, at 60 per second.
const FRAMES: usize = 240;
/// Noise is measured every n-th frame.
const EVERY: usize = 12;

/// The lights of one tree, frame by frame, and the shading points.
struct Motion {
    name: String,
    frames: Vec<Vec<Light>>,
    shading_points: Vec<ShadingPoint>,
}

/// What follows each refit.
#[derive(Clone, Copy)]
enum Strategy {
    /// Nothing.
    Refit,
    /// A rebuild of the whole tree every n-th frame.
    RebuildEvery(usize),
}

/// A row of the table.
struct Row {
    scene: String,
    strategy: String,
    /// The mean over shading points and frames.
    sigma: f64,
    /// By what share sigma exceeds that of a fresh build; the mean over frames.
    loss: f64,
    /// The time of refits and rebuilds, as a multiple of the time of refits alone.
    cost: f64,
    /// The share of the lights that lie in rebuilt subtrees, per frame.
    rebuilt: f64,
}

fn frames(mut stage: Stage, count: usize) -> Result<(Stage, Vec<Vec<Light>>), SceneError> {
    let mut frames = Vec::with_capacity(count);
    for frame in 0..count {
        stage.animation.advance(frame as f64 / 60.0, &mut stage.scene, &mut stage.world)?;
        stage.world.update(FrameBudget::new(std::time::Duration::ZERO));
        frames.push(carried(&stage.world));
    }
    Ok((stage, frames))
}

fn city((count, frame_count): (usize, usize)) -> Result<Motion, SceneError> {
    let (stage, frames) = frames(
        procedural::stage(&CityOptions { size: Size::S, cars: None, seed: 1, lamp_profile: None })?,
        frame_count,
    )?;
    Ok(Motion { name: "city S".into(), frames, shading_points: shading_points(&stage.scene, &CITY_BOUNDS, count)? })
}

fn gltf(path: &Path, (count, frame_count): (usize, usize)) -> Result<Motion, SceneError> {
    let (stage, frames) = frames(gltf_scene::stage(path, None)?, frame_count)?;
    let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let everywhere = Aabb { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
    Ok(Motion { name, frames, shading_points: shading_points(&stage.scene, &everywhere, count)? })
}

/// 3,000 drones, and shading points among them.
fn swarm((count, frame_count): (usize, usize)) -> Result<Motion, SceneError> {
    let frame = |frame: usize| Ok(carried(&swarm_at(3_000, 8.0 + frame as f64 / 60.0)?));
    let mut rng = Rng::new(3, 0);
    let mut signed = || 2.0 * rng.unit() - 1.0;
    let mut point = || vec3(signed(), signed(), signed());
    let shading_point =
        |_| ShadingPoint::surface(vec3(2.0, 78.0, -60.0) + 30.0 * point(), point().normalize_or(Vec3::Y));
    let shading_points = (0..count).map(shading_point).collect();
    Ok(Motion {
        name: "swarm".into(),
        frames: (0..frame_count).map(frame).collect::<Result<_, SceneError>>()?,
        shading_points,
    })
}

/// The mean of sigma over shading points.
fn noise(tree: &LightTree, lux: &[Vec<f32>], shading_points: &[ShadingPoint]) -> f64 {
    let one = |(at, lux): (&ShadingPoint, &Vec<f32>)| {
        let mut pmfs = Vec::new();
        tree.distribution(at, 6, &mut pmfs);
        Noise::of(lux, &pmfs)
    };
    let noises: Vec<Noise> = shading_points.par_iter().zip(lux).filter_map(one).collect();
    Summary::of(&noises).mean
}

fn measure(motion: &Motion) -> Result<Vec<Row>, SceneError> {
    let strategies = [Strategy::Refit, Strategy::RebuildEvery(1), Strategy::RebuildEvery(10)];
    // For each frame in which noise is measured: sigma of a fresh build, and the contribution of
    // each light at each shading point.
    let mut fresh = Vec::new();
    for lights in motion.frames.iter().skip(EVERY - 1).step_by(EVERY) {
        let lux: Vec<Vec<f32>> = motion.shading_points.par_iter().map(|at| illuminances(lights, at)).collect();
        let built = LightTree::new(lights.clone())?;
        fresh.push((noise(&built, &lux, &motion.shading_points), lux));
    }
    let mut rows: Vec<Row> = Vec::new();
    for strategy in strategies {
        let played = play(motion, strategy, &fresh)?;
        let plain = rows.first().map_or(played.cost, |row| row.cost);
        rows.push(Row { scene: motion.name.clone(), ..played });
        let last = rows.len() - 1;
        if last > 0 {
            rows[last].cost /= plain;
        }
    }
    rows[0].cost = 1.0;
    Ok(rows)
}

/// Plays all frames. The cost of the row is in seconds.
fn play(motion: &Motion, strategy: Strategy, fresh: &[(f64, Vec<Vec<f32>>)]) -> Result<Row, SceneError> {
    let count = motion.frames[0].len();
    let mut tree = LightTree::new(motion.frames[0].clone())?;
    let (mut cost, mut rebuilt, mut sigma, mut loss) = (0.0, 0, 0.0, 0.0);
    for (frame, lights) in motion.frames.iter().enumerate() {
        let has_changed = |(index, light): &(u32, Light)| tree.lights()[*index as usize] != *light;
        let changes: Vec<(u32, Light)> = (0..).zip(lights.iter().copied()).filter(has_changed).collect();
        tree.set_lights(&changes)?;
        let start = Instant::now();
        tree.refit();
        match strategy {
            Strategy::RebuildEvery(every) if frame % every == every - 1 => {
                tree.rebuild();
                rebuilt += count;
            }
            Strategy::Refit | Strategy::RebuildEvery(_) => {}
        }
        cost += start.elapsed().as_secs_f64();
        if frame % EVERY == EVERY - 1 {
            let (best, lux) = &fresh[frame / EVERY];
            let now = noise(&tree, lux, &motion.shading_points);
            sigma += now / fresh.len() as f64;
            loss += (now / best - 1.0) / fresh.len() as f64;
        }
    }
    tree.check().map_err(|error| SceneError(error.to_string()))?;
    let strategy = match strategy {
        Strategy::Refit => "refit".to_owned(),
        Strategy::RebuildEvery(1) => "rebuild".to_owned(),
        Strategy::RebuildEvery(every) => format!("rebuild every {every}"),
    };
    let rebuilt = rebuilt as f64 / (count * motion.frames.len()) as f64;
    Ok(Row { scene: String::new(), strategy, sigma, loss, cost, rebuilt })
}

const COLUMNS: [&str; 6] = ["scene", "strategy", "sigma_mean", "sigma_loss", "time_per_refit", "rebuilt_per_frame"];

impl Row {
    fn fields(&self) -> [String; 6] {
        let Self { scene, strategy, sigma, loss, cost, rebuilt } = self;
        let numbers = [format!("{sigma:.4}"), format!("{loss:.4}"), format!("{cost:.2}"), format!("{rebuilt:.4}")];
        let [sigma, loss, cost, rebuilt] = numbers;
        [scene.clone(), strategy.clone(), sigma, loss, cost, rebuilt]
    }
}

/// Measures all scenes and strategies, prints the table and writes it.
pub fn run(gltf_path: Option<&Path>, count: usize, effort: Effort, out: &Path) -> Result<(), SceneError> {
    let counts = (count, effort.select(FRAMES, EVERY));
    let mut motions = vec![swarm(counts)?, city(counts)?];
    if let Some(path) = gltf_path {
        motions.push(gltf(path, counts)?);
    }
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&COLUMNS));
    for motion in &motions {
        for row in measure(motion)? {
            testbed::say!("| {} |", row.fields().join(" | "));
            table.add(row.fields()).map_err(SceneError)?;
        }
    }
    Ok(())
}
