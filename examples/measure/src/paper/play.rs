//! Plays a scene under all strategies. Frames are the outer loop, so that the geometry, the lights
//! and the reference of a frame are computed once.

use super::decisions::Rule;
use super::pictures::{Settings, Shot, view};
use super::pool::{Pool, Step};
use super::results::{FrameResult, Results, Run};
use super::stages::{Film, Source, Timing};
use super::strategies::{BUDGETS, Strategy, TreeKind, rules};
use super::survey::Survey;
use super::trees::FromTree;
use super::worlds::Contender;
use girandole::LightId;
use rayon::ThreadPool;
use testbed::direct_light::draw::Resampled;
use testbed::render::geometry::Geometry;
use testbed::scene::SceneError;

/// What is played.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub frames: u32,
    /// Play the algorithms of [SS], and the binary tree; otherwise only the library's trees and
    /// their budgets.
    pub has_algorithms: bool,
    pub timing: Timing,
    pub settings: Settings,
}

/// All trees of a film.
struct Cast {
    /// Each kind of tree over all lights, with the index of its first run.
    pools: Vec<(Pool, usize)>,
    /// The worlds, with the index of the first one's run.
    worlds: (Vec<Contender>, usize),
    runs: Vec<Run>,
}

impl Cast {
    /// Builds all trees over the lights of frame 0. Returns what each run did for that.
    fn new(
        film: &Film,
        survey: &Survey,
        has_algorithms: bool,
        threads: &ThreadPool,
    ) -> Result<(Self, Vec<Step>), SceneError> {
        let (mut pools, mut runs, mut steps) = (Vec::new(), Vec::new(), Vec::new());
        let kinds = [TreeKind::Binary, TreeKind::Library].into_iter().skip(usize::from(!has_algorithms));
        for kind in kinds {
            let mut rules = rules(&survey.of(kind).deviations);
            rules.retain(|rule| has_algorithms || matches!(rule, Rule::Never | Rule::Always));
            let (pool, first) = Pool::new(kind, &rules, &film.lights, threads)?;
            pools.push((pool, runs.len()));
            runs.extend(rules.iter().map(|rule| Run { kind, strategy: Strategy::Rule(*rule), frames: Vec::new() }));
            steps.extend(first);
        }
        let mut worlds = Vec::new();
        for share in BUDGETS {
            worlds.push(Contender::one_tree(Strategy::Budget(share), survey.library.times, &film.lights)?);
            // The first build is the same as that of the rules.
            steps.push(steps[steps.len() - 1]);
        }
        let mut strategies = vec![Strategy::Rule(Rule::Never)];
        if survey.two_levels.lights > 0.0 {
            strategies.push(Strategy::Rule(Rule::Always));
            strategies.extend(BUDGETS.map(Strategy::Budget));
        }
        for strategy in strategies {
            worlds.push(Contender::two_levels(strategy, Some(survey.two_levels), &film.stage.world)?);
            steps.push(Step::default());
        }
        let first = runs.len();
        for world in &mut worlds {
            world.set_eye(film.stage.scene.camera.eye)?;
            runs.push(Run { kind: world.kind, strategy: world.strategy, frames: Vec::new() });
        }
        Ok((Self { pools, worlds: (worlds, first), runs }, steps))
    }

    /// Plays the next frame and returns what each run did.
    fn advance(&mut self, film: &Film, frame: u32, threads: &ThreadPool) -> Result<Vec<Step>, SceneError> {
        let mut steps = Vec::with_capacity(self.runs.len());
        for (pool, _) in &mut self.pools {
            steps.extend(pool.advance(frame, (&film.lights, &film.changes), threads)?);
        }
        for world in &mut self.worlds.0 {
            let (step, _) = world.advance((&film.stage.world, &film.changes), film.frame_time(), threads)?;
            steps.push(step);
        }
        Ok(steps)
    }

    /// Renders the frame with all trees and adds the errors to the runs.
    fn render(&mut self, film: &Film, shot: &Shot<'_>, steps: Vec<Step>) {
        let lights = film.stage.world.sampler();
        let ids: Vec<LightId> = lights.all_lights().collect();
        let mut errors = vec![Vec::new(); self.runs.len()];
        for (pool, first) in &self.pools {
            for (tree, users) in pool.in_use() {
                let of_tree = shot.errors(&mut FromTree { tree, ids: &ids, lights });
                users.into_iter().for_each(|user| errors[first + user].clone_from(&of_tree));
            }
        }
        let (worlds, first) = &self.worlds;
        for (world, errors) in worlds.iter().zip(&mut errors[*first..]) {
            *errors = match world.tree_of_all() {
                Some(tree) => shot.errors(&mut FromTree { tree, ids: &ids, lights }),
                None => shot.errors(&mut Resampled { lights: world.sampler(), candidates: 1, has_gloss: false }),
            };
        }
        for ((run, step), errors) in self.runs.iter_mut().zip(steps).zip(errors) {
            run.frames.push(FrameResult { step, errors });
        }
    }
}

/// Plays a scene. Trees are timed on `threads`. `tick` is called
/// after each point of the survey and after each frame.
pub fn play(source: &Source, plan: &Plan, threads: &ThreadPool, tick: impl Fn()) -> Result<Results, SceneError> {
    let survey = Survey::new(source, (plan.frames, plan.timing), threads, &tick)?;
    let mut film = Film::new(source, plan.timing)?;
    let mut geometry = Geometry::new(&film.stage.scene)?;
    let (mut cast, mut steps) = Cast::new(&film, &survey, plan.has_algorithms, threads)?;
    let (mut changed, mut reference_error) = (0, 0.0);
    for frame in 0..plan.frames {
        if frame > 0 {
            film.advance(frame)?;
            geometry.update(&film.stage.scene)?;
            steps = cast.advance(&film, frame, threads)?;
            changed += film.changes.len();
        }
        let view = view(&film, &geometry, &plan.settings);
        let shot = Shot::new(&film, (&geometry, &view), (&plan.settings, frame))?;
        reference_error += shot.reference_error / f64::from(plan.frames);
        cast.render(&film, &shot, std::mem::take(&mut steps));
        tick();
    }
    Ok(Results {
        scene: source.name(),
        lights: film.lights.len(),
        instances: film.stage.world.instances().len(),
        changed_lights: changed as f64 / f64::from(plan.frames - 1),
        reference_error,
        runs: cast.runs,
    })
}
