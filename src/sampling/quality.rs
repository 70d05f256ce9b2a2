//! Presets of the settings that trade the time of a sample for its accuracy.

use crate::sampling::counts::{CandidateCount, SplitCount};

/// How much time a sample may take.
///
/// A preset sets what belongs together: the splits before a light is chosen, and the candidates of
/// which one is kept. The number of samples per pixel stays the engine's choice.
///
/// ```
/// use girandole::glam::Vec3;
/// use girandole::{Light, LightTree, LightWorld, Placement, Policy, Quality, ShadingPoint};
///
/// let mut world = LightWorld::new();
/// let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::new(0.0, 6.0, 0.0), Vec3::splat(800.0))])?);
/// world.add_instance(lamp, Placement::IDENTITY, Policy::Static)?;
///
/// let quality = Quality::High;
/// let sampler = world.sampler().with_splits(quality.splits());
/// let ground = ShadingPoint::surface(Vec3::X, Vec3::Y);
/// assert!(sampler.resample(&ground, [0.1, 0.2, 0.3, 0.4, 0.5], quality.candidates()).weight > 0.0);
/// # Ok::<(), girandole::WorldError>(())
/// ```
///
/// Shaders choose from cells and have no splits: pass [`candidates`](Self::candidates) to `light_resample` in WGSL.
///
/// The numbers below are those of one sample per pixel in city S, relative to plain sampling with
/// six splits and one candidate. Time is that of a whole frame on one core, with one shadow ray per
/// sample; error is relMSE, on diffuse materials and with the city's glossy ones. Measured by
/// `cargo run --release -p accuracy -- --out DIR --pictures 4 [--matte]` on an Intel Xeon, 2026-11-22;
/// `docs/accuracy.md` has the intervals and the other settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Quality {
    /// Four splits, one candidate: 0.86 of the time, 1.49 of the error on diffuse materials, 1.40 on
    /// glossy ones. Fewer splits are hardly faster.
    Fast,
    /// Six splits, four candidates: 1.4 times the time, 0.51 of the error on diffuse materials,
    /// 0.79 on glossy ones. On diffuse materials, no other setting has less error in its time, with
    /// one, two or four samples per pixel.
    #[default]
    Balanced,
    /// Seven splits, eight candidates: 2.0 times the time, 0.42 of the error on diffuse materials,
    /// 0.65 on glossy ones. It has less error per shadow ray than [`Quality::Balanced`] on diffuse
    /// materials, and no measured difference on glossy ones. If shadow rays are not the limit, take
    /// two samples of `Balanced` instead.
    High,
}

impl Quality {
    /// All presets, the fastest first.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Balanced, Self::High];

    /// The splits, for [`LightSampler::with_splits`](crate::LightSampler::with_splits).
    pub const fn splits(self) -> SplitCount {
        match self {
            Self::Fast => SplitCount::of::<4>(),
            Self::Balanced => SplitCount::DEFAULT,
            Self::High => SplitCount::MAX,
        }
    }

    /// The candidates, for [`LightSampler::resample`](crate::LightSampler::resample). One candidate
    /// is plain sampling.
    pub const fn candidates(self) -> CandidateCount {
        match self {
            Self::Fast => CandidateCount::ONE,
            Self::Balanced => CandidateCount::of::<4>(),
            Self::High => CandidateCount::of::<8>(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::documented::{assert_says, word};

    #[test]
    fn the_documentation_of_the_presets_names_their_settings() {
        for quality in Quality::ALL {
            let [splits, candidates] = [quality.splits().get(), quality.candidates().get() as usize].map(word);
            let plural = if candidates == "one" { "candidate" } else { "candidates" };
            let (first, rest) = splits.split_at(1);
            let sentence = format!("{}{rest} splits, {candidates} {plural}: ", first.to_uppercase());
            assert_says(include_str!("quality.rs"), &sentence);
        }
    }
}
