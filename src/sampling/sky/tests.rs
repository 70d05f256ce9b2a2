use std::f32::consts::PI;

use glam::{DVec3, Mat3, Vec3};

use crate::light::luminance;
use crate::sky::tests::cloudy;
use crate::tree::testing::Rng;
use crate::{
    CutOptions, CutTable, Gloss, InstanceKey, Light, LightId, LightSampler, LightTree, LightWorld, Placement, Policy,
    ShadingPoint, Sky, VisibilityTable,
};

const SIZE: [usize; 2] = [128, 64];

/// Lamps over the ground, under a sky.
fn world(lamps: usize, sky: &[Vec3]) -> (LightWorld, InstanceKey) {
    let mut rng = Rng(21);
    let mut world = LightWorld::new();
    for _ in 0..lamps.div_ceil(10) {
        let lights = (0..10).map(|_| Light::point(rng.position(2.0), Vec3::splat(4.0e5 * rng.unit()))).collect();
        let tree = world.add_tree(LightTree::new(lights).expect("sound lamps"));
        let at = rng.position(30.0) + Vec3::Y * 33.0;
        world.add_instance(tree, Placement::at(at.as_dvec3()), Policy::Static).expect("a placement");
    }
    let key = world.set_sky(Sky::equirectangular(SIZE[0], sky).expect("sound pixels"));
    (world, key)
}

fn turned(angle: f32) -> Placement {
    Placement { linear: Mat3::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), angle), ..Placement::at(DVec3::splat(1.0e4)) }
}

/// The directions of all texels in the world, and the solid angle and radiance of each.
pub(super) fn texels(world: &LightWorld) -> Vec<(Vec3, f32, Vec3)> {
    let (key, sky) = world.sky().expect("a sky");
    let linear = world.instance(key).expect("an instance").placement.linear;
    let [width, height] = sky.size();
    let mut all = Vec::new();
    for row in 0..height {
        let theta = |row: f32| PI * row / height as f32;
        let angle = 2.0 * PI / width as f32 * (theta(row as f32).cos() - theta(row as f32 + 1.0).cos());
        for column in 0..width {
            let phi = 2.0 * PI * ((column as f32 + 0.5) / width as f32 - 0.5);
            let (sin, cos) = theta(row as f32 + 0.5).sin_cos();
            let direction = Vec3::new(sin * phi.cos(), cos, sin * phi.sin());
            all.push((linear * direction, angle, sky.radiance(direction)));
        }
    }
    all
}

/// The illuminance by all lamps and the sky, as the sum over all of them.
fn exact(sampler: &LightSampler<'_>, at: &ShadingPoint, texels: &[(Vec3, f32, Vec3)], sky: InstanceKey) -> f64 {
    let cosine = |direction: Vec3| cosine(at, direction);
    let lamps = sampler.all_lights().filter(|light| !is_sky(*light, sky)).filter_map(|light| {
        let incident = sampler.sample_light(at, light, [0.5, 0.5])?;
        Some(f64::from(luminance(incident.radiance) * cosine(incident.direction) / incident.pdf))
    });
    let of_sky =
        texels.iter().map(|(direction, angle, radiance)| f64::from(luminance(*radiance) * angle * cosine(*direction)));
    lamps.sum::<f64>() + of_sky.sum::<f64>()
}

/// What light from a direction is multiplied by.
fn cosine(at: &ShadingPoint, direction: Vec3) -> f32 {
    if at.normal == Vec3::ZERO { 1.0 } else { at.normal.dot(direction).max(0.0) }
}

fn is_sky(light: LightId, sky: InstanceKey) -> bool {
    matches!(light, LightId::Local { instance, .. } if instance == sky)
}

/// Numbers that are spread evenly.
fn numbers(i: usize) -> [f32; 5] {
    const STEPS: [f64; 5] = [0.864_806, 0.747_890, 0.646_778, 0.559_339, 0.483_715];
    STEPS.map(|step| (0.5 + step * (i + 1) as f64).fract() as f32)
}

