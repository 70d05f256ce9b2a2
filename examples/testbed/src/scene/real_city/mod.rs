//! A real city: its street lamps from CSV or GeoJSON, its traffic from a SUMO simulation, its roads from a
//! SUMO network, its buildings from GeoJSON, or some of these.
//!
//! Read in this order:
//!
//! 1. this file: how the city is put together;
//! 2. `source`, `xml` and `geojson`: files as streams; `found`, `spread` and `projection`: what is told of files,
//!    where most positions are, and degrees in metres; `lamp_columns`, `lamp_table`, `vehicle_types`, `fcd`, `net` and
//!    `footprints`: readers of the files; `vehicle_class`: the classes of vehicles;
//! 3. `grid` and `ground`: roads and houses, which are derived from the positions of lamps and
//!    vehicles;
//! 4. `strips`, `lane_lines` and `roads`: the roads of a network;
//! 5. `placing`: lamps, houses and parked cars; `blocks`: buildings on footprints;
//! 6. `survey` and `traffic`: vehicles that follow the file.

use std::collections::BTreeSet;
use std::path::PathBuf;

use girandole::Profile;
use girandole::glam::{Affine3A, DVec2, Vec2, dvec2, vec2, vec3};

use super::assembly::Assembly;
use super::designs::vehicles::fleet::car_designs;
use super::designs::{buildings, facade, furniture, land, vehicles};
use super::palette::Palette;
use super::{Animation, Camera, SceneError, Stage, Still, assembly, palette, part, rng};

pub mod source;
pub mod xml;
pub mod geojson;
pub mod found;
pub mod spread;
pub mod projection;
pub mod lamp_columns;
pub mod lamp_table;
pub mod vehicle_class;
pub mod vehicle_types;
pub mod fcd;
pub mod net;
pub mod footprints;

pub mod grid;
pub mod ground;
pub mod strips;
pub mod lane_lines;
pub mod roads;

pub mod placing;
pub mod blocks;

pub mod survey;
pub mod traffic;

use fcd::FcdReader;
use footprints::Footprints;
use grid::{Grid, to_plane};
use ground::{DRIVEN_CELL, RoadSegment};
use lamp_columns::LampColumns;
use lamp_table::Lamps;
use net::Network;
use survey::Survey;
use traffic::Traffic;
use vehicle_types::VehicleTypes;

/// What the city is built from. At least one of the files must be given.
#[derive(Clone, Debug, Default)]
pub struct RealCityOptions {
    /// Street lamps; see [`lamp_table`].
    pub lamps: Option<PathBuf>,
    /// The names of their columns, as far as they are not the usual ones.
    pub lamp_columns: LampColumns,
    /// Traffic; see [`fcd`].
    pub traffic: Option<PathBuf>,
    /// Types of the vehicles of the traffic; see [`vehicle_types`].
    pub vehicle_types: Vec<PathBuf>,
    /// Roads, and the offset of the traffic; see [`net`].
    pub net: Option<PathBuf>,
    /// Buildings, in the coordinates of the lamps; see [`footprints`]. Without it, houses are placed
    /// beside the roads.
    pub buildings: Option<PathBuf>,
    /// Number of cars that are parked along the roads if there is no traffic file; `None` for 60.
    pub cars: Option<usize>,
    /// Determines what the files do not: the colours of vehicles, houses, and parked cars.
    pub seed: u64,
    /// Street lamps shine as it says, if there is one.
    pub lamp_profile: Option<Profile>,
}

/// Positions in national grids can lie megametres from (0, 0). If the middle of the lamps or, without lamps, the
/// first position is farther away than this, in metres, all positions are shifted by a multiple of a kilometre
/// that brings it close.
const MAX_OFFSET: f64 = 50_000.0;

/// Traffic, lamps and roads of one place are within this distance of each other, metres. If less than this
/// share is, the files probably have different coordinates.
const NEAR: f32 = 150.0;
const LEAST_NEAR: f32 = 0.05;

/// Height of the land below the roads, metres.
const LAND_HEIGHT: f32 = -0.06;
/// How far the part of the land that is near reaches beyond all positions, metres.
const LAND_MARGIN: f32 = 1_500.0;

/// The camera is above all roofs within this distance, by this height, metres.
const ROOF_REACH: f32 = 25.0;
const ROOF_CLEARANCE: f32 = 15.0;

/// Number of parked cars by default.
const DEFAULT_PARKED_CARS: usize = 60;

