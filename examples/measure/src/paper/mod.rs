//! The experiment of [SS], repeated with confidence intervals: when is it worth rebuilding an
//! animated light tree that was only updated?
//!
//! [SS] is Sosnowski and Szajerman, BVH Trees of Many Dynamic Lights for Real-Time Ray Tracing.
//!
//! ```text
//! measure paper --out DIR [--quick] [--budgets] [--world S|M|L]
//!     [--gltf FILE] [--no-city] [--seeds N] [--size WxH] [--frames N] [--fps F] [--start S]
//!     [--samples N] [--passes N] [--camera x,y,z,x,y,z] [--path x,y,z,x,y,z] [--vehicles N]
//! ```
//!
//! It plays 44 frames of the procedural city, and of a glTF scene if a file is given. Three kinds
//! of trees hold the lights: a binary tree over all lights with pbrt-v4's formula, as in [SS]; one
//! tree of this library over all lights; and the library's two levels, one tree per object. In each
//! frame a tree is updated or rebuilt, as its strategy decides: never, always, by algorithm 1 or 2
//! of [SS] on one of four attributes, or within a time budget. The frame is rendered with one light
//! sample per pixel, with shadows, and compared with a converged reference by MAPE, equation 1 of
//! [SS].
//!
//! It writes:
//!
//! - `paper.md`: the tables of [SS], with intervals, the gap recovered and the share of the cost;
//! - `paper.csv`: the same for programs, and `frames.csv`: every run frame by frame;
//! - an SVG plot for each scene, kind of tree and attribute: MAPE and the attribute over the
//!   frames, with rebuilds marked, in the form of figures 3 to 14 of [SS];
//! - `cost_SCENE.svg`: the change of the MAPE over the share of the cost.
//!
//! Expect each mean with its 95 % interval over seeds. All strategies get the same random numbers,
//! so differences between them have narrower intervals than the means. A difference smaller than
//! its interval is called no difference. `--quick` takes seconds and shows only that the program
//! works. `docs/paper.md` has a measured run. Updates and rebuilds are timed on one thread; compare
//! times within one run only.

pub mod decisions;
pub mod strategies;

pub mod vehicles;
pub mod stages;

pub mod trees;
pub mod pool;
pub mod worlds;

pub mod survey;
pub mod pictures;
pub mod play;

pub mod results;
pub mod report;
pub mod plots;

pub mod options;
