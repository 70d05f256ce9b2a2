//! The calls of programs.

use crate::documents::figure::{RUN, Run, Scene};

/// All runs.
pub const RUNS: &[Run] = &[
    Run {
        name: "noise",
        arguments: "noise",
        quick: Some("noise --quick --shading-points 4"),
        out: Some("noise.csv"),
        scene: Scene::Added,
        is_timed: true,
        seconds: 40,
        ..RUN
    },
    Run {
        name: "noise-m",
        arguments: "noise --world M --shading-points 100",
        quick: Some("noise --world M --quick --shading-points 2"),
        out: Some("noise.csv"),
        is_timed: true,
        seconds: 40,
        ..RUN
    },
    Run { name: "torture", arguments: "noise torture", out: Some("torture.csv"), seconds: 60, ..RUN },
    Run { name: "cliffs", arguments: "noise cliffs", out: Some("cliffs.csv"), seconds: 20, ..RUN },
    Run { name: "gloss", arguments: "noise gloss --shading-points 200", out: Some("gloss.csv"), seconds: 30, ..RUN },
    Run {
        name: "segments",
        arguments: "noise segments --shading-points 200",
        out: Some("segments.csv"),
        is_timed: true,
        seconds: 90,
        ..RUN
    },
    Run {
        name: "candidates",
        arguments: "noise candidates",
        out: Some("candidates.csv"),
        is_timed: true,
        seconds: 30,
        ..RUN
    },
    Run { name: "learn", arguments: "noise learn", out: Some("learn.csv"), seconds: 60, ..RUN },
    Run { name: "sky", arguments: "noise sky", out: Some("sky.csv"), is_timed: true, seconds: 15, ..RUN },
    Run {
        name: "kernel-noise",
        arguments: "gpu-lights",
        quick: Some("gpu-lights --quick"),
        out: Some("noise.csv"),
        seconds: 180,
        ..RUN
    },
    Run {
        name: "kernel-cost",
        arguments: "gpu-lights --cost",
        quick: Some("gpu-lights --cost --quick"),
        out: Some("cost.csv"),
        is_timed: true,
        seconds: 60,
        ..RUN
    },
    Run { name: "signs", arguments: "noise signs", out: Some("signs.csv"), is_timed: true, seconds: 15, ..RUN },
    Run {
        name: "deform",
        arguments: "noise deform --shading-points 100",
        out: Some("deform.csv"),
        scene: Scene::Added,
        is_timed: true,
        seconds: 120,
        ..RUN
    },
    Run {
        name: "rivals",
        arguments: "pictures --rivals",
        quick: Some("pictures --rivals --quick"),
        scene: Scene::Added,
        is_timed: true,
        seconds: 900,
        ..RUN
    },
    Run {
        name: "reuse",
        arguments: "pictures --reuse",
        quick: Some("pictures --reuse --quick"),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 1_200,
        ..RUN
    },
    Run {
        name: "budget",
        arguments: "rebuilds --scene S10,M100 --strategies girandole,round,oracle --shares 0.02,0.1,0.5 --shading-points 120 --frames 240",
        is_timed: true,
        seconds: 600,
        ..RUN
    },
    Run { name: "cases", arguments: "rebuilds --cases", seconds: 120, ..RUN },
    Run {
        name: "scheduler",
        program: "bench_scheduler",
        arguments: "--bench",
        out: None,
        is_timed: true,
        seconds: 60,
        ..RUN
    },
    Run { name: "trees", program: "bench_trees", arguments: "--bench", out: None, is_timed: true, seconds: 90, ..RUN },
    Run { name: "bake", program: "bench_bake", arguments: "--bench", out: None, is_timed: true, seconds: 90, ..RUN },
    Run { name: "edits", program: "bench_edits", arguments: "--bench", out: None, is_timed: true, seconds: 120, ..RUN },
    Run { name: "flight", arguments: "scale --runs 3", is_timed: true, seconds: 120, ..RUN },
    Run { name: "scale", arguments: "scale --scale", is_timed: true, seconds: 40, ..RUN },
    Run { name: "shaders", arguments: "kernels --chip navi21", out: Some("shaders.csv"), seconds: 30, ..RUN },
    Run {
        name: "pipelines",
        program: "bench_pipelines",
        arguments: "--bench",
        out: None,
        seconds: 40,
        is_timed: true,
        ..RUN
    },
    Run {
        name: "effects",
        program: "bench_effects",
        arguments: "--bench",
        out: None,
        is_timed: true,
        seconds: 70,
        ..RUN
    },
    Run {
        name: "glossy",
        arguments: "pictures --pictures 4",
        quick: Some("pictures --quick --size 16x16 --pictures 2"),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 540,
        ..RUN
    },
    Run {
        name: "matte",
        arguments: "pictures --matte --pictures 4",
        quick: Some("pictures --matte --quick --size 16x16 --pictures 2"),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 540,
        ..RUN
    },
    Run { name: "paper", arguments: "paper --no-city --seeds 3", scene: Scene::Needed, seconds: 500, ..RUN },
    Run { name: "paper-city", arguments: "paper --world S --seeds 3", seconds: 300, ..RUN },
];
