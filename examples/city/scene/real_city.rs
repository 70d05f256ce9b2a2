//! A real city: its street lamps from a CSV, its traffic from a SUMO simulation; either alone will do.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;

use girandole::glam::{Affine3A, DVec2, Quat, Vec2, Vec3, dvec2, vec2, vec3};
use girandole::{InstanceKey, LightWorld, Policy};

use super::assembly::{Assembly, Design};
use super::buildings::{self, Lot};
use super::fcd::{FcdReader, FcdVehicle, Timestep};
use super::furniture::{self, Lamp};
use super::lamps_csv::{self, LampRecord};
use super::palette::Palette;
use super::procedural::{car_designs, car_transform};
use super::real_ground::{self, Grid, Strip, TRACE_CELL};
use super::rng::Rng;
use super::vehicles::{Body, CarDesign};
use super::{Animation, Camera, Scene, SceneError, Stage};

/// What the city is made from; at least one of the two files.
#[derive(Clone, Debug, Default)]
pub struct RealCityOptions {
    /// Street lamps, see [`super::lamps_csv`].
    pub lamps: Option<PathBuf>,
    /// Traffic, see [`super::fcd`].
    pub traffic: Option<PathBuf>,
    /// Cars parked along the roads, where no traffic drives; `None` for a few.
    pub cars: Option<usize>,
    /// For what the files don't say: paints, houses, parked cars.
    pub seed: u64,
}

/// Houses stand within this distance of the view's middle.
const HOUSE_REACH: f32 = 420.0;
/// Files in national grids lie megametres away from (0, 0): beyond this, all is moved to the lamps' middle.
const FAR: f64 = 50_000.0;

/// Loads both files.
pub fn stage(options: &RealCityOptions) -> Result<Stage, SceneError> {
    let lamps = options.lamps.as_deref().map(lamps_csv::read).transpose()?.unwrap_or_default();
    let survey = options.traffic.as_deref().map(|path| Survey::read(path, options.seed)).transpose()?;
    let first = lamps.first().map(|lamp| dvec2(lamp.east, lamp.north)).or(survey.as_ref().and_then(|s| s.first));
    let Some(first) = first else {
        return Err(SceneError("neither lamps nor vehicles: nothing to show".into()));
    };
    let shift = if first.abs().max_element() > FAR { (first / 1000.0).round() * 1000.0 } else { DVec2::ZERO };
    let mut assembly = Assembly::new();
    let mut palette = Palette::default();
    let spots: Vec<Vec2> = lamps.iter().map(|lamp| to_plane(dvec2(lamp.east, lamp.north) - shift)).collect();
    let (strips, arms) = real_ground::strips(&spots, options.seed);
    place_lamps(&mut assembly, &mut palette, &lamps, &spots, &arms)?;

    let mut traces = BTreeSet::new();
    let mut busy = spots.clone();
    for &(x, y) in survey.iter().flat_map(|survey| &survey.cells) {
        let at = to_plane(dvec2(f64::from(x), f64::from(y)) * f64::from(TRACE_CELL) - shift);
        traces.insert(real_ground::key(at, TRACE_CELL));
        busy.push(at);
    }
    let low = busy.iter().copied().reduce(Vec2::min).unwrap_or(Vec2::ZERO);
    let high = busy.iter().copied().reduce(Vec2::max).unwrap_or(Vec2::ZERO);
    let land = real_ground::land(&strips, &traces, low, high, &mut palette);
    let land = assembly.mesh(land.mesh);
    assembly.object(land, Affine3A::IDENTITY);
    // Where traffic is known the view goes to it, else to the most lamps.
    let driven: Vec<Vec2> = if traces.is_empty() { spots.clone() } else { busy[spots.len()..].to_vec() };
    let middle = Grid::new(driven, 240.0).densest().map_or(Vec2::ZERO, |(middle, _)| middle);
    let lamp_grid = Grid::new(spots.clone(), 90.0);
    houses(&mut assembly, &mut palette, &lamp_grid, &strips, &traces, middle, options.seed)?;

    let kinds = car_designs(&mut assembly, &mut palette)?;
    let traffic = match (survey, &options.traffic) {
        (Some(survey), Some(path)) => Some(Traffic::new(&mut assembly, &kinds, FcdReader::open(path)?, survey, shift)?),
        _ => {
            park(&mut assembly, &kinds, &strips, middle, options.cars.unwrap_or(60), options.seed)?;
            None
        }
    };
    assembly.add_night()?;
    let Assembly { mut scene, world } = assembly;
    scene.materials = palette.materials;
    scene.camera = camera(&strips, middle);
    scene.lamp_clearance = 0.1;
    scene.exposure = 0.5;
    let mut stage = Stage { scene, world, animation: Box::new(Still) };
    if let Some(mut traffic) = traffic {
        traffic.advance(0.0, &mut stage.scene, &mut stage.world)?;
        stage.animation = Box::new(traffic);
    }
    Ok(stage)
}

