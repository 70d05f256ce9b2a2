//! What is measured: every setting, by name.

use super::options::Plan;
use super::played::Upkeep;
use super::simplified::LIGHT_EFFECTS;
use girandole::Effects;
use testbed::direct_light::rivals;

/// How a sample draws its light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sampler {
    /// The library with its two levels.
    TwoLevels { splits: usize, candidates: u32 },
    /// The library with its two levels; candidates are weighed by the light that they reflect.
    ByBrdf { splits: usize, candidates: u32 },
    /// The library with its two levels, which are told how surfaces reflect.
    WithGloss { splits: usize, candidates: u32 },
    /// The library with its two levels and cuts that the pixels of a cell share, which may know what earlier
    /// frames taught about shadows.
    SharedCuts { candidates: u32, has_gloss: bool, learns: bool },
    /// The library with one tree over all lights.
    OneLevel { splits: usize, candidates: u32 },
    /// One of the samplers to compare with, by its name in `measuring/samplers.rs`.
    Published(&'static str),
    /// A published sampler that prepares each frame, by its name in `direct_light/rivals/by_name.rs`.
    Rival(&'static str),
    /// All lights in every sample.
    AllLights,
}

impl Sampler {
    /// Its name in the table, the plots and the page.
    pub fn name(self) -> String {
        let tree = |levels: &str, splits, candidates: u32| {
            format!("{levels} / {} / {}", counted(splits, "split"), counted(candidates as usize, "candidate"))
        };
        match self {
            Self::TwoLevels { splits, candidates } => tree("Girandole", splits, candidates),
            Self::ByBrdf { splits, candidates } => tree("Girandole", splits, candidates) + " by BRDF",
            Self::WithGloss { splits, candidates } => tree("Girandole", splits, candidates) + " with gloss",
            Self::SharedCuts { candidates, has_gloss, learns } => {
                let cuts = if learns { "learnt cuts" } else { "shared cuts" };
                let gloss = if has_gloss { " with gloss" } else { "" };
                format!("Girandole, {cuts} / {}{gloss}", counted(candidates as usize, "candidate"))
            }
            Self::OneLevel { splits, candidates } => tree("Girandole, one tree", splits, candidates),
            Self::Published("pbrt") => "pbrt-v4's formula".into(),
            Self::Published("pbrt opaque") => "pbrt-v4's formula, opaque".into(),
            Self::Published("cycles") => "Cycles' formula".into(),
            Self::Published("sg tree") => "spherical Gaussians".into(),
            Self::Published("sg tree, wide") => "spherical Gaussians, eight-wide".into(),
            Self::Rival("regir") => "ReGIR".into(),
            Self::Rival("nee-at") => "NEE-AT".into(),
            Self::Published(name) | Self::Rival(name) => name.into(),
            Self::AllLights => "all lights".into(),
        }
    }
}

/// A number of things: "1 split", "6 splits".
pub fn counted(count: usize, thing: &str) -> String {
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}

/// Splits and candidates of the library's defaults.
pub const DEFAULT: Sampler = Sampler::TwoLevels { splits: 6, candidates: 1 };

/// The samples per pixel at which knobs are turned and changes are measured.
pub const KNOB_SAMPLES: f64 = 4.0;

/// What differs from the default frame besides the sampler.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    Nothing,
    /// Another way to keep trees fit while they deform.
    Upkeep(Upkeep),
    /// Large and near surfaces are sampled by solid angle.
    SolidAngles,
    /// No shadow rays.
    NoShadows,
    /// Diffuse materials.
    NoGloss,
    /// Lights that lack an effect.
    Without(Effects, &'static str),
}

impl Change {
    /// Whether pictures show something else than the reference, however many samples they have.
    pub fn is_biased(self) -> bool {
        matches!(self, Self::NoShadows | Self::NoGloss | Self::Without(..))
    }
}

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    pub sampler: Sampler,
    /// Samples per pixel, in the mean.
    pub samples: f64,
    pub change: Change,
}

impl Setting {
    /// Its name in the table.
    pub fn name(&self) -> String {
        let change = match self.change {
            Change::Nothing => String::new(),
            Change::Upkeep(Upkeep::RefitOnly) => " / refit only".into(),
            Change::Upkeep(Upkeep::AlwaysRebuild) => " / always rebuild".into(),
            Change::Upkeep(Upkeep::Budgeted(us)) => format!(" / budget {us} us"),
            Change::SolidAngles => " / solid angles".into(),
            Change::NoShadows => " / no shadows".into(),
            Change::NoGloss => " / no gloss".into(),
            Change::Without(_, effect) => format!(" / no {effect}"),
        };
        // As short as possible: 1, 2.5, 16.
        let samples = (self.samples * 100.0).round() / 100.0;
        format!("{} / {samples} spp{change}", self.sampler.name())
    }
}

/// A setting with several candidates that every run measures.
pub fn resampled_default(is_quick: bool) -> Sampler {
    Sampler::TwoLevels { splits: 6, candidates: resampled_candidates(is_quick) }
}

/// The default with cuts that the pixels of a cell share.
pub const SHARED: Sampler = Sampler::SharedCuts { candidates: 1, has_gloss: false, learns: false };

/// The same with learnt visibility.
pub const LEARNT: Sampler = Sampler::SharedCuts { candidates: 1, has_gloss: false, learns: true };

