//! The night city of `examples/city` in a browser: the same scene and the same
//! shader, from the package `testbed`, on WebGPU.
//!
//! `examples/girandole-web/build.sh` makes a folder of static files from it, and `docs/browser.md` tells the
//! rest. Read in this order:
//!
//! 1. `common`, `scene` and `render`: what this page shares with `examples/city`;
//! 1. `signal` and `device`: waits for callbacks, opens WebGPU, and keeps what went wrong;
//! 2. `pipelines`, `light_list`, `resolve` and `present`: the shaders, and what they bind;
//! 3. `tour`: the camera before anyone touches it;
//! 4. `city`: a frame, and what the page calls;
//! 5. `check`: compares the page's picture with the sum over all lights.
#![cfg(target_family = "wasm")]

mod signal;
mod device;

mod pipelines;
mod light_list;
mod resolve;
mod present;

mod tour;

mod city;
mod check;

use wasm_bindgen::prelude::wasm_bindgen;

/// Writes panics to the console. They stop the page, which shows a sentence then.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| web_sys::console::error_1(&panic.to_string().into())));
}
