//! The pictures of pages.

use crate::documents::figure::{Figure, picture};

const ACCURACY: &str = "docs/accuracy.md";
const PAPER: &str = "docs/paper.md";

const PICTURE_TEXT: &str = "The same part of the picture by several samplers in equal time, and the reference";

pub const README_PICTURE: Figure =
    picture("readme-picture", "README.md", ("matte/equal_time.svg", "docs/equal_time.svg"), PICTURE_TEXT);

pub const PICTURE: Figure =
    picture("equal-time-picture", ACCURACY, ("matte/equal_time.svg", "equal_time.svg"), PICTURE_TEXT);

pub const FRONT_PLOT: Figure = picture(
    "front-plot",
    ACCURACY,
    ("matte/error_over_time.svg", "accuracy_front.svg"),
    "relMSE over time for all settings on diffuse materials, and the front of least error, along which half \
     of the error takes about twice the time",
);

pub const BUDGET_PLOT: Figure = picture(
    "budget-plot",
    "docs/benchmarks.md",
    ("budget/gap_S10.svg", "budget.svg"),
    "Gap recovered over time spent for five motions, by strategy: the library's scheduler is ahead of round \
     robin where time is short",
);

pub const PAPER_COST: Figure = picture(
    "paper-cost",
    PAPER,
    ("paper/cost_bistro_exterior_lite.svg", "paper_cost_bistro.svg"),
    "MAPE minus that of always updating, over the share of rebuild time, on Bistro, for all strategies",
);

pub const PAPER_FRAMES: Figure = picture(
    "paper-frames",
    PAPER,
    ("paper/frames_bistro_exterior_lite_girandole_splitting_cost.svg", "paper_frames_bistro.svg"),
    "MAPE and splitting cost over the frames for one tree on Bistro, updated and rebuilt",
);
