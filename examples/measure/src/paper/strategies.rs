//! The strategies that are compared, on which kinds of trees, and their names in tables.

use super::decisions::Rule;
use girandole::{Attribute, Attributes};

/// The kinds of trees that hold the lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TreeKind {
    /// A binary tree over all lights with pbrt-v4's importance at one point, made opaque: the
    /// closest to the tree of [SS].
    Binary,
    /// One tree of this library over all lights, with the default number of splits.
    Library,
    /// This library's two levels: a tree per object, and one over the instances, which is new in
    /// each frame.
    TwoLevels,
}

impl TreeKind {
    /// All kinds, in the order of the tables.
    pub const ALL: [Self; 3] = [Self::Binary, Self::Library, Self::TwoLevels];

    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Binary => "binary tree",
            Self::Library => "girandole, one tree",
            Self::TwoLevels => "girandole, two levels",
        }
    }

    /// The name in file names.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Binary => "binary",
            Self::Library => "girandole",
            Self::TwoLevels => "two_levels",
        }
    }
}

/// A way to decide when trees are rebuilt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Strategy {
    /// A rule for one tree.
    Rule(Rule),
    /// The library's scheduler with this share of the time of always rebuilding.
    Budget(f64),
}

/// The attributes in the order of the tables.
pub const ATTRIBUTES: [Attribute; 4] =
    [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost];
/// The values of S of algorithm 1.
pub const DEVIATION_FACTORS: [f32; 3] = [0.5, 1.0, 1.1];
/// The values of S of algorithm 2.
pub const RATIO_FACTORS: [f32; 2] = [1.05, 1.1];
/// The budgets, as shares of the time of always rebuilding.
pub const BUDGETS: [f64; 4] = [0.02, 0.05, 0.1, 0.2];

/// The name of an attribute.
pub fn attribute_name(attribute: Attribute) -> &'static str {
    match attribute {
        Attribute::Distance => "distance",
        Attribute::Overlap => "overlap",
        Attribute::Variance => "variance of lights",
        Attribute::SplittingCost => "splitting cost",
    }
}

/// The rules for one tree whose attributes have these standard deviations over rebuilt trees. The
/// first two are the ends: never and always.
pub fn rules(deviations: &Attributes) -> Vec<Rule> {
    let mut rules = vec![Rule::Never, Rule::Always];
    for attribute in ATTRIBUTES {
        let deviation = deviations.get(attribute);
        rules.extend(DEVIATION_FACTORS.map(|factor| Rule::Deviation { attribute, deviation, factor }));
        rules.extend(RATIO_FACTORS.map(|factor| Rule::Ratio { attribute, factor }));
    }
    rules
}

impl Strategy {
    /// The name in tables.
    pub fn name(&self) -> String {
        match *self {
            Self::Rule(Rule::Never) => "always update".into(),
            Self::Rule(Rule::Always) => "always rebuild".into(),
            Self::Rule(Rule::Deviation { attribute, deviation, factor }) => {
                format!("{}, alg 1, SD {}, S {factor}", attribute_name(attribute), three_digits(deviation))
            }
            Self::Rule(Rule::Ratio { attribute, factor }) => {
                format!("{}, alg 2, S {factor}", attribute_name(attribute))
            }
            Self::Budget(share) => format!("budget {} %", 100.0 * share),
        }
    }
}

/// A number with three significant digits.
fn three_digits(value: f32) -> String {
    if value <= 0.0 {
        return "0".into();
    }
    let digits = (2 - value.log10().floor() as i32).max(0) as usize;
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strategies_have_the_names_of_the_tables_of_ss() {
        let rule = Rule::Deviation { attribute: Attribute::Overlap, deviation: 0.00296, factor: 1.1 };
        assert_eq!(Strategy::Rule(rule).name(), "overlap, alg 1, SD 0.00296, S 1.1");
        assert_eq!(Strategy::Budget(0.05).name(), "budget 5 %");
        assert_eq!([12.34, 0.0, 1.0].map(three_digits), ["12.3", "0", "1.00"]);
        assert_eq!(rules(&Attributes::default()).len(), 22);
    }
}
