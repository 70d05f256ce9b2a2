//! What accuracy costs in time, in pictures.

use crate::documents::figure::{Figure, picture, selection, table};
use crate::documents::number::Format::{Digits, Fixed, Percent, Within};
use crate::documents::view::{VIEW, View, cell};

const PAGE: &str = "docs/accuracy.md";

const EQUAL_TIME_FILES: &[&str] = &["matte/equal_time.csv", "glossy/equal_time.csv"];
const REL_MSE: crate::documents::number::Format = Within("rel_mse_low", "rel_mse_high", 2);
/// Small versions have other numbers of candidates.
const EQUAL_TIME_LABELS: &[(&str, &str)] = &[
    ("matte", "diffuse"),
    ("glossy", "glossy"),
    ("Girandole / 6 splits / 1 candidate", "Girandole"),
    ("Girandole / 6 splits / 4 candidates", "Girandole, several candidates"),
    ("Girandole / 6 splits / 8 candidates", "Girandole, several candidates"),
];
/// The pictures of a run of each kind of materials.
const RUN_LABELS: &[(&str, &str)] = &[("matte", "diffuse"), ("glossy", "glossy")];

const PICTURE_TEXT: &str = "The same part of the picture by several samplers in equal time, and the reference";

pub const README_PICTURE: Figure =
    picture("readme-picture", "README.md", ("matte/equal_time.svg", "docs/equal_time.svg"), PICTURE_TEXT);

/// Samplers under reuse, in the last frame.
const REUSED: View = View {
    from: &["reuse/reuse.csv"],
    keep: &[("frame", &["16 frames"])],
    keys: &[("scene", "scene"), ("change", "what changes")],
    across: Some("sampler"),
    ..VIEW
};
const OVER: crate::documents::number::Format = Within("over_low", "over_high", 2);

pub const README_REUSE: Figure = selection(
    "readme-reuse",
    "README.md",
    &[View {
        keep: &[
            ("frame", &["16 frames"]),
            ("sampler", &["presampled 32", "ReGIR", "Girandole, no reuse", "Girandole"]),
            ("scene", &["city S"]),
        ],
        keys: &[("sampler", "new samples")],
        across: Some("change"),
        labels: &[("nothing", "nothing moves")],
        cells: &[cell("", "rel_mse", REL_MSE), cell("error × time", "over", Digits(2)).only("nothing")],
        ..REUSED
    }],
);

pub const REUSE: Figure = table(
    "reuse",
    "docs/data/reuse.csv",
    &[View {
        cells: &[cell("", "over", OVER)],
        drop: &[("sampler", "Girandole, learnt"), ("sampler", "presampled 8")],
        ..REUSED
    }],
);

pub const REUSE_ERRORS: Figure = table(
    "reuse-errors",
    "docs/data/reuse-errors.csv",
    &[View {
        keep: &[("frame", &["16 frames"]), ("sampler", &["Girandole", "presampled 32", "ReGIR"])],
        cells: &[
            cell("", "rel_mse", Digits(2)),
            cell("of all", "rel_mse_of_all", Digits(2)),
            cell("mean", "mean", Fixed(3)).only("Girandole"),
        ],
        ..REUSED
    }],
);

pub const REUSE_FRAMES: Figure = table(
    "reuse-frames",
    "docs/data/reuse-frames.csv",
    &[View {
        keep: &[("scene", &["city S", "70 rooms"]), ("change", &["nothing", "lights move"])],
        drop: &[("sampler", "presampled 8"), ("sampler", "uniform")],
        keys: &[("scene", "scene"), ("change", "what changes"), ("sampler", "new samples")],
        across: Some("frame"),
        cells: &[
            cell("", "rel_mse", Digits(2)),
            cell("choosing, ns", "choosing_ns", Digits(3)).only("16 frames"),
            cell("rays, ns", "shadow_rays_ns", Digits(3)).only("16 frames"),
            cell("merging, ns", "merging_ns", Digits(3)).only("16 frames"),
        ],
        ..REUSED
    }],
);

pub const PICTURE: Figure =
    picture("equal-time-picture", PAGE, ("matte/equal_time.svg", "equal_time.svg"), PICTURE_TEXT);

