//! Random lights, shading points and worlds for tests and benches.

pub use crate::common::split_mix::Rng;
use girandole::glam::{Affine3A, Mat3, Quat, Vec3};
use girandole::{
    Appearance, DirectionalLight, InstanceKey, Light, LightId, LightSampler, LightTree, LightWorld, Placement, Policy,
    ShadingPoint, TreeKey,
};

impl Rng {
    /// A random unit vector.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            if v.length_squared() > 1e-3 && v.length_squared() < 1.0 {
                return v.normalize();
            }
        }
    }

    /// A light of any shape, in the cube from `-size` to `size`, with emission over six decades.
    /// One in eight has a range.
    pub fn light(&mut self, size: f32) -> Light {
        let place = self.position(size);
        let emission = Vec3::new(self.unit(), self.unit(), self.unit()) * 10.0_f32.powf(self.between(-3.0, 3.0));
        let (u, v) = (self.direction() * self.between(0.05, 0.5), self.direction() * self.between(0.05, 0.5));
        let light = match self.bits() % 6 {
            0 => Light::point(place, emission),
            1 => {
                let outer = self.between(0.05, 3.0);
                Light::spot(place, self.direction(), outer * self.unit(), outer, emission)
            }
            2 => Light::rectangle(place, u, v, emission),
            3 => Light::triangle([place, place + u, place + v], emission),
            4 => Light::triangle([place, place + u, place + v], emission).two_sided(),
            _ => Light::sphere(place, self.between(0.01, 0.3), emission),
        };
        if self.bits().is_multiple_of(8) { light.with_range(self.between(1.0, 3.0 * size)) } else { light }
    }

    /// Several such lights.
    pub fn lights(&mut self, count: usize, size: f32) -> Vec<Light> {
        (0..count).map(|_| self.light(size)).collect()
    }

    /// A shading point in the cube from `-size` to `size`. One in five is in a volume, the others
    /// are on surfaces.
    pub fn shading_point(&mut self, size: f32) -> ShadingPoint {
        let position = self.position(size);
        if self.bits().is_multiple_of(5) {
            ShadingPoint::volume(position)
        } else {
            ShadingPoint::surface(position, self.direction())
        }
    }

    /// Such a shading point, half of them with another mask than that of all bits.
    pub fn masked_point(&mut self, size: f32) -> ShadingPoint {
        let mask = [0b01, 0b10, 1 << 31 | 0b10, 0].get(self.bits() as usize % 8).copied();
        self.shading_point(size).with_mask(mask.unwrap_or(u32::MAX))
    }

    /// A rotation and translation, with one of: no scale, uniform scale, mirroring, non-uniform
    /// scale, shear.
    pub fn affine(&mut self, size: f32) -> Affine3A {
        let turn = Mat3::from_quat(Quat::from_axis_angle(self.direction(), self.between(0.0, 6.0)));
        let shape = match self.bits() % 5 {
            0 => Mat3::IDENTITY,
            1 => Mat3::from_diagonal(Vec3::splat(self.between(0.2, 4.0))),
            2 => Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)),
            3 => Mat3::from_diagonal(Vec3::new(self.between(0.3, 3.0), self.between(0.3, 3.0), self.between(0.3, 3.0))),
            _ => Mat3::from_cols(Vec3::X, Vec3::new(self.between(-1.0, 1.0), 1.0, 0.0), Vec3::Z),
        };
        Affine3A::from_mat3_translation(turn * shape, self.position(size))
    }

    /// A world with several instances of several trees, under all kinds of transforms, and two
    /// directional lights.
    pub fn world(&mut self, trees: usize, lights: usize, instances: usize, size: f32) -> LightWorld {
        let mut world = LightWorld::new();
        for _ in 0..trees {
            let tree =
                world.add_tree(LightTree::new(self.lights(lights, 0.1 * size)).expect("random lights are valid"));
            for _ in 0..instances {
                world.add_instance(tree, self.affine(size), Policy::Budgeted).expect("random placements are valid");
            }
        }
        for _ in 0..2 {
            let light = DirectionalLight { direction: self.direction(), illuminance: Vec3::splat(0.2) };
            world.add_directional(light).expect("a valid light");
        }
        world
    }

    /// The same, where some instances are disabled, some have factors or masks, and all have user
    /// data.
    pub fn varied_world(&mut self, trees: usize, lights: usize, instances: usize, size: f32) -> LightWorld {
        let mut world = self.world(trees, lights, instances, size);
        vary(&mut world);
        world
    }
}

/// Disables one of eight instances, never the first, and gives all of them user data. Every third
/// gets a factor over four decades, and one of sixteen the factor 0. Half of them have masks of few
/// bits, and some of none.
pub fn vary(world: &mut LightWorld) {
    let keys: Vec<InstanceKey> = world.instances().collect();
    for (i, key) in (0..).zip(keys) {
        let mut rng = Rng(i);
        let factor = match i % 48 {
            7 | 23 | 39 => Vec3::ZERO,
            i if i % 3 == 1 => (rng.position(0.5) + 0.5) * 10.0_f32.powf(rng.between(-2.0, 2.0)),
            _ => Vec3::ONE,
        };
        let mask = [u32::MAX, 0b01, 0b10, 1 << 31, u32::MAX, 0b11, u32::MAX, 0b100][i as usize % 8];
        let mask = if i % 16 == 14 { 0 } else { mask };
        let user_data = user_data_of(world, key);
        let appearance = Appearance { is_enabled: i % 8 != 5, factor, mask, user_data };
        world.set_appearance(key, |present| *present = appearance).expect("a valid factor");
    }
}

/// The user data that [`vary`] gives to an instance.
pub fn user_data_of(world: &LightWorld, instance: InstanceKey) -> u32 {
    world.slot(instance).expect("a live key").wrapping_mul(0x9e37_79b9)
}

