//! The scenes that are hard for a choice of lights, and the exact light by which they are judged.

use girandole::glam::Vec3;
use girandole::{Gloss, Incident, Light, LightId, Policy, ShadingPoint, Shape};
use testbed::measuring::irradiance::irradiance;
use testbed::measuring::lights::{carried, reflections};
use testbed::measuring::reflection::{brdf, reflection};
use testbed::measuring::samplers::{self, Chooser};
use testbed::measuring::torture::cuts::TOWN;
use testbed::measuring::torture::table::{TortureRow, rows};
use testbed::measuring::torture::{TortureScene, cliffs, scenes};
use testbed::testing::support::{Rng, mean, world_of};

/// The goals: sigma relative to the least of other samplers, and to one tree over the same lights.
const OF_OTHERS: f64 = 0.6;
/// See [`OF_OTHERS`].
const OF_FLAT: f64 = 1.5;
/// The most that sigma with shared cuts may be, relative to that without. Measured: 0.2 to 1.0, where there is
/// noise.
const OF_NO_CELLS: f64 = 1.05;

/// The scenes that do not reach both goals, and the most that sigma may be there: 5 to 10 % above
/// what was measured.
const MISSED: [(&str, f64); 10] = [
    ("scales from 0.001 to 1", 0.58),
    ("sheared spots", 3.0),
    ("squashed by 0.9 over a turn", 0.33),
    ("squashed by 0.5 over a turn", 0.48),
    ("squashed by 0.1 over a turn", 0.74),
    ("cars", 2.05),
    ("on a glowing ball", 1.78),
    ("inside a sphere light", 4.8),
    ("dense clusters far apart", 1.35),
    ("metal floor", 1.37),
];
/// Below this sigma the ratios do not matter: the lights of others than the sampler decide the
/// noise.
const NO_NOISE: f64 = 0.2;

#[test]
fn no_scene_is_a_cliff_but_those_that_are_known() {
    for scene in scenes() {
        let rows = rows(&scene, false).expect("valid lights");
        let [others @ .., two, flat, shared] = &rows[..] else { panic!("rows are missing") };
        assert_eq!((others.len(), two.sampler, flat.sampler), (7, "girandole", "girandole flat"));
        let sigma = |row: &TortureRow| row.sigma.mean;
        // The last one has the nodes and the splits of this library.
        let published = others.iter().filter(|row| row.sampler != "sg tree, wide");
        let other = published.map(sigma).fold(f64::INFINITY, f64::min);
        let ratios = (sigma(two) / other, sigma(two) / sigma(flat));
        let of_shared = sigma(shared) / sigma(two);
        assert!(of_shared <= OF_NO_CELLS || sigma(shared) < NO_NOISE, "{}: shared cuts: {of_shared}", scene.name);
        let unreached = [two, flat, shared].map(|row| row.sigma.unreached);
        assert!(unreached == [0; 3], "{}: lights are never chosen", scene.name);
        match MISSED.iter().find(|(name, _)| *name == scene.name) {
            Some((name, most)) => assert!(sigma(two) <= *most, "{name}: {}", sigma(two)),
            None => {
                assert!(ratios.0 <= OF_OTHERS, "{}: {ratios:?} of {other}", scene.name);
                assert!(ratios.1 <= OF_FLAT || sigma(two) < NO_NOISE, "{}: {ratios:?}", scene.name);
            }
        }
    }
}

/// Sigma below this is noise of rounding, and counts as this.
const RESOLVED: f64 = 0.01;

/// The most that sigma by one tree may be where two levels are compared with it. Measured: 1.81.
const MOST_OF_FLAT: f64 = 2.0;

/// The goal of [`OF_FLAT`] for scenes that once were cliffs: all but these. The values are
/// sigma relative to one tree as measured.
const MISSED_CLIFFS: [(&str, f64); 2] =
    [("one tree at scales from 0.01 to 1", 1.61), ("eight instances from 17 m to 1.4e8 m", 13_200.0)];

#[test]
fn scenes_that_once_were_cliffs_are_none_but_those_that_are_known() {
    for scene in cliffs::scenes() {
        let [two, flat] = two_and_flat(&scene);
        let ratio = two / flat.max(RESOLVED);
        assert!(flat <= MOST_OF_FLAT, "{}: {flat} by one tree", scene.name);
        match MISSED_CLIFFS.iter().find(|(name, _)| *name == scene.name) {
            // One that reaches the goal leaves the list.
            Some((name, most)) => assert!((OF_FLAT..=1.1 * most).contains(&ratio), "{name}: {ratio}"),
            None => assert!(ratio <= OF_FLAT || two < NO_NOISE, "{}: {ratio}, {two}", scene.name),
        }
    }
}

