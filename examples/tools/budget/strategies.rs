//! What is compared: who decides which trees are rebuilt.

use girandole::{Attribute, Policy};

/// Who decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Strategy {
    /// Nobody: trees are only ever refitted.
    UpdateOnly,
    /// Whatever changed is rebuilt at once.
    AlwaysRebuild,
    /// One tree after the other, of those that changed.
    RoundRobin,
    /// Those whose last rebuild is longest ago, of those that changed.
    OldestFirst,
    /// Algorithm 1 of SS.
    Deviation(Attribute),
    /// Algorithm 2 of SS.
    Ratio(Attribute),
    /// The library's scheduler, which knows where the camera stands.
    Girandole,
    /// The library's scheduler, which is told what the sampler picked.
    GirandoleUsage,
    /// Knows what each rebuild would gain in this frame.
    Oracle,
}

use Attribute::{Distance, Overlap, SplittingCost, Variance};

impl Strategy {
    /// All, the two ends of the gap first.
    pub const ALL: [Self; 15] = [
        Self::UpdateOnly,
        Self::AlwaysRebuild,
        Self::RoundRobin,
        Self::OldestFirst,
        Self::Deviation(Distance),
        Self::Deviation(Overlap),
        Self::Deviation(Variance),
        Self::Deviation(SplittingCost),
        Self::Ratio(Distance),
        Self::Ratio(Overlap),
        Self::Ratio(Variance),
        Self::Ratio(SplittingCost),
        Self::Girandole,
        Self::GirandoleUsage,
        Self::Oracle,
    ];

    /// As tables call it.
    pub fn name(self) -> String {
        let of = |attribute| match attribute {
            Distance => "distance",
            Overlap => "overlap",
            Variance => "variance",
            SplittingCost => "splitting cost",
        };
        match self {
            Self::UpdateOnly => "update only".into(),
            Self::AlwaysRebuild => "always rebuild".into(),
            Self::RoundRobin => "round robin".into(),
            Self::OldestFirst => "oldest first".into(),
            Self::Deviation(attribute) => format!("SS 1 {}", of(attribute)),
            Self::Ratio(attribute) => format!("SS 2 {}", of(attribute)),
            Self::Girandole => "girandole".into(),
            Self::GirandoleUsage => "girandole picks".into(),
            Self::Oracle => "oracle".into(),
        }
    }

    /// The same whatever the budget.
    pub fn ignores_budget(self) -> bool {
        matches!(self, Self::UpdateOnly | Self::AlwaysRebuild)
    }

    /// An algorithm of SS, which is measured without a budget too.
    pub fn is_of_ss(self) -> bool {
        matches!(self, Self::Deviation(_) | Self::Ratio(_))
    }

    /// Rebuilds by hand; the world only refits.
    pub fn is_by_hand(self) -> bool {
        matches!(self, Self::RoundRobin | Self::OldestFirst | Self::Oracle)
    }

    /// Of a tree whose attributes spread so much over rebuilt trees.
    pub fn policy(self, deviations: &Deviations) -> Policy {
        match self {
            Self::UpdateOnly | Self::RoundRobin | Self::OldestFirst | Self::Oracle => Policy::RefitOnly,
            Self::AlwaysRebuild => Policy::AlwaysRebuild,
            Self::Girandole | Self::GirandoleUsage => Policy::Budgeted,
            Self::Deviation(attribute) => {
                let deviation = ATTRIBUTES.iter().position(|a| *a == attribute).map_or(0.0, |i| deviations[i]);
                Policy::Deviation { attribute, deviation, factor: DEVIATIONS }
            }
            Self::Ratio(attribute) => Policy::Ratio { attribute, factor: RATIO },
        }
    }
}

/// S of algorithm 1 of SS.
const DEVIATIONS: f32 = 1.0;
/// S of algorithm 2 of SS.
const RATIO: f32 = 1.1;

/// In the order of [`Deviations`].
pub const ATTRIBUTES: [Attribute; 4] = [Distance, Overlap, Variance, SplittingCost];

/// Standard deviation of each attribute of a tree over rebuilds at several points of its animation.
pub type Deviations = [f32; 4];
