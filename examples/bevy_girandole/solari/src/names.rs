//! The names by which Girandole and Solari know the same lights.

use std::collections::HashMap;

use bevy::ecs::entity::Entity;
use bevy_girandole::GirandoleName;

/// What has no name.
const NONE: u32 = u32::MAX;

/// A light of Solari.
#[derive(Clone, Copy, Debug)]
pub struct SolariName {
    /// The entity in the main world.
    pub entity: Entity,
    /// The index among all lights.
    pub light: u32,
    /// The instance that rays hit, of a mesh.
    pub instance: Option<u32>,
}

/// The words of `GirandoleNames` in solari.wgsl.
pub fn words(ours: &[GirandoleName], theirs: &[SolariName]) -> Vec<u32> {
    let is_directional = |name: &&GirandoleName| name.instance == NONE;
    let slots = ours.iter().filter(|name| !is_directional(name)).map(|name| name.instance + 1).max().unwrap_or(0);
    let directionals = ours.iter().filter(is_directional).map(|name| name.light + 1).max().unwrap_or(0);
    let lights = theirs.iter().map(|name| name.light + 1).max().unwrap_or(0);
    let instances = theirs.iter().filter_map(|name| name.instance).map(|instance| instance + 1).max().unwrap_or(0);
    let places: HashMap<Entity, u32> = ours
        .iter()
        .map(|name| (name.entity, if name.instance == NONE { slots + name.light } else { name.instance }))
        .collect();
    let (first_light, first_instance) = (4 + slots + directionals, 4 + slots + directionals + lights);
    let mut words = vec![NONE; (first_instance + instances).max(5) as usize];
    words[..4].copy_from_slice(&[slots, directionals, lights, instances]);
    for name in theirs {
        let Some(&place) = places.get(&name.entity) else { continue };
        words[4 + place as usize] = name.light;
        words[(first_light + name.light) as usize] = place;
        if let Some(instance) = name.instance {
            words[(first_instance + instance) as usize] = name.light;
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_there_and_back() {
        let [a, b, c, unknown] =
            std::array::from_fn(|i| Entity::from_raw_u32(i as u32 + 1).expect("it is not the last"));
        let name = |instance, light, entity| GirandoleName { instance, light, entity };
        let ours = [name(2, 0, a), name(5, 0, b), name(NONE, 1, c)];
        let theirs = [(b, 0, Some(7)), (unknown, 1, Some(3)), (c, 2, None), (a, 3, Some(0))]
            .map(|(entity, light, instance)| SolariName { entity, light, instance });
        let words = words(&ours, &theirs);
        assert_eq!(words[..4], [6, 2, 4, 8]);
        let [slots, directionals, lights, instances] =
            [&words[4..10], &words[10..12], &words[12..16], &words[16..]].map(<[u32]>::to_vec);
        assert_eq!(slots, [NONE, NONE, 3, NONE, NONE, 0]);
        assert_eq!(directionals, [NONE, 2]);
        assert_eq!(lights, [5, NONE, 7, 2]);
        assert_eq!(instances, [3, NONE, NONE, NONE, NONE, NONE, NONE, 0]);
        assert_eq!(super::words(&[], &[]).len(), 5, "a binding has at least one word");
    }
}
