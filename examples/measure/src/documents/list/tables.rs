//! The tables of pages.

use crate::documents::figure::{Figure, selection, table};
use crate::documents::number::Format::{self, Digits, Fixed, Percent, Text, Within};
use crate::documents::view::{Derived, VIEW, View, cell};

const BENCHMARKS: &str = "docs/benchmarks.md";
const ACCURACY: &str = "docs/accuracy.md";
const NOISE: &[&str] = &["noise/noise.csv", "noise-m/noise.csv"];
const SCENES: (&str, &[&str]) = ("scene", &["city S", "city M", "bistro_exterior_lite"]);
/// The library, by its names in the documents.
const OWN: &[&str] = &["two levels", "one tree"];

const SUMMARY_VIEW: View = View {
    from: NOISE,
    keep: &[SCENES],
    drop: &[("sampler", "flat,"), ("sampler", "shared cuts")],
    keys: &[("scene", "scene")],
    across: Some("sampler"),
    cells: &[
        cell("σ", "sigma_mean", Digits(3)),
        cell("ns per sample", "ns_per_sample", Digits(3)),
        cell("bytes per light", "bytes_per_light", Digits(3)),
    ],
    is_stacked: true,
    ..VIEW
};

pub const README: Figure = table(
    "readme-noise",
    "README.md",
    &[View {
        keep: &[
            SCENES,
            ("sampler", &["girandole", "girandole flat", "sg tree", "pbrt opaque", "pbrt", "cycles", "flux"]),
        ],
        labels: &[
            ("girandole", "Girandole"),
            ("girandole flat", "Girandole, one tree"),
            ("sg tree", "SG tree"),
            ("pbrt", "pbrt-v4"),
            ("pbrt opaque", "pbrt-v4, opaque"),
            ("cycles", "Cycles"),
            ("flux", "by flux"),
        ],
        ..SUMMARY_VIEW
    }],
);

pub const SUMMARY: Figure = table("summary", BENCHMARKS, &[SUMMARY_VIEW]);

/// Rows in which the library exceeds a share of the best other sampler.
const LOSS: View = View {
    keys: &[("scene", "scene")],
    across: Some("sampler"),
    is_stacked: true,
    derived: &[Derived::OfBest("quotient", "two levels", OWN), Derived::Best("best rival", OWN)],
    show: &["two levels", "best rival", "quotient"],
    ..VIEW
};

pub const LOSSES: Figure = selection(
    "losses",
    "",
    &[
        View {
            from: NOISE,
            keep: &[SCENES],
            drop: &[("sampler", "flat,"), ("sampler", "shared cuts")],
            cells: &[cell("σ² × µs", "sigma_mean^2 * ns_per_sample / 1000", Digits(3))],
            above: Some(("quotient", 1.0 / 3.0)),
            ..LOSS
        },
        View {
            from: &["torture/torture.csv"],
            drop: &[("sampler", "shared cuts")],
            cells: &[cell("σ", "sigma_mean", Digits(3))],
            above: Some(("quotient", 0.6)),
            ..LOSS
        },
        View {
            from: &["torture/torture.csv", "cliffs/cliffs.csv"],
            keep: &[("sampler", &["girandole", "girandole flat"])],
            cells: &[cell("σ", "sigma_mean", Digits(3))],
            derived: &[
                Derived::OfBest("quotient", "two levels", &["two levels"]),
                Derived::Best("best rival", &["two levels"]),
            ],
            above: Some(("quotient", 1.5)),
            ..LOSS
        },
    ],
);

pub const LOSSES_WITH_SHADOWS: Figure = selection(
    "losses-with-shadows",
    "",
    &[View {
        from: &["rivals/rivals.csv"],
        drop: &[("sampler", "Girandole, 8 candidates"), ("sampler", "Girandole, shared cuts")],
        cells: &[cell("relMSE × µs", "rel_mse * sample_ns / 1000", Digits(3))],
        labels: &[("Girandole", "two levels"), ("Girandole, one tree", "one tree")],
        above: Some(("quotient", 1.0 / 3.0)),
        ..LOSS
    }],
);