/// A world of one tree in one instance, which is where its lights are.
pub fn world_of(lights: Vec<Light>, policy: Policy) -> (LightWorld, TreeKey, InstanceKey) {
    let mut world = LightWorld::new();
    let (tree, instance) = place_tree(&mut world, lights, Placement::IDENTITY, policy);
    (world, tree, instance)
}

/// Adds a tree with one instance.
pub fn place_tree(
    world: &mut LightWorld,
    lights: Vec<Light>,
    at: impl Into<Placement>,
    policy: Policy,
) -> (TreeKey, InstanceKey) {
    let tree = world.add_tree(LightTree::new(lights).expect("valid lights"));
    (tree, world.add_instance(tree, at, policy).expect("a valid placement"))
}

/// The mean of a random value over some draws, and its standard error.
pub fn mean(draws: u32, mut value: impl FnMut() -> f64) -> [f64; 2] {
    let (mut sum, mut squares, n) = (0.0, 0.0, f64::from(draws));
    for _ in 0..draws {
        let value = value();
        sum += value;
        squares += value * value;
    }
    [sum / n, ((squares / n - (sum / n).powi(2)).max(0.0) / n).sqrt()]
}

/// The rounds of a long test over random scenes: all of them if the variable `GIRANDOLE_THOROUGH` is set,
/// as in `scripts/test-all.sh`, and the first quarter for each change.
pub fn rounds(all: u64) -> u64 {
    if std::env::var_os("GIRANDOLE_THOROUGH").is_some() { all } else { all.div_ceil(4) }
}

/// The numbers of splits that tests of probabilities run with: none, and the default.
pub const SPLITS: [usize; 2] = [0, 6];

/// Every light of a world with its probability at a shading point.
pub fn all_pmfs(sampler: &LightSampler, shading_point: &ShadingPoint) -> Vec<(LightId, f32)> {
    sampler.all_lights().map(|light| (light, sampler.pmf(shading_point, light))).collect()
}

/// The probabilities of all lights in one pass.
pub fn distribution(sampler: &LightSampler, at: &ShadingPoint) -> Vec<f32> {
    let mut pmfs = Vec::new();
    sampler.distribution(at, &mut pmfs);
    pmfs
}

/// Checks that the probabilities of all lights at a shading point are those of `distribution` and of
/// picks, that they add up to the share of random numbers that pick a light, and that every light
/// that contributes has one.
pub fn assert_probabilities(sampler: &LightSampler, at: &ShadingPoint, draws: u32, rng: &mut Rng) {
    let mut sum = 0.0;
    for ((light, pmf), same) in all_pmfs(sampler, at).into_iter().zip(distribution(sampler, at)) {
        // Below the last summand the floors that keep a probability from rounding to 0 may apply in another order.
        assert!((pmf - same).abs() <= 1.0e-5 * pmf + 1.0e-28, "{light:?} {pmf} {same} at {at:?}");
        assert_eq!(pmf > 0.0, same > 0.0, "{light:?} at {at:?}");
        sum += f64::from(pmf);
        let contributes = (0..4).any(|_| sampler.sample_light(at, light, [rng.unit(); 2]).is_some());
        assert!(pmf > 0.0 || !contributes, "{light:?} is never chosen at {at:?}");
    }
    // The rest is the probability that no light is chosen.
    assert!(sum <= 1.0 + 1.0e-4, "{sum}");
    let mut misses = 0;
    for i in 0..draws {
        let Some(pick) = sampler.pick(at, [(i as f32 + 0.5) / draws as f32, rng.unit()]) else {
            misses += 1;
            continue;
        };
        let pmf = sampler.pmf(at, pick.light);
        assert!(pick.pmf > 0.0 && (pick.pmf - pmf).abs() <= 1.0e-4 * pmf, "{pick:?} {pmf} at {at:?}");
    }
    // Six standard deviations: one false alarm in a billion comparisons.
    let expected = 1.0 - sum.min(1.0);
    let deviation = (expected * (1.0 - expected) / f64::from(draws)).sqrt();
    let share = f64::from(misses) / f64::from(draws);
    assert!((share - expected).abs() <= 6.0 * deviation + 1.0e-3, "{share} {expected}");
}

/// Checks that the frequencies of all lights among some draws are their probabilities.
pub fn assert_frequencies(sampler: &LightSampler, at: &ShadingPoint, draws: usize, rng: &mut Rng) {
    let pmfs = all_pmfs(sampler, at);
    let mut counts = vec![0_u32; pmfs.len()];
    for _ in 0..draws {
        if let Some(pick) = sampler.pick(at, [rng.unit(), rng.unit()]) {
            counts[pmfs.iter().position(|(light, _)| *light == pick.light).expect("a light")] += 1;
        }
    }
    let (mut chi_sq, mut cells) = (0.0, 0.0);
    for ((_, pmf), count) in pmfs.iter().zip(counts) {
        let mean = f64::from(*pmf) * draws as f64;
        if mean >= 5.0 {
            chi_sq += (f64::from(count) - mean).powi(2) / mean;
            cells += 1.0;
        }
        // Six standard deviations and six counts: a false alarm in less than one of 10^6 runs.
        assert!((f64::from(count) - mean).abs() <= 6.0 * mean.sqrt() + 6.0, "{count} of {mean} at {at:?}");
    }
    // A false alarm in less than one of 10^4 comparisons: 7e-5 for a single cell of five expected draws, whose tail is
    // heavier than that of chi squared, and less for more or larger cells.
    assert!(chi_sq < cells + 5.0 * (2.0_f64 * cells).sqrt() + 15.0, "{chi_sq} over {cells} at {at:?}");
}
