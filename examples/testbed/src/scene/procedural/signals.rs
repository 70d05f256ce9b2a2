//! Traffic lights at every crossing, and what they show at each time. Each of the four groups has one light tree, which
//! all its lights share.

use girandole::glam::{Affine3A, Quat, vec3};
use girandole::{Light, LightTree, LightWorld, Policy, TreeKey};

use super::assembly::Assembly;
use super::furniture;
use super::ground::PAVEMENT;
use super::palette::Palette;
use super::roads::{Roads, heading_vector};
use super::{Scene, SceneError};

/// Seconds for which an approach is green, then amber, then red together with all others of its
/// crossing.
const PHASES: [f64; 3] = [8.0, 1.5, 1.5];
/// Seconds of the cycle that have passed at time 0. The first picture then shows cars whose light
/// has just turned green.
const ROUND_START: f64 = 18.0;

/// What a traffic light shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Cars stop.
    Red,
    /// Red follows.
    Amber,
    /// Cars go.
    Green,
}

/// The group, 0 to 3, of the light for cars that reach a crossing in direction `heading`. All
/// lights of a group show the same signal. `side` is the number of crossings along each side of the
/// city.
pub fn signal_group(node: u32, side: u32, heading: u32) -> u32 {
    (heading + (node % side) + 2 * (node / side)) % 4
}

/// The signal of a group at a time, in seconds. At each crossing one approach is open at a time, so
/// that turning cars never meet.
pub fn signal(group: u32, time: f64) -> Signal {
    let slot: f64 = PHASES.iter().sum();
    let local = (time + ROUND_START + slot * f64::from(group)).rem_euclid(4.0 * slot);
    match local {
        t if t < PHASES[0] => Signal::Green,
        t if t < PHASES[0] + PHASES[1] => Signal::Amber,
        _ => Signal::Red,
    }
}

/// The traffic lights of a city.
pub struct TrafficLights {
    trees: Vec<TreeKey>,
    /// Objects of the three lenses of each traffic light, by group.
    lenses: Vec<Vec<[usize; 3]>>,
    /// The lights of the lenses at full power: red, amber, green.
    lights: [Light; 3],
    /// What each group shows.
    shown: [Option<Signal>; 4],
}

impl TrafficLights {
    /// Places a traffic light for every approach of every crossing.
    pub fn new(assembly: &mut Assembly, palette: &mut Palette, roads: &Roads) -> Result<Self, SceneError> {
        let body = assembly.design(furniture::signal_body(palette))?;
        let lenses = [0, 1, 2].map(|index| furniture::signal_lens(index, palette));
        let lights = lenses.each_ref().map(|lens| lens.lights[0]);
        let meshes = lenses.map(|lens| assembly.mesh(lens.mesh));
        let mut trees = Vec::new();
        for _ in 0..4 {
            trees.push(assembly.world.add_tree(LightTree::new(lights.to_vec())?));
        }
        let mut lenses = vec![Vec::new(); 4];
        for (node, heading) in (0..roads.nodes()).flat_map(|node| (0..4).map(move |heading| (node, heading))) {
            // A light stands beyond the crossing, for cars that come from another crossing.
            if roads.neighbor(node, heading + 2).is_none() {
                continue;
            }
            let group = signal_group(node, roads.side, heading) as usize;
            let at = roads.position(node) + heading_vector(heading) * 10.8 + heading_vector(heading + 3) * 7.7;
            let turn = Quat::from_rotation_y((heading as f32 + 2.0) * std::f32::consts::FRAC_PI_2);
            let place = Affine3A::from_rotation_translation(turn, vec3(at.x, PAVEMENT, at.y));
            assembly.place(body, place, Policy::Static)?;
            lenses[group].push(meshes.map(|mesh| assembly.object(mesh, place)));
            assembly.world.add_instance(trees[group], place, Policy::RefitOnly)?;
        }
        let mut signals = Self { trees, lenses, lights, shown: [None; 4] };
        signals.show(0.0, &mut assembly.scene, &mut assembly.world)?;
        Ok(signals)
    }

    /// Shows the signals of a time, in seconds.
    pub fn show(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for group in 0..4 {
            let now = signal(group as u32, time);
            if self.shown[group].replace(now) == Some(now) {
                continue;
            }
            let lit = [Signal::Red, Signal::Amber, Signal::Green].map(|lens| f32::from(u8::from(lens == now)));
            let light = |index: usize| self.lights[index].with_emission(self.lights[index].emission * lit[index]);
            world.set_lights(self.trees[group], &[(0, light(0)), (1, light(1)), (2, light(2))])?;
            for (object, lit) in self.lenses[group].iter().flat_map(|lenses| lenses.iter().zip(lit)) {
                scene.objects[*object].emission_scale = lit;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_most_one_approach_of_a_crossing_is_open() {
        for tenth in 0..1000 {
            let open = (0..4).filter(|&group| signal(group, tenth as f64 * 0.1) != Signal::Red).count();
            assert!(open <= 1);
        }
    }
}
