//! The library for web pages: worlds of lights, and plans that a page plays on its own WebGPU device.
//!
//! `examples/girandole-npm/build.sh` makes the npm package from it and from the modules in `js/`, and
//! `docs/npm.md` explains how to use it. Read in this order:
//!
//! 1. `failure` and `vectors`: errors of JavaScript, and vectors in its arrays;
//! 2. `light_list` and `world`: lights, and the world that holds them;
//! 3. `shader`: the WGSL of the kernels and of the functions for the page's own shaders;
//! 4. `player` and `planner`: plans, and who plays them.

mod failure;
mod vectors;

mod light_list;
mod world;

mod shader;

mod player;
mod planner;

use wasm_bindgen::prelude::wasm_bindgen;

/// Makes errors of JavaScript from panics.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| wasm_bindgen::throw_str(&panic.to_string())));
}