#[test]
fn means_are_the_sums_over_all_texels_and_lamps() {
    let (mut world, sky) = world(200, &cloudy(SIZE, 1));
    let gloss = Gloss { view: Vec3::new(0.3, 0.8, 0.1), roughness: 0.3, specular: 0.3, diffuse: 0.3 };
    let mut cuts = CutTable::new(CutOptions::new(0.5, 64).expect("sound").with_min_marks(1));
    for (turn, factor) in [(0.0, 1.0), (2.3, 0.25)] {
        world.move_instance(sky, turned(turn)).expect("a rotation");
        world.set_appearance(sky, |a| a.factor = Vec3::splat(factor)).expect("a factor");
        let mut texels = texels(&world);
        texels.iter_mut().for_each(|(_, _, radiance)| *radiance *= factor);
        let position = Vec3::new(3.0, 0.2, -2.0);
        let points = [
            ShadingPoint::surface(position, Vec3::Y),
            ShadingPoint::surface(position, Vec3::new(0.6, -0.8, 0.0)),
            ShadingPoint::surface(position, Vec3::Y).with_gloss(gloss),
            ShadingPoint::volume(position),
        ];
        for at in &points {
            world.sampler().with_cuts(&cuts).mark(at);
        }
        cuts.build(world.sampler());
        for at in points {
            let own = world.sampler();
            let exact = exact(&own, &at, &texels, sky);
            for (sampler, candidates) in
                [(own, 1), (own.with_splits(0), 1), (own.with_splits(7), 4), (own.with_cuts(&cuts), 1)]
            {
                let count = 40_000;
                let (mean, deviation) = moments(&sampler, &at, exact, count, candidates);
                // Three standard errors: one of 32 such tests fails by chance in one of twelve rounds of other numbers.
                let bound = 3.0 * deviation / f64::from(count).sqrt();
                assert!((mean - 1.0).abs() <= bound, "{at:?} {candidates:?}: {mean} {bound}");
                assert!(bound < 0.03, "{bound}");
            }
        }
    }
    // One more, to a standard error of 0.2 %.
    let at = ShadingPoint::surface(Vec3::new(-5.0, 0.2, 4.0), Vec3::new(0.28, 0.96, 0.0));
    let mut texels = texels(&world);
    texels.iter_mut().for_each(|(_, _, radiance)| *radiance *= 0.25);
    let (mean, deviation) = moments(&world.sampler(), &at, exact(&world.sampler(), &at, &texels, sky), 1_000_000, 1);
    assert!(deviation < 2.0 && (mean - 1.0).abs() < 0.006, "{mean} {deviation}");
}

/// The mean and the standard deviation of samples, relative to the sum over all lights.
fn moments(sampler: &LightSampler<'_>, at: &ShadingPoint, exact: f64, count: u32, candidates: u32) -> (f64, f64) {
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 0..count {
        let kept = sampler.reservoir_sample(at, &sampler.resample(at, numbers(i as usize), candidates));
        let light = kept.map_or(0.0, |kept| {
            let incident = kept.incident;
            let cosine = if at.normal == Vec3::ZERO { 1.0 } else { at.normal.dot(incident.direction) };
            f64::from(luminance(incident.radiance) * cosine / (kept.pmf * incident.pdf)) / exact
        });
        sum += light;
        squares += light * light;
    }
    let mean = sum / f64::from(count);
    (mean, (squares / f64::from(count) - mean * mean).max(0.0).sqrt())
}

#[test]
fn probabilities_of_all_patches_and_lamps_add_up_to_one() {
    let (mut world, sky) = world(100, &cloudy(SIZE, 2));
    world.move_instance(sky, turned(1.0)).expect("a rotation");
    let (mut pmfs, mut rng, mut all) = (Vec::new(), Rng(3), 0.0);
    for _ in 0..50 {
        let at = ShadingPoint::surface(rng.position(20.0), rng.position(1.0).normalize());
        let sampler = world.sampler();
        sampler.distribution(&at, &mut pmfs);
        let sum: f64 = pmfs.iter().map(|pmf| f64::from(*pmf)).sum();
        // What is left leads below the horizon, most where a sun is just below it.
        assert!((0.7..1.0001).contains(&sum), "{sum}");
        all += sum;
        for (light, pmf) in sampler.all_lights().zip(&pmfs).step_by(7) {
            assert!((sampler.pmf(&at, light) - pmf).abs() <= 1.0e-4 * pmf, "{light:?}");
        }
        for i in 0..20 {
            if let Some(pick) = sampler.pick(&at, [numbers(i)[0], numbers(i)[1]]) {
                assert!((sampler.pmf(&at, pick.light) / pick.pmf - 1.0).abs() < 1.0e-4);
            }
        }
    }
    assert!(all > 0.97 * 50.0, "{all}");
}