/// Loads the files.
pub fn stage(options: &RealCityOptions) -> Result<Stage, SceneError> {
    let network = options.net.as_deref().map(Network::read).transpose()?;
    let projection = network.as_ref().map(|network| network.projection.as_str());
    let read = |path| lamp_table::read(path, &options.lamp_columns, projection);
    let Lamps { all: lamps, middle: lamp_middle, warnings: lamp_warnings } =
        options.lamps.as_deref().map(read).transpose()?.unwrap_or_default();
    let types = VehicleTypes::read(&options.vehicle_types)?;
    let survey = options.traffic.as_deref().map(|path| Survey::read(path, types, options.seed)).transpose()?;
    let footprints = options.buildings.as_deref().map(|path| Footprints::read(path, projection)).transpose()?;
    let buildings = footprints.as_ref().map_or(&[][..], |footprints| &footprints.all);
    // The simulation has the positions of the network.
    let offset = network.as_ref().map_or(DVec2::ZERO, |network| network.offset);
    let first = lamp_middle
        .or(survey.as_ref().and_then(|survey| survey.first).map(|first| first - offset))
        .or(network.as_ref().and_then(|network| network.lanes.first()).map(|lane| lane.line[0]))
        .or(buildings.first().map(|footprint| footprint.rings[0][0]));
    let Some(first) = first else {
        let left_out = footprints.iter().flat_map(Footprints::warnings);
        let told: String = left_out.map(|warning| format!("; {warning}")).collect();
        return Err(SceneError(format!("the files contain neither lamps nor vehicles, roads or buildings{told}")));
    };
    let shift = if first.abs().max_element() > MAX_OFFSET { (first / 1000.0).round() * 1000.0 } else { DVec2::ZERO };
    let mut assembly = Assembly::new();
    let mut palette = Palette { lamp_profile: options.lamp_profile, ..Palette::default() };
    let lamp_positions: Vec<Vec2> = lamps.iter().map(|lamp| to_plane(dvec2(lamp.east, lamp.north) - shift)).collect();
    let (posts, post_of) = grid::thin(&lamp_positions, ground::LEAST_ROW_GAP);
    let (guessed, mut arms) = ground::road_segments(&posts, options.seed);
    let segments = network.as_ref().map_or(guessed, |network| roads::segments(network, shift));
    if network.is_some() {
        ground::turn_arms(&posts, &segments, &mut arms);
    }
    let arms = ground::share_posts(&post_of, &arms);
    placing::place_lamps(&mut assembly, &mut palette, &lamps, &lamp_positions, &arms)?;

    let mut driven_cells = BTreeSet::new();
    let mut positions = lamp_positions.clone();
    for &(x, y) in survey.iter().flat_map(|survey| &survey.cells) {
        let at = to_plane(dvec2(f64::from(x), f64::from(y)) * f64::from(DRIVEN_CELL) - offset - shift);
        driven_cells.insert(grid::key(at, DRIVEN_CELL));
        positions.push(at);
    }
    positions.extend(segments.iter().flat_map(|segment| [segment.from, segment.to]).filter(|_| network.is_some()));
    positions.extend(blocks::bounds(buildings, shift).into_iter().flatten());
    let low = positions.iter().copied().reduce(Vec2::min).unwrap_or(Vec2::ZERO);
    let high = positions.iter().copied().reduce(Vec2::max).unwrap_or(Vec2::ZERO);
    let margin = Vec2::splat(LAND_MARGIN);
    let near = [low - margin, high + margin].map(|corner| corner.to_array());
    let land = land::land(near, LAND_HEIGHT, [0.075, 0.08, 0.06], &mut palette);
    // A network has the roads on which vehicles drive.
    let paved = match &network {
        Some(network) => roads::pave(network, shift, &mut palette),
        None => ground::roads(&segments, &driven_cells, &mut palette),
    };
    for part in land.into_iter().chain([paved]).filter(|part| !part.mesh.triangles.is_empty()) {
        let mesh = assembly.mesh(part.mesh);
        assembly.object(mesh, Affine3A::IDENTITY);
    }
    // The view is centred where most vehicles drive or, without traffic, where most lamps are, else among
    // the roads or the buildings.
    let driven: Vec<Vec2> = match () {
        () if !driven_cells.is_empty() => positions[lamp_positions.len()..][..driven_cells.len()].to_vec(),
        () if !lamp_positions.is_empty() => lamp_positions.clone(),
        () if network.is_some() => positions.clone(),
        () => buildings.iter().map(|footprint| to_plane(footprint.rings[0][0] - shift)).collect(),
    };
    let along = |segment: &RoadSegment| {
        let (from, to) = (segment.from, segment.to);
        let steps = (from.distance(to) / NEAR).ceil().clamp(1.0, 1000.0) as u32;
        (0..=steps).map(move |step| from.lerp(to, step as f32 / steps as f32))
    };
    let roads: Vec<Vec2> = segments.iter().flat_map(along).collect();
    let roads = if network.is_some() { &roads[..] } else { &[] };
    let traffic = if driven_cells.is_empty() { &[] } else { &driven[..] };
    let advice = match network {
        Some(_) => "is the network of the same place, in the coordinates of the lamps?",
        None => "netconvert moves a network to an origin of its own; name the network with --net FILE.net.xml",
    };
    let other_place = "are the files of the same place and network?";
    let mut warnings: Vec<String> = [
        apart(["traffic is", "a lamp"], [traffic, &posts], advice),
        apart(["traffic is", "a road"], [traffic, roads], other_place),
        apart(["lamps are", "a road"], [&posts, roads], advice),
    ]
    .into_iter()
    .flatten()
    .collect();
    warnings.extend(lamp_warnings);
    warnings.extend(footprints.iter().flat_map(Footprints::warnings));
    warnings.extend(survey.as_ref().and_then(Survey::warning));
    let middle = Grid::new(driven, 240.0).densest().map_or(Vec2::ZERO, |(middle, _)| middle);
    let lamp_grid = Grid::new(lamp_positions, 90.0);
    match footprints {
        Some(_) => blocks::place(&mut assembly, &mut palette, buildings, shift, middle, options.seed)?,
        None => {
            placing::place_houses(
                &mut assembly,
                &mut palette,
                &lamp_grid,
                &segments,
                &driven_cells,
                middle,
                options.seed,
            )?;
        }
    }

    let traffic = match (survey, &options.traffic) {
        (Some(survey), Some(path)) => {
            Some(Traffic::new(&mut assembly, &mut palette, FcdReader::open(path)?, survey, offset + shift)?)
        }
        _ => {
            let kinds = car_designs(&mut assembly, &mut palette)?;
            placing::park_cars(
                &mut assembly,
                &kinds,
                &segments,
                middle,
                options.cars.unwrap_or(DEFAULT_PARKED_CARS),
                options.seed,
            )?;
            None
        }
    };
    assembly.add_night()?;
    let Assembly { mut scene, world } = assembly;
    scene.materials = palette.materials;
    // Buildings may stand beside the road.
    scene.camera = camera(&segments, middle, if buildings.is_empty() { 30.0 } else { 0.0 });
    let below = vec2(scene.camera.eye.x, scene.camera.eye.z);
    let roof = blocks::highest_near(buildings, below, ROOF_REACH, shift);
    scene.camera.eye.y = scene.camera.eye.y.max(roof + ROOF_CLEARANCE);
    scene.lamp_clearance = 0.1;
    scene.is_metered = true;
    scene.warnings = warnings;
    let mut stage = Stage { scene, world, animation: Box::new(Still) };
    if let Some(mut traffic) = traffic {
        traffic.advance(0.0, &mut stage.scene, &mut stage.world)?;
        stage.animation = Box::new(traffic);
    }
    Ok(stage)
}

