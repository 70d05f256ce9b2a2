//! Vehicles that follow a traffic file, taken from a pool of cars that are shown, moved and hidden.
//!
//! The file is read twice, since it may not fit in memory: [`Survey`] counts the cars of each
//! appearance that are on the road at once, and [`Traffic`] plays the file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use girandole::glam::{Affine3A, DVec2, Quat, Vec2, Vec3, dvec2, vec2};
use girandole::{InstanceKey, LightWorld, Policy};

use super::assembly::{Assembly, Design};
use super::fcd::{FcdReader, FcdVehicle, Timestep};
use super::grid::to_plane;
use super::ground::DRIVEN_CELL;
use super::palette::Palette;
use super::rng::Rng;
use super::vehicle_class::VehicleClass;
use super::vehicle_types::VehicleTypes;
use super::vehicles::body::Appearance;
use super::vehicles::fleet::{Fleet, car_transform};
use super::xml::AnySource;
use super::{Animation, Scene, SceneError};

/// The result of the first reading of a traffic file.
pub struct Survey {
    /// Time of the first time step, seconds.
    start: f64,
    /// The most vehicles of each appearance that are on the road at once.
    max_counts: BTreeMap<Appearance, usize>,
    /// Where vehicles drive: cells of [`DRIVEN_CELL`] metres, east and north.
    pub cells: BTreeSet<(i32, i32)>,
    /// Position of the first vehicle, metres east and north.
    pub first: Option<DVec2>,
    /// How far vehicles went between time steps, and how far they would have gone at their speeds,
    /// metres.
    moved: f64,
    driven: f64,
    /// The types whose class is unknown.
    unknown_types: BTreeSet<String>,
    types: VehicleTypes,
    seed: u64,
}

/// Vehicles that moved less than this share of the way at their speeds have positions in degrees, which
/// are about 1e-5 for a metre.
const LEAST_MOVED: f64 = 1e-3;
/// Metres that have to be driven for that to be judged.
const LEAST_DRIVEN: f64 = 20.0;

impl Survey {
    /// Reads a file. The types and the seed determine the appearance of vehicles.
    pub fn read(path: &Path, types: VehicleTypes, seed: u64) -> Result<Self, SceneError> {
        let mut reader = FcdReader::open(path)?;
        let mut survey = Self {
            start: 0.0,
            max_counts: BTreeMap::new(),
            cells: BTreeSet::new(),
            first: None,
            moved: 0.0,
            driven: 0.0,
            unknown_types: BTreeSet::new(),
            types,
            seed,
        };
        let mut is_first = true;
        // The time step before, by the names of the vehicles.
        let mut last: (f64, BTreeMap<String, DVec2>) = (0.0, BTreeMap::new());
        while let Some(step) = reader.next_step()? {
            if std::mem::take(&mut is_first) {
                survey.start = step.time;
            }
            let mut present: BTreeMap<Appearance, usize> = BTreeMap::new();
            for vehicle in &step.vehicles {
                *present.entry(appearance(vehicle, &survey.types, seed)).or_default() += 1;
                if vehicle.class.is_none() && survey.types.get(&vehicle.kind).is_none() {
                    survey.unknown_types.insert(vehicle.kind.clone());
                }
                let at = dvec2(vehicle.east, vehicle.north);
                survey.first.get_or_insert(at);
                if let (Some(before), Some(speed)) = (last.1.get(&vehicle.id), vehicle.speed) {
                    survey.moved += before.distance(at);
                    survey.driven += speed.abs() * (step.time - last.0);
                }
                let cell = (at / f64::from(DRIVEN_CELL)).floor();
                survey.cells.insert((cell.x as i32, cell.y as i32));
            }
            let places = step.vehicles.iter().map(|vehicle| (vehicle.id.clone(), dvec2(vehicle.east, vehicle.north)));
            last = (step.time, places.collect());
            for (appearance, count) in present {
                let max_count = survey.max_counts.entry(appearance).or_default();
                *max_count = count.max(*max_count);
            }
        }
        if survey.is_geographic() {
            return Err(SceneError(format!(
                "{}: the positions are degrees of longitude and latitude; write them in metres, without \
                 --fcd-output.geo",
                path.display()
            )));
        }
        Ok(survey)
    }