#[test]
fn each_texel_above_the_horizon_can_be_chosen_and_rays_find_what_sampling_returns() {
    let (mut world, sky) = world(50, &cloudy(SIZE, 4));
    let mut rng = Rng(5);
    for _ in 0..20 {
        world.move_instance(sky, turned(6.0 * rng.unit())).expect("a rotation");
        let at = ShadingPoint::surface(rng.position(20.0), rng.position(1.0).normalize());
        let sampler = world.sampler();
        for (direction, _, radiance) in texels(&world).into_iter().step_by(3) {
            let found = sampler.hit(&at, direction, f32::INFINITY);
            if at.normal.dot(direction) <= 1.0e-4 || radiance == Vec3::ZERO {
                continue;
            }
            let found = found.expect("the sky, or a lamp before it");
            assert!(found.pmf > 0.0 && found.incident.pdf > 0.0);
            if is_sky(found.light, sky) {
                assert!(found.incident.dist == f32::INFINITY && found.incident.radiance == radiance);
                let pdf = sampler.pdf(&at, found.light, at.position + direction * 7.0);
                // The point has rounded.
                assert!((pdf / (found.pmf * found.incident.pdf) - 1.0).abs() < 1.0e-3, "{pdf}");
            }
            assert!(sampler.hit(&at, direction, 1.0e6).is_none_or(|found| !is_sky(found.light, sky)));
        }
        let mut differ = 0;
        for i in 0..300 {
            let Some(sample) = sampler.sample(&at, numbers(i)[..4].try_into().expect("four")) else { continue };
            if is_sky(sample.light, sky) {
                let found = sampler.hit(&at, sample.incident.direction, f32::INFINITY).expect("it is there");
                // Lamps stand before it, and borders of texels belong to either.
                let is_same = (found.incident.pdf / sample.incident.pdf - 1.0).abs() < 1.0e-5;
                differ += usize::from(found.light != sample.light || !is_same);
            }
        }
        assert!(differ <= 12, "{differ}");
    }
}

#[test]
fn a_stretched_or_mirrored_sky_keeps_the_light_of_each_direction() {
    let (mut world, sky) = world(0, &vec![Vec3::splat(100.0); SIZE[0] * SIZE[1]]);
    for linear in [
        Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)),
        Mat3::from_diagonal(Vec3::new(3.0, 0.5, 1.0)),
        Mat3::from_axis_angle(Vec3::X, 1.0) * Mat3::from_diagonal(Vec3::new(0.2, 1.0, 1.0)),
    ] {
        world.move_instance(sky, Placement { linear, ..Placement::IDENTITY }).expect("a placement");
        let at = ShadingPoint::surface(Vec3::ZERO, Vec3::new(0.0, 0.6, 0.8));
        let mut lux = 0.0;
        let count = 20_000;
        for i in 0..count {
            if let Some(sample) = world.sampler().sample(&at, numbers(i)[..4].try_into().expect("four")) {
                let cosine = at.normal.dot(sample.incident.direction);
                lux += luminance(sample.incident.radiance) * cosine / (sample.pmf * sample.incident.pdf);
            }
        }
        // Sigma is at most 1.5, so this is four standard errors of even numbers.
        assert!((lux / count as f32 / (100.0 * PI) - 1.0).abs() < 0.04, "{linear}: {}", lux / count as f32);
    }
    // A flat one is hidden.
    let flat = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 0.0, 1.0)), ..Placement::IDENTITY };
    world.move_instance(sky, flat).expect("a placement");
    assert!(world.sampler().sample(&ShadingPoint::volume(Vec3::ZERO), [0.5; 4]).is_none());
}