pub const KERNEL_NOISE: Figure = table(
    "kernel-noise",
    "docs/gpu-lights.md",
    &[View {
        from: &["kernel-noise/noise.csv"],
        keys: &[("scene", "lights"), ("policy", "followed by")],
        cells: &[
            cell("rebuilds of a tree in 100 frames", "rebuilds", Digits(2)),
            cell("σ", "sigma_mean", Digits(3)),
            cell("over fresh", "over_fresh", Digits(3)),
            cell("at most", "most_over_fresh", Digits(3)),
        ],
        ..VIEW
    }],
);

pub const KERNEL_COST: Figure = table(
    "kernel-cost",
    "docs/gpu-lights.md",
    &[View {
        from: &["kernel-cost/cost.csv"],
        keys: &[("scene", "lights")],
        cells: &[
            cell("trees", "trees", Fixed(0)),
            cell("triangles", "lights", Fixed(0)),
            cell("dispatches", "dispatches", Fixed(0)),
            cell("bytes, by those of a copy", "bytes_per_copy", Digits(3)),
            cell("refit, ms", "refit_ms", Digits(3)),
            cell("copy, ms", "copy_ms", Digits(2)),
            cell("a frame on the CPU, µs", "cpu_us", Digits(2)),
        ],
        ..VIEW
    }],
);

const REL_MSE: Format = Within("rel_mse_low", "rel_mse_high", 2);
/// Small versions have other numbers of candidates.
const EQUAL_TIME_LABELS: &[(&str, &str)] = &[
    ("matte", "diffuse"),
    ("glossy", "glossy"),
    ("Girandole / 6 splits / 1 candidate", "Girandole"),
    ("Girandole / 6 splits / 4 candidates", "Girandole, several candidates"),
    ("Girandole / 6 splits / 8 candidates", "Girandole, several candidates"),
];

pub const README_REUSE: Figure = selection(
    "readme-reuse",
    "README.md",
    &[View {
        from: &["reuse/reuse.csv"],
        keep: &[
            ("frame", &["16 frames"]),
            ("sampler", &["presampled 32", "ReGIR", "Girandole, no reuse", "Girandole"]),
            ("scene", &["city S"]),
        ],
        keys: &[("sampler", "new samples")],
        across: Some("change"),
        labels: &[("nothing", "nothing moves")],
        cells: &[cell("", "rel_mse", REL_MSE), cell("error × time", "over", Digits(2)).only("nothing")],
        ..VIEW
    }],
);

pub const EQUAL_TIME: Figure = selection(
    "equal-time",
    ACCURACY,
    &[View {
        from: &["matte/equal_time.csv", "glossy/equal_time.csv"],
        keys: &[("sampler", "sampler")],
        across: Some("run"),
        cells: &[
            cell("relMSE", "rel_mse", REL_MSE),
            cell("samples", "samples", Digits(2)).only("matte"),
            cell("MAPE, diffuse", "mape", Digits(2)).only("matte"),
            cell("σ", "sigma", Digits(2)).only("matte"),
            cell("σ with shadows", "sigma_visible", Digits(2)).only("matte"),
            cell("dead", "dead", Percent(0)).only("matte"),
        ],
        labels: EQUAL_TIME_LABELS,
        ..VIEW
    }],
);

pub const RIVALS: Figure = table(
    "rivals",
    ACCURACY,
    &[View {
        from: &["rivals/rivals.csv"],
        keys: &[("sampler", "sampler")],
        across: Some("scene"),
        cells: &[cell("", "over_one_tree", Digits(2))],
        ..VIEW
    }],
);

pub const GPU_GOALS: Figure = table(
    "gpu-goals",
    BENCHMARKS,
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
