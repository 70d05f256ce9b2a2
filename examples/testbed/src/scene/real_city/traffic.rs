//! Vehicles that follow a traffic file, taken from a pool of cars that are shown, moved and hidden.
//!
//! The file is read twice, since it may not fit in memory: [`Survey`] counts the vehicles of each
//! appearance that are on the road at once, and [`Traffic`] plays the file.

use std::collections::{BTreeMap, BTreeSet};

use girandole::glam::{Affine3A, DVec2, Quat, Vec2, Vec3, dvec2, vec2};
use girandole::{InstanceKey, LightWorld, Policy};

use super::assembly::{Assembly, Design};
use super::fcd::{FcdReader, FcdVehicle, Timestep};
use super::grid::to_plane;
use super::palette::Palette;
use super::source::Source;
use super::survey::Survey;
use super::vehicles::body::Appearance;
use super::vehicles::fleet::{Fleet, car_transform};
use crate::scene::{Animation, Scene, SceneError};

/// A car of the pool.
struct PoolCar {
    object: usize,
    /// Its lights while it is on the road.
    instance: Option<InstanceKey>,
}

/// The vehicles of a file.
pub struct Traffic {
    reader: FcdReader<Source>,
    designs: BTreeMap<Appearance, Design>,
    pool: Vec<PoolCar>,
    /// Cars of the pool that are hidden.
    free: BTreeMap<Appearance, Vec<usize>>,
    /// Cars of the pool that are on the road, by the name of the vehicle.
    shown: BTreeMap<String, (Appearance, usize)>,
    /// The time step before the present time.
    before: Timestep,
    /// The time step after the present time, unless the file has ended.
    after: Option<Timestep>,
    survey: Survey,
    /// Subtracted from all positions, metres east and north.
    shift: DVec2,
}

impl Traffic {
    /// Adds a pool that is large enough for every time step. All cars are hidden.
    pub fn new(
        assembly: &mut Assembly,
        palette: &mut Palette,
        reader: FcdReader<Source>,
        survey: Survey,
        shift: DVec2,
    ) -> Result<Self, SceneError> {
        let (mut fleet, mut designs) = (Fleet::default(), BTreeMap::new());
        let mut pool = Vec::new();
        let mut free: BTreeMap<Appearance, Vec<usize>> = BTreeMap::new();
        for (&appearance, &count) in &survey.max_counts {
            let design = fleet.design(appearance, assembly, palette)?;
            designs.insert(appearance, design);
            for _ in 0..count {
                let object = assembly.object(design.mesh, Affine3A::IDENTITY);
                assembly.scene.objects[object].visible = false;
                free.entry(appearance).or_default().push(pool.len());
                pool.push(PoolCar { object, instance: None });
            }
        }
        let (shown, before) = (BTreeMap::new(), Timestep { time: f64::NEG_INFINITY, vehicles: Vec::new() });
        let mut traffic = Self { reader, designs, pool, free, shown, before, after: None, survey, shift };
        traffic.after = traffic.reader.next_step()?;
        Ok(traffic)
    }

    /// Position (x, z) and angle about +Y of a vehicle of the given length between two time steps.
    /// `share` is the time since the first one as a share of the time between them.
    fn pose(&self, from: &FcdVehicle, to: Option<&FcdVehicle>, share: f32, length: f32) -> (Vec2, f32) {
        let position = |vehicle: &FcdVehicle| to_plane(dvec2(vehicle.east, vehicle.north) - self.shift);
        let (mut at, mut degrees) = (position(from), from.angle);
        if let Some(to) = to {
            at = at.lerp(position(to), share);
            // The smaller of the two turns between the angles.
            let turn = (to.angle - from.angle + 540.0).rem_euclid(360.0) - 180.0;
            degrees += turn * share;
        }
        // Degrees are clockwise from north, which is -Z. A car faces -Z and turns counter-clockwise
        // about +Y.
        let angle = -degrees.to_radians();
        let forward = Quat::from_rotation_y(angle) * Vec3::NEG_Z;
        // SUMO states the middle of the front bumper.
        (at - vec2(forward.x, forward.z) * (length * 0.5), angle)
    }

    /// Returns the car of a vehicle to the pool.
    fn hide(&mut self, id: &str, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        let Some((appearance, car)) = self.shown.remove(id) else { return Ok(()) };
        let pooled = &mut self.pool[car];
        scene.objects[pooled.object].visible = false;
        if let Some(instance) = pooled.instance.take() {
            world.remove_instance(instance)?;
        }
        self.free.entry(appearance).or_default().push(car);
        Ok(())
    }

