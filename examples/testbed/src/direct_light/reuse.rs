//! Reservoirs that pixels keep from frame to frame and share with neighbours, for any way to draw new samples.
//!
//! It is the pass of docs/reuse.md: multiple importance sampling by targets with shadows, as they were at the points of
//! the last frame. A merge traces two rays.

use super::draw::{Draw, Drawn, Sample, reflected};
use super::renderer::Renderer;
use super::rivals::Random;
use super::view::{Square, Surface};
use girandole::glam::{IVec2, Vec3};
use girandole::light::luminance;
use girandole::{LightSample, LightSampler, Reservoir};
use rayon::prelude::*;
use std::time::Instant;

/// The pixels that are timed together.
const PART: usize = 256;
/// How far away a neighbour is, in pixels along each axis, at most.
const REACH: f32 = 3.0;
/// Surfaces are alike if the cosine of the angle between their normals exceeds this, and each is at most so far from the
/// plane of the other, relative to the distance of the eye.
const ALIKE: (f32, f32) = (0.9, 0.02);

/// How much is reused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The draws that a reservoir of the last frame stands for, at most. With 0, nothing is reused.
    pub draws: f32,
    /// Neighbours in the last frame, besides the place where the surface was.
    pub neighbours: u32,
}

/// What a frame shows, and the lights that shine on it.
#[derive(Clone, Copy)]
pub struct Moment<'a> {
    pub renderer: Renderer<'a>,
    pub lights: LightSampler<'a>,
}

impl<'a> Moment<'a> {
    fn surface(&self, pixel: usize) -> Option<&'a Surface> {
        self.renderer.view.pixels[pixel].surfaces[0].as_ref()
    }

    fn light(&self, surface: &Surface, reservoir: &Reservoir) -> Option<LightSample> {
        self.lights.reservoir_sample(&surface.shading_point, reservoir)
    }

    /// What a point on a light reflects without shadows.
    fn target(&self, surface: &Surface, light: &LightSample) -> f32 {
        luminance(reflected(surface, self.renderer.material(surface), &light.incident)) / light.incident.pdf
    }

    /// Sets targets to 0 that a shadow ray finds blocked.
    fn trace(&self, surface: &Surface, light: Option<&LightSample>, target: &mut f32) {
        if *target > 0.0 && light.is_some_and(|light| self.renderer.is_shadowed(surface, &light.incident)) {
            *target = 0.0;
        }
    }
}

/// The frame before, and the pixel there that showed what each pixel shows now.
pub struct Before<'a> {
    pub moment: Moment<'a>,
    pub pixels: Vec<Option<IVec2>>,
    /// What its pixels have kept.
    pub kept: &'a [Reservoir],
}

/// Where each pixel's surface was in the frame before: the motion vectors of an engine.
pub fn pixels_before(now: &Renderer<'_>, before: &Renderer<'_>, square: &Square) -> Vec<Option<IVec2>> {
    let pixel = |index: usize| {
        let surface = now.view.pixels[index].surfaces[0].as_ref()?;
        let [moved, old] = [now, before].map(|frame| frame.scene.objects[surface.object as usize].transform);
        let position = surface.shading_point.position;
        let then = if moved == old { position } else { (old * moved.inverse()).transform_point3(position) };
        square.pixel(&before.scene.camera, then)
    };
    (0..now.view.pixels.len()).into_par_iter().map(pixel).collect()
}

/// The seconds of the stages of some pixels: choosing lights, shadow rays, and evaluating and merging lights.
pub type Seconds = [f64; 3];

/// A frame that was drawn.
pub struct Drawing {
    /// Radiance in nits, row by row from the top.
    pub picture: Vec<Vec3>,
    pub kept: Vec<Reservoir>,
    /// For each part of the pixels.
    pub seconds: Vec<Seconds>,
}

/// A pixel on its way through the stages.
struct Shown<'a> {
    surface: &'a Surface,
    pixel: u32,
    drawn: Option<Drawn>,
    own: Reservoir,
    random: Random,
    merge: Option<Merge<'a>>,
}

/// A merge that was prepared.
struct Merge<'a> {
    surface: &'a Surface,
    other: Reservoir,
    /// The light of the pixel's reservoir at the other surface, and of the other at the pixel's.
    lights: [Option<LightSample>; 2],
    targets: [f32; 2],
}

