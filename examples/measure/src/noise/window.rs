//! A room with a window under a sky: the noise of a sample of the sky with shadows, for a sampler that knows nothing, with
//! learnt visibility, with a portal, and for one that knows which patches of the sky each point sees.

use super::effort::Effort;
use girandole::glam::{DVec3, Mat3, Vec3, vec3};
use girandole::light::luminance;
use girandole::{
    CutOptions, CutTable, FrameBudget, LightId, LightSampler, LightWorld, Placement, Portal, ShadingPoint, Sky,
    SkyError, ValueError, VisibilityOptions, VisibilityTable,
};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f32::consts::PI;
use testbed::common::pcg::Rng;
use testbed::scene::SceneError;

/// Columns of the map.
const WIDTH: usize = 256;
/// The room reaches from 0 to this corner, in metres.
const ROOM: Vec3 = vec3(6.0, 3.0, 4.0);
/// The window in the wall at the greatest x: its middle, and half its size along y and z.
const MIDDLE: Vec3 = vec3(6.0, 1.7, 2.0);
const HALF: [f32; 2] = [0.7, 0.8];
/// Points that learn in a frame, and the frames after which noise is measured.
const TAUGHT: usize = 1000;
const FRAMES: [u64; 2] = [16, 256];
/// The edge of cells that share cuts, in metres.
const CUT_EDGE: f32 = 0.5;

/// The sun, over the mean of the sky, and where it is.
const SCENES: [(&str, f32, Vec3); 2] =
    [("a room with a window", 0.0, Vec3::X), ("a room with a window, and a sun", 1000.0, vec3(0.7, 0.4, 0.2))];

/// Whether a ray from a point of the room leaves it through the window.
fn leaves(from: Vec3, direction: Vec3) -> bool {
    let at = from + direction * ((ROOM.x - from.x) / direction.x) - MIDDLE;
    direction.x > 0.0 && at.y.abs() < HALF[0] && at.z.abs() < HALF[1]
}

/// Points of the floor and of three walls.
fn points(count: usize, seed: u64) -> Vec<ShadingPoint> {
    let mut rng = Rng::new(seed, 3);
    let point = |i: usize| {
        let at = vec3(rng.range(0.05, 5.9), rng.range(0.05, 2.9), rng.range(0.05, 3.9));
        match i % 4 {
            0 => ShadingPoint::surface(vec3(at.x, 0.0, at.z), Vec3::Y),
            1 => ShadingPoint::surface(vec3(0.0, at.y, at.z), Vec3::X),
            2 => ShadingPoint::surface(vec3(at.x, at.y, 0.0), Vec3::Z),
            _ => ShadingPoint::surface(vec3(at.x, at.y, 4.0), Vec3::NEG_Z),
        }
    };
    (0..count).map(point).collect()
}

/// A texel of the sky.
struct Texel {
    direction: Vec3,
    solid_angle: f32,
    /// In nits.
    luminance: f32,
}

