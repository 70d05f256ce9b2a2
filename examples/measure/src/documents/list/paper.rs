//! The experiment of [SS].

use crate::documents::figure::{Figure, picture, table};
use crate::documents::number::Format::{Digits, Fixed, PlusMinus};
use crate::documents::view::{VIEW, View, cell};

const PAGE: &str = "docs/paper.md";

const TREES: View = View {
    keys: &[("strategy", "strategy")],
    across: Some("trees"),
    cells: &[
        cell("MAPE minus that of updates", "difference", PlusMinus("difference_half_width", 4)),
        cell("rebuilds", "rebuilds", Fixed(0)),
        cell("cost", "cost_share", Digits(2)),
    ],
    labels: &[("girandole, one tree", "one tree"), ("girandole, two levels", "two levels")],
    ..VIEW
};

pub const BISTRO: Figure =
    table("paper-bistro", "docs/data/paper-bistro.csv", &[View { from: &["paper/paper.csv"], ..TREES }]);

pub const CITY: Figure =
    table("paper-city", "docs/data/paper-city.csv", &[View { from: &["paper-city/paper.csv"], ..TREES }]);

pub const COST: Figure = picture(
    "paper-cost",
    PAGE,
    ("paper/cost_bistro_exterior_lite.svg", "paper_cost_bistro.svg"),
    "MAPE minus that of always updating, over the share of rebuild time, on Bistro, for all strategies",
);

pub const FRAMES: Figure = picture(
    "paper-frames",
    PAGE,
    ("paper/frames_bistro_exterior_lite_girandole_splitting_cost.svg", "paper_frames_bistro.svg"),
    "MAPE and splitting cost over the frames for one tree on Bistro, updated and rebuilt",
);
