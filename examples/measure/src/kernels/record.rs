//! The rows of the table.

use super::driver::Statistics;
use super::subjects::Subject;
use super::translate::Zeroing;

/// The columns; `main.rs` explains them.
pub const COLUMNS: [&str; 12] = [
    "kernel",
    "effects",
    "chip",
    "zeroing",
    "vgprs",
    "spilled_vgprs",
    "scratch_bytes_per_lane",
    "waves",
    "instructions",
    "code_bytes",
    "inverse_throughput",
    "compile_seconds",
];

/// What the compiler says of one kernel on one chip.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub kernel: String,
    pub effects: String,
    pub chip: String,
    pub zeroing: String,
    pub vgprs: u64,
    pub spilled_vgprs: u64,
    pub scratch_bytes_per_lane: u64,
    pub waves: u64,
    pub instructions: u64,
    pub code_bytes: u64,
    pub inverse_throughput: u64,
    pub compile_seconds: f64,
}

/// The driver reports scratch memory for this many lanes together.
const LANES: u64 = 64;

impl Row {
    pub fn new(
        subject: &Subject,
        chip: &str,
        zeroing: Zeroing,
        statistics: &Statistics,
        compile_seconds: f64,
    ) -> Result<Self, String> {
        let count = |name: &str| {
            let value = statistics.get(name).ok_or_else(|| format!("the driver does not report \"{name}\""))?;
            Ok::<u64, String>(*value as u64)
        };
        Ok(Self {
            kernel: subject.kernel.to_owned(),
            effects: subject.effects.to_owned(),
            chip: chip.to_owned(),
            zeroing: zeroing.name().to_owned(),
            vgprs: count("VGPRs")?,
            spilled_vgprs: count("Spilled VGPRs")?,
            scratch_bytes_per_lane: count("Scratch size")? / LANES,
            waves: count("Subgroups per SIMD")?,
            instructions: count("Instructions")?,
            code_bytes: count("Code size")?,
            inverse_throughput: count("Inverse Throughput")?,
            compile_seconds,
        })
    }

    /// In the order of [`COLUMNS`].
    pub fn fields(&self) -> [String; 12] {
        let counts = [
            self.vgprs,
            self.spilled_vgprs,
            self.scratch_bytes_per_lane,
            self.waves,
            self.instructions,
            self.code_bytes,
            self.inverse_throughput,
        ];
        let [vgprs, spilled, scratch, waves, instructions, code, throughput] = counts.map(|count| count.to_string());
        let names = [&self.kernel, &self.effects, &self.chip, &self.zeroing].map(String::clone);
        let [kernel, effects, chip, zeroing] = names;
        let seconds = format!("{:.3}", self.compile_seconds);
        [kernel, effects, chip, zeroing, vgprs, spilled, scratch, waves, instructions, code, throughput, seconds]
    }

    /// The row of a line that [`Row::line`] wrote; `None` for any other line.
    pub fn parse(line: &str) -> Option<Self> {
        let fields: Vec<&str> = line.split(',').collect();
        let [kernel, effects, chip, zeroing, counts @ .., seconds] = &fields[..] else { return None };
        let counts: Vec<u64> = counts.iter().map(|count| count.parse().ok()).collect::<Option<_>>()?;
        let [vgprs, spilled_vgprs, scratch_bytes_per_lane, waves, instructions, code_bytes, inverse_throughput] =
            counts[..]
        else {
            return None;
        };
        Some(Self {
            kernel: (*kernel).to_owned(),
            effects: (*effects).to_owned(),
            chip: (*chip).to_owned(),
            zeroing: (*zeroing).to_owned(),
            vgprs,
            spilled_vgprs,
            scratch_bytes_per_lane,
            waves,
            instructions,
            code_bytes,
            inverse_throughput,
            compile_seconds: seconds.parse().ok()?,
        })
    }

    /// The fields in one line. No field has a comma.
    pub fn line(&self) -> String {
        self.fields().join(",")
    }
}
