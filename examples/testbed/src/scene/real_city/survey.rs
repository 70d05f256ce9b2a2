//! The first reading of a traffic file: how many vehicles of each appearance there are at once, where
//! they drive, and whether the file fits the others.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use girandole::glam::{DVec2, dvec2};

use super::SceneError;
use super::fcd::{FcdReader, FcdVehicle};
use super::ground::DRIVEN_CELL;
use super::rng::Rng;
use super::vehicle_class::VehicleClass;
use super::vehicle_types::VehicleTypes;
use super::vehicles::body::Appearance;

/// The result of the first reading of a traffic file.
pub struct Survey {
    /// Time of the first time step, seconds.
    pub start: f64,
    /// The most vehicles of each appearance that are on the road at once.
    pub max_counts: BTreeMap<Appearance, usize>,
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
/// The distance that vehicles must have driven at their speeds before this is decided, metres.
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
                *present.entry(survey.appearance(vehicle)).or_default() += 1;
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

    /// The appearance of a vehicle in all time steps. Its body and size follow from its class and its
    /// type. Where a class has several bodies, the name of the vehicle chooses one, and its paint too.
    pub fn appearance(&self, vehicle: &FcdVehicle) -> Appearance {
        // FNV-1a, since the hashes of the standard library may change between releases.
        let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        let mut rng = Rng::new(self.seed, vehicle.id.bytes().fold(0xcbf2_9ce4_8422_2325, hash));
        let kind = self.types.get(&vehicle.kind);
        let class = vehicle.class.or(kind.map(|kind| kind.class)).unwrap_or_else(VehicleClass::passenger);
        let body = rng.pick(class.bodies());
        let size = class.size(body, kind.map_or([None; 3], |kind| kind.extents));
        Appearance { body, size, paint: rng.below(body.paints()) }
    }

    /// Whether the positions are degrees: then vehicles hardly move for their speed.
    fn is_geographic(&self) -> bool {
        self.driven >= LEAST_DRIVEN && self.moved < LEAST_MOVED * self.driven
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
