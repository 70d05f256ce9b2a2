//! Traffic lights at every crossing. Each of the four groups has one light tree, which all its
//! lights share.

use girandole::glam::{Affine3A, Quat, vec3};
use girandole::{Light, LightTree, LightWorld, Policy, TreeKey};

use super::assembly::Assembly;
use super::furniture;
use super::ground::PAVEMENT;
use super::palette::{Glow, Palette};
use super::part::Part;
use super::roads::{Roads, heading_vector};
use super::signals::{Signal, signal, signal_group};
use super::{Scene, SceneError};

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
        let lens: Vec<(Part, Glow)> = (0..3).map(|index| furniture::signal_lens(index, palette)).collect();
        let lights = [0, 1, 2].map(|index| lens[index].0.lights[0]);
        let meshes: Vec<u32> = lens.into_iter().map(|(part, _)| assembly.mesh(part.mesh)).collect();
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
            lenses[group].push([0, 1, 2].map(|index| assembly.object(meshes[index], place)));
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
