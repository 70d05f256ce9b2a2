//! The design of each appearance. All paints of a body of one size share a light tree.

use std::collections::BTreeMap;

use girandole::TreeKey;
use girandole::glam::{Affine3A, Quat, Vec2, vec3};

use super::SceneError;
use super::assembly::{Assembly, Design};
use super::body::{Appearance, Body, PAINTS, Size};
use super::palette::Palette;
use super::part::Part;
use super::{cars, crafts, cycles, people, rails, trucks};

/// The bodies of the procedural city.
const CITY_BODIES: [Body; 5] = [Body::Sedan, Body::Hatch, Body::Van, Body::Taxi, Body::Bus];

/// Designs that are made when they are first asked for.
#[derive(Default)]
pub struct Fleet {
    designs: BTreeMap<Appearance, Design>,
    trees: BTreeMap<(Body, Size), Option<TreeKey>>,
}

impl Fleet {
    /// The design of an appearance.
    pub fn design(
        &mut self,
        appearance: Appearance,
        assembly: &mut Assembly,
        palette: &mut Palette,
    ) -> Result<Design, SceneError> {
        if let Some(known) = self.designs.get(&appearance) {
            return Ok(*known);
        }
        let Appearance { body, size, paint } = appearance;
        let part = vehicle(body, size, PAINTS[paint], palette);
        let design = match self.trees.get(&(body, size)) {
            Some(&tree) => Design { mesh: assembly.mesh(part.mesh), tree },
            None => assembly.design(part)?,
        };
        self.trees.insert((body, size), design.tree);
        self.designs.insert(appearance, design);
        Ok(design)
    }
}

/// The designs of sedans, hatchbacks, vans, taxis and buses, in this order, one for each paint.
pub fn car_designs(assembly: &mut Assembly, palette: &mut Palette) -> Result<Vec<(Body, Vec<Design>)>, SceneError> {
    let mut fleet = Fleet::default();
    let mut kinds = Vec::new();
    for body in CITY_BODIES {
        let appearances = (0..body.paints()).map(|paint| Appearance { body, size: body.size(), paint });
        let designs: Result<_, _> = appearances.map(|appearance| fleet.design(appearance, assembly, palette)).collect();
        kinds.push((body, designs?));
    }
    Ok(kinds)
}

/// The transform of a vehicle at (x, z) that is turned by `angle` radians about +Y.
pub fn car_transform(position: Vec2, angle: f32) -> Affine3A {
    Affine3A::from_rotation_translation(Quat::from_rotation_y(angle), vec3(position.x, 0.0, position.y))
}

/// A vehicle or a person of the given size.
pub fn vehicle(body: Body, size: Size, paint: [f32; 3], palette: &mut Palette) -> Part {
    match body {
        Body::Sedan | Body::Hatch | Body::Van | Body::Taxi | Body::Bus | Body::Police | Body::Ambulance => {
            cars::car(body, size, paint, palette)
        }
        Body::Truck => trucks::truck(size, paint, palette),
        Body::SemiTrailer => trucks::semi_trailer(size, paint, palette),
        Body::Container => trucks::container(size, paint, palette),
        Body::Motorcycle => cycles::motorcycle(size, paint, palette),
        Body::Bicycle => cycles::bicycle(size, paint, palette),
        Body::Pedestrian => people::pedestrian(size, paint, false, palette),
        Body::PhoneUser => people::pedestrian(size, paint, true, palette),
        Body::Tram => rails::tram(size, palette),
        Body::Train => rails::train(size, palette),
        Body::Ship => crafts::ship(size, palette),
        Body::Aircraft => crafts::aircraft(size, palette),
        Body::Drone => crafts::drone(size, palette),
    }
}

#[cfg(test)]
mod tests {
    use girandole::Shape;
    use girandole::glam::Vec3;

    use super::super::body::BODIES;
    use super::super::lamps;
    use super::*;

    fn bounds(part: &Part) -> [Vec3; 2] {
        let vertices = part.mesh.triangles.iter().flat_map(|triangle| triangle.vertices);
        vertices.fold([Vec3::MAX, Vec3::MIN], |[low, high], at| [low.min(at), high.max(at)])
    }