#[test]
fn the_sky_can_be_masked_darkened_replaced_and_removed() {
    let (mut world, sky) = world(20, &cloudy(SIZE, 6));
    let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let share = |world: &LightWorld, at: &ShadingPoint| -> f32 {
        let sampler = world.sampler();
        sampler.all_lights().filter(|light| is_sky(*light, sky)).map(|light| sampler.pmf(at, light)).sum()
    };
    let all = share(&world, &at);
    assert!((0.05..0.999).contains(&all), "{all}");
    world.set_appearance(sky, |a| a.factor = Vec3::splat(0.1)).expect("a factor");
    let dim = share(&world, &at);
    assert!((dim / (0.1 * all / (0.1 * all + 1.0 - all)) - 1.0).abs() < 0.1, "{all} {dim}");
    world.set_appearance(sky, |a| a.mask = 2).expect("an instance");
    assert_eq!(share(&world, &at.with_mask(1)), 0.0);
    assert!(world.sampler().hit(&at.with_mask(1), Vec3::Y, f32::INFINITY).is_none());
    assert!((share(&world, &at.with_mask(2)) / dim - 1.0).abs() < 0.05);
    world.set_appearance(sky, |a| a.mask = u32::MAX).expect("an instance");
    world.set_appearance(sky, |a| a.is_enabled = false).expect("an instance");
    assert_eq!(share(&world, &at), 0.0);
    world.set_appearance(sky, |a| a.is_enabled = true).expect("an instance");

    let bright = vec![Vec3::splat(1.0e7); SIZE[0] * SIZE[1]];
    assert_eq!(world.set_sky(Sky::equirectangular(SIZE[0], &bright).expect("sound pixels")), sky);
    assert!(share(&world, &at) > 0.99);
    let black = vec![Vec3::ZERO; SIZE[0] * SIZE[1]];
    world.set_sky_part([0, 0], SIZE, &black).expect("the whole map");
    assert_eq!(share(&world, &at), 0.0);
    world.set_sky_part([5, 3], [1, 1], &[Vec3::splat(1.0e9)]).expect("a texel");
    assert!(share(&world, &at) > 0.0);
    assert!(world.set_sky_part([0, 0], [1, 1], &[Vec3::NAN]).is_err());

    world.remove_instance(sky).expect("an instance");
    assert!(world.sky().is_none() && world.set_sky_part([0, 0], [0, 0], &[]).is_err());
    assert!(world.sampler().sample(&at, [0.5; 4]).is_some_and(|sample| !is_sky(sample.light, sky)));
    let other = world.set_sky(Sky::equirectangular(1, &[Vec3::ONE]).expect("a pixel"));
    assert!(other != sky && world.sampler().hit(&at, Vec3::Y, f32::INFINITY).is_some());
}

#[test]
fn a_segment_gathers_the_sky_along_all_of_it() {
    let (world, _) = world(0, &vec![Vec3::splat(100.0); SIZE[0] * SIZE[1]]);
    let segment = ShadingPoint::segment(Vec3::ZERO, Vec3::X, 5.0);
    let count = 4000;
    let (mut sum, mut along) = (0.0, 0.0);
    for i in 0..count {
        let sample = world.sampler().sample(&segment, numbers(i)[..4].try_into().expect("four")).expect("lit");
        sum += luminance(sample.incident.radiance) / (sample.pmf * sample.incident.pdf) / count as f32;
        along += sample.incident.along / count as f32;
    }
    assert!((sum / (100.0 * 4.0 * PI * 5.0) - 1.0).abs() < 0.02, "{sum}");
    assert!((along - 2.5).abs() < 0.1, "{along}");
}

#[test]
fn shadow_rays_teach_where_the_sky_is_hidden() {
    let (world, sky) = world(50, &cloudy(SIZE, 8));
    let at = ShadingPoint::surface(Vec3::new(0.5, 0.0, 0.5), Vec3::Y);
    let mut table = VisibilityTable::default();
    let share = |table: &VisibilityTable| -> f32 {
        let sampler = world.sampler().with_visibility(table);
        sampler.all_lights().filter(|light| is_sky(*light, sky)).map(|light| sampler.pmf(&at, light)).sum()
    };
    let before = share(&table);
    for frame in 0..20 {
        for i in 0..64 {
            let sampler = world.sampler().with_visibility(&table);
            let Some(sample) = sampler.sample(&at, numbers(64 * frame + i)[..4].try_into().expect("four")) else {
                continue;
            };
            sampler.record_visibility(&at, &sample, !is_sky(sample.light, sky));
        }
        table.end_frame();
    }
    let after = share(&table);
    assert!(before > 0.1 && after < 0.3 * before, "{before} {after}");
}

