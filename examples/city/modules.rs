//! The modules of the example, in the order in which data passes through them: a scene is rendered,
//! and the program saves the pictures. Each imports only from those above it. `main.rs`, the tests
//! and the measuring tools include this file.

pub mod scene;

pub mod render;

pub mod app;
