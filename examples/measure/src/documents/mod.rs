//! Measures every figure of the documents on this machine, and writes it into its document.
//!
//! ```text
//! bash scripts/figures.sh [--gltf FILE] [--gpu FILE.json] [--jobs N] [--only NAME,...]
//! bash scripts/figures.sh --list
//! target/debug/measure documents --quick
//! ```
//!
//! A figure (`list/`) is the table of a page, drawn from some columns of what programs wrote; a picture; or a CSV file
//! of `docs/data` with all rows of a program. In a page it stands between `<!-- figure: NAME -->` and `<!-- end -->`,
//! with the machine, the date and the commit below it. The program calls each program once, keeps what it wrote below
//! `--out`, and replaces blocks and files.
//!
//! - `--gltf` names the Bistro. Without it, figures that show it stay as they are, and a line says so.
//! - `--gpu` takes the output of `measure gpu` from a machine with a GPU.
//! - `--jobs N` runs programs that measure no time side by side. The others run alone, unless
//!   `--timed-jobs N` says otherwise: most of them use one thread.
//! - `--measure` writes no documents, and `--draw` calls no programs: so a machine without the repository
//!   can measure. Programs are looked for beside this one, or in `--programs DIR`; `--commit` says what was built.
//! - `--quick` makes small versions of the figures of pages, writes copies of the pages below `--out`, and fails if a
//!   table of a page has other columns or names of rows than its program makes, if a block has no figure, or if a
//!   figure has no block. It says which figures have no small version: those of compilers, GPUs and the Bistro.
//!
//! Expect about two hours on two cores.

pub mod figure;
pub mod list;
pub mod options;

pub mod measure;
pub mod sheet;
pub mod number;
pub mod view;
pub mod draw;
pub mod document;
