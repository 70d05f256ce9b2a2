//! Vehicles with head and tail lights that drive through a scene along a line, over and over.

use girandole::glam::{Affine3A, Quat, Vec3};
use girandole::{LightWorld, Policy};
use testbed::scene::assembly::{Assembly, Placed};
use testbed::scene::designs::vehicles::{Body, car_designs};
use testbed::scene::palette::Palette;
use testbed::scene::{Animation, Scene, SceneError, Stage};

/// Metres per second: 30 km/h.
const SPEED: f32 = 8.3;
/// The bodies, in turn.
const BODIES: [Body; 4] = [Body::Sedan, Body::Taxi, Body::Hatch, Body::Van];

/// The inner animation, and vehicles at equal distances on a line.
struct Convoy {
    inner: Box<dyn Animation>,
    placed: Vec<Placed>,
    from: Vec3,
    to: Vec3,
}

/// Adds vehicles that drive on the ground from one point to another. At the end of the line they
/// start again.
pub fn with_vehicles(stage: Stage, (from, to): (Vec3, Vec3), count: usize) -> Result<Stage, SceneError> {
    let Stage { scene, world, animation } = stage;
    let mut palette = Palette { materials: scene.materials.clone(), ..Palette::default() };
    let mut assembly = Assembly { scene, world };
    let designs = car_designs(&mut assembly, &mut palette)?;
    assembly.scene.materials = palette.materials;
    let mut placed = Vec::with_capacity(count);
    for vehicle in 0..count {
        let body = BODIES[vehicle % BODIES.len()];
        let paints = designs.iter().find(|(other, _)| *other == body).map_or(&[][..], |(_, paints)| paints);
        let Some(design) = paints.get(vehicle % paints.len().max(1)) else { continue };
        placed.push(assembly.place(*design, transform(from, to, 0.0), Policy::RefitOnly)?);
    }
    let Assembly { scene, world } = assembly;
    Ok(Stage { scene, world, animation: Box::new(Convoy { inner: animation, placed, from, to }) })
}

/// The transform of a vehicle that has driven a distance, in metres.
fn transform(from: Vec3, to: Vec3, driven: f32) -> Affine3A {
    let along = to - from;
    let length = along.length();
    let forward = along / length;
    // Vehicles face -Z.
    let turn = Quat::from_rotation_y((-forward.x).atan2(-forward.z));
    Affine3A::from_rotation_translation(turn, from + forward * driven.rem_euclid(length))
}

impl Animation for Convoy {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        self.inner.advance(time, scene, world)?;
        let spacing = self.from.distance(self.to) / self.placed.len().max(1) as f32;
        for (index, placed) in self.placed.iter().enumerate() {
            let transform = transform(self.from, self.to, index as f32 * spacing + SPEED * time as f32);
            scene.objects[placed.object].transform = transform;
            if let Some(instance) = placed.instance {
                world.move_instance(instance, transform)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::vec3;

    #[test]
    fn vehicles_face_the_way_they_drive_and_start_again_at_the_end() {
        let (from, to) = (vec3(1.0, 0.5, 2.0), vec3(1.0, 0.5, 12.0));
        for (driven, z) in [(0.0, 2.0), (4.0, 6.0), (13.0, 5.0)] {
            let transform = transform(from, to, driven);
            assert!((transform.transform_point3(Vec3::ZERO) - vec3(1.0, 0.5, z)).length() < 1e-5);
            assert!((transform.transform_vector3(Vec3::NEG_Z) - Vec3::Z).length() < 1e-5);
        }
        let east = transform(Vec3::ZERO, vec3(5.0, 0.0, 0.0), 1.0);
        assert!((east.transform_vector3(Vec3::NEG_Z) - Vec3::X).length() < 1e-5);
    }
}