/// The library's samplers that are shown in equal time.
pub fn own_in_equal_time(is_quick: bool) -> [Sampler; 4] {
    [DEFAULT, resampled_default(is_quick), SHARED, LEARNT]
}

/// The candidates of [`resampled_default`], which are also weighed by BRDF.
fn resampled_candidates(is_quick: bool) -> u32 {
    if is_quick { 4 } else { 8 }
}

/// The budget of the default frame, in microseconds.
pub const DEFAULT_BUDGET: u32 = 300;

/// The numbers of splits that are measured with this many candidates.
fn splits(candidates: u32, is_quick: bool) -> &'static [usize] {
    match (is_quick, candidates) {
        (true, _) => &[0, 6],
        (false, 1 | 2 | 4 | 8) => &[0, 2, 4, 6, 7],
        (false, _) => &[6],
    }
}

/// The numbers of samples per pixel that are measured with this many candidates. Expensive settings
/// need no curve beyond the times of the others.
fn samples(candidates: u32, is_quick: bool) -> &'static [f64] {
    match (is_quick, candidates) {
        (true, _) => &[1.0, 4.0],
        (false, 1) => &[1.0, 2.0, 4.0, 8.0, 16.0],
        (false, 2 | 4 | 8) => &[1.0, 2.0, 4.0, 8.0],
        (false, _) => &[1.0, 2.0, 4.0],
    }
}

/// The knobs of splits, candidates and samples, for two levels and for one.
fn of_library(is_quick: bool) -> Vec<Setting> {
    let candidates: &[u32] = if is_quick { &[1, 4] } else { &[1, 2, 4, 8, 16, 32] };
    let mut settings = Vec::new();
    for candidates in candidates.iter().copied() {
        for samples in samples(candidates, is_quick).iter().copied() {
            let mut add = |sampler| settings.push(Setting { sampler, samples, change: Change::Nothing });
            splits(candidates, is_quick)
                .iter()
                .for_each(|splits| add(Sampler::TwoLevels { splits: *splits, candidates }));
            if candidates == resampled_candidates(is_quick) {
                add(Sampler::ByBrdf { splits: 6, candidates });
            }
            if candidates == 1 || candidates == resampled_candidates(is_quick) {
                add(Sampler::WithGloss { splits: 6, candidates });
                for (has_gloss, learns) in [(false, false), (false, true), (true, false), (true, true)] {
                    add(Sampler::SharedCuts { candidates, has_gloss, learns });
                }
            }
            if matches!(candidates, 1 | 8) {
                add(Sampler::OneLevel { splits: 6, candidates });
            }
        }
    }
    settings
}

/// The samplers to compare with that know the probability of each light.
const PUBLISHED: [&str; 7] = ["uniform", "flux", "pbrt", "pbrt opaque", "cycles", "sg tree", "sg tree, wide"];

/// All samplers to compare with.
pub fn others() -> impl Iterator<Item = Sampler> {
    PUBLISHED.map(Sampler::Published).into_iter().chain(rivals::NAMES.map(Sampler::Rival))
}

/// The samplers to compare with, at numbers of samples whose times span those of the library.
fn of_others(is_quick: bool) -> Vec<Setting> {
    let samples: &[f64] = if is_quick { &[1.0, 4.0] } else { &[1.0, 2.0, 4.0, 8.0, 16.0, 32.0] };
    let settings = others().flat_map(|sampler| {
        samples.iter().map(move |samples| Setting { sampler, samples: *samples, change: Change::Nothing })
    });
    settings.collect()
}

/// Ways to keep trees fit, settings of the library that are off by default, and effects that are left
/// out, each with the default sampler.
fn of_frames(effects: Effects, is_matte: bool, is_quick: bool) -> Vec<Setting> {
    let budgets: &[u32] = if is_quick { &[100] } else { &[0, 30, 100, 1_000] };
    let ends = [Upkeep::RefitOnly, Upkeep::AlwaysRebuild];
    let upkeeps = ends.into_iter().chain(budgets.iter().map(|us| Upkeep::Budgeted(*us))).map(Change::Upkeep);
    let simpler = LIGHT_EFFECTS.into_iter().filter(|(effect, _)| effects.contains(*effect));
    let simpler = simpler.map(|(effect, name)| Change::Without(effect, name));
    let gloss = (!is_matte).then_some(Change::NoGloss);
    let solid_angles = effects.contains(Effects::AREAS).then_some(Change::SolidAngles);
    let changes = upkeeps.chain(solid_angles).chain([Change::NoShadows]).chain(gloss).chain(simpler);
    changes.map(|change| Setting { sampler: DEFAULT, samples: KNOB_SAMPLES, change }).collect()
}

/// All settings of a run. `lights` is the number of lights of the world, `effects` what they need.
pub fn all(lights: usize, effects: Effects, is_matte: bool, plan: &Plan) -> Vec<Setting> {
    let mut settings = of_library(plan.is_quick);
    settings.extend(of_others(plan.is_quick));
    if lights <= MOST_LIGHTS {
        settings.push(Setting { sampler: Sampler::AllLights, samples: 1.0, change: Change::Nothing });
    }
    settings.extend(of_frames(effects, is_matte, plan.is_quick));
    settings
}

/// Sums over more lights than this are not worth their time.
pub const MOST_LIGHTS: usize = 100_000;
