//! The time of upload, top-level build and sampling on this machine's GPU.
//!
//! ```text
//! measure gpu --out gpu_timings.json [--quick] [--adapter NAME]
//!     [--only upload|top-level|sampling]
//! ```
//!
//! The program first compares the GPU with the CPU, and ends if they disagree. Then it prints three
//! tables as Markdown, with a verdict on each goal, and writes all numbers as JSON:
//!
//! 1. upload, where 1, 10 and 100 % of the instances have moved;
//! 2. each stage of the top-level build over 1,000 to 1,000,000 instances, and a radix sort alone
//!    of as many keys;
//! 3. samples per second in the procedural cities S, M and L, with one candidate and with eight,
//!    and the nodes and bytes that a sample reads.
//!
//! Where the adapter has timestamps, times are those of the GPU without submission. The run takes a
//! few minutes at most, and `--quick` seconds. Expect a sample of eight candidates to read more
//! nodes than one of a single candidate, but far fewer than eight times as many. The binary
//! needs no files and can be copied to another machine. `docs/benchmarks.md` has measured tables. The
//! file says the adapter, the date and the commit; where there is no repository, the environment
//! variable `GIRANDOLE_COMMIT` names the commit.

pub mod spread;
pub mod timer;

pub mod machine;
pub mod shading_points;
pub mod sampling;
pub mod top_level;
pub mod uploads;

pub mod checks;
pub mod goals;

pub mod report;
pub mod run;
