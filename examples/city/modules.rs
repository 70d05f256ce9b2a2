//! The example's modules, in the order data passes through them. `main.rs`, the tests and the tools include this file.

pub mod scene;

pub mod render;

pub mod app;
