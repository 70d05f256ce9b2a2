//! Scenes for reuse from frame to frame, and what changes in them.

use super::rival_scenes::{Lamps, street, yard};
use girandole::glam::{Affine3A, Vec3, vec3};
use girandole::{InstanceKey, LightWorld};
use std::f32::consts::{FRAC_PI_2, TAU};
use testbed::direct_light::stage::prepare;
use testbed::render::geometry::Geometry;
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::{Animation, Object, Scene, SceneError, Stage, Still, rooms};

/// Frames of a second.
const RATE: f64 = 60.0;
/// How far the camera goes in a frame, relative to the distance of what it looks at, and at most, in metres: about a
/// pixel.
const CAMERA_STEP: (f32, f32) = (0.001, 0.03);
/// One in so many lamps sways by so many metres, so often in a second.
const SWAYING: usize = 3;
const SWAY: (f32, f32) = (0.3, 0.7);
/// Frames in which a door opens.
const DOOR_FRAMES: f64 = 16.0;

/// What changes from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    Nothing,
    /// It goes to its right.
    Camera,
    /// Cars drive, or lamps sway.
    Lights,
    /// The door that the camera looks at.
    Door,
}

impl Change {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Camera => "the camera moves",
            Self::Lights => "lights move",
            Self::Door => "a door opens",
        }
    }
}

/// A scene that changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    City,
    Rooms,
    Panels,
    Street,
    Points(usize),
}

impl Place {
    /// All places with what changes in them.
    pub const ALL: [(Self, &'static [Change]); 6] = [
        (Self::City, &[Change::Nothing, Change::Lights, Change::Camera]),
        (Self::Rooms, &[Change::Nothing, Change::Lights, Change::Camera, Change::Door]),
        (Self::Panels, &[Change::Nothing, Change::Camera]),
        (Self::Street, &[Change::Nothing, Change::Camera]),
        (Self::Points(1_000), &[Change::Nothing, Change::Lights]),
        (Self::Points(100), &[Change::Nothing, Change::Lights]),
    ];

    /// Its name in tables.
    pub fn name(self) -> String {
        match self {
            Self::City => "city S".into(),
            Self::Rooms => "70 rooms".into(),
            Self::Panels => "10,000 panels".into(),
            Self::Street => "glossy street".into(),
            Self::Points(count) => format!("{count} points"),
        }
    }

    /// Whether materials become diffuse.
    pub fn is_matte(self) -> bool {
        self != Self::Street
    }

    /// The scene, which `change` changes `warm_up` frames after its start.
    fn stage(self, change: Change, warm_up: u32) -> Result<Stage, SceneError> {
        let stage = match self {
            Self::City => procedural::stage(&CityOptions { size: Size::S, cars: None, seed: 1, lamp_profile: None })?,
            Self::Rooms => house(change, warm_up)?,
            Self::Panels => yard(Lamps::Panels, 10_000)?,
            Self::Street => street()?,
            Self::Points(count) => yard(Lamps::Points, count)?,
        };
        let mut stage = prepare(stage, 0.0)?;
        match change {
            Change::Nothing | Change::Camera => stage.animation = Box::new(Still),
            Change::Lights if self != Self::City => stage.animation = Box::new(Sway::new(&stage.scene, &stage.world)),
            Change::Lights | Change::Door => {}
        }
        Ok(stage)
    }
}

fn house(change: Change, warm_up: u32) -> Result<Stage, SceneError> {
    let (mut scene, world, _) = rooms::rooms(70, true)?;
    if change != Change::Door {
        return Ok(Stage { scene, world, animation: Box::new(Still) });
    }
    // The first material is that of the walls.
    let (part, hinge) = rooms::door(0);
    scene.meshes.push(part.mesh);
    let mesh = (scene.meshes.len() - 1) as u32;
    scene.objects.push(Object { mesh, transform: hinge, emission_scale: 1.0, visible: true });
    let opening = Opening { object: scene.objects.len() - 1, hinge, start: f64::from(warm_up) / RATE };
    Ok(Stage { scene, world, animation: Box::new(opening) })
}

/// A door that opens by a right angle.
struct Opening {
    object: usize,
    hinge: Affine3A,
    start: f64,
}

impl Animation for Opening {
    fn advance(&mut self, time: f64, scene: &mut Scene, _: &mut LightWorld) -> Result<(), SceneError> {
        let share = ((time - self.start) * RATE / DOOR_FRAMES).clamp(0.0, 1.0) as f32;
        scene.objects[self.object].transform = self.hinge * Affine3A::from_rotation_y(FRAC_PI_2 * share);
        Ok(())
    }
}

/// Lamps that sway with what they hang in.
struct Sway(Vec<(usize, InstanceKey, Affine3A)>);

impl Sway {
    fn new(scene: &Scene, world: &LightWorld) -> Self {
        let lamp = |instance: InstanceKey| {
            let placement = world.instance(instance)?.placement;
            let at = placement.translation.as_vec3();
            // What lies at the origin is the whole of a scene.
            let is_same = |object: &Object| {
                let [linear, other] = [placement.linear.into(), object.transform.matrix3];
                at != Vec3::ZERO
                    && object.transform.translation.abs_diff_eq(at.into(), 1e-4)
                    && other.abs_diff_eq(linear, 1e-4)
            };
            let object = scene.objects.iter().position(is_same)?;
            Some((object, instance, scene.objects[object].transform))
        };
        Self(world.instances().step_by(SWAYING).filter_map(lamp).collect())
    }
}

impl Animation for Sway {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for (object, instance, base) in &self.0 {
            let phase = *object as f32;
            let offset = SWAY.0 * (TAU * SWAY.1 * time as f32 + phase).sin();
            let transform = Affine3A::from_translation(vec3(phase.cos(), 0.0, phase.sin()) * offset) * *base;
            scene.objects[*object].transform = transform;
            world.move_instance(*instance, transform)?;
        }
        Ok(())
    }
}