fn texels(sky: &Sky) -> Vec<Texel> {
    let height = WIDTH / 2;
    let texel = |i: usize| {
        let [x, y] = [(i % WIDTH) as f32 + 0.5, (i / WIDTH) as f32 + 0.5];
        let (theta, phi) = (PI * y / height as f32, 2.0 * PI * (x / WIDTH as f32 - 0.5));
        let direction = vec3(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        let solid_angle = 2.0 * PI / WIDTH as f32 * 2.0 * theta.sin() * (0.5 * PI / height as f32).sin();
        Texel { direction, solid_angle, luminance: luminance(sky.radiance(direction)) }
    };
    (0..WIDTH * height).map(texel).collect()
}

/// The noise of a sampler at a point, and that of the same without the patches of which the point sees nothing. `None`
/// where it sees no light.
fn sigmas(sampler: &LightSampler<'_>, at: &ShadingPoint, texels: &[Texel]) -> Option<[f64; 2]> {
    let (mut mean, mut squares) = (0.0, 0.0);
    let mut seen: BTreeMap<u32, f64> = BTreeMap::new();
    for texel in texels.iter().filter(|texel| leaves(at.position, texel.direction)) {
        let value = f64::from(texel.luminance * texel.direction.dot(at.normal).max(0.0) * texel.solid_angle);
        if value > 0.0 {
            let hit = sampler.hit(at, texel.direction, f32::INFINITY)?;
            mean += value;
            squares += value * value / f64::from(hit.pmf * hit.incident.pdf * texel.solid_angle);
            if let LightId::Local { light, .. } = hit.light {
                seen.insert(light, f64::from(hit.pmf));
            }
        }
    }
    let all: f64 = seen.values().sum();
    (mean > 0.0).then(|| [squares, squares * all].map(|squares| (squares / (mean * mean) - 1.0).max(0.0).sqrt()))
}

fn refused(error: ValueError) -> SceneError {
    SceneError(error.to_string())
}

/// The cells of points, built for what a sampler knows.
fn cuts(sampler: LightSampler<'_>, points: &[ShadingPoint]) -> Result<CutTable, ValueError> {
    let mut cuts = CutTable::new(CutOptions::new(CUT_EDGE, 1 << 12)?.with_min_marks(1));
    let marker = sampler.with_cuts(&cuts);
    points.iter().for_each(|at| marker.mark(at));
    cuts.build(sampler);
    Ok(cuts)
}

/// One frame: points of the room take a sample each, and record whether it leaves through the window.
fn teach(world: &LightWorld, table: &mut VisibilityTable, frame: u64, count: usize) -> Result<(), ValueError> {
    let points = points(count, 100 + frame);
    let sampler = world.sampler().with_visibility(table);
    let cuts = cuts(sampler, &points)?;
    let (sampler, mut rng) = (sampler.with_cuts(&cuts), Rng::new(frame, 7));
    for at in &points {
        if let Some(sample) = sampler.sample(at, [(); 4].map(|()| rng.unit())) {
            sampler.record_visibility(at, &sample, leaves(at.position, sample.incident.direction));
        }
    }
    table.end_frame();
    Ok(())
}

/// A sampler of a scene, and its noise at all points that see light.
pub type Row = (&'static str, String, Vec<f64>);

/// Measures all scenes.
pub fn measure(effort: Effort) -> Result<Vec<Row>, SceneError> {
    let mut rows = Vec::new();
    for (name, sun, toward) in effort.select(&SCENES[..], &SCENES[..1]) {
        let toward = toward.normalize();
        let cloud = |d: Vec3| (1.0 + 0.5 * (7.0 * d.x + 3.0 * d.z).sin() * (5.0 * d.z).cos()) * d.y.signum().max(0.2);
        let sky = Sky::from_fn(WIDTH, |d| Vec3::splat(cloud(d) + if d.dot(toward) > 0.9996 { *sun } else { 0.0 }));
        let sky = sky.map_err(|error: SkyError| SceneError(error.to_string()))?;
        let texels = texels(&sky);
        let mut world = LightWorld::new();
        world.set_sky(sky);
        world.update(FrameBudget::NONE);
        let receivers = points(effort.select(200, 4), 1);
        let noise = |sampler: &LightSampler<'_>| -> [Vec<f64>; 2] {
            let found: Vec<[f64; 2]> = receivers.par_iter().filter_map(|at| sigmas(sampler, at, &texels)).collect();
            [0, 1].map(|k| found.iter().map(|sigmas| sigmas[k]).collect())
        };
        let mut add = |what: &str, sigmas: Vec<f64>| rows.push((*name, what.to_owned(), sigmas));
        let [bare, best] = noise(&world.sampler());
        add("girandole", bare);
        let mut table = VisibilityTable::new(VisibilityOptions::default());
        let mut frame = 0;
        for until in effort.select(&FRAMES[..], &FRAMES[..1]) {
            while frame < *until {
                frame += 1;
                teach(&world, &mut table, frame, effort.select(TAUGHT, 10)).map_err(refused)?;
            }
            let [learnt, _] = noise(&world.sampler().with_visibility(&table));
            add(&format!("learnt visibility, {frame} frames"), learnt);
        }
        let room = Placement { linear: Mat3::from_diagonal(0.5 * ROOM + 0.1), translation: (0.5 * ROOM).as_dvec3() };
        let [half_u, half_v] = [Vec3::Z * HALF[1], Vec3::Y * HALF[0]];
        let center: DVec3 = MIDDLE.as_dvec3();
        world
            .set_portals(&[Portal { center, half_u, half_v, room }])
            .map_err(|error: SkyError| SceneError(error.to_string()))?;
        add("a portal", noise(&world.sampler()).into_iter().next().unwrap_or_default());
        let cuts = cuts(world.sampler(), &receivers).map_err(refused)?;
        add("a portal, shared cuts", noise(&world.sampler().with_cuts(&cuts)).into_iter().next().unwrap_or_default());
        add("knows what each point sees", best);
    }
    Ok(rows)
}