    /// A warning if the class of a type is unknown.
    pub fn warning(&self) -> Option<String> {
        /// Number of types that are named.
        const NAMED: usize = 3;
        let count = self.unknown_types.len();
        let names: Vec<String> = self.unknown_types.iter().take(NAMED).map(|name| format!("{name:?}")).collect();
        let (names, more) = (names.join(", "), if count > NAMED { ", ..." } else { "" });
        (count > 0).then(|| {
            format!(
                "the classes of {count} vehicle type(s) are unknown ({names}{more}), and their vehicles are drawn as \
                 cars; name the files that define them with --vtypes FILE.rou.xml"
            )
        })
    }

    /// Whether the positions are degrees: then vehicles hardly move for their speed.
    fn is_geographic(&self) -> bool {
        self.driven >= LEAST_DRIVEN && self.moved < LEAST_MOVED * self.driven
    }
}

/// The appearance of a vehicle in all time steps. Its body and size follow from its class and its
/// type. Where a class has several bodies, the name of the vehicle chooses one, and its paint too.
fn appearance(vehicle: &FcdVehicle, types: &VehicleTypes, seed: u64) -> Appearance {
    // FNV-1a, since the hashes of the standard library may change between releases.
    let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    let mut rng = Rng::new(seed, vehicle.id.bytes().fold(0xcbf2_9ce4_8422_2325, hash));
    let kind = types.get(&vehicle.kind);
    let class = vehicle.class.or(kind.map(|kind| kind.class)).unwrap_or_else(VehicleClass::passenger);
    let body = rng.pick(class.bodies());
    let size = class.size(body, kind.map_or([None; 3], |kind| kind.extents));
    Appearance { body, size, paint: rng.below(body.paints()) }
}

/// A car of the pool.
struct PoolCar {
    object: usize,
    /// Its lights while it is on the road.
    instance: Option<InstanceKey>,
}

/// The vehicles of a file.
pub struct Traffic {
    reader: FcdReader<AnySource>,
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
        reader: FcdReader<AnySource>,
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
        let appearance = appearance(vehicle, &self.survey.types, self.survey.seed);
        let known = self.shown.get(&vehicle.id).filter(|known| known.0 == appearance).map(|known| known.1);
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
        let file = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/fcd_small.xml"));
        stage(&RealCityOptions { traffic: Some(file), cars: Some(0), ..RealCityOptions::default() }).unwrap()
    }

    #[test]
    fn positions_in_degrees_are_refused_and_standing_traffic_is_not() {
        let survey = |name: &str, step: f64, speed: f64| {
            let path = std::env::temp_dir().join(format!("girandole_geo_{}_{name}.xml", std::process::id()));
            let vehicle = |second: u32| {
                let x = -88.24 + step * f64::from(second);
                format!(
                    "<timestep time=\"{second}\"><vehicle id=\"a\" x=\"{x:.6}\" y=\"40.11\" angle=\"90\" \
                     speed=\"{speed}\"/></timestep>"
                )
            };
            let steps: String = (0..5).map(vehicle).collect();
            std::fs::write(&path, format!("<fcd-export>{steps}</fcd-export>")).unwrap();
            let survey = Survey::read(&path, VehicleTypes::default(), 1);
            std::fs::remove_file(&path).unwrap();
            survey.map(|_| ())
        };
        // 10 m east at this latitude are 1.2e-4 degrees.
        let SceneError(message) = survey("degrees", 1.2e-4, 10.0).unwrap_err();
        assert!(message.contains("--fcd-output.geo") && !message.contains('\n'), "{message}");
        assert!(survey("metres", 10.0, 10.0).is_ok());
        assert!(survey("jam", 0.0, 0.0).is_ok());
    }

    #[test]
    fn vehicles_appear_and_disappear_with_the_file() {
        let mut stage = load();
        let hidden = |stage: &Stage| stage.scene.objects.iter().filter(|object| !object.visible).count();
        let houses = stage.world.instance_count() - 1;
        let pool = hidden(&stage) + 1;
        let mut counts = Vec::new();
        for tenth in 0..=120 {
            stage.animation.advance(f64::from(tenth) * 0.1, &mut stage.scene, &mut stage.world).unwrap();
            let shown = stage.world.instance_count() - houses;
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