/// A warning if hardly any of the first positions are near one of the second. None if there are no positions.
fn apart([what, other]: [&str; 2], [of, others]: [&[Vec2]; 2], advice: &str) -> Option<String> {
    let grid = Grid::new(others.to_vec(), NEAR);
    let near = of.iter().filter(|at| grid.near(**at, NEAR).next().is_some()).count();
    let share = near as f32 / of.len().max(1) as f32;
    let are_apart = !of.is_empty() && !others.is_empty() && share < LEAST_NEAR;
    are_apart
        .then(|| format!("only {:.0} % of the {what} within {NEAR} m of {other}: {advice}", (100.0 * share).floor()))
}

/// A camera above the roofs that looks down along the road nearest to `middle`, from `side` metres beside
/// the road.
fn camera(segments: &[RoadSegment], middle: Vec2, side: f32) -> Camera {
    let nearest = segments.iter().min_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle)));
    let along = nearest.map_or(vec2(0.0, -1.0), |segment| (segment.to - segment.from).normalize_or(vec2(0.0, -1.0)));
    let center = nearest.map_or(middle, |segment| (segment.from + segment.to) * 0.5);
    let eye = center - along * 110.0 + vec2(-along.y, along.x) * side;
    Camera {
        eye: vec3(eye.x, 52.0, eye.y),
        target: vec3(center.x, 0.0, center.y),
        vertical_fov: 0.8,
        up: vec3(0.0, 1.0, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use girandole::glam::Vec3;

    use super::*;

    fn sample(name: &str) -> Option<PathBuf> {
        Some(PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/")).join(name))
    }

    fn load(lamps: bool, traffic: bool) -> Result<Stage, SceneError> {
        let lamps = lamps.then(|| sample("lamps_small.csv")).flatten();
        let traffic = traffic.then(|| sample("fcd_small.xml")).flatten();
        stage(&RealCityOptions { lamps, traffic, cars: Some(0), seed: 1, ..RealCityOptions::default() })
    }

    #[test]
    fn lamps_have_the_positions_and_fluxes_of_the_file() {
        let stage = load(true, false).unwrap();
        let all: Vec<_> =
            stage.world.instances().map(|instance| stage.world.instance(instance).unwrap().placement).collect();
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
    fn the_work_of_loading_grows_with_the_number_of_lamps_wherever_they_are() {
        const COUNT: u32 = 3_000;
        let path = std::env::temp_dir().join(format!("girandole_many_{}.csv", std::process::id()));
        for name in ["one place", "a line", "a square"] {
            let place = |lamp: u32| match name {
                "one place" => [500.0, 500.0],
                "a line" => [500.0 + 0.01 * f64::from(lamp), 500.0],
                _ => [500.0 + 0.3 * f64::from(lamp % 55), 500.0 + 0.3 * f64::from(lamp / 55)],
            };
            let lamps: String = (0..COUNT).map(place).map(|[x, y]| format!("{x},{y},8,9000\n")).collect();
            std::fs::write(&path, format!("x,y,height,lumens\n{lamps}")).unwrap();
            grid::LOOKED_AT.set(0);
            let stage = stage(&RealCityOptions { lamps: Some(path.clone()), cars: Some(0), ..Default::default() });
            assert!(stage.unwrap().world.instances().len() >= COUNT as usize);
            // Houses look at all lamps near each of some hundred places.
            let share = grid::LOOKED_AT.get() as f64 / f64::from(COUNT);
            assert!(share < 200.0, "{share} lamps are looked at for each lamp at {name}");
        }
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn a_city_without_files_is_refused() {
        assert!(load(false, false).is_err());
    }

    /// Files of the test `name`, with the sample of the traffic moved by an offset.
    fn with_moved_traffic(name: &str, offset: (f64, f64), net: Option<&str>) -> Result<Stage, SceneError> {
        let folder = std::env::temp_dir().join(format!("girandole_city_{}_{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let text = std::fs::read_to_string(sample("fcd_small.xml").unwrap()).unwrap();
        let moved: String = text
            .split_inclusive('"')
            .scan(None, |axis: &mut Option<f64>, piece| {
                let value = axis.take().and_then(|by| Some(by + piece.strip_suffix('"')?.parse::<f64>().ok()?));
                *axis = if piece.ends_with(" x=\"") {
                    Some(offset.0)
                } else if piece.ends_with(" y=\"") {
                    Some(offset.1)
                } else {
                    None
                };
                Some(value.map_or(piece.to_owned(), |value| format!("{value:.2}\"")))
            })
            .collect();
        let (traffic, network) = (folder.join("fcd.xml"), folder.join("city.net.xml"));
        std::fs::write(&traffic, moved).unwrap();
        let net = net.map(|text| {
            std::fs::write(&network, text).unwrap();
            network
        });
        let traffic = Some(traffic);
        let lamps = sample("lamps_small.csv");
        let loaded =
            stage(&RealCityOptions { lamps, traffic, net, cars: Some(0), seed: 1, ..RealCityOptions::default() });
        std::fs::remove_dir_all(&folder).unwrap();
        loaded
    }

    /// The network of the sample, moved as netconvert does it.
    const MOVED: &str = r#"<net><location netOffset="7000.00,-3000.00"/>
        <edge id="e"><lane id="e_0" shape="6900.00,-3001.60 7100.00,-3001.60"/></edge></net>"#;

    #[test]
    fn traffic_of_a_moved_network_is_moved_back_and_without_the_network_there_is_a_warning() {
        let place = |stage: &Stage| {
            let mut places: Vec<_> =
                stage.world.instances().map(|key| stage.world.instance(key).unwrap().placement.translation).collect();
            places.retain(|at| (at.z - 1.6).abs() < 1e-3 && at.x < -55.0 && at.y == 0.0);
            places
        };
        let in_place = load(true, true).unwrap();
        assert_eq!((place(&in_place).len(), in_place.scene.warnings.len()), (1, 0));
        let back = with_moved_traffic("back", (7000.0, -3000.0), Some(MOVED)).unwrap();
        assert_eq!((place(&back).len(), back.scene.warnings.len()), (1, 0));
        assert!((place(&back)[0] - place(&in_place)[0]).length() < 1e-3);
        let apart = with_moved_traffic("apart", (7000.0, -3000.0), None).unwrap();
        assert_eq!(apart.scene.warnings.len(), 1);
        assert!(apart.scene.warnings[0].contains("--net"), "{:?}", apart.scene.warnings);
    }

    #[test]
    fn buildings_have_the_coordinates_of_the_lamps_and_take_the_place_of_houses() {
        let path = std::env::temp_dir().join(format!("girandole_city_{}.geojson", std::process::id()));
        let ring = "[[-90,30],[-60,30],[-60,50],[-90,50],[-90,30]]";
        let text = format!(
            r#"{{"type":"FeatureCollection","features":[{{"type":"Feature","properties":{{"height":"11 m"}},
            "geometry":{{"type":"Polygon","coordinates":[{ring}]}}}}]}}"#
        );
        std::fs::write(&path, text).unwrap();
        let lamps = sample("lamps_small.csv");
        let buildings = Some(path.clone());
        let loaded = stage(&RealCityOptions { lamps, buildings, cars: Some(0), seed: 1, ..RealCityOptions::default() });
        std::fs::remove_file(&path).unwrap();
        let stage = loaded.unwrap();
        let is_high = |object: &&super::super::Object| {
            let triangles = &stage.scene.meshes[object.mesh as usize].triangles;
            triangles.iter().flat_map(|triangle| triangle.vertices).any(|vertex| vertex.y == 11.0)
        };
        let high: Vec<_> = stage.scene.objects.iter().filter(is_high).collect();
        assert_eq!(high.len(), 1);
        let corners = stage.scene.meshes[high[0].mesh as usize].triangles.iter().flat_map(|triangle| triangle.vertices);
        let placed = corners.map(|corner| high[0].transform.transform_point3(corner));
        let [low, high] = placed.fold([Vec3::MAX, Vec3::MIN], |[low, high], at| [low.min(at), high.max(at)]);
        // Windows lie in front of the walls.
        assert!(low.abs_diff_eq(vec3(-90.0, 0.0, -50.0), 0.05) && high.abs_diff_eq(vec3(-60.0, 11.0, -30.0), 0.05));
    }

    #[test]
    fn a_network_alone_is_a_city_of_roads_and_one_of_another_place_is_warned_about() {
        let wrong = MOVED.replace("7000.00,-3000.00\"/>", "0.00,0.00\"/>");
        let apart = with_moved_traffic("wrong", (7000.0, -3000.0), Some(&wrong)).unwrap();
        let told = |stage: &Stage, what: &[&str]| {
            let warnings = &stage.scene.warnings;
            assert_eq!(warnings.len(), what.len(), "{warnings:?}");
            assert!(warnings.iter().zip(what).all(|(warning, what)| warning.contains(what)), "{warnings:?}");
        };
        told(&apart, &["of the traffic is within 150 m of a lamp: is the network of the same place", "of the lamps"]);
        // Traffic among the lamps, and the roads elsewhere.
        let roads_apart = with_moved_traffic("roads", (0.0, 0.0), Some(&wrong)).unwrap();
        told(&roads_apart, &["of the traffic is within 150 m of a road", "of the lamps are within 150 m of a road"]);
        let path = std::env::temp_dir().join(format!("girandole_net_{}.net.xml", std::process::id()));
        std::fs::write(&path, MOVED).unwrap();
        let alone = stage(&RealCityOptions { net: Some(path.clone()), cars: Some(0), ..RealCityOptions::default() });
        std::fs::remove_file(&path).unwrap();
        assert!(!alone.unwrap().scene.objects.is_empty());
    }
}