/// East and north to x and z.
fn to_plane(at: DVec2) -> Vec2 {
    vec2(at.x as f32, -at.y as f32)
}

/// From above the roofs, down along the road that is nearest to the middle.
fn camera(strips: &[Strip], middle: Vec2) -> Camera {
    let nearest = strips.iter().min_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle)));
    let along = nearest.map_or(vec2(0.0, -1.0), |strip| (strip.to - strip.from).normalize_or(vec2(0.0, -1.0)));
    let center = nearest.map_or(middle, |strip| (strip.from + strip.to) * 0.5);
    let eye = center - along * 110.0 + vec2(-along.y, along.x) * 30.0;
    Camera { eye: vec3(eye.x, 52.0, eye.y), target: vec3(center.x, 0.0, center.y), vertical_fov: 0.8 }
}

fn place_lamps(
    assembly: &mut Assembly,
    palette: &mut Palette,
    lamps: &[LampRecord],
    spots: &[Vec2],
    arms: &[Vec2],
) -> Result<(), SceneError> {
    // Lamps of the same height and flux share a tree and a mesh: real lists know few kinds.
    let mut designs: BTreeMap<(u32, u32), Design> = BTreeMap::new();
    for ((lamp, spot), arm) in lamps.iter().zip(spots).zip(arms) {
        let kind = match lamp.height {
            height if height < 5.5 => Lamp::Globe,
            _ if lamp.lumens > 12_000.0 => Lamp::Sodium,
            _ => Lamp::Led,
        };
        let design = match designs.get(&(lamp.height.to_bits(), lamp.lumens.to_bits())) {
            Some(&known) => known,
            None => {
                let design = assembly.design(furniture::lamp(kind, lamp.height, lamp.lumens, palette))?;
                designs.insert((lamp.height.to_bits(), lamp.lumens.to_bits()), design);
                design
            }
        };
        let turn = Quat::from_rotation_y(arm.x.atan2(arm.y));
        let place = Affine3A::from_rotation_translation(turn, vec3(spot.x, 0.0, spot.y));
        assembly.place(design, place, Policy::Static)?;
    }
    Ok(())
}

fn houses(
    assembly: &mut Assembly,
    palette: &mut Palette,
    lamps: &Grid,
    strips: &[Strip],
    traces: &BTreeSet<(i32, i32)>,
    middle: Vec2,
    seed: u64,
) -> Result<(), SceneError> {
    let places = real_ground::house_places(lamps, strips, traces, middle, HOUSE_REACH, seed);
    let mut designs = Vec::new();
    for (index, floors) in [1, 1, 2, 2, 3, 4].into_iter().enumerate() {
        let mut rng = Rng::new(seed, 0x6000 + index as u64);
        designs.push(assembly.design(buildings::building(Lot::Detached, floors, palette, &mut rng))?);
    }
    let mut rng = Rng::new(seed, 0x6fff);
    for place in places {
        assembly.place(rng.pick(&designs), place, Policy::Static)?;
    }
    Ok(())
}

