//! The shapes of vehicles and people, their sizes and their paints.

/// A shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Body {
    /// A car with a bonnet and a boot.
    Sedan,
    /// A short car with a steep back.
    Hatch,
    /// A tall box.
    Van,
    /// A sedan with a lit sign.
    Taxi,
    /// Lit inside, and articulated if it is long.
    Bus,
    /// A sedan with blue beacons.
    Police,
    /// A van with blue beacons.
    Ambulance,
    /// A cab with a box on one chassis.
    Truck,
    /// A tractor with a semi-trailer.
    SemiTrailer,
    /// A motorcycle or moped with its rider.
    Motorcycle,
    /// A bicycle with its rider.
    Bicycle,
    /// A person on foot, without a light.
    Pedestrian,
    /// A person on foot whose telephone glows.
    PhoneUser,
    /// Short sections with lit windows.
    Tram,
    /// Carriages with lit windows.
    Train,
    /// A boat with a cabin and navigation lights.
    Ship,
    /// A box without lights.
    Container,
    /// An airliner on the ground, with navigation lights.
    Aircraft,
    /// A drone in the air, with navigation lights.
    Drone,
}

/// All shapes.
#[cfg_attr(not(test), allow(dead_code, reason = "only tests go through all shapes"))]
pub const BODIES: [Body; 19] = [
    Body::Sedan,
    Body::Hatch,
    Body::Van,
    Body::Taxi,
    Body::Bus,
    Body::Police,
    Body::Ambulance,
    Body::Truck,
    Body::SemiTrailer,
    Body::Motorcycle,
    Body::Bicycle,
    Body::Pedestrian,
    Body::PhoneUser,
    Body::Tram,
    Body::Train,
    Body::Ship,
    Body::Container,
    Body::Aircraft,
    Body::Drone,
];

/// Linear colours of private cars, and of what people wear. Other shapes have colours of their own.
pub const PAINTS: [[f32; 3]; 8] = [
    [0.55, 0.55, 0.56],
    [0.04, 0.04, 0.045],
    [0.45, 0.03, 0.03],
    [0.03, 0.08, 0.28],
    [0.7, 0.7, 0.68],
    [0.12, 0.13, 0.14],
    [0.05, 0.2, 0.12],
    [0.35, 0.3, 0.22],
];

/// The extents of a vehicle in whole centimetres, so that sizes compare exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Size {
    length: u32,
    width: u32,
    height: u32,
}

impl Size {
    /// Rounds extents in metres to centimetres, at least one.
    pub fn metres(length: f32, width: f32, height: f32) -> Self {
        let [length, width, height] = [length, width, height].map(|extent| ((extent * 100.0).round() as u32).max(1));
        Self { length, width, height }
    }

    /// From bumper to bumper, metres.
    pub fn length(self) -> f32 {
        self.length as f32 / 100.0
    }

    /// Without mirrors, metres.
    pub fn width(self) -> f32 {
        self.width as f32 / 100.0
    }

    /// From the ground to the roof, metres.
    pub fn height(self) -> f32 {
        self.height as f32 / 100.0
    }
}

/// A body, its size and one of its paints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Appearance {
    /// The body.
    pub body: Body,
    /// Its extents.
    pub size: Size,
    /// Index into [`PAINTS`], below [`Body::paints`].
    pub paint: usize,
}

impl Body {
    /// The usual size.
    pub fn size(self) -> Size {
        let [length, width, height] = match self {
            Body::Sedan | Body::Taxi | Body::Police => [4.6, 1.76, 1.44],
            Body::Hatch => [3.9, 1.76, 1.5],
            Body::Van => [5.2, 1.76, 2.0],
            Body::Bus => [11.0, 2.5, 2.8],
            Body::Ambulance => [6.5, 2.16, 2.8],
            Body::Truck => [7.1, 2.4, 3.1],
            Body::SemiTrailer => [16.5, 2.55, 4.0],
            Body::Motorcycle => [2.2, 0.8, 1.5],
            Body::Bicycle => [1.75, 0.6, 1.7],
            Body::Pedestrian | Body::PhoneUser => [0.3, 0.48, 1.72],
            Body::Tram => [30.0, 2.4, 3.4],
            Body::Train => [100.0, 2.9, 3.9],
            Body::Ship => [17.0, 4.0, 4.0],
            Body::Container => [6.06, 2.44, 2.59],
            Body::Aircraft => [37.6, 35.8, 11.8],
            Body::Drone => [0.6, 0.6, 0.2],
        };
        Size::metres(length, width, height)
    }

    /// Number of [`PAINTS`] that the body comes in.
    pub fn paints(self) -> usize {
        match self {
            Body::Sedan | Body::Hatch | Body::Van | Body::Truck | Body::SemiTrailer => PAINTS.len(),
            Body::Motorcycle | Body::Bicycle | Body::Pedestrian | Body::PhoneUser | Body::Container => PAINTS.len(),
            _ => 1,
        }
    }
}
