//! The sky of a world: an instance of a tree of patches, beside the top level.

use super::delta::Delta;
use super::{Instance, LightWorld};
use crate::error::SkyError;
use crate::instance::placement::{Placed, Placement};
use crate::instance::portal::{MAX_PORTALS, PlacedPortal, Portal};
use crate::keys::InstanceKey;
use crate::policy::Policy;
use crate::sky::Sky;
use crate::tree::LightTree;

impl LightWorld {
    /// Makes a map the sky of the world: a light behind all others. It takes the place of the sky that there was.
    ///
    /// The sky is an instance, whose lights are patches of the map, and it stays the same instance when another
    /// map comes. Its placement turns the map ([`move_instance`](Self::move_instance); the translation counts for
    /// nothing), a [factor](crate::Appearance::factor) makes it brighter or darker, and a [mask](crate::Appearance::mask) chooses
    /// who sees it. [`remove_instance`](Self::remove_instance) removes it.
    ///
    /// | for a sample of the sky | |
    /// |---|---|
    /// | [`LightSample::light`](crate::LightSample::light) | the instance and a patch, whose numbers change with the map |
    /// | [`Incident::dist`](crate::Incident::dist) | infinity |
    /// | [`Incident::radiance`](crate::Incident::radiance) | that of the map in this direction |
    /// | [`LightSampler::pdf`](crate::LightSampler::pdf) | for a point at any distance in the direction |
    /// | [`LightSampler::hit`](crate::LightSampler::hit) | what a ray finds that hits nothing and has a `max_dist` of infinity |
    ///
    /// O(1), and a tree of at most 1,024 lights is built. A GPU gets the map with the next
    /// plan or upload, 4.3 bytes a pixel, in the buffer of the top level.
    ///
    /// ```
    /// use girandole::glam::Vec3;
    /// use girandole::{LightWorld, ShadingPoint, Sky};
    ///
    /// let mut world = LightWorld::new();
    /// let sky = world.set_sky(Sky::equirectangular(32, &vec![Vec3::splat(800.0); 32 * 16])?);
    /// world.set_appearance(sky, |a| a.factor = Vec3::new(0.8, 0.9, 1.0))?;
    ///
    /// // The illuminance of the ground by an even sky is pi times its radiance.
    /// let ground = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    /// let mut lux = 0.0;
    /// for i in 0..4096 {
    ///     let [a, b] = [(i as f32 + 0.5) / 4096.0, (i as f32 * 0.618_034).fract()];
    ///     if let Some(sample) = world.sampler().sample(&ground, [a, b, b, (a * 64.0).fract()]) {
    ///         lux += sample.incident.radiance.y * sample.incident.direction.y / (sample.pmf * sample.incident.pdf);
    ///     }
    /// }
    /// assert!((lux / 4096.0 / (std::f32::consts::PI * 720.0) - 1.0).abs() < 0.02);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_sky(&mut self, mut sky: Sky) -> InstanceKey {
        sky.renew();
        let patches = LightTree::new(sky.lights()).unwrap_or_default();
        if let Some((key, present)) = &mut self.scene.sky {
            let key = *key;
            *present = sky;
            self.record(Delta::Sky);
            self.exchange(self.scene.instances[key].tree, patches);
            return key;
        }
        let placement = Placement::IDENTITY;
        let placed = Placed::new(&placement).unwrap_or_default();
        let tree = self.add_tree(patches);
        let instance = Instance { is_sky: true, ..Instance::new(tree, placement, Policy::Static, placed) };
        let key = self.insert_instance(instance);
        self.scene.sky = Some((key, sky));
        self.record(Delta::Sky);
        key
    }

    /// Changes a part of the sky's map, as a moving sun or clouds do: `size[0]` columns and `size[1]` rows from the
    /// column and row `corner` on, in rows from the top down.
    ///
    /// O(pixels of the part), and as [`LightWorld::set_sky`]. A pixel that is more than 128 times as bright as the
    /// brightest one when the map was made stores all pixels anew.
    ///
    /// # Errors
    /// [`SkyError::NoSky`]; [`SkyError::Part`] for a part that leaves the map or has another number of pixels;
    /// [`SkyError::Pixel`].
    pub fn set_sky_part(
        &mut self,
        corner: [usize; 2],
        size: [usize; 2],
        pixels: &[glam::Vec3],
    ) -> Result<(), SkyError> {
        let (key, sky) = self.scene.sky.as_mut().ok_or(SkyError::NoSky)?;
        sky.set_part(corner, size, pixels)?;
        let (key, lights) = (*key, sky.lights());
        self.record(Delta::Sky);
        self.exchange(self.scene.instances[key].tree, LightTree::new(lights).unwrap_or_default());
        Ok(())
    }

    /// Sets the openings of rooms through which the sky shines in, in place of those that were set before.
    ///
    /// A point in the room of a portal sees the sky through the portals of the rooms that it is in, and nowhere else: so
    /// samples go through the window, whichever walls there are. A direction that misses these portals has a
    /// probability near 0 or of 0: a room that has other openings is lit too little through them. Lights of trees
    /// know no portals. Points in no room and segments see all of the sky.
    ///
    /// A world has at most 32 portals: set those near the camera. O(portals), and a GPU gets 96 bytes for each, when they
    /// or the origin have changed. Shaders need [`Effects::PORTALS`](crate::Effects::PORTALS), which a world with
    /// portals has.
    ///
    /// # Errors
    /// [`SkyError::Portals`] for more than 32; [`SkyError::Portal`] for one with a number that is not finite, without an
    /// area, or with a room without a volume.
    ///
    /// ```
    /// use girandole::glam::{DVec3, Mat3, Vec3};
    /// use girandole::{LightWorld, Placement, Portal, ShadingPoint, Sky};
    ///
    /// let mut world = LightWorld::new();
    /// world.set_sky(Sky::from_fn(64, |_| Vec3::ONE)?);
    /// // A room of 6 x 3 x 4 m and 0.1 m into its walls, and a window of 1.6 x 1.2 m in the wall at x = 6.
    /// let room = Placement {
    ///     linear: Mat3::from_diagonal(Vec3::new(3.1, 1.6, 2.1)),
    ///     translation: DVec3::new(3.0, 1.5, 2.0),
    /// };
    /// let [half_u, half_v] = [Vec3::new(0.0, 0.0, 0.8), Vec3::new(0.0, 0.6, 0.0)];
    /// world.set_portals(&[Portal { center: DVec3::new(6.1, 1.6, 2.0), half_u, half_v, room }])?;
    ///
    /// let floor = ShadingPoint::surface(Vec3::new(4.0, 0.0, 2.0), Vec3::Y);
    /// let sample = world.sampler().sample(&floor, [0.3, 0.5, 0.7, 0.9]).expect("the window shows the sky");
    /// assert!(sample.incident.direction.x > 0.5);
    /// # Ok::<(), girandole::SkyError>(())
    /// ```
    pub fn set_portals(&mut self, portals: &[Portal]) -> Result<(), SkyError> {
        if portals.len() > MAX_PORTALS {
            return Err(SkyError::Portals { given: portals.len(), max: MAX_PORTALS });
        }
        if let Some(portal) = portals.iter().position(|portal| !portal.is_sound()) {
            return Err(SkyError::Portal { portal });
        }
        self.scene.portals = portals.to_vec();
        self.scene.place_portals();
        self.record(Delta::Sky);
        Ok(())
    }

    /// The portals that are set.
    pub fn portals(&self) -> &[Portal] {
        &self.scene.portals
    }

    /// The same relative to the origin.
    pub(crate) fn placed_portals(&self) -> &[PlacedPortal] {
        &self.scene.placed_portals
    }

    /// The instance of the sky and its map; `None` if there is none.
    pub fn sky(&self) -> Option<(InstanceKey, &Sky)> {
        self.scene.sky.as_ref().map(|(key, sky)| (*key, sky))
    }
}
