//! Scenes that broke earlier schedulers. Each is played on a virtual clock with stated costs, so
//! that the results do not depend on the machine.

mod at_rest;
mod large_tree;
mod lights;
mod lock_out;
mod outcome;
mod play;
mod tree_noise;
mod varying_budgets;

use outcome::{COLUMNS, Outcome, show};
use std::path::Path;
use testbed::common::table::Table;
use testbed::scene::SceneError;

pub use at_rest::{AtRest, measure as at_rest};
pub use large_tree::{LargeTree, measure as large_tree};
pub use lock_out::{LockOut, measure as lock_out};
pub use varying_budgets::{VaryingBudgets, measure as varying_budgets};

/// The names of all scenes.
pub const SCENES: [&str; 4] = [VaryingBudgets::SCENE, LargeTree::SCENE, LockOut::SCENE, AtRest::SCENE];

/// How much of each scene is played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// All of it: some minutes.
    Full,
    /// Fewer frames, trees and seeds: some seconds.
    Quick,
}

impl Extent {
    /// One of two values.
    fn select<T>(self, full: T, quick: T) -> T {
        match self {
            Self::Full => full,
            Self::Quick => quick,
        }
    }
}

/// Plays scenes, prints a table for each and writes `cases.csv`.
pub fn run(out: &Path, extent: Extent, scenes: &[&str]) -> Result<(), SceneError> {
    std::fs::create_dir_all(out).map_err(|error| SceneError(format!("cannot make {}: {error}", out.display())))?;
    let mut table = Table::create(&out.join("cases.csv"), &COLUMNS).map_err(SceneError)?;
    for scene in scenes {
        match *scene {
            VaryingBudgets::SCENE => show(&varying_budgets(extent)?, &mut table)?,
            LargeTree::SCENE => show(&large_tree(extent)?, &mut table)?,
            LockOut::SCENE => show(&lock_out(extent)?, &mut table)?,
            _ => show(&at_rest(extent)?, &mut table)?,
        }
    }
    Ok(())
}
