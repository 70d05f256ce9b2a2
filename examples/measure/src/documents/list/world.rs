//! Lights that move, trees, edits and flights.

use crate::documents::figure::{Figure, picture, table};
use crate::documents::number::Format::{Digits, Fixed, Percent, Text};
use crate::documents::view::{VIEW, View, cell};

const PAGE: &str = "docs/benchmarks.md";

pub const DEFORM: Figure = table(
    "deform",
    "docs/data/deform.csv",
    &[View {
        from: &["deform/deform.csv"],
        keys: &[("scene", "scene"), ("strategy", "strategy")],
        cells: &[
            cell("σ mean", "sigma_mean", Digits(3)),
            cell("above a new tree", "sigma_loss", Percent(1)),
            cell("time, of refits alone", "time_per_refit", Digits(3)),
            cell("rebuilt in a frame", "rebuilt_per_frame", Percent(0)),
        ],
        ..VIEW
    }],
);

pub const BUDGET_PLOT: Figure = picture(
    "budget-plot",
    PAGE,
    ("budget/gap_S10.svg", "budget.svg"),
    "Gap recovered over time spent for five motions, by strategy: the library's scheduler is ahead of round \
     robin where time is short",
);

pub const BUDGET: Figure = table(
    "budget",
    "docs/data/budget.csv",
    &[View {
        from: &["budget/budget.csv"],
        keep: &[
            ("budget_share", &["0.02", "0.1", "0.5"]),
            ("strategy", &["girandole", "girandole in frames", "round robin", "oracle"]),
        ],
        keys: &[("budget_share", "budget"), ("strategy", "strategy")],
        across: Some("scene"),
        cells: &[
            cell("gap", "gap_recovered", Fixed(2)),
            cell("cost", "cost_share", Fixed(3)),
            cell("frames within", "within_budget", Percent(1)),
        ],
        labels: &[("girandole", "girandole"), ("0.02", "2 %"), ("0.1", "10 %"), ("0.5", "50 %")],
        ..VIEW
    }],
);

pub const CASES: Figure = table(
    "cases",
    "docs/data/cases.csv",
    &[View {
        from: &["cases/cases.csv"],
        keep: &[(
            "measure",
            &[
                "longest wait (rounds of time granted)",
                "as good as new after (frames)",
                "trees above 1.5 times the sigma of a new tree (%)",
                "after 30 frames",
            ],
        )],
        drop: &[("variant", "scrambled once, then"), ("variant", "scrambled every frame")],
        keys: &[("measure", "measure"), ("scene", "scene"), ("variant", "variant")],
        cells: &[cell("value", "value", Text)],
        labels: &[("after 30 frames", "gap recovered at rest, after 30 frames")],
        ..VIEW
    }],
);

const BENCH: View = View {
    across: Some("parameter"),
    labels: &[
        ("100", "100"),
        ("1000", "1,000"),
        ("10000", "10,000"),
        ("100000", "100,000"),
        ("200000", "200,000"),
        ("1000000", "1,000,000"),
    ],
    ..VIEW
};

pub const SCHEDULER: Figure = table(
    "scheduler",
    "docs/data/scheduler.csv",
    &[View {
        from: &["scheduler/criterion"],
        keep: &[
            ("function", &["nothing moved", "nothing moved, awake", "choosing among"]),
            ("parameter", &["100", "1000", "10000", "100000"]),
        ],
        keys: &[("function", "µs of an update, by number of trees")],
        cells: &[cell("", "ns / 1000", Digits(2))],
        ..BENCH
    }],
);

pub const TREES: Figure = table(
    "trees",
    PAGE,
    &[View {
        from: &["trees/criterion"],
        keep: &[
            (
                "function",
                &[
                    "build",
                    "build of pbrt's tree",
                    "refit",
                    "refit without attributes",
                    "set and refit",
                    "copy of a refit's bytes",
                    "pick, 0 splits",
                    "pick, 6 splits",
                    "pmf, 0 splits",
                    "pmf, 6 splits",
                ],
            ),
            ("parameter", &["1000", "10000", "100000", "1000000"]),
        ],
        keys: &[("function", "ns per light, or per call")],
        cells: &[cell("", "ns / elements", Digits(3))],
        ..BENCH
    }],
);

pub const BAKE: Figure = table(
    "bake",
    "docs/data/bake.csv",
    &[View {
        from: &["bake/criterion"],
        keep: &[
            ("function", &["copy", "load", "insert", "write", "check", "build"]),
            ("parameter", &["1000", "100000", "1000000"]),
        ],
        keys: &[("function", "µs, by number of lights")],
        cells: &[cell("", "ns / 1000", Digits(3))],
        ..BENCH
    }],
);

pub const EDITS: Figure = table(
    "edits",
    "docs/data/edits.csv",
    &[
        View {
            from: &["edits/criterion"],
            keep: &[
                ("group", &["lights", "many edits", "taken builds", "origin", "top level"]),
                ("parameter", &["", "1000", "10000", "20000", "100000", "200000", "1000000"]),
            ],
            keys: &[("group", "edit"), ("function", "of what"), ("parameter", "lights or instances")],
            cells: &[cell("µs", "ns / 1000", Digits(2))],
            across: None,
            ..BENCH
        },
        View {
            from: &["edits/criterion"],
            keep: &[("group", &["moves"])],
            keys: &[("group", "edit"), ("function", "of what"), ("parameter", "lights or instances")],
            cells: &[cell("µs", "ns / elements / 1000", Digits(2))],
            across: None,
            labels: &[("moves", "each of 10,000 moves"), ("100000", "100,000")],
            ..BENCH
        },
    ],
);

pub const REGIONS: Figure = table(
    "regions",
    "docs/data/regions.csv",
    &[View {
        from: &["edits/criterion"],
        keep: &[("group", &["regions"]), ("parameter", &["1", "100"])],
        keys: &[("function", "stage and trees")],
        cells: &[cell("trees, µs", "ns / 1000", Digits(2))],
        ..BENCH
    }],
);

pub const FLIGHT: Figure = table(
    "flight",
    PAGE,
    &[View {
        from: &["flight/summary.csv"],
        keys: &[("what", "")],
        cells: &[
            cell("median", "median", Digits(3)),
            cell("99.9 %", "p999", Digits(3)),
            cell("worst", "worst", Digits(3)),
            cell("worst over median", "worst / median", Digits(2)),
        ],
        ..VIEW
    }],
);

pub const SCALE: Figure = table(
    "scale",
    "docs/data/scale.csv",
    &[View {
        from: &["scale/scale.csv"],
        keys: &[("resident_lights", "resident lights")],
        cells: &[
            cell("instances", "instances", Fixed(0)),
            cell("frame, µs", "frame_us", Digits(3)),
            cell("moves and edits", "edit_us", Digits(3)),
            cell("update", "update_us", Digits(3)),
            cell("plan", "plan_us", Digits(3)),
            cell("bytes uploaded", "upload_bytes", Fixed(0)),
        ],
        ..VIEW
    }],
);