/// Cars at the kerbs near the middle.
fn park(
    assembly: &mut Assembly,
    kinds: &[(Body, Vec<Design>)],
    strips: &[Strip],
    middle: Vec2,
    count: usize,
    seed: u64,
) -> Result<(), SceneError> {
    let mut rng = Rng::new(seed, 0x9a2c);
    let mut near: Vec<&Strip> = strips.iter().collect();
    near.sort_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle)));
    near.truncate(count.div_ceil(2));
    for car in 0..if near.is_empty() { 0 } else { count } {
        let strip = near[car % near.len()];
        let along = (strip.to - strip.from).normalize_or(vec2(1.0, 0.0));
        // Every other car on the other side, facing the other way.
        let along = if (car / near.len()).is_multiple_of(2) { along } else { -along };
        let at = strip.from.lerp(strip.to, rng.range(0.25, 0.75)) + vec2(-along.y, along.x) * 2.2;
        let kind = rng.below(3);
        let design = rng.pick(&kinds[kind].1);
        let angle = (-along.x).atan2(-along.y);
        assembly.place(design, car_transform(at, angle), Policy::RefitOnly)?;
    }
    Ok(())
}

/// What a first reading of a traffic file tells.
struct Survey {
    /// Seconds of the first time step.
    start: f64,
    /// Most vehicles of each design at once.
    most: BTreeMap<CarDesign, usize>,
    /// Where vehicles drove: cells of [`TRACE_CELL`] metres, east and north.
    cells: BTreeSet<(i32, i32)>,
    first: Option<DVec2>,
    seed: u64,
}

impl Survey {
    fn read(path: &std::path::Path, seed: u64) -> Result<Self, SceneError> {
        let mut reader = FcdReader::open(path)?;
        let mut survey = Self { start: 0.0, most: BTreeMap::new(), cells: BTreeSet::new(), first: None, seed };
        let mut is_first = true;
        while let Some(step) = reader.next_step()? {
            if std::mem::take(&mut is_first) {
                survey.start = step.time;
            }
            let mut present: BTreeMap<CarDesign, usize> = BTreeMap::new();
            for vehicle in &step.vehicles {
                *present.entry(look(vehicle, seed)).or_default() += 1;
                let at = dvec2(vehicle.east, vehicle.north);
                survey.first.get_or_insert(at);
                let cell = (at / f64::from(TRACE_CELL)).floor();
                survey.cells.insert((cell.x as i32, cell.y as i32));
            }
            for (design, count) in present {
                let most = survey.most.entry(design).or_default();
                *most = count.max(*most);
            }
        }
        Ok(survey)
    }
}

/// The body and paint that a vehicle has for all its life: by its type, else by its name.
fn look(vehicle: &FcdVehicle, seed: u64) -> CarDesign {
    // FNV-1a: the standard library's hashes may change from release to release.
    let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    let mut rng = Rng::new(seed, vehicle.id.bytes().fold(0xcbf2_9ce4_8422_2325, hash));
    let kind = vehicle.kind.to_ascii_lowercase();
    let body = match () {
        () if kind.contains("bus") => Body::Bus,
        () if kind.contains("truck") || kind.contains("van") || kind.contains("delivery") => Body::Van,
        () if kind.contains("taxi") => Body::Taxi,
        () => rng.pick(&[Body::Sedan, Body::Sedan, Body::Hatch]),
    };
    CarDesign { body, paint: rng.below(body.paints()) }
}

/// A car of the pool: hidden, or on the road with its lights.
struct PoolCar {
    object: usize,
    instance: Option<InstanceKey>,
}

