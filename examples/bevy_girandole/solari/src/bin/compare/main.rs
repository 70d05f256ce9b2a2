//! Draws a scene with Solari, and compares the picture with another one.

mod options;
mod picture;
mod scene;

use std::process::ExitCode;

use bevy::prelude::*;

use options::Options;

fn main() -> ExitCode {
    match Options::parse(std::env::args().skip(1)).and_then(|options| run(&options)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Options) -> Result<(), String> {
    let mut app = picture::app(options)?;
    let camera = scene::add(app.world_mut(), options.scene);
    picture::add_camera(&mut app, options, camera);
    let (mean, brightness) = picture::mean(&mut app, options)?;
    println!("brightness {:.6}, standard error {:.6}", brightness.mean, brightness.standard_error);
    if let Some(file) = &options.raw {
        picture::write_raw(file, &mean)?;
    }
    if let Some(file) = &options.reference {
        let (mape, rel_mse) = picture::error(&mean, &picture::read_raw(file)?)?;
        println!("MAPE {mape:.4}, relMSE {rel_mse:.5}");
    }
    if let Some(file) = &options.out {
        picture::write_png(file, &mean, options.size)?;
    }
    Ok(())
}
