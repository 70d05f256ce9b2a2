//! The classes of vehicles of SUMO, and how each is drawn.

use super::vehicles::body::{Body, Size};

/// A class, such as `passenger`: what SUMO calls `vClass`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleClass(&'static Class);

/// A row of [`CLASSES`].
#[derive(Debug, PartialEq)]
struct Class {
    names: &'static [&'static str],
    bodies: &'static [Body],
    /// Length, width and height in metres, where they differ from those of the bodies. The lengths are
    /// those that SUMO uses by default.
    size: Option<[f32; 3]>,
}

const fn class(names: &'static [&'static str], bodies: &'static [Body], size: Option<[f32; 3]>) -> Class {
    Class { names, bodies, size }
}

/// Two of three cars are sedans.
const CARS: &[Body] = &[Body::Sedan, Body::Sedan, Body::Hatch];

/// All classes. Where there are two names, the second is that of earlier versions of SUMO.
const CLASSES: &[Class] = &[
    class(&["passenger"], CARS, None),
    class(&["private"], CARS, None),
    class(&["vip"], CARS, None),
    class(&["hov"], CARS, None),
    class(&["evehicle"], CARS, None),
    class(&["custom1"], CARS, None),
    class(&["custom2"], CARS, None),
    class(&["ignoring"], CARS, None),
    class(&["taxi"], &[Body::Taxi], None),
    class(&["emergency", "public_emergency"], &[Body::Ambulance], None),
    class(&["authority", "public_authority"], &[Body::Police], None),
    class(&["army", "public_army"], &[Body::Truck], None),
    class(&["bus", "public_transport"], &[Body::Bus], Some([12.0, 2.5, 3.0])),
    class(&["coach"], &[Body::Bus], Some([14.0, 2.55, 3.6])),
    class(&["delivery"], &[Body::Van], Some([6.5, 2.1, 2.7])),
    class(&["truck", "transport"], &[Body::Truck], None),
    class(&["trailer"], &[Body::SemiTrailer], None),
    class(&["motorcycle"], &[Body::Motorcycle], None),
    class(&["moped"], &[Body::Motorcycle], Some([2.1, 0.75, 1.45])),
    class(&["bicycle"], &[Body::Bicycle], None),
    class(&["scooter"], &[Body::Bicycle], None),
    // One person in three looks at a telephone.
    class(&["pedestrian"], &[Body::Pedestrian, Body::Pedestrian, Body::PhoneUser], None),
    class(&["wheelchair"], &[Body::Pedestrian], None),
    class(&["tram", "lightrail"], &[Body::Tram], Some([22.0, 2.4, 3.4])),
    class(&["cable_car"], &[Body::Tram], Some([22.0, 2.4, 3.4])),
    class(&["rail_urban", "cityrail"], &[Body::Train], Some([109.5, 3.0, 3.7])),
    class(&["subway"], &[Body::Train], Some([109.5, 3.0, 3.7])),
    class(&["rail", "rail_slow"], &[Body::Train], Some([135.0, 2.85, 3.8])),
    class(&["rail_electric"], &[Body::Train], Some([200.0, 2.95, 3.9])),
    class(&["rail_fast"], &[Body::Train], Some([200.0, 2.95, 3.9])),
    class(&["ship"], &[Body::Ship], None),
    class(&["container"], &[Body::Container], None),
    class(&["aircraft"], &[Body::Aircraft], None),
    class(&["drone"], &[Body::Drone], None),
];

/// The types that exist without a file, and their classes.
const DEFAULT_TYPES: [(&str, &str); 6] = [
    ("DEFAULT_VEHTYPE", "passenger"),
    ("DEFAULT_BIKETYPE", "bicycle"),
    ("DEFAULT_PEDTYPE", "pedestrian"),
    ("DEFAULT_RAILTYPE", "rail"),
    ("DEFAULT_CONTAINERTYPE", "container"),
    ("DEFAULT_TAXITYPE", "taxi"),
];

impl VehicleClass {
    /// The class with a name; `None` if SUMO has none.
    pub fn named(name: &str) -> Option<Self> {
        CLASSES.iter().find(|class| class.names.contains(&name)).map(Self)
    }

    /// The class of a type that exists without a file, or whose name is that of a class.
    pub fn of_default_type(id: &str) -> Option<Self> {
        let known = DEFAULT_TYPES.iter().find(|(default, _)| *default == id);
        Self::named(known.map_or(id, |(_, class)| class))
    }

    /// The class of vehicles of unknown types.
    pub fn passenger() -> Self {
        Self(&CLASSES[0])
    }

    /// The bodies by which the class is drawn, each with the same chance.
    pub fn bodies(self) -> &'static [Body] {
        self.0.bodies
    }

    /// The size of a body of this class, except for the extents in metres that a file states.
    pub fn size(self, body: Body, [length, width, height]: [Option<f32>; 3]) -> Size {
        let usual = body.size();
        let usual = self.0.size.unwrap_or([usual.length(), usual.width(), usual.height()]);
        Size::metres(length.unwrap_or(usual[0]), width.unwrap_or(usual[1]), height.unwrap_or(usual[2]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_every_default_type_has_a_class() {
        let names: Vec<&str> = CLASSES.iter().flat_map(|class| class.names).copied().collect();
        let unique: std::collections::BTreeSet<&str> = names.iter().copied().collect();
        assert_eq!(names.len(), unique.len());
        assert!(DEFAULT_TYPES.iter().all(|(id, _)| VehicleClass::of_default_type(id).is_some()));
        assert_eq!(VehicleClass::of_default_type("DEFAULT_BIKETYPE"), VehicleClass::named("bicycle"));
        assert_eq!(VehicleClass::passenger(), VehicleClass::named("passenger").unwrap());
        assert_eq!(VehicleClass::of_default_type("my_bus"), None);
    }

    #[test]
    fn stated_extents_replace_those_of_the_class() {
        let tram = VehicleClass::named("tram").unwrap();
        let size = tram.size(Body::Tram, [None, Some(2.65), None]);
        assert_eq!((size.length(), size.width(), size.height()), (22.0, 2.65, Body::Tram.size().height()));
    }
}