    /// Sizes that a file may state: the usual one, and a larger and a smaller one.
    fn sizes(body: Body) -> [Size; 3] {
        let usual = body.size();
        let by = |factor: f32| Size::metres(usual.length() * factor, usual.width() * factor, usual.height() * factor);
        [usual, by(1.4), by(0.7)]
    }

    #[test]
    fn vehicles_have_the_stated_length_and_width_and_stand_on_the_ground() {
        for body in BODIES {
            for size in sizes(body) {
                let [low, high] = bounds(&vehicle(body, size, PAINTS[0], &mut Palette::default()));
                let is_walker = matches!(body, Body::Pedestrian | Body::PhoneUser);
                // Lamps and what people hold stick out.
                let slack = if is_walker { 0.5 } else { 0.03 * size.length() + 0.1 };
                let ends = [low.z + 0.5 * size.length(), high.z - 0.5 * size.length()];
                assert!(ends.iter().all(|end| end.abs() < slack), "{body:?} of {size:?}: {ends:?}");
                let sides = [low.x + 0.5 * size.width(), high.x - 0.5 * size.width()];
                assert!(sides.iter().all(|side| side.abs() < 0.3), "{body:?} of {size:?}: {sides:?}");
                assert!(low.y > -0.02 && (low.y < 0.1 || body == Body::Drone), "{body:?} of {size:?}: {}", low.y);
            }
        }
    }

    #[test]
    fn lights_are_as_large_as_the_emissive_faces_and_as_many_as_the_kind_has() {
        for body in BODIES {
            for size in sizes(body) {
                let mut palette = Palette::default();
                let part = vehicle(body, size, PAINTS[0], &mut palette);
                let (mut faces, mut lenses) = (0.0, 0.0);
                let lens = lamps::lens(&mut palette).material;
                for triangle in &part.mesh.triangles {
                    let emission = palette.materials[triangle.material as usize].emission.element_sum();
                    let [a, b, c] = triangle.vertices;
                    let power = emission * 0.5 * (b - a).cross(c - a).length();
                    // The lenses of headlights have spots in place of area lights.
                    *if triangle.material == lens { &mut lenses } else { &mut faces } += power;
                }
                let area = |shape: &Shape| match shape {
                    Shape::Rectangle { half_u, half_v, .. } => 4.0 * half_u.cross(*half_v).length(),
                    Shape::Sphere { radius, .. } => 4.0 * std::f32::consts::PI * radius * radius,
                    _ => 0.0,
                };
                let lights: f32 =
                    part.lights.iter().map(|light| area(&light.shape) * light.emission.element_sum()).sum();
                let spots = part.lights.iter().filter(|light| area(&light.shape) == 0.0).count();
                // Balls are polyhedra inscribed in their spheres.
                let is_equal = lights == 0.0 && faces == 0.0 || (0.6..1.001).contains(&(faces / lights));
                assert!(is_equal, "{body:?}: {faces} of faces, {lights} of lights");
                let expected = match body {
                    Body::Pedestrian | Body::PhoneUser | Body::Container => 0,
                    Body::Ship | Body::Aircraft | Body::Drone => 0,
                    Body::Bicycle | Body::Motorcycle => 1,
                    Body::Tram | Body::Train => 3,
                    _ => 2,
                };
                assert_eq!((spots, lenses > 0.0), (expected, expected > 0), "{body:?}");
                let is_dark = matches!(body, Body::Pedestrian | Body::Container);
                assert_eq!(part.lights.is_empty(), is_dark, "{body:?}");
            }
        }
    }

    #[test]
    fn paints_of_a_size_share_a_tree_and_other_sizes_do_not() {
        let (mut assembly, mut palette, mut fleet) = (Assembly::new(), Palette::default(), Fleet::default());
        let mut tree = |size: Size, paint: usize| {
            let appearance = Appearance { body: Body::Sedan, size, paint };
            fleet.design(appearance, &mut assembly, &mut palette).unwrap().tree
        };
        let (usual, long) = (Body::Sedan.size(), Size::metres(5.2, 1.8, 1.5));
        assert_eq!(tree(usual, 0), tree(usual, 1));
        assert_ne!(tree(usual, 0), tree(long, 0));
    }
}
