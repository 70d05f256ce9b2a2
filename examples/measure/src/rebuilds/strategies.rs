//! The strategies that are compared: each decides which trees are rebuilt.
//!
//! [SS] is Sosnowski and Szajerman, BVH Trees of Many Dynamic Lights for Real-Time Ray Tracing.

use girandole::{Attribute, Policy};

/// A way to decide which trees are rebuilt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Strategy {
    /// Trees are only refitted.
    UpdateOnly,
    /// Every changed tree is rebuilt at once.
    AlwaysRebuild,
    /// Changed trees are rebuilt in turn.
    RoundRobin,
    /// Of the changed trees, those with the oldest last rebuild come first.
    OldestFirst,
    /// Algorithm 1 of [SS].
    Deviation(Attribute),
    /// Algorithm 2 of [SS].
    Ratio(Attribute),
    /// The library's scheduler with the position of the camera.
    Girandole,
    /// [`Strategy::Girandole`] without builds in the background: large trees are built in slices
    /// within frames.
    GirandoleInFrames,
    /// The rebuilds with the largest gain per time in this frame come first; the gains are computed
    /// exactly.
    Oracle,
}

use Attribute::{Distance, Overlap, SplittingCost, Variance};

impl Strategy {
    /// All strategies, the two ends of the gap first.
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
        Self::GirandoleInFrames,
        Self::Oracle,
    ];

    /// The strategy's name in tables.
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
            Self::GirandoleInFrames => "girandole in frames".into(),
            Self::Oracle => "oracle".into(),
        }
    }

    /// Whether the budget makes no difference.
    pub fn ignores_budget(self) -> bool {
        matches!(self, Self::UpdateOnly | Self::AlwaysRebuild)
    }

    /// Whether this is an algorithm of [SS], which is also measured without a budget.
    pub fn is_of_ss(self) -> bool {
        matches!(self, Self::Deviation(_) | Self::Ratio(_))
    }

    /// Whether the strategy calls for rebuilds itself, and the world only refits.
    pub fn is_external(self) -> bool {
        matches!(self, Self::RoundRobin | Self::OldestFirst | Self::Oracle)
    }

    /// The policy of a tree whose attributes have these deviations.
    pub fn policy(self, deviations: &Deviations) -> Policy {
        match self {
            Self::UpdateOnly | Self::RoundRobin | Self::OldestFirst | Self::Oracle => Policy::RefitOnly,
            Self::AlwaysRebuild => Policy::AlwaysRebuild,
            Self::Girandole | Self::GirandoleInFrames => Policy::Budgeted,
            Self::Deviation(attribute) => {
                let deviation = ATTRIBUTES.iter().position(|a| *a == attribute).map_or(0.0, |i| deviations[i]);
                Policy::Deviation { attribute, deviation, factor: DEVIATIONS }
            }
            Self::Ratio(attribute) => Policy::Ratio { attribute, factor: RATIO },
        }
    }
}

/// The factor S of algorithm 1 of [SS].
const DEVIATIONS: f32 = 1.0;
/// The factor S of algorithm 2 of [SS].
const RATIO: f32 = 1.1;

/// The attributes in the order of [`Deviations`].
pub const ATTRIBUTES: [Attribute; 4] = [Distance, Overlap, Variance, SplittingCost];

/// The standard deviation of each attribute of a tree over fresh builds at several points of its
/// animation.
pub type Deviations = [f32; 4];
