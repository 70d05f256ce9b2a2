//! Random lights and shading points that several tests use.

use girandole::glam::{Affine3A, Mat3, Quat, Vec3};
use girandole::{DirectionalLight, Light, LightId, LightSampler, LightWorld, Policy, ShadingPoint, SplitCount};

/// A small random number generator (SplitMix64), so that every test has its own fixed stream.
pub struct Rng(pub u64);

impl Rng {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1), with 24 bits.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            if v.length_squared() > 1e-3 && v.length_squared() < 1.0 {
                return v.normalize();
            }
        }
    }

    pub fn place(&mut self, size: f32) -> Vec3 {
        Vec3::new(self.between(-size, size), self.between(-size, size), self.between(-size, size))
    }

    /// A light of any kind within `size` of the origin, its emission over six decades.
    pub fn light(&mut self, size: f32) -> Light {
        let place = self.place(size);
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

    pub fn lights(&mut self, count: usize, size: f32) -> Vec<Light> {
        (0..count).map(|_| self.light(size)).collect()
    }

    pub fn shading_point(&mut self, size: f32) -> ShadingPoint {
        let position = self.place(size);
        if self.bits().is_multiple_of(5) {
            ShadingPoint::volume(position)
        } else {
            ShadingPoint::surface(position, self.direction())
        }
    }

    /// A rotation with one of: nothing, uniform scale, mirror, non-uniform scale, shear.
    pub fn affine(&mut self, size: f32) -> Affine3A {
        let turn = Mat3::from_quat(Quat::from_axis_angle(self.direction(), self.between(0.0, 6.0)));
        let shape = match self.bits() % 5 {
            0 => Mat3::IDENTITY,
            1 => Mat3::from_diagonal(Vec3::splat(self.between(0.2, 4.0))),
            2 => Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)),
            3 => Mat3::from_diagonal(Vec3::new(self.between(0.3, 3.0), self.between(0.3, 3.0), self.between(0.3, 3.0))),
            _ => Mat3::from_cols(Vec3::X, Vec3::new(self.between(-1.0, 1.0), 1.0, 0.0), Vec3::Z),
        };
        Affine3A::from_mat3_translation(turn * shape, self.place(size))
    }

    /// A world with instances of several trees, placed in every way, and two directional lights.
    pub fn world(&mut self, trees: usize, lights: usize, instances: usize, size: f32) -> LightWorld {
        let mut world = LightWorld::new();
        for _ in 0..trees {
            let tree = world.add_tree(self.lights(lights, 0.1 * size)).expect("random lights are valid");
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
}

/// Bounds on opened clusters that tests of chances run with: a plain walk, and what callers get.
pub const SPLITS: [SplitCount; 2] = [SplitCount::NONE, SplitCount::DEFAULT];

/// Every light of a world with its chance at a shading point.
pub fn all_chances(sampler: &LightSampler, shading_point: &ShadingPoint) -> Vec<(LightId, f32)> {
    sampler.all_lights().map(|light| (light, sampler.pmf(shading_point, light))).collect()
}
