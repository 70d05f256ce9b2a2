//! What the kernels may need at most, on navi21.

use super::record::Row;
use testbed::common::table::markdown_head;

/// The chip for which the limits are.
pub const CHIP: &str = "navi21";

/// The most CPU time for all kernels of uploads and of the top level, in seconds.
pub const MOST_SECONDS: f64 = 3.0;

/// What a kernel may need at most.
pub struct Limit {
    pub kernel: &'static str,
    pub effects: &'static str,
    vgprs: u64,
    scratch_bytes_per_lane: u64,
    instructions: u64,
}

const fn limit(kernel: &'static str, effects: &'static str, most: [u64; 3]) -> Limit {
    let [vgprs, scratch_bytes_per_lane, instructions] = most;
    Limit { kernel, effects, vgprs, scratch_bytes_per_lane, instructions }
}

/// Registers, bytes of scratch memory for each lane, and instructions. Registers and scratch memory
/// are those that were measured; instructions are rounded up. Mesa
/// 22.3.6, 2026-11-30, by `measure kernels --out FILE.csv`.
pub const LIMITS: [Limit; 49] = [
    limit("scatter", "", [8, 0, 100]),
    limit("top_leaves", "", [48, 0, 700]),
    limit("top_keys", "", [16, 0, 200]),
    limit("sort_scatter", "", [16, 0, 400]),
    limit("top_cells", "", [64, 0, 2400]),
    limit("top_blocks", "", [64, 0, 2100]),
    limit("refit", "", [120, 0, 2500]),
    limit("refit_parts", "", [40, 0, 700]),
    limit("light_put_triangle", "", [24, 0, 250]),
    limit("visibility_gather", "", [8, 0, 150]),
    limit("visibility_fold_blocks", "", [16, 0, 550]),
    limit("visibility_fold_cells", "", [16, 0, 550]),
    limit("light_sample", "none", [64, 0, 1300]),
    limit("light_sample", "city", [72, 0, 2200]),
    limit("light_sample", "all", [128, 0, 6100]),
    limit("light_sample_twice", "none", [64, 0, 2400]),
    limit("light_sample_twice", "city", [72, 0, 4100]),
    limit("light_sample_twice", "all", [128, 0, 11700]),
    limit("light_sample_loop", "none", [80, 0, 1300]),
    limit("light_sample_loop", "city", [80, 0, 2200]),
    limit("light_sample_loop", "all", [160, 0, 6100]),
    limit("light_resample", "none", [80, 0, 1800]),
    limit("light_resample", "city", [88, 0, 3400]),
    limit("light_resample", "all", [176, 0, 9000]),
    limit("light_reservoir_merge", "none", [40, 0, 800]),
    limit("light_reservoir_merge", "city", [56, 0, 2100]),
    limit("light_reservoir_merge", "all", [96, 0, 5500]),
    limit("light_pmf", "none", [64, 0, 1100]),
    limit("light_pmf", "city", [72, 0, 1200]),
    limit("light_pmf", "all", [128, 0, 3300]),
    limit("light_pdf", "none", [8, 0, 50]),
    limit("light_pdf", "city", [72, 0, 1500]),
    limit("light_pdf", "all", [128, 0, 4200]),
    limit("light_hit", "none", [8, 0, 50]),
    limit("light_hit", "city", [72, 0, 2100]),
    limit("light_hit", "all", [128, 0, 5100]),
    limit("cut_list", "none", [16, 0, 400]),
    limit("cut_looks", "none", [8, 0, 100]),
    limit("cut_keep", "none", [24, 0, 1200]),
    limit("cut_dispatch", "none", [8, 0, 100]),
    limit("light_mark", "none", [32, 0, 500]),
    limit("cut_build", "none", [64, 0, 2700]),
    limit("light_mark", "city", [32, 0, 500]),
    limit("cut_build", "city", [64, 0, 2800]),
    limit("light_mark", "all", [32, 0, 500]),
    limit("cut_build", "all", [112, 0, 4300]),
    limit("cut_build_by_visibility", "none", [64, 0, 3000]),
    limit("cut_build_by_visibility", "city", [72, 0, 3200]),
    limit("cut_build_by_visibility", "all", [120, 0, 4800]),
];

/// What exceeds its limits, one line for each kernel. A kernel without limits exceeds them.
pub fn exceeded(rows: &[Row]) -> Vec<String> {
    let mut found: Vec<String> = rows.iter().filter(|row| row.chip == CHIP).filter_map(excess).collect();
    let own = rows.iter().filter(|row| row.chip == CHIP && row.effects.is_empty());
    let seconds: f64 = own.map(|row| row.compile_seconds).sum();
    if seconds > MOST_SECONDS {
        found.push(format!("uploads and the top level take {seconds:.1} s to compile, of {MOST_SECONDS} s"));
    }
    found
}

fn excess(row: &Row) -> Option<String> {
    let name = format!("{} {}", row.kernel, row.effects);
    let Some(limit) = LIMITS.iter().find(|limit| limit.kernel == row.kernel && limit.effects == row.effects) else {
        return Some(format!("{} has no limits in limits.rs", name.trim()));
    };
    let of = [
        ("registers", row.vgprs, limit.vgprs),
        ("bytes of scratch memory", row.scratch_bytes_per_lane, limit.scratch_bytes_per_lane),
        ("instructions", row.instructions, limit.instructions),
    ];
    let beyond: Vec<String> = of
        .iter()
        .filter(|(_, needed, most)| needed > most)
        .map(|(what, needed, most)| format!("{needed} {what} of {most}"))
        .collect();
    (!beyond.is_empty()).then(|| format!("{} needs {}", name.trim(), beyond.join(", ")))
}

/// The rows as a Markdown table, with the columns that limits and comparisons need.
pub fn summary(rows: &[Row]) -> String {
    let columns = ["kernel", "effects", "chip", "vgprs", "spilled", "scratch", "waves", "instructions", "seconds"];
    let line = |row: &Row| {
        let Row { kernel, effects, chip, vgprs, spilled_vgprs, scratch_bytes_per_lane, waves, instructions, .. } = row;
        format!(
            "| {kernel} | {effects} | {chip} | {vgprs} | {spilled_vgprs} | {scratch_bytes_per_lane} | {waves} | {instructions} | {:.2} |",
            row.compile_seconds
        )
    };
    std::iter::once(markdown_head(&columns)).chain(rows.iter().map(line)).collect::<Vec<_>>().join("\n")
}
