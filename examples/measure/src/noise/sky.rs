//! A sky beside lamps: both in one distribution, and apart by halves, as engines and pbrt choose.
//!
//! The noise is that of one sample of a matte surface without shadows. It is a sum over all lamps and texels, so it
//! has no noise of its own. pbrt's sample has two rays: one to a light, where a half of the samples go to the sky by a
//! compensated map, and one by the cosine, both weighted by the balance heuristic (PBRT4 12.5, 12.6 and 13.4).

use super::effort::Effort;
use super::window;
use girandole::glam::{Vec3, vec3};
use girandole::light::luminance;
use girandole::{Light, LightId, LightSampler, LightTree, LightWorld, Placement, Policy, ShadingPoint, Sky};
use rayon::prelude::*;
use std::f32::consts::PI;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use testbed::common::pcg::Rng;
use testbed::common::table::{Table, markdown_head, short};
use testbed::scene::SceneError;

const COLUMNS: [&str; 7] = ["scene", "sampler", "sigma_mean", "sigma_p95", "rays", "sigma_of_equal_rays", "ns"];

/// Columns of the maps.
const WIDTH: usize = 128;
const LAMPS: usize = 2000;
/// Half the width of the place where lamps and shading points are, in metres.
const HALF: f32 = 40.0;
/// Samples that are timed, and rounds, of which the fastest counts.
const TIMED: usize = 20_000;
const ROUNDS: usize = 9;

/// Light of the sky on open ground, over that of the lamps; and the sun, over the mean of the sky.
const SCENES: [(&str, f32, f32); 4] = [
    ("clouds and lamps", 1.0, 0.0),
    ("a sun 1,000 times as bright, and lamps", 1.0, 1000.0),
    ("night", 0.05, 0.0),
    ("day", 20.0, 0.0),
];

const SAMPLERS: [&str; 3] = ["girandole", "halves", "halves with MIS (pbrt)"];

/// Lamps and a sky, apart and together.
struct Place {
    both: LightWorld,
    lamps: LightWorld,
    texels: Vec<Texel>,
    /// Of texels by their light, and by what of it exceeds the mean.
    by_light: Choice,
    compensated: Choice,
}

/// A texel of the sky.
struct Texel {
    direction: Vec3,
    /// In nits.
    luminance: f32,
    solid_angle: f32,
}

/// Chooses in proportion to weights by a search in their sums.
struct Choice {
    sums: Vec<f32>,
}

impl Choice {
    fn new(weights: impl Iterator<Item = f32>) -> Self {
        let mut sum = 0.0;
        let sums = std::iter::once(0.0).chain(weights.map(|weight| {
            sum += weight;
            sum
        }));
        Self { sums: sums.collect() }
    }

    fn probability(&self, index: usize) -> f32 {
        (self.sums[index + 1] - self.sums[index]) / self.sums[self.sums.len() - 1]
    }

    fn choose(&self, u: f32) -> usize {
        let sum = u * self.sums[self.sums.len() - 1];
        (self.sums.partition_point(|before| *before <= sum) - 1).min(self.sums.len() - 2)
    }
}

