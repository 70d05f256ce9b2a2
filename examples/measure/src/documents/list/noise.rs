//! The noise of one light sample.

use crate::documents::figure::{Figure, selection, table};
use crate::documents::number::Format::{Digits, Fixed, Percent, Text};
use crate::documents::view::{Derived, VIEW, View, cell};

const PAGE: &str = "docs/benchmarks.md";
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

pub const SUMMARY: Figure = table("summary", PAGE, &[SUMMARY_VIEW]);

pub const ALL: Figure = table(
    "noise",
    "docs/data/noise.csv",
    &[View {
        from: NOISE,
        keep: &[SCENES],
        drop: &[
            ("sampler", "uniform"),
            ("sampler", "flux"),
            ("sampler", "flat, 2"),
            ("sampler", "flat, 4"),
            ("sampler", "shared cuts"),
        ],
        keys: &[("scene", "scene"), ("sampler", "sampler")],
        cells: &[
            cell("σ mean", "sigma_mean", Digits(3)),
            cell("median", "sigma_median", Digits(3)),
            cell("95 %", "sigma_p95", Digits(3)),
            cell("99.9 %", "sigma_p999", Digits(3)),
            cell("rms", "sigma_rms", Digits(3)),
            cell("dead", "dead", Percent(1)),
            cell("ns per sample", "ns_per_sample", Digits(3)),
        ],
        ..VIEW
    }],
);

pub const SHARED_CUTS: Figure = table(
    "shared-cuts",
    "docs/data/shared-cuts.csv",
    &[View {
        from: NOISE,
        keep: &[
            SCENES,
            (
                "sampler",
                &["girandole", "shared cuts, 0.25 m", "shared cuts, 0.5 m", "shared cuts, 1 m", "shared cuts, 4 m"],
            ),
        ],
        keys: &[("scene", "scene"), ("sampler", "sampler")],
        cells: &[
            cell("σ mean", "sigma_mean", Digits(3)),
            cell("95 %", "sigma_p95", Digits(3)),
            cell("99.9 %", "sigma_p999", Digits(3)),
            cell("rms", "sigma_rms", Digits(3)),
            cell("dead", "dead", Percent(1)),
            cell("ns per sample", "ns_per_sample", Digits(3)),
            cell("with the build", "ns_with_build", Digits(3)),
        ],
        ..VIEW
    }],
);

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
    "docs/data/losses.csv",
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
    "docs/data/losses-with-shadows.csv",
    &[View {
        from: &["rivals/rivals.csv"],
        drop: &[("sampler", "Girandole, 8 candidates"), ("sampler", "Girandole, shared cuts")],
        cells: &[cell("relMSE × µs", "rel_mse * sample_ns / 1000", Digits(3))],
        labels: &[("Girandole", "two levels"), ("Girandole, one tree", "one tree")],
        above: Some(("quotient", 1.0 / 3.0)),
        ..LOSS
    }],
);

/// The scenes with the least lead. The program prints all.
pub const TORTURE: Figure = selection(
    "torture",
    "docs/data/torture.csv",
    &[View {
        from: &["torture/torture.csv"],
        drop: &[("sampler", "uniform"), ("sampler", "flux")],
        keys: &[("scene", "scene")],
        across: Some("sampler"),
        cells: &[
            cell("", "sigma_mean", Digits(2)),
            cell("99.9 %", "sigma_p999", Digits(2)).only("girandole"),
            cell("99.9 %, shared", "sigma_p999", Digits(2)).only("shared cuts"),
        ],
        derived: &[Derived::OfBest(
            "quotient",
            "two levels",
            &["two levels", "one tree", "shared cuts", "99.9 %", "99.9 %, shared"],
        )],
        above: Some(("quotient", 0.25)),
        ..VIEW
    }],
);

/// The scenes in which two levels are most behind one tree. The program prints all.
pub const CLIFFS: Figure = selection(
    "cliffs",
    "docs/data/cliffs.csv",
    &[View {
        from: &["cliffs/cliffs.csv"],
        keys: &[("scene", "scene")],
        across: Some("sampler"),
        cells: &[cell("", "sigma_mean", Digits(2))],
        derived: &[Derived::Ratio("quotient", "two levels", "one tree")],
        above: Some(("quotient", 1.1)),
        ..VIEW
    }],
);

