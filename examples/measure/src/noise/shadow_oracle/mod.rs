//! What a sampler would gain if it knew which lights are visible: the exact noise of one sample
//! with shadows, for the library and for oracles whose probabilities account for visibility.
//!
//! An oracle multiplies the library's probability of each light by a visibility: that of the light,
//! of a cluster of lights at the shading point, or of a cluster in a cell of the world. The last
//! one is what a table hashed by cell, side and cluster could learn at best. No oracle is part of
//! the library.
//!
//! Read the files in the order of the list below, in which data passes through them. They refer to
//! `crate::noise::city`, `testbed::common`, `testbed::direct_light` and `testbed::measuring`.

pub mod places;

pub mod receivers;
pub mod cells;
pub mod clusters;
pub mod oracles;

pub mod measure;
pub mod table;

use std::path::Path;
use testbed::common::table::{Table, markdown_head};
use testbed::scene::SceneError;

/// Measures the scenes, prints the table and writes it. `count` is the number of shading points in
/// each scene.
pub fn run(gltf: Option<&Path>, count: usize, out: &Path) -> Result<(), SceneError> {
    let mut table = Table::create(out, &table::COLUMNS).map_err(SceneError)?;
    let mut places = vec![places::street()?, places::rooms()?];
    if let Some(path) = gltf {
        places.push(places::gltf(path)?);
    }
    for place in &places {
        let measured = measure::measure(place, count)?;
        let lights = place.world.light_count();
        testbed::say!("\n{}: {lights} lights in {} instances\n", place.name, place.world.instances().len());
        testbed::say!("{}", markdown_head(&table::COLUMNS));
        for row in table::rows(&measured) {
            testbed::say!("| {} |", row.join(" | "));
            table.add(row).map_err(SceneError)?;
        }
    }
    Ok(())
}