/// A scene as it is in one frame.
pub struct Playing {
    pub stage: Stage,
    pub geometry: Geometry,
    change: Change,
    /// What the camera goes by in a frame.
    step: Vec3,
    number: u32,
}

impl Playing {
    /// The first frame.
    pub fn new(place: Place, change: Change, warm_up: u32) -> Result<Self, SceneError> {
        let mut stage = place.stage(change, warm_up)?;
        if place.is_matte() {
            stage.scene = super::scene_view::matte(stage.scene);
        }
        let geometry = Geometry::new(&stage.scene)?;
        let camera = &stage.scene.camera;
        let toward = camera.target - camera.eye;
        let step = toward.cross(camera.up).normalize_or_zero() * (CAMERA_STEP.0 * toward.length()).min(CAMERA_STEP.1);
        Ok(Self { stage, geometry, change, step, number: 0 })
    }

    /// Plays the next frame.
    pub fn advance(&mut self) -> Result<(), SceneError> {
        self.number += 1;
        let Stage { scene, world, animation } = &mut self.stage;
        animation.advance(f64::from(self.number) / RATE, scene, world)?;
        world.update(girandole::FrameBudget::UNLIMITED);
        if self.change == Change::Camera {
            scene.camera.eye += self.step;
            scene.camera.target += self.step;
        }
        self.geometry.update(scene)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_door_opens_and_lamps_take_what_they_hang_in_along() {
        let mut playing = Playing::new(Place::Rooms, Change::Door, 1).expect("a sound scene");
        let camera = playing.stage.scene.camera;
        // Through the middle of the door, as wide as two metres behind it.
        let through =
            playing.stage.scene.objects.last().expect("a door").transform.transform_point3(vec3(0.5, 1.0, -1.0));
        let is_blocked = |playing: &Playing| {
            let toward = through - camera.eye;
            playing.geometry.occluded(camera.eye, toward.normalize(), toward.length())
        };
        let blocked: Vec<bool> = (0..20)
            .map(|_| {
                playing.advance().expect("it plays");
                is_blocked(&playing)
            })
            .collect();
        assert!(blocked[0] && !blocked[19], "{blocked:?}");

        let mut playing = Playing::new(Place::Points(100), Change::Lights, 0).expect("a sound scene");
        let objects = |playing: &Playing| -> Vec<_> {
            playing.stage.scene.objects.iter().map(|object| object.transform.translation).collect()
        };
        let lamps = |playing: &Playing| -> Vec<_> {
            let world = &playing.stage.world;
            world
                .instances()
                .filter_map(|key| world.instance(key).map(|i| i.placement))
                .map(|at| at.translation.as_vec3())
                .collect()
        };
        let before = [objects(&playing).len(), lamps(&playing).len()];
        let (objects_before, lamps_before) = (objects(&playing), lamps(&playing));
        playing.advance().expect("it plays");
        let moved = objects(&playing).iter().zip(&objects_before).filter(|(a, b)| a != b).count();
        let swayed = lamps(&playing).iter().zip(&lamps_before).filter(|(a, b)| a != b).count();
        assert!(moved == swayed && swayed > 20, "{moved} objects and {swayed} lamps of {before:?}");
    }
}
