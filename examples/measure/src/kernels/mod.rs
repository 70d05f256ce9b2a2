//! What the compiler of a GPU makes of every kernel of the library: registers, scratch memory,
//! occupancy, instructions, and the time it takes.
//!
//! ```text
//! measure kernels --out FILE.csv [--chip NAME] [--trusted] [--check]
//! ```
//!
//! No GPU is needed. Mesa's driver RADV compiles for AMD chips that are not there, with the compiler
//! that players of games have, and reports what it made. Debian has it in `mesa-vulkan-drivers`,
//! Fedora in `mesa-vulkan-drivers`, Arch in `vulkan-radeon`. Without it the program says so and ends
//! with success.
//!
//! | column | value |
//! |---|---|
//! | `kernel` | the entry point; for functions that engines call, a kernel that does nothing else |
//! | `effects` | those of the world, for kernels that read lights: none, those of the city, or all |
//! | `chip` | navi21 (RDNA 2), gfx1100 (RDNA 3) or vega10 (GCN 5) |
//! | `zeroing` | who clears workgroup memory (`--zeroing`): nobody, the driver, or stores at the start of the shader |
//! | `vgprs`, `spilled_vgprs` | vector registers of a lane, and those that did not fit |
//! | `scratch_bytes_per_lane` | memory for arrays that are indexed at run time, and for spilled registers |
//! | `waves` | waves that fit on a SIMD at once: at most 32 on navi21 and gfx1100, and 10 on vega10 |
//! | `instructions`, `code_bytes` | the size of the code |
//! | `inverse_throughput` | the compiler's estimate of the cycles that a wave takes of a SIMD; it weighs loops by a guess |
//! | `compile_seconds` | CPU time that the driver takes for the pipeline |
//!
//! Shaders are compiled with the checks that wgpu adds on these drivers: of indices into arrays and of
//! loops. `--trusted` leaves them out, as `wgpu::Device::create_shader_module_trusted` can.
//!
//! `--spirv DIR` writes the kernels as SPIR-V instead, which needs no driver; `.ci/run` hands them to
//! `spirv-val`.
//!
//! `--check` fails if a kernel exceeds its limits, which are in `limits.rs`. They are those of one
//! version of the driver, so CI checks them and a user's test run does not. Estimates compare two
//! versions of a kernel; they are no measurements.

pub mod subjects;
pub mod translate;

pub mod driver;
pub mod record;
pub mod limits;
pub mod page;
pub mod options;
