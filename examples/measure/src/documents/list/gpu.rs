//! What runs on a GPU, and what its compiler makes of shaders.

use crate::documents::figure::{Figure, table};
use crate::documents::number::Format::{Digits, Fixed, Text};
use crate::documents::view::{VIEW, View, cell};

const PAGE: &str = "docs/benchmarks.md";

pub const GOALS: Figure = table(
    "gpu-goals",
    PAGE,
    &[View {
        from: &["gpu/gpu.json#/verdicts"],
        keys: &[("goal", "goal")],
        cells: &[
            cell("at most", "most", Text),
            cell("measured", "measured", Digits(3)),
            cell("outcome", "outcome", Text),
        ],
        ..VIEW
    }],
);

pub const UPLOAD: Figure = table(
    "gpu-upload",
    "docs/data/gpu-upload.csv",
    &[View {
        from: &["gpu/gpu.json#/upload"],
        keys: &[("moved", "moved")],
        cells: &[
            cell("bytes", "bytes", Fixed(0)),
            cell("call on the CPU, ms", "upload_call.median_ms", Digits(3)),
            cell("submit and wait, ms", "submit_and_wait.median_ms", Digits(2)),
        ],
        ..VIEW
    }],
);

pub const TOP_LEVEL: Figure = table(
    "gpu-top-level",
    "docs/data/gpu-top-level.csv",
    &[View {
        from: &["gpu/gpu.json#/top_level"],
        keys: &[("instances", "instances")],
        cells: &[
            cell("dispatches", "dispatches", Fixed(0)),
            cell("leaves", "stages.leaves.time.median_ms", Digits(2)),
            cell("keys", "stages.keys.time.median_ms", Digits(2)),
            cell("sort", "stages.sort.time.median_ms", Digits(2)),
            cell("cells", "stages.cells.time.median_ms", Digits(2)),
            cell("blocks", "stages.blocks.time.median_ms", Digits(2)),
            cell("total, ms", "total.median_ms", Digits(3)),
            cell("of the sort", "total_per_sort", Digits(3)),
        ],
        ..VIEW
    }],
);

pub const SAMPLES: Figure = table(
    "gpu-samples",
    PAGE,
    &[View {
        from: &["gpu/gpu.json#/sampling"],
        keys: &[("city", "city"), ("candidates", "candidates")],
        cells: &[
            cell("lights", "lights", Fixed(0)),
            cell("instances", "instances", Fixed(0)),
            cell("ms", "picture.median_ms", Digits(3)),
            cell("fastest", "picture.least_ms", Digits(3)),
            cell("million samples a second", "samples_per_second / 1000000", Digits(3)),
        ],
        ..VIEW
    }],
);

pub const FUNCTIONS: Figure = table(
    "shader-functions",
    "docs/data/shader-functions.csv",
    &[View {
        from: &["shaders/shaders.csv"],
        keep: &[("effects", &["none", "city", "all"])],
        drop: &[
            ("kernel", "light_pdf"),
            ("kernel", "light_hit"),
            ("kernel", "light_sample_"),
            ("kernel", "light_mark"),
            ("kernel", "cut_list"),
            ("kernel", "cut_looks"),
            ("kernel", "cut_dispatch"),
        ],
        keys: &[("kernel", "function"), ("effects", "effects")],
        cells: &[
            cell("registers", "vgprs", Fixed(0)),
            cell("spilled", "spilled_vgprs", Fixed(0)),
            cell("scratch, bytes", "scratch_bytes_per_lane", Fixed(0)),
            cell("waves", "waves", Fixed(0)),
            cell("instructions", "instructions", Fixed(0)),
            cell("inverse throughput", "inverse_throughput", Fixed(0)),
            cell("seconds to compile", "compile_seconds", Digits(2)),
        ],
        ..VIEW
    }],
);

pub const PIPELINES: Figure = table(
    "pipelines",
    "docs/data/pipelines.csv",
    &[View {
        from: &["pipelines/stdout.md"],
        keys: &[("uses", "calls")],
        cells: &[
            cell("no effects, s", "none, s", Text),
            cell("those of the city, s", "city, s", Text),
            cell("all effects, s", "all, s", Text),
        ],
        ..VIEW
    }],
);

pub const EFFECTS: Figure = table(
    "effects",
    "docs/data/effects.csv",
    &[View {
        from: &["effects/stdout.md"],
        keys: &[("code for", "code for")],
        cells: &[
            cell("ns per sample", "ns per sample", Text),
            cell("relative to no effect", "relative to no effect", Text),
            cell("fastest", "fastest", Digits(3)),
        ],
        ..VIEW
    }],
);