    /// Moves the car of a vehicle, or takes one from the pool. `pose` returns the pose for a car's
    /// length.
    fn show(
        &mut self,
        vehicle: &FcdVehicle,
        pose: impl Fn(f32) -> (Vec2, f32),
        scene: &mut Scene,
        world: &mut LightWorld,
    ) -> Result<(), SceneError> {
        let appearance = self.survey.appearance(vehicle);
        if self.shown.get(&vehicle.id).is_some_and(|known| known.0 != appearance) {
            self.hide(&vehicle.id, scene, world)?;
        }
        let known = self.shown.get(&vehicle.id).map(|known| known.1);
        // A vehicle that changes its type or appears twice in a time step may find no free car. It
        // is then not shown.
        let Some(car) = known.or_else(|| self.free.get_mut(&appearance)?.pop()) else { return Ok(()) };
        let (at, angle) = pose(appearance.size.length());
        let transform = car_transform(at, angle);
        let pooled = &mut self.pool[car];
        let object = &mut scene.objects[pooled.object];
        let moved = object.transform != transform;
        (object.transform, object.visible) = (transform, true);
        match pooled.instance {
            Some(instance) if moved => world.move_instance(instance, transform)?,
            Some(_) => {}
            None => {
                let tree = self.designs.get(&appearance).and_then(|design| design.tree);
                if let Some(tree) = tree {
                    pooled.instance = Some(world.add_instance(tree, transform, Policy::RefitOnly)?);
                }
            }
        }
        self.shown.insert(vehicle.id.clone(), (appearance, car));
        Ok(())
    }
}

impl Animation for Traffic {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        let now = self.survey.start + time;
        while self.after.as_ref().is_some_and(|after| after.time <= now) {
            let next = self.reader.next_step()?;
            if let Some(before) = std::mem::replace(&mut self.after, next) {
                self.before = before;
            }
        }
        let before = std::mem::take(&mut self.before);
        let after = self.after.take();
        let later: BTreeMap<&str, &FcdVehicle> =
            after.iter().flat_map(|step| &step.vehicles).map(|vehicle| (vehicle.id.as_str(), vehicle)).collect();
        let span = after.as_ref().map_or(1.0, |after| after.time - before.time);
        let share = ((now - before.time) / span).clamp(0.0, 1.0) as f32;
        let present: BTreeSet<&str> = before.vehicles.iter().map(|vehicle| vehicle.id.as_str()).collect();
        let gone: Vec<String> = self.shown.keys().filter(|id| !present.contains(id.as_str())).cloned().collect();
        for id in gone {
            self.hide(&id, scene, world)?;
        }
        for vehicle in &before.vehicles {
            let to = later.get(vehicle.id.as_str()).copied();
            let poses = [0.0, 1.0].map(|length| self.pose(vehicle, to, share, length));
            // The position is linear in the length of the car.
            let pose = |length: f32| (poses[0].0.lerp(poses[1].0, length), poses[0].1);
            self.show(vehicle, pose, scene, world)?;
        }
        (self.before, self.after) = (before, after);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use girandole::glam::vec3;

    use super::super::{RealCityOptions, Stage, stage};
    use super::*;

    fn load() -> Stage {
        let file = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/fcd_small.xml"));
        stage(&RealCityOptions { traffic: Some(file), cars: Some(0), ..RealCityOptions::default() }).unwrap()
    }