/// The exact relative standard deviation of one sample of a matte point, without shadows: the root of
/// sum(f² / p) / sum(f)² - 1 over all lamps and texels.
fn sigma(world: &LightWorld, at: &ShadingPoint) -> f64 {
    let sampler = world.sampler();
    let (mut sum, mut squares) = (0.0, 0.0);
    let mut add = |light: f64, probability: f64| {
        if light > 0.0 {
            sum += light;
            squares += light * light / probability;
        }
    };
    let mut pmfs = Vec::new();
    sampler.distribution(at, &mut pmfs);
    let mut of_patches = std::collections::HashMap::new();
    let sky = world.sky().map(|(key, _)| key);
    for (light, pmf) in sampler.all_lights().zip(&pmfs) {
        if sky.is_some_and(|sky| is_sky(light, sky)) {
            of_patches.insert(light, f64::from(*pmf));
        } else if let Some(incident) = sampler.sample_light(at, light, [0.5; 2]) {
            let lux = luminance(incident.radiance) * cosine(at, incident.direction);
            add(f64::from(lux), f64::from(*pmf));
        }
    }
    if let Some((key, map)) = world.sky() {
        for (direction, angle, radiance) in texels(world) {
            let Some((patch, point)) = map.point(direction) else { continue };
            let probability =
                of_patches[&LightId::Local { instance: key, light: patch }] * f64::from(point.pdf * angle);
            add(f64::from(luminance(radiance) * angle * cosine(at, direction)), probability);
        }
    }
    (squares / (sum * sum) - 1.0).max(0.0).sqrt()
}

#[test]
fn a_white_sky_has_no_noise_but_that_of_the_cosine() {
    for width in [16, 64, 128] {
        let mut world = LightWorld::new();
        world.set_sky(Sky::from_fn(width, |_| Vec3::splat(100.0)).expect("a map"));
        let mean = |normal: fn(&mut Rng) -> Vec3| {
            let mut rng = Rng(32);
            let sigmas = (0..20).map(|_| sigma(&world, &ShadingPoint::surface(rng.position(9.0), normal(&mut rng))));
            sigmas.sum::<f64>() / 20.0
        };
        // Each patch sends its share everywhere. What is left is the rounding of fluxes.
        let volume = mean(|_| Vec3::ZERO);
        assert!(volume < 0.04, "{width}: {volume} in a volume");
        // Texels of a patch are chosen without the cosine, and coarse maps have coarse patches.
        let surface = mean(|rng| rng.position(1.0).normalize());
        let most = if width == 16 { 0.4 } else { 0.23 };
        assert!(surface < most, "{width}: {surface} at surfaces");
    }
}

#[test]
fn a_sky_beside_lamps_adds_little_noise_to_either_alone() {
    // A sun a thousand times as bright as a sky that fades toward the horizon.
    let mut pixels: Vec<Vec3> =
        (0..SIZE[0] * SIZE[1]).map(|i| Vec3::splat(1000.0 / (1.0 + (i / SIZE[0]) as f32 / 10.0))).collect();
    pixels[SIZE[0] * 12 + 40] = Vec3::splat(1.0e6);
    let (both, key) = world(2000, &pixels);
    let (lamps, sky_of_lamps) = world(2000, &pixels);
    let mut lamps = lamps;
    lamps.remove_instance(sky_of_lamps).expect("it lives");
    let (sky, _) = world(0, &pixels);
    assert!(both.sky().is_some_and(|(sky, _)| sky == key));
    let mut rng = Rng(31);
    let mut sums = [0.0; 3];
    for _ in 0..50 {
        let normal = (Vec3::Y + 0.8 * rng.position(1.0)).normalize();
        let at = ShadingPoint::surface(rng.position(25.0) * Vec3::new(1.0, 0.02, 1.0), normal);
        let all = [&both, &sky, &lamps].map(|world| sigma(world, &at));
        sums.iter_mut().zip(all).for_each(|(sum, sigma)| *sum += sigma / 50.0);
    }
    let [both, sky, lamps] = sums;
    // 0.128, 0.111 and 0.105.
    assert!(both <= 1.3 * sky.min(lamps), "{both} {sky} {lamps}");
}