/// Draws a frame. `place` is the seed of the picture and the number of the frame.
pub fn frame(
    draw: &dyn Draw,
    now: &Moment<'_>,
    before: Option<&Before<'_>>,
    limits: Limits,
    place: (u32, u32),
) -> Drawing {
    let pixels = now.renderer.view.pixels.len();
    let parts: Vec<(Vec<(Vec3, Reservoir)>, Seconds)> = (0..pixels.div_ceil(PART))
        .into_par_iter()
        .map(|part| {
            let pixels = part * PART..((part + 1) * PART).min(pixels);
            let mut seconds = [0.0; 3];
            let mut start = Instant::now();
            let mut end_stage = |stage: usize| {
                let now = Instant::now();
                seconds[stage] += (now - start).as_secs_f64();
                start = now;
            };
            let mut shown: Vec<Option<Shown<'_>>> =
                pixels.map(|pixel| Some(choose(draw, now, now.surface(pixel)?, pixel as u32, place))).collect();
            end_stage(0);
            let light = |shown: &Shown<'_>| shown.drawn.map(|drawn| sample_of(&drawn));
            for shown in shown.iter_mut().flatten() {
                shown.own.reflected = light(shown).map_or(0.0, |light| now.target(shown.surface, &light));
            }
            end_stage(2);
            let mut found = Vec::new();
            for shown in shown.iter_mut().flatten().filter(|shown| shown.own.reflected > 0.0) {
                now.trace(shown.surface, light(shown).as_ref(), &mut shown.own.reflected);
                found.push((shown.surface, shown.pixel, shown.drawn, shown.own.reflected > 0.0));
            }
            end_stage(1);
            for (surface, pixel, drawn, is_visible) in found {
                let sample = Sample { pixel, frame: place.1, u: (now.renderer.numbers)(pixel, place.1, place.0) };
                drawn.iter().for_each(|drawn| draw.learn(surface, &sample, drawn, is_visible));
            }
            end_stage(0);
            for (before, step) in
                before.iter().flat_map(|before| (0..=limits.neighbours).map(move |step| (before, step)))
            {
                if limits.draws <= 0.0 {
                    break;
                }
                for shown in shown.iter_mut().flatten() {
                    shown.merge = prepare(shown, now, before, limits, step);
                }
                end_stage(2);
                for shown in shown.iter_mut().flatten() {
                    if let Some(Merge { surface, lights: [there, here], targets: [own, other], .. }) = &mut shown.merge
                    {
                        before.moment.trace(surface, there.as_ref(), own);
                        now.trace(shown.surface, here.as_ref(), other);
                    }
                }
                end_stage(1);
                for shown in shown.iter_mut().flatten() {
                    if let Some(Merge { other, targets: [there, here], .. }) = shown.merge.take() {
                        shown.own = shown.own.merge(there, &other, here, shown.random.pair()[0]);
                    }
                }
            }
            let finished =
                shown.iter().map(|shown| shown.as_ref().map_or_else(Default::default, |shown| finish(now, shown)));
            let finished = finished.collect();
            end_stage(2);
            (finished, seconds)
        })
        .collect();
    let seconds = parts.iter().map(|(_, seconds)| *seconds).collect();
    let (picture, kept) = parts.into_iter().flat_map(|(part, _)| part).unzip();
    Drawing { picture, kept, seconds }
}

/// The new sample of a pixel.
fn choose<'a>(
    draw: &dyn Draw,
    now: &Moment<'a>,
    surface: &'a Surface,
    pixel: u32,
    (seed, frame): (u32, u32),
) -> Shown<'a> {
    let sample = Sample { pixel, frame, u: (now.renderer.numbers)(pixel, frame, seed) };
    let drawn = draw.draw(surface, now.renderer.material(surface), &sample);
    let none = Reservoir { count: 1.0, ..Reservoir::default() };
    let own = drawn.map_or(none, |drawn| drawn.reservoir(&now.lights));
    Shown { surface, pixel, drawn, own, random: Random::new(&[seed, frame, pixel]), merge: None }
}

/// A drawn light as the library has it. Its probability is in the reservoir.
fn sample_of(drawn: &Drawn) -> LightSample {
    LightSample { light: drawn.id, pmf: 1.0, incident: drawn.incident, user_data: 0 }
}

/// Evaluates the lights of a pixel's reservoir and of one of the frame before, each at the point of the other.
fn prepare<'a>(
    shown: &mut Shown<'_>,
    now: &Moment<'_>,
    before: &Before<'a>,
    limits: Limits,
    step: u32,
) -> Option<Merge<'a>> {
    let view = before.moment.renderer.view;
    let [x, y] = shown.random.pair().map(|u| if step == 0 { 0.0 } else { ((2.0 * u - 1.0) * REACH).round() });
    let place = before.pixels[shown.pixel as usize]? + IVec2::new(x as i32, y as i32);
    let (width, height) = (view.width as i32, (view.pixels.len() / view.width) as i32);
    let is_inside = place.cmpge(IVec2::ZERO).all() && place.x < width && place.y < height;
    let pixel = is_inside.then(|| (place.y * width + place.x) as usize)?;
    let surface = before.moment.surface(pixel)?;
    if !are_alike(shown.surface, surface, now.renderer.scene.camera.eye) {
        return None;
    }
    let mut other = before.kept[pixel];
    other.count = other.count.min(limits.draws);
    let lights = [before.moment.light(surface, &shown.own), now.light(shown.surface, &other)];
    let target = |moment: &Moment<'_>, surface: &Surface, light: &Option<LightSample>| {
        light.as_ref().map_or(0.0, |light| moment.target(surface, light))
    };
    let targets = [target(&before.moment, surface, &lights[0]), target(now, shown.surface, &lights[1])];
    Some(Merge { surface, other, lights, targets })
}

fn are_alike(one: &Surface, other: &Surface, eye: Vec3) -> bool {
    let [a, b] = [one, other].map(|surface| surface.shading_point);
    let apart = b.position - a.position;
    let limit = ALIKE.1 * a.position.distance(eye);
    one.material == other.material
        && a.normal.dot(b.normal) > ALIKE.0
        && a.normal.dot(apart).abs().max(b.normal.dot(apart).abs()) < limit
}

/// The light that a pixel reflects. No ray: what is reflected knows shadows.
fn finish(now: &Moment<'_>, shown: &Shown<'_>) -> (Vec3, Reservoir) {
    let Shown { surface, own, .. } = shown;
    let light = now.light(surface, own).filter(|_| own.reflected > 0.0);
    let radiance = light.map_or(Vec3::ZERO, |light| {
        let incident = &light.incident;
        reflected(surface, now.renderer.material(surface), incident) * (own.weight / incident.pdf)
    });
    (radiance, *own)
}