/// Vehicles as the file has them, from a pool of cars that are shown, moved and hidden.
struct Traffic {
    reader: FcdReader<BufReader<File>>,
    designs: BTreeMap<CarDesign, Design>,
    cars: Vec<PoolCar>,
    free: BTreeMap<CarDesign, Vec<usize>>,
    /// The pool's cars by vehicle.
    shown: BTreeMap<String, (CarDesign, usize)>,
    before: Timestep,
    after: Option<Timestep>,
    survey: Survey,
    shift: DVec2,
}

impl Traffic {
    fn new(
        assembly: &mut Assembly,
        kinds: &[(Body, Vec<Design>)],
        reader: FcdReader<BufReader<File>>,
        survey: Survey,
        shift: DVec2,
    ) -> Result<Self, SceneError> {
        let mut designs = BTreeMap::new();
        let mut cars = Vec::new();
        let mut free: BTreeMap<CarDesign, Vec<usize>> = BTreeMap::new();
        for (&look, &count) in &survey.most {
            let Some((_, paints)) = kinds.iter().find(|(body, _)| *body == look.body) else { continue };
            let design = paints[look.paint];
            designs.insert(look, design);
            for _ in 0..count {
                let object = assembly.object(design.mesh, Affine3A::IDENTITY);
                assembly.scene.objects[object].visible = false;
                free.entry(look).or_default().push(cars.len());
                cars.push(PoolCar { object, instance: None });
            }
        }
        let (shown, before) = (BTreeMap::new(), Timestep { time: f64::NEG_INFINITY, vehicles: Vec::new() });
        let mut traffic = Self { reader, designs, cars, free, shown, before, after: None, survey, shift };
        traffic.after = traffic.reader.next_step()?;
        Ok(traffic)
    }

    /// Position (x, z) and angle of a vehicle between two time steps.
    fn pose(&self, from: &FcdVehicle, to: Option<&FcdVehicle>, share: f32, length: f32) -> (Vec2, f32) {
        let place = |vehicle: &FcdVehicle| to_plane(dvec2(vehicle.east, vehicle.north) - self.shift);
        let (mut at, mut degrees) = (place(from), from.angle);
        if let Some(to) = to {
            at = at.lerp(place(to), share);
            // The short way around.
            let turn = (to.angle - from.angle + 540.0).rem_euclid(360.0) - 180.0;
            degrees += turn * share;
        }
        // Clockwise from north, and north is -Z: the car, which faces -Z, turns the other way about Y.
        let angle = -degrees.to_radians();
        let forward = Quat::from_rotation_y(angle) * Vec3::NEG_Z;
        // SUMO gives the middle of the front bumper.
        (at - vec2(forward.x, forward.z) * (length * 0.5), angle)
    }

    fn hide(&mut self, id: &str, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        let Some((look, car)) = self.shown.remove(id) else { return Ok(()) };
        let pooled = &mut self.cars[car];
        scene.objects[pooled.object].visible = false;
        if let Some(instance) = pooled.instance.take() {
            world.remove_instance(instance)?;
        }
        self.free.entry(look).or_default().push(car);
        Ok(())
    }

    fn show(
        &mut self,
        vehicle: &FcdVehicle,
        pose: impl Fn(f32) -> (Vec2, f32),
        scene: &mut Scene,
        world: &mut LightWorld,
    ) -> Result<(), SceneError> {
        let look = look(vehicle, self.survey.seed);
        let known = self.shown.get(&vehicle.id).filter(|known| known.0 == look).map(|known| known.1);
        // A vehicle that changes its type, or appears twice in one step, keeps to what the survey counted.
        let Some(car) = known.or_else(|| self.free.get_mut(&look)?.pop()) else { return Ok(()) };
        let (at, angle) = pose(look.body.length());
        let transform = car_transform(at, angle);
        let pooled = &mut self.cars[car];
        let object = &mut scene.objects[pooled.object];
        let moved = object.transform != transform;
        (object.transform, object.visible) = (transform, true);
        match pooled.instance {
            Some(instance) if moved => world.move_instance(instance, transform)?,
            Some(_) => {}
            None => {
                let tree = self.designs.get(&look).and_then(|design| design.tree);
                if let Some(tree) = tree {
                    pooled.instance = Some(world.add_instance(tree, transform, Policy::RefitOnly)?);
                }
            }
        }
        self.shown.insert(vehicle.id.clone(), (look, car));
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
            // The pose is linear in the car's length.
            let pose = |length: f32| (poses[0].0.lerp(poses[1].0, length), poses[0].1);
            self.show(vehicle, pose, scene, world)?;
        }
        (self.before, self.after) = (before, after);
        Ok(())
    }
}