impl Place {
    fn new(lit_by_sky: f32, sun: f32) -> Result<Self, SceneError> {
        let mut rng = Rng::new(45, 1);
        let mut at = || vec3(rng.range(-HALF, HALF), rng.range(4.0, 12.0), rng.range(-HALF, HALF));
        let lamps: Vec<Light> = (0..LAMPS).map(|_| Light::point(at(), Vec3::splat(100.0))).collect();
        let with_lamps = || -> Result<LightWorld, SceneError> {
            let mut world = LightWorld::new();
            let tree = world.add_tree(LightTree::new(lamps.clone())?);
            world.add_instance(tree, Placement::IDENTITY, Policy::Static)?;
            Ok(world)
        };
        let (mut both, lamps) = (with_lamps()?, with_lamps()?);
        let cloud = |d: Vec3| (1.0 + (7.0 * d.x + 3.0 * d.z).sin() * (5.0 * d.z).cos()) * d.y.max(0.0).sqrt();
        let toward_sun = vec3(0.5, 0.6, -0.62).normalize();
        let shape = |d: Vec3| cloud(d) + if d.dot(toward_sun) > 0.9996 { sun } else { 0.0 };
        // Clouds alone light the ground as much as the lamps do, or by the share of the scene.
        let ground = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
        let of_lamps: f32 = {
            let sampler = lamps.sampler();
            let arriving = sampler.all_lights().filter_map(|light| sampler.sample_light(&ground, light, [0.5; 2]));
            arriving.map(|incident| luminance(incident.radiance) * incident.direction.y).sum()
        };
        let texels_of = |scale: f32| {
            let height = WIDTH / 2;
            let texel = move |i: usize| {
                let row = i / WIDTH;
                let [phi, theta] = [
                    2.0 * PI * ((i % WIDTH) as f32 + 0.5) / WIDTH as f32 - PI,
                    PI * (row as f32 + 0.5) / height as f32,
                ];
                let direction = vec3(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                let ring = (PI * row as f32 / height as f32).cos() - (PI * (row + 1) as f32 / height as f32).cos();
                Texel { direction, luminance: scale * shape(direction), solid_angle: 2.0 * PI / WIDTH as f32 * ring }
            };
            (0..WIDTH * height).map(texel)
        };
        let of_clouds: f32 =
            texels_of(1.0).map(|texel| cloud(texel.direction) * texel.direction.y.max(0.0) * texel.solid_angle).sum();
        let scale = lit_by_sky * of_lamps / of_clouds;
        let map = Sky::from_fn(WIDTH, |direction| Vec3::splat(scale * shape(direction)));
        both.set_sky(map.map_err(|refused| SceneError(refused.to_string()))?);
        // What is stored, which is rounded.
        let sky = both.sky().map(|(_, sky)| sky.clone());
        let mut texels: Vec<Texel> = texels_of(scale).collect();
        for texel in &mut texels {
            texel.luminance = sky.as_ref().map_or(0.0, |sky| luminance(sky.radiance(texel.direction)));
        }
        let mean = texels.iter().map(|texel| texel.luminance * texel.solid_angle).sum::<f32>() / (4.0 * PI);
        let by_light = Choice::new(texels.iter().map(|texel| texel.luminance * texel.solid_angle));
        let above = |texel: &Texel| (texel.luminance - mean).max(0.0) * texel.solid_angle;
        let compensated = Choice::new(texels.iter().map(above));
        Ok(Self { both, lamps, texels, by_light, compensated })
    }

    /// The relative standard deviations of one sample of each of [`SAMPLERS`].
    fn sigmas(&self, at: &ShadingPoint) -> [f64; 3] {
        let (both, lamps) = (self.both.sampler(), self.lamps.sampler());
        let mut mean = 0.0;
        // Sums of f² / p; and for pbrt the mean of the part that its first ray finds.
        let [mut ours, mut halves, mut first, mut second, mut first_mean] = [0.0; 5];
        let sky = self.both.sky().map(|(key, _)| key);
        let is_patch = |light: &LightId| matches!(light, LightId::Local { instance, .. } if Some(*instance) == sky);
        let own_lamps = both.all_lights().filter(|light| !is_patch(light));
        for (light, alone) in own_lamps.zip(lamps.all_lights()) {
            let Some(incident) = lamps.sample_light(at, alone, [0.5; 2]) else { continue };
            let value = f64::from(luminance(incident.radiance) * incident.direction.dot(at.normal).max(0.0));
            if value > 0.0 {
                mean += value;
                ours += value * value / f64::from(both.pmf(at, light));
                let half = 0.5 * f64::from(lamps.pmf(at, alone));
                halves += value * value / half;
                first += value * value / half;
                first_mean += value;
            }
        }
        for (i, texel) in self.texels.iter().enumerate() {
            let cosine = texel.direction.dot(at.normal).max(0.0);
            let value = f64::from(texel.luminance * cosine * texel.solid_angle);
            if value <= 0.0 {
                continue;
            }
            mean += value;
            let seen = both.hit(at, texel.direction, f32::INFINITY);
            let density = seen.map_or(0.0, |seen| f64::from(seen.pmf) * f64::from(seen.incident.pdf));
            ours += value * value / (density * f64::from(texel.solid_angle));
            halves += value * value / (0.5 * f64::from(self.by_light.probability(i)));
            let light = 0.5 * f64::from(self.compensated.probability(i));
            let surface = f64::from(cosine * texel.solid_angle / PI);
            let weighted = value / (light + surface);
            first += light * weighted * weighted;
            second += surface * weighted * weighted;
            first_mean += light * weighted;
        }
        let second_mean = mean - first_mean;
        let pbrt = first - first_mean * first_mean + second - second_mean * second_mean;
        [ours - mean * mean, halves - mean * mean, pbrt].map(|variance| variance.max(0.0).sqrt() / mean)
    }

    /// A sample of one of [`SAMPLERS`].
    fn sample(&self, sampler: usize, samplers: &[LightSampler<'_>; 2], at: &ShadingPoint, u: &[f32; 6]) -> f32 {
        let arriving = |sampler: &LightSampler<'_>, u: [f32; 4]| {
            sampler.sample(at, u).map_or(0.0, |sample| {
                let cosine = sample.incident.direction.dot(at.normal).max(0.0);
                luminance(sample.incident.radiance) * cosine / (sample.pmf * sample.incident.pdf)
            })
        };
        let [both, lamps] = samplers;
        let of_texel = |i: usize, light: f32, surface: f32| {
            let texel = &self.texels[i];
            let value = texel.luminance * texel.direction.dot(at.normal).max(0.0) * texel.solid_angle;
            // A texel whose middle is below the horizon has no density either.
            if value > 0.0 { value / (light + surface) } else { 0.0 }
        };
        let of_surface = |i: usize| self.texels[i].direction.dot(at.normal).max(0.0) * self.texels[i].solid_angle / PI;
        let [choice, a, b, c, d, e] = *u;
        match sampler {
            0 => arriving(both, [a, b, c, d]),
            1 if choice < 0.5 => {
                let texel = self.by_light.choose(a);
                of_texel(texel, 0.5 * self.by_light.probability(texel), 0.0)
            }
            1 => 2.0 * arriving(lamps, [a, b, c, d]),
            _ => {
                let first = if choice < 0.5 {
                    let texel = self.compensated.choose(a);
                    of_texel(texel, 0.5 * self.compensated.probability(texel), of_surface(texel))
                } else {
                    2.0 * arriving(lamps, [a, b, c, d])
                };
                let texel = self.along_cosine(at, [d, e]);
                first + of_texel(texel, 0.5 * self.compensated.probability(texel), of_surface(texel))
            }
        }
    }

    /// The texel in a direction that is chosen in proportion to the cosine.
    fn along_cosine(&self, at: &ShadingPoint, u: [f32; 2]) -> usize {
        let (radius, (sin, cos)) = (u[0].sqrt(), (2.0 * PI * u[1]).sin_cos());
        let (x, y) = at.normal.any_orthonormal_pair();
        let d = x * (radius * cos) + y * (radius * sin) + at.normal * (1.0 - u[0]).sqrt();
        let column = ((d.z.atan2(d.x) / (2.0 * PI) + 0.5) * WIDTH as f32) as usize % WIDTH;
        let row = (d.y.clamp(-1.0, 1.0).acos() / PI * (WIDTH / 2) as f32) as usize;
        row.min(WIDTH / 2 - 1) * WIDTH + column
    }

    /// Nanoseconds of a sample of each of [`SAMPLERS`].
    fn nanoseconds(&self, points: &[ShadingPoint], effort: Effort) -> [f64; 3] {
        let (rounds, timed) = effort.select((ROUNDS, TIMED), (1, 50));
        let mut rng = Rng::new(8, 0);
        let inputs: Vec<_> = (0..timed).map(|i| (points[i % points.len()], [(); 6].map(|()| rng.unit()))).collect();
        let samplers = [self.both.sampler(), self.lamps.sampler()];
        let mut fastest = [f64::INFINITY; 3];
        for _ in 0..rounds {
            for (sampler, fastest) in fastest.iter_mut().enumerate() {
                let start = Instant::now();
                for (at, u) in &inputs {
                    black_box(self.sample(sampler, &samplers, at, u));
                }
                *fastest = fastest.min(start.elapsed().as_secs_f64() * 1.0e9 / timed as f64);
            }
        }
        fastest
    }
}

/// Points on the ground and on walls.
fn points(count: usize) -> Vec<ShadingPoint> {
    let mut rng = Rng::new(46, 2);
    let mut point = |i: usize| {
        let position = vec3(rng.range(-HALF, HALF), rng.range(0.0, 3.0), rng.range(-HALF, HALF));
        let (sin, cos) = (rng.unit() * 2.0 * PI).sin_cos();
        let wall = vec3(cos, 0.1, sin).normalize();
        ShadingPoint::surface(position, if i.is_multiple_of(2) { Vec3::Y } else { wall })
    };
    (0..count).map(&mut point).collect()
}

/// Measures all scenes, prints a table and writes it as CSV.
pub fn run(count: usize, effort: Effort, out: &Path) -> Result<(), SceneError> {
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&COLUMNS).trim_end());
    let mut add = |name: &str, what: &str, mut sigmas: Vec<f64>, rays: u32, ns: String| {
        sigmas.sort_by(f64::total_cmp);
        let mean = sigmas.iter().sum::<f64>() / sigmas.len() as f64;
        let p95 = sigmas[(sigmas.len() * 95 / 100).min(sigmas.len() - 1)];
        let [sigma, p95, equal] = [mean, p95, mean * f64::from(rays).sqrt()].map(short);
        let row = [name.to_owned(), what.to_owned(), sigma, p95, rays.to_string(), equal, ns];
        testbed::say!("| {} |", row.join(" | "));
        table.add(&row).map_err(SceneError)
    };
    let scenes = effort.select(&SCENES[..], &SCENES[..1]);
    let points = points(effort.select(count, 8));
    for (name, lit_by_sky, sun) in scenes {
        let place = Place::new(*lit_by_sky, *sun)?;
        let sigmas: Vec<[f64; 3]> = points.par_iter().map(|at| place.sigmas(at)).collect();
        let times = place.nanoseconds(&points, effort);
        for (sampler, what) in SAMPLERS.into_iter().enumerate() {
            let sigmas = sigmas.iter().map(|sigmas| sigmas[sampler]).collect();
            add(name, what, sigmas, if sampler == 2 { 2 } else { 1 }, format!("{:.0}", times[sampler]))?;
        }
    }
    for (name, what, sigmas) in window::measure(effort)? {
        add(name, &what, sigmas, 1, String::new())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exact_noise_is_that_of_samples_and_their_mean_is_the_light() {
        let place = Place::new(1.0, 200.0).expect("a valid scene");
        let samplers = [place.both.sampler(), place.lamps.sampler()];
        let mut rng = Rng::new(3, 3);
        for at in points(2) {
            let sigmas = place.sigmas(&at);
            let mut means = [0.0; 3];
            for sampler in 0..3 {
                let count = 300_000;
                let (mut sum, mut squares) = (0.0, 0.0);
                for _ in 0..count {
                    let u = [(); 6].map(|()| rng.unit());
                    let value = f64::from(place.sample(sampler, &samplers, &at, &u));
                    sum += value;
                    squares += value * value;
                }
                let mean = sum / f64::from(count);
                means[sampler] = mean;
                let sigma = (squares / f64::from(count) - mean * mean).sqrt() / mean;
                assert!((sigma / sigmas[sampler] - 1.0).abs() < 0.05, "{sampler}: {sigma} {}", sigmas[sampler]);
                // Four standard errors of both means; the grid of texels of `along_cosine` adds some thousandths.
                let error = 4.0 * 2.0_f64.sqrt() * sigma.max(sigmas[0]) / f64::from(count).sqrt() + 5.0e-3;
                assert!((mean / means[0] - 1.0).abs() < error, "{sampler}: {means:?}");
            }
        }
    }
}
