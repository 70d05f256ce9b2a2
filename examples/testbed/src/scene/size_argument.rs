//! The sizes of the procedural city as values of a command line.

use clap::ValueEnum;
use clap::builder::PossibleValue;

use super::procedural::Size;

impl ValueEnum for Size {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::S, Self::M, Self::L]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (name, alias, help) = match self {
            Self::S => ("S", "s", "25 blocks, about 1,000 instances and 20,000 lights"),
            Self::M => ("M", "m", "256 blocks, about 10,000 instances and 300,000 lights"),
            Self::L => ("L", "l", "2,500 blocks, about 100,000 instances and 3,000,000 lights"),
        };
        Some(PossibleValue::new(name).alias(alias).help(help))
    }
}
