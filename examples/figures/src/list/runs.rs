//! The calls of programs.

use crate::figure::{RUN, Run, Scene};

/// All runs.
pub const RUNS: &[Run] = &[
    Run {
        name: "noise",
        program: "variance",
        quick: Some("--quick --shading-points 4"),
        out: Some("noise.csv"),
        scene: Scene::Added,
        is_timed: true,
        seconds: 40,
        ..RUN
    },
    Run {
        name: "noise-m",
        program: "variance",
        arguments: "--world M --shading-points 100",
        quick: Some("--world M --quick --shading-points 2"),
        out: Some("noise.csv"),
        is_timed: true,
        seconds: 40,
        ..RUN
    },
    Run {
        name: "torture",
        program: "variance",
        arguments: "--torture",
        quick: Some("--torture --quick"),
        out: Some("torture.csv"),
        has_fewer_rows: true,
        seconds: 60,
        ..RUN
    },
    Run { name: "cliffs", program: "variance", arguments: "--cliffs", out: Some("cliffs.csv"), seconds: 20, ..RUN },
    Run {
        name: "gloss",
        program: "variance",
        arguments: "--gloss --shading-points 200",
        quick: Some("--gloss --quick --shading-points 2"),
        out: Some("gloss.csv"),
        seconds: 30,
        ..RUN
    },
    Run {
        name: "segments",
        program: "variance",
        arguments: "--segments --shading-points 200",
        quick: Some("--segments --quick --shading-points 2"),
        out: Some("segments.csv"),
        is_timed: true,
        seconds: 90,
        ..RUN
    },
    Run {
        name: "candidates",
        program: "variance",
        arguments: "--candidates",
        quick: Some("--candidates --quick --shading-points 2"),
        out: Some("candidates.csv"),
        is_timed: true,
        seconds: 30,
        ..RUN
    },
    Run {
        name: "shadows",
        program: "variance",
        arguments: "--shadows --shading-points 200",
        quick: Some("--shadows --quick --shading-points 2"),
        out: Some("shadows.csv"),
        scene: Scene::Added,
        seconds: 300,
        ..RUN
    },
    Run {
        name: "learn",
        program: "variance",
        arguments: "--learn",
        quick: Some("--learn --quick --shading-points 2"),
        out: Some("learn.csv"),
        has_fewer_rows: true,
        seconds: 60,
        ..RUN
    },
    Run {
        name: "sky",
        program: "variance",
        arguments: "--sky",
        quick: Some("--sky --quick --shading-points 2"),
        out: Some("sky.csv"),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 15,
        ..RUN
    },
    Run {
        name: "kernel-noise",
        program: "kernel_lights",
        quick: Some("--quick"),
        out: Some("noise.csv"),
        seconds: 180,
        ..RUN
    },
    Run {
        name: "kernel-cost",
        program: "kernel_lights",
        arguments: "--cost",
        quick: Some("--cost --quick"),
        out: Some("cost.csv"),
        is_timed: true,
        seconds: 60,
        ..RUN
    },
    Run {
        name: "signs",
        program: "variance",
        arguments: "--signs",
        quick: Some("--signs --quick"),
        out: Some("signs.csv"),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 15,
        ..RUN
    },
    Run {
        name: "deform",
        program: "variance",
        arguments: "--deform --shading-points 100",
        quick: Some("--deform --quick --shading-points 2"),
        out: Some("deform.csv"),
        scene: Scene::Added,
        is_timed: true,
        seconds: 120,
        ..RUN
    },
    Run {
        name: "rivals",
        program: "accuracy",
        arguments: "--rivals",
        quick: Some("--rivals --quick"),
        scene: Scene::Added,
        is_timed: true,
        seconds: 900,
        ..RUN
    },
    Run {
        name: "reuse",
        program: "accuracy",
        arguments: "--reuse",
        quick: Some("--reuse --quick"),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 1_200,
        ..RUN
    },
    Run {
        name: "budget",
        program: "budget",
        arguments: "--scene S10,M100 --strategies girandole,round,oracle --shares 0.02,0.1,0.5 --shading-points 120 --frames 240",
        quick: Some(
            "--quick --scene S10,M100 --strategies girandole,round,oracle --shares 0.02,0.1,0.5 --motion smooth --shading-points 2 --frames 8",
        ),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 600,
        ..RUN
    },
    Run {
        name: "cases",
        program: "budget",
        arguments: "--cases",
        quick: Some("--cases --quick"),
        has_fewer_rows: true,
        seconds: 120,
        ..RUN
    },
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
    Run {
        name: "flight",
        program: "flight",
        arguments: "--runs 3",
        quick: Some("--quick --runs 3"),
        is_timed: true,
        seconds: 120,
        ..RUN
    },
    Run {
        name: "scale",
        program: "flight",
        arguments: "--scale",
        quick: Some("--scale --quick"),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 40,
        ..RUN
    },
    Run {
        name: "shaders",
        program: "shader_stats",
        arguments: "--chip navi21",
        out: Some("shaders.csv"),
        seconds: 30,
        ..RUN
    },
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
        program: "accuracy",
        arguments: "--pictures 4",
        quick: Some("--quick --size 16x16 --pictures 2"),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 540,
        ..RUN
    },
    Run {
        name: "matte",
        program: "accuracy",
        arguments: "--matte --pictures 4",
        quick: Some("--matte --quick --size 16x16 --pictures 2"),
        has_fewer_rows: true,
        is_timed: true,
        seconds: 540,
        ..RUN
    },
    Run {
        name: "paper",
        program: "paper",
        arguments: "--no-city --seeds 3",
        scene: Scene::Needed,
        seconds: 500,
        ..RUN
    },
    Run {
        name: "paper-city",
        program: "paper",
        arguments: "--world S --seeds 3",
        quick: Some("--quick"),
        seconds: 300,
        ..RUN
    },
];