    #[test]
    fn long_vehicles_trail_behind_their_position_and_follow_from_their_types() {
        let path = |name: &str| std::env::temp_dir().join(format!("girandole_tram_{}_{name}", std::process::id()));
        let (traffic, types) = (path("fcd.xml"), path("types.rou.xml"));
        let step = r#"<vehicle id="a" x="100" y="-20" angle="90" type="line_7" speed="0"/>
            <person id="a" x="50" y="5" angle="0"/>"#;
        std::fs::write(&traffic, format!("<fcd-export><timestep time=\"0\">{step}</timestep></fcd-export>")).unwrap();
        std::fs::write(&types, r#"<additional><vType id="line_7" vClass="tram" length="30"/></additional>"#).unwrap();
        let options =
            |vehicle_types| RealCityOptions { traffic: Some(traffic.clone()), vehicle_types, ..Default::default() };
        let [with, without] = [vec![types.clone()], Vec::new()].map(|types| stage(&options(types)).unwrap());
        [&traffic, &types].into_iter().for_each(|path| std::fs::remove_file(path).unwrap());
        let vehicles = |stage: &Stage| -> Vec<Vec3> {
            let objects = stage.scene.objects.iter().rev().take(2);
            objects.map(|object| object.transform.translation.into()).collect()
        };
        assert!(with.scene.warnings.is_empty());
        assert!(vehicles(&with).iter().any(|at| at.abs_diff_eq(vec3(85.0, 0.0, 20.0), 1e-3)), "{:?}", vehicles(&with));
        // Half of a person's length of 0.3 m.
        assert!(vehicles(&with).iter().any(|at| at.abs_diff_eq(vec3(50.0, 0.0, -4.85), 1e-3)), "{:?}", vehicles(&with));
        // Without the types, the tram is a car.
        assert!(vehicles(&without).iter().any(|at| (97.0..98.5).contains(&at.x)), "{:?}", vehicles(&without));
        let [warning] = &without.scene.warnings[..] else { panic!("{:?}", without.scene.warnings) };
        assert!(warning.contains("1 vehicle type(s)") && warning.contains("--vtypes"), "{warning}");
    }

    #[test]
    fn a_vehicle_that_changes_its_class_leaves_nothing_behind() {
        let path = std::env::temp_dir().join(format!("girandole_class_{}_fcd.xml", std::process::id()));
        let vehicle = |class: &str| format!(r#"<vehicle id="a" x="0" y="0" angle="90" vClass="{class}"/>"#);
        let steps = [vehicle("passenger"), vehicle("bus"), String::new()];
        let steps = (0..).zip(steps).map(|(time, text)| format!("<timestep time=\"{time}\">{text}</timestep>"));
        std::fs::write(&path, format!("<fcd-export>{}</fcd-export>", steps.collect::<String>())).unwrap();
        let options = RealCityOptions { traffic: Some(path.clone()), cars: Some(0), ..Default::default() };
        let mut stage = stage(&options).unwrap();
        let mut seen: Vec<(Vec<u32>, usize)> = Vec::new();
        for time in [0.0, 1.0, 2.5] {
            stage.animation.advance(time, &mut stage.scene, &mut stage.world).unwrap();
            let visible = stage.scene.objects.iter().filter(|object| object.visible);
            seen.push((visible.map(|object| object.mesh).collect(), stage.world.instances().len()));
        }
        std::fs::remove_file(path).unwrap();
        let (rest, instances) = seen.pop().unwrap();
        // What is seen beyond the rest, and its length.
        let lengths = seen.into_iter().map(|(mut meshes, count)| {
            assert_eq!(count, instances + 1);
            for mesh in &rest {
                meshes.swap_remove(meshes.iter().position(|other| other == mesh).expect("the rest is always visible"));
            }
            let [mesh] = meshes[..] else { panic!("{meshes:?}") };
            let depths = stage.scene.meshes[mesh as usize].triangles.iter().flat_map(|t| t.vertices.map(|v| v.z));
            depths.clone().fold(f32::MIN, f32::max) - depths.fold(f32::MAX, f32::min)
        });
        let lengths: Vec<f32> = lengths.collect();
        assert!((3.0..6.0).contains(&lengths[0]) && (10.0..14.0).contains(&lengths[1]), "{lengths:?}");
    }

    #[test]
    fn vehicles_appear_and_disappear_with_the_file() {
        let mut stage = load();
        let hidden = |stage: &Stage| stage.scene.objects.iter().filter(|object| !object.visible).count();
        let houses = stage.world.instances().len() - 1;
        let pool = hidden(&stage) + 1;
        let mut counts = Vec::new();
        for tenth in 0..=120 {
            stage.animation.advance(f64::from(tenth) * 0.1, &mut stage.scene, &mut stage.world).unwrap();
            let shown = stage.world.instances().len() - houses;
            assert_eq!(shown, pool - hidden(&stage));
            counts.push(shown);
        }
        // One at 0 s, two at 1.5 s, three from 2 s, two from 7 s and none from 9 s on.
        assert_eq!([0, 15, 25, 75, 95, 120].map(|tenth| counts[tenth]), [1, 2, 3, 2, 0, 0]);
    }

    #[test]
    fn vehicles_are_interpolated_between_time_steps_and_face_their_direction() {
        let mut stage = load();
        stage.animation.advance(0.5, &mut stage.scene, &mut stage.world).unwrap();
        let car = stage.scene.objects.iter().rfind(|object| object.visible).unwrap();
        // Half way from x = -60 to -51, half a car's length behind its bumper, on the southern
        // lane.
        let forward = car.transform.transform_point3(vec3(0.0, 0.0, -1.0)) - Vec3::from(car.transform.translation);
        assert!(forward.abs_diff_eq(Vec3::X, 1e-4), "{forward}");
        assert!(
            (-58.1..-57.2).contains(&car.transform.translation.x) && (car.transform.translation.z - 1.6).abs() < 1e-3
        );
    }
}
