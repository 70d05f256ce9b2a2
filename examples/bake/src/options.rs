//! The command line, and the whole run.

use super::compare::equal_samples;
use super::load::load;
use super::write::write;
use clap::Parser;
use std::path::PathBuf;
use std::time::Duration;
use testbed::scene::SceneError;

/// The samples that are compared.
const SAMPLES: usize = 10_000;

/// Bakes the lights of a glTF scene.
#[derive(Clone, Debug, Parser)]
#[command(name = "bake", version)]
pub struct Options {
    /// The scene (.gltf or .glb)
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    /// The folder of the baked trees; files of earlier runs are overwritten
    #[arg(value_name = "DIR")]
    pub out: PathBuf,
}

pub fn run(options: &Options) -> Result<(), SceneError> {
    let baked = write(&options.scene, &options.out)?;
    let loaded = load(&options.out)?;
    let world = &baked.world;
    let lights: usize = world.trees().filter_map(|key| world.tree(key)).map(|tree| tree.lights().len()).sum();
    testbed::say!("{} trees of {lights} lights, {} instances", world.trees().len(), world.instances().len());
    testbed::say!("baked files      {:9.3} MB", baked.bytes as f64 * 1.0e-6);
    let line = |what: &str, time: Duration| testbed::say!("{what:16} {:9.3} ms", time.as_secs_f64() * 1.0e3);
    line("build", baked.building);
    line("bake", baked.baking);
    line("copy of files", loaded.copying);
    line("load", loaded.loading);
    line("insert and place", loaded.inserting);
    let equal = equal_samples(world, &loaded.world, SAMPLES);
    if equal < SAMPLES {
        return Err(SceneError(format!("{} of {SAMPLES} samples differ", SAMPLES - equal)));
    }
    testbed::say!("{SAMPLES} samples of both worlds agree");
    Ok(())
}
