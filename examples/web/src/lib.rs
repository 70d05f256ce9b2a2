//! The night city of `examples/city` in a browser: the same scene and the same shader, on WebGPU.
//!
//! `examples/web/build.sh` makes a folder of static files from it, and `docs/browser.md` tells the
//! rest. Read in this order:
//!
//! 1. `common`, `scene` and `render`: what this page shares with `examples/city`;
//! 2. `signal` and `device`: waits for callbacks, opens WebGPU, and keeps what went wrong;
//! 3. `pipelines`, `light_list`, `resolve` and `present`: the shaders, and what they bind;
//! 4. `tour`: the camera before anyone touches it;
//! 5. `city`: a frame, and what the page calls;
//! 6. `check`: compares the page's picture with the sum over all lights.
#![cfg(target_family = "wasm")]

#[allow(dead_code, reason = "the city uses more of it")]
mod common;
#[allow(dead_code, reason = "the city uses more of it")]
mod scene;
#[allow(dead_code, reason = "the city uses more of it")]
mod render;

mod signal;
mod device;

mod pipelines;
mod light_list;
mod resolve;
mod present;

mod tour;
#[allow(dead_code, reason = "the city uses more of it")]
#[path = "../../city/window/flight.rs"]
mod flight;

mod city;
mod check;

use wasm_bindgen::prelude::wasm_bindgen;

/// Writes panics to the console. They stop the page, which shows a sentence then.
#[wasm_bindgen(start)]
fn start() {
    std::panic::set_hook(Box::new(|panic| web_sys::console::error_1(&panic.to_string().into())));
}
