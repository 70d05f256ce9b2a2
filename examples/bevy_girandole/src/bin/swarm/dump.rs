//! Writes the lights of the last frame into a file, which the city of the library shows.

use std::fs::File;
use std::io::{BufWriter, Write};

use bevy::prelude::*;
use bevy::render::{Render, RenderApp};
use bevy_girandole::{GirandoleLights, GirandoleSystems};

use crate::options::Options;

pub fn add_systems(app: &mut App, options: &Options) {
    let Some(file) = options.dump.clone() else { return };
    let last = options.frames.max(1);
    let write = move |mut frame: Local<u32>, lights: Res<GirandoleLights>| {
        *frame += 1;
        if *frame == last
            && let Err(error) = dump(&lights, &file)
        {
            eprintln!("{file}: {error}");
        }
    };
    if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
        render_app.add_systems(Render, write.after(GirandoleSystems::Upload));
    }
}

fn dump(lights: &GirandoleLights, file: &str) -> std::io::Result<()> {
    let mut file = BufWriter::new(File::create(file)?);
    lights.world().write_dump(&mut file)?;
    file.flush()
}