/// Nothing moves.
struct Still;

impl Animation for Still {
    fn advance(&mut self, _: f64, _: &mut Scene, _: &mut LightWorld) -> Result<(), SceneError> {
        Ok(())
    }

    fn is_still(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(name: &str) -> Option<PathBuf> {
        Some(PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/")).join(name))
    }

    fn load(lamps: bool, traffic: bool) -> Result<Stage, SceneError> {
        let lamps = lamps.then(|| sample("lamps_small.csv")).flatten();
        let traffic = traffic.then(|| sample("fcd_small.xml")).flatten();
        stage(&RealCityOptions { lamps, traffic, cars: Some(0), seed: 1 })
    }

    #[test]
    fn lamps_stand_where_the_file_says_and_give_what_it_says() {
        let stage = load(true, false).unwrap();
        let all: Vec<_> = stage.world.instances().map(|instance| stage.world.placement(instance).unwrap()).collect();
        // The first lamp: 135 m west and 7 m north of the origin.
        assert!(all.iter().any(|place| place.translation.as_vec3().abs_diff_eq(vec3(-135.0, 0.0, -7.0), 1e-3)));
        let fluxes: Vec<f32> = stage
            .world
            .trees()
            .filter_map(|tree| stage.world.tree(tree).filter(|tree| tree.lights().len() == 1))
            .map(|tree| tree.lights()[0].flux())
            .collect();
        for lumens in [23_750.0, 14_250.0, 9_500.0, 4_125.0] {
            assert!(fluxes.iter().any(|flux| (flux / lumens - 1.0).abs() < 0.01), "{lumens} in {fluxes:?}");
        }
    }

    #[test]
    fn vehicles_come_drive_and_go() {
        let mut stage = load(false, true).unwrap();
        let quiet = |stage: &Stage| stage.scene.objects.iter().filter(|object| !object.visible).count();
        let houses = stage.world.instance_count() - 1;
        let pool = quiet(&stage) + 1;
        let mut counts = Vec::new();
        for tenth in 0..=120 {
            stage.animation.advance(f64::from(tenth) * 0.1, &mut stage.scene, &mut stage.world).unwrap();
            let shown = stage.world.instance_count() - houses;
            assert_eq!(shown, pool - quiet(&stage));
            counts.push(shown);
        }
        // One at first, three from 2 s, two from 7 s, none from 9 s on.
        assert_eq!([0, 15, 25, 75, 95, 120].map(|tenth| counts[tenth]), [1, 2, 3, 2, 0, 0]);
    }

    #[test]
    fn vehicles_drive_between_time_steps_with_their_nose_ahead() {
        let mut stage = load(false, true).unwrap();
        stage.animation.advance(0.5, &mut stage.scene, &mut stage.world).unwrap();
        let car = stage.scene.objects.iter().rfind(|object| object.visible).unwrap();
        // Half way from x = -60 to -51, half a car's length behind its bumper, on the southern lane.
        let nose = car.transform.transform_point3(vec3(0.0, 0.0, -1.0)) - Vec3::from(car.transform.translation);
        assert!(nose.abs_diff_eq(Vec3::X, 1e-4), "{nose}");
        assert!(
            (-58.1..-57.2).contains(&car.transform.translation.x) && (car.transform.translation.z - 1.6).abs() < 1e-3
        );
    }

    #[test]
    fn nothing_given_is_an_error() {
        assert!(load(false, false).is_err());
    }
}
