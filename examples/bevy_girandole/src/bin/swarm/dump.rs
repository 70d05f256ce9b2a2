//! Writes the lights of the last frame into a file, which the city of the library shows.

use std::fs::File;
use std::io::{BufWriter, Write};

use bevy::prelude::*;
use bevy::render::{Render, RenderApp};
use bevy_girandole::{GirandoleLights, GirandoleSystems};

use crate::options::Options;

/// Fails if the file cannot be made.
pub fn add_systems(app: &mut App, options: &Options) -> Result<(), String> {
    let Some(path) = options.dump.clone() else { return Ok(()) };
    let mut file = Some(File::create(&path).map_err(|error| format!("{path}: {error}"))?);
    let last = options.frames.max(1);
    let write = move |mut frame: Local<u32>, lights: Res<GirandoleLights>| {
        *frame += 1;
        if *frame == last
            && let Some(Err(error)) = file.take().map(|file| dump(&lights, file))
        {
            eprintln!("{path}: {error}");
        }
    };
    if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
        render_app.add_systems(Render, write.after(GirandoleSystems::Upload));
    }
    Ok(())
}

fn dump(lights: &GirandoleLights, file: File) -> std::io::Result<()> {
    let mut file = BufWriter::new(file);
    lights.world().write_dump(&mut file)?;
    file.flush()
}