/// The mean sigma of a scene in two levels, and by one tree over the same lights.
fn two_and_flat(scene: &TortureScene) -> [f64; 2] {
    let lights = carried(&scene.world);
    let ids: Vec<LightId> = scene.world.sampler().all_lights().collect();
    let lux: Vec<Vec<f32>> = scene.shading_points.iter().map(|at| reflections(&lights, at)).collect();
    let sigma = |chooser: &Chooser<'_>| samplers::noise(chooser, &scene.shading_points, &lux).0.mean;
    let flat = samplers::flat(&lights, &ids).expect("valid lights");
    [&samplers::two_level(&scene.world), &flat].map(sigma)
}

/// The most that sigma of a town may be, relative to one tree without a top level, however its lights
/// are cut into trees. Measured: 0.96 to 1.18.
const OF_CUTS: f64 = 1.25;

#[test]
fn quality_does_not_depend_on_how_a_town_is_cut() {
    let scenes = scenes();
    let towns: Vec<_> = scenes.iter().filter(|scene| TOWN.contains(&&*scene.name)).collect();
    assert_eq!(towns.len(), TOWN.len());
    for scene in towns {
        let [two, flat] = two_and_flat(scene);
        assert!(two <= OF_CUTS * flat, "{}: {two} {flat}", scene.name);
    }
}

/// The mean of a value over 4,000 points of a light, and its standard error.
fn of_points(light: Light, at: &ShadingPoint, rng: &mut Rng, value: impl Fn(&Incident) -> f64) -> [f64; 2] {
    let (world, _, instance) = world_of(vec![light], Policy::Static);
    let (sampler, id) = (world.sampler(), LightId::Local { instance, light: 0 });
    let sent = |u| sampler.sample_light(at, id, u).map_or(0.0, |incident| value(&incident));
    mean(4000, || sent([rng.unit(), rng.unit()]))
}

/// The illuminance that one point estimates, in lux.
fn lux(at: &ShadingPoint, incident: &Incident) -> f64 {
    let cosine = if at.normal == Vec3::ZERO { 1.0 } else { at.normal.dot(incident.direction).max(0.0) };
    f64::from(girandole::light::luminance(incident.radiance) * cosine / incident.pdf)
}

#[test]
fn illuminances_are_the_means_of_sampled_points() {
    let mut rng = Rng(91);
    let mut compared = 0;
    for light in rng.lights(60, 4.0).into_iter().map(|light| light.with_range(f32::INFINITY)) {
        for normal in [Vec3::ZERO, rng.direction(), rng.direction()] {
            let at = ShadingPoint::surface(rng.position(9.0), normal);
            let [mean, error] = of_points(light, &at, &mut rng, |incident| lux(&at, incident));
            let exact = irradiance(&light, &at);
            compared += u32::from(exact > 0.0);
            // Five standard errors and rounding: a false alarm in less than one of 10,000 runs.
            assert!((mean - exact).abs() <= 5.0 * error + 1.0e-4 * exact, "{light:?} {at:?}: {mean} {exact} {error}");
        }
    }
    assert!(compared > 60, "only {compared} lights shine on their shading points");
}

#[test]
fn reflections_are_the_means_of_sampled_points() {
    let mut rng = Rng(92);
    let mut compared = 0;
    let is_flat = |light: &Light| !matches!(light.shape, Shape::Sphere { .. });
    for light in rng.lights(60, 4.0).into_iter().filter(is_flat) {
        let (light, normal) = (light.with_range(f32::INFINITY), rng.direction());
        let view = normal + rng.direction() * 0.9;
        let gloss = Gloss { view, roughness: rng.between(0.2, 1.0), specular: 0.3, diffuse: 0.1 };
        let at = ShadingPoint::surface(rng.position(9.0), normal).with_gloss(gloss);
        let [mean, error] = of_points(light, &at, &mut rng, |incident| {
            brdf(&gloss, &at, incident.direction.as_dvec3()) * lux(&at, incident)
        });
        let exact = reflection(&light, &at);
        compared += u32::from(exact > 0.0);
        // Five standard errors: a false alarm in less than one of 10,000 runs. Pieces are as large
        // as half the width of a lobe, which costs 2 %.
        assert!((mean - exact).abs() <= 5.0 * error + 0.02 * exact, "{light:?} {at:?}: {mean} {exact} {error}");
    }
    assert!(compared > 15, "only {compared} lights shine on their shading points");
}