pub const EQUAL_TIME: Figure = selection(
    "equal-time",
    PAGE,
    &[View {
        from: EQUAL_TIME_FILES,
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

pub const FRONT_PLOT: Figure = picture(
    "front-plot",
    PAGE,
    ("matte/error_over_time.svg", "accuracy_front.svg"),
    "relMSE over time for all settings on diffuse materials, and the front of least error, along which half \
     of the error takes about twice the time",
);

const FRONT_VIEW: View = View {
    from: &["glossy/front.csv"],
    keys: &[("run", "materials"), ("setting", "setting")],
    cells: &[cell("time, ms of the page", "page_ms", Digits(2)), cell("relMSE (95 % interval)", "rel_mse", REL_MSE)],
    labels: RUN_LABELS,
    ..VIEW
};

pub const FRONT: Figure = selection(
    "front",
    "docs/data/front.csv",
    &[View { from: &["matte/front.csv", "glossy/front.csv"], drop: CLOSE, ..FRONT_VIEW }],
);

/// Settings that are close to those of six splits.
const CLOSE: &[(&str, &str)] = &[("setting", "Girandole / 4 splits"), ("setting", "Girandole / 7 splits")];

/// Of all settings, with diffuse and with glossy materials.
const BOTH: View = View {
    from: &["matte/accuracy.csv", "glossy/accuracy.csv"],
    keys: &[("setting", "setting")],
    across: Some("run"),
    ..VIEW
};

pub const GLOSS: Figure = table(
    "gloss-pictures",
    "docs/data/gloss-pictures.csv",
    &[View {
        from: &["glossy/accuracy.csv"],
        keep: &[(
            "setting",
            &[
                "Girandole / 6 splits / 1 candidate / 1 spp",
                "Girandole / 6 splits / 1 candidate with gloss / 1 spp",
                "Girandole / 6 splits / 8 candidates / 1 spp",
                "Girandole / 6 splits / 8 candidates by BRDF / 1 spp",
                "Girandole / 6 splits / 8 candidates with gloss / 1 spp",
                "Girandole / 6 splits / 1 candidate / 4 spp",
                "Girandole / 6 splits / 1 candidate with gloss / 4 spp",
                "Girandole / 6 splits / 8 candidates / 4 spp",
                "Girandole / 6 splits / 8 candidates by BRDF / 4 spp",
                "Girandole / 6 splits / 8 candidates with gloss / 4 spp",
                "Girandole / 6 splits / 1 candidate / 16 spp",
                "Girandole / 6 splits / 1 candidate with gloss / 16 spp",
            ],
        )],
        keys: &[("setting", "setting")],
        cells: &[
            cell("relMSE (95 % interval)", "rel_mse", REL_MSE),
            cell("time, ms of one core", "time_ms", Digits(3)),
        ],
        ..VIEW
    }],
);

pub const UPKEEP: Figure = table(
    "upkeep",
    "docs/data/upkeep.csv",
    &[View {
        keep: &[(
            "setting",
            &[
                "Girandole / 6 splits / 1 candidate / 4 spp",
                "Girandole / 6 splits / 1 candidate / 4 spp / refit only",
                "Girandole / 6 splits / 1 candidate / 4 spp / always rebuild",
                "Girandole / 6 splits / 1 candidate / 4 spp / budget 100 us",
                "Girandole / 6 splits / 1 candidate / 4 spp / solid angles",
            ],
        )],
        cells: &[
            cell("relMSE", "rel_mse", REL_MSE),
            cell("updates, ms", "update_ms", Digits(2)).only("matte"),
            cell("upload, ms", "upload_ms", Digits(2)).only("matte"),
            cell("top level, ms", "top_level_ms", Digits(2)).only("matte"),
            cell("choosing, ms", "choosing_ms", Digits(3)).only("matte"),
            cell("shadow rays, ms", "shadow_rays_ms", Digits(3)).only("matte"),
            cell("shading, ms", "shading_ms", Digits(2)).only("matte"),
        ],
        labels: &[
            ("matte", "diffuse"),
            ("glossy", "glossy"),
            ("Girandole / 6 splits / 1 candidate / 4 spp", "default: a budget of 300 µs"),
            ("Girandole / 6 splits / 1 candidate / 4 spp / refit only", "refit only"),
            ("Girandole / 6 splits / 1 candidate / 4 spp / always rebuild", "always rebuild"),
            ("Girandole / 6 splits / 1 candidate / 4 spp / budget 100 us", "a budget of 100 µs"),
            ("Girandole / 6 splits / 1 candidate / 4 spp / solid angles", "solid angles"),
        ],
        ..BOTH
    }],
);

pub const RIVALS: Figure = table(
    "rivals",
    PAGE,
    &[View {
        from: &["rivals/rivals.csv"],
        keys: &[("sampler", "sampler")],
        across: Some("scene"),
        cells: &[cell("", "over_one_tree", Digits(2))],
        ..VIEW
    }],
);

pub const LEFT_OUT: Figure = table(
    "left-out",
    "docs/data/left-out.csv",
    &[View {
        keep: &[(
            "setting",
            &[
                "Girandole / 6 splits / 1 candidate / 4 spp",
                "Girandole / 6 splits / 1 candidate / 4 spp / no shadows",
                "Girandole / 6 splits / 1 candidate / 4 spp / no cones",
                "Girandole / 6 splits / 1 candidate / 4 spp / no ranges",
                "Girandole / 6 splits / 1 candidate / 4 spp / no areas",
                "Girandole / 6 splits / 1 candidate / 4 spp / no gloss",
            ],
        )],
        cells: &[
            cell("relMSE, factor", "rel_mse", Digits(2)).relative(),
            cell("time, factor", "time_ms", Digits(2)).relative().only("matte"),
        ],
        labels: &[
            ("matte", "diffuse"),
            ("glossy", "glossy"),
            ("Girandole / 6 splits / 1 candidate / 4 spp", "nothing"),
            ("Girandole / 6 splits / 1 candidate / 4 spp / no shadows", "shadows"),
            ("Girandole / 6 splits / 1 candidate / 4 spp / no cones", "cones"),
            ("Girandole / 6 splits / 1 candidate / 4 spp / no ranges", "ranges"),
            ("Girandole / 6 splits / 1 candidate / 4 spp / no areas", "areas"),
            ("Girandole / 6 splits / 1 candidate / 4 spp / no gloss", "gloss"),
        ],
        ..BOTH
    }],
);