pub const GLOSS: Figure = table(
    "gloss",
    "docs/data/gloss.csv",
    &[View {
        from: &["gloss/gloss.csv"],
        keep: &[("roughness", &["0.1", "0.5"])],
        keys: &[("scene", "scene"), ("surface", "surface"), ("roughness", "roughness")],
        across: Some("sampler"),
        cells: &[cell("", "sigma_mean", Digits(3))],
        derived: &[Derived::Ratio("of cosine only", "with gloss", "cosine only")],
        is_least_bold: true,
        labels: &[
            ("girandole with gloss, shared cuts, 0.25 m", "shared, 0.25 m"),
            ("girandole with gloss, shared cuts, 1 m", "shared, 1 m"),
            ("girandole with gloss", "with gloss"),
            ("girandole", "cosine only"),
        ],
        ..VIEW
    }],
);

const SEGMENT: View = View {
    from: &["segments/segments.csv"],
    keys: &[("what", "what"), ("sampler", "for")],
    across: Some("segments"),
    is_stacked: true,
    ..VIEW
};

pub const SEGMENTS: Figure = table(
    "segments",
    "docs/data/segments.csv",
    &[
        View { cells: &[cell("σ", "sigma_mean", Digits(2))], ..SEGMENT },
        View {
            keep: &[("what", &["choice"]), ("sampler", &["segment", "its middle"])],
            cells: &[cell("segments with a light never chosen", "unreached", Fixed(0)), cell("ns", "ns", Digits(3))],
            ..SEGMENT
        },
    ],
);

pub const CANDIDATES: Figure = table(
    "candidates",
    "docs/data/candidates.csv",
    &[View {
        from: &["candidates/candidates.csv"],
        keys: &[("candidates", "candidates")],
        cells: &[
            cell("error", "rmse", Digits(3)),
            cell("of independent candidates", "rmse_independent", Digits(3)),
            cell("ns per estimate", "ns_per_estimate", Digits(3)),
        ],
        ..VIEW
    }],
);

pub const LEARNING: Figure = table(
    "learning",
    "docs/data/learning.csv",
    &[View {
        from: &["learn/learn.csv"],
        drop: &[
            ("scene", "ten rooms, nothing hidden"),
            ("table", "0.5 m"),
            ("table", "2 m"),
            ("table", "1 m, 1 frames"),
            ("table", "1 m, 20 frames"),
            ("table", "1 m, 65 frames"),
        ],
        keys: &[("scene", "scene"), ("table", "cells and frames")],
        cells: &[
            cell("samples per cell", "samples_per_cell", Text),
            cell("σ mean", "sigma_mean", Digits(3)),
            cell("95 %", "sigma_p95", Digits(3)),
            cell("gain in mean", "gain_mean", Digits(3)),
            cell("gain in rms", "gain_rms", Digits(3)),
            cell("ns per pick", "ns_per_pick", Digits(3)),
            cell("σ of eight candidates", "sigma_of_8", Digits(3)),
        ],
        ..VIEW
    }],
);

/// A sky beside lamps.
pub const SKY: Figure = table(
    "sky",
    "docs/data/sky.csv",
    &[View {
        from: &["sky/sky.csv"],
        keys: &[("scene", "scene"), ("sampler", "sampler")],
        cells: &[
            cell("σ", "sigma_mean", Digits(2)),
            cell("σ, 95 %", "sigma_p95", Digits(2)),
            cell("shadow rays", "rays", Digits(1)),
            cell("σ at equal rays", "sigma_of_equal_rays", Digits(2)),
            cell("ns", "ns", Digits(3)),
        ],
        labels: &[("girandole", "one distribution")],
        ..VIEW
    }],
);

/// Signs and films in parts.
pub const SIGNS: Figure = table(
    "signs",
    "docs/data/signs.csv",
    &[View {
        from: &["signs/signs.csv"],
        keys: &[("image", "image"), ("parts", "parts")],
        cells: &[
            cell("σ", "sigma_mean", Digits(2)),
            cell("σ, 95 %", "sigma_p95", Digits(2)),
            cell("a sample in ns", "sample_ns", Digits(2)),
            cell("to cut, in ms", "cut_ms", Digits(2)),
            cell("a frame of a film, in ms", "frame_ms", Digits(2)),
        ],
        ..VIEW
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
