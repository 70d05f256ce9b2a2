//! How much a tree matters to what is seen: by how often its lights are sampled, or by its light at the eye.

use glam::DVec3;

use super::LightWorld;
use crate::error::{WorldError, check_finite};
use crate::keys::{InstanceKey, TreeKey};

/// Updates after which a tree's light at the eye is reckoned anew, when it asks for a rebuild.
const STALE: u64 = 8;

/// Instances of a tree that are looked at for that; of more, evenly chosen ones stand for all.
const MAX_INSTANCES: usize = 16;

/// What is left of earlier counts of picks when new ones come.
const KEPT: f32 = 0.8;

/// Updates after which counts of picks say nothing any more.
const LASTING: u64 = 240;

/// What the light at the eye counts beside picks: the next picture may show what this one does not.
const UNSEEN_SHARE: f32 = 0.1;

/// A tree's light is at most this, in lux.
const MAX_LIGHT: f32 = 1.0e12;

/// Of one tree.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Attention {
    /// Its light at the eye, in lux without cosines; its flux if the eye is unknown.
    light: f32,
    /// The update in which that was reckoned, if it was.
    weighed: Option<u64>,
    /// Its share of the picks, as of a batch of counts.
    picks: f32,
    batch: u32,
    /// What the batch that is being noted has counted so far.
    counted: u32,
}

/// The world's part of it.
#[derive(Debug, Default)]
pub(super) struct Gaze {
    eye: Option<DVec3>,
    /// Sum of all trees' light.
    light: f64,
    /// Batches of counts so far.
    batch: u32,
    /// The update of the last one.
    noted: u64,
    /// Trees of the batch that is being noted.
    touched: Vec<TreeKey>,
}

impl LightWorld {
    /// Tells where the picture is taken from, in metres: rebuilds go first to trees whose light is strong there. Trees
    /// that move follow within eight updates; of those that wait at rest, one does in each. O(1).
    ///
    /// # Errors
    /// [`WorldError::NotFinite`] for a coordinate that is NaN or infinite.
    pub fn set_viewpoint(&mut self, eye: DVec3) -> Result<(), WorldError> {
        check_finite("a coordinate of the viewpoint", eye)?;
        self.gaze.eye = Some(eye);
        Ok(())
    }

    /// Tells how often lights of each instance were sampled lately, of a frame or of some, from a part of all samples
    /// or from all: what is sampled most matters most. Better than [`LightWorld::set_viewpoint`], since it knows what is in
    /// sight. Counts of earlier calls fade by a fifth with each; two hundred updates after the last they are forgotten.
    /// Instances that are gone are skipped.
    ///
    /// O(instances that are named).
    pub fn record_usage(&mut self, picks: impl IntoIterator<Item = (InstanceKey, u32)>) {
        let Self { trees, instances, gaze, .. } = self;
        let mut total = 0_u64;
        for (instance, count) in picks {
            let Some(instance) = instances.get(instance) else { continue };
            let attention = &mut trees[instance.tree].standing.attention;
            if count > 0 && attention.counted == 0 {
                gaze.touched.push(instance.tree);
            }
            attention.counted = attention.counted.saturating_add(count);
            total += u64::from(count);
        }
        if total == 0 {
            return;
        }
        gaze.batch = gaze.batch.wrapping_add(1);
        gaze.noted = self.schedule.frame;
        let mut touched = std::mem::take(&mut gaze.touched);
        for key in touched.drain(..) {
            let batch = self.gaze.batch;
            let standing = &mut self.trees[key].standing;
            let attention = &mut standing.attention;
            let share = std::mem::take(&mut attention.counted) as f32 / total as f32;
            attention.picks = attention.picks_at(batch) + (1.0 - KEPT) * share;
            attention.batch = batch;
            if standing.waiting.is_some() {
                self.judge(key);
            }
        }
        self.gaze.touched = touched;
    }

    /// The share of all light that comes from a tree, or of all picks.
    pub(super) fn attention_of(&mut self, key: TreeKey) -> f32 {
        let frame = self.schedule.frame;
        let attention = self.trees[key].standing.attention;
        if attention.weighed.is_none_or(|weighed| frame - weighed >= STALE) {
            let light = self.light_of(key);
            self.gaze.light += f64::from(light) - f64::from(attention.light);
            let attention = &mut self.trees[key].standing.attention;
            attention.light = light;
            attention.weighed = Some(frame);
        }
        let (attention, gaze) = (&self.trees[key].standing.attention, &self.gaze);
        let light = if gaze.light > 0.0 { (f64::from(attention.light) / gaze.light) as f32 } else { 0.0 };
        if gaze.batch == 0 || frame - gaze.noted > LASTING {
            return light;
        }
        (1.0 - UNSEEN_SHARE) * attention.picks_at(gaze.batch) + UNSEEN_SHARE * light
    }

    /// A tree goes.
    pub(super) fn forget_attention(&mut self, key: TreeKey) {
        self.gaze.light -= f64::from(self.trees[key].standing.attention.light);
    }

    /// A tree's light at the eye.
    fn light_of(&self, key: TreeKey) -> f32 {
        let instances = &self.trees[key].instances;
        let step = instances.len().div_ceil(MAX_INSTANCES).max(1);
        let eye = self.gaze.eye.map(|eye| (eye - self.origin).as_vec3());
        let light = instances.iter().step_by(step).map(|instance| {
            let cluster = self.cluster(*instance);
            let dist_sq = eye.map_or(1.0, |eye| eye.distance_squared(cluster.mean) + cluster.variance);
            cluster.flux / dist_sq.max(f32::MIN_POSITIVE)
        });
        let sum = light.sum::<f32>() * step as f32;
        // The eye in the one lamp of a tree: more than this would leave nothing of the others in the sum of all.
        if sum.is_nan() { 0.0 } else { sum.min(MAX_LIGHT) }
    }
}

impl Attention {
    /// Its share of picks once a batch has come.
    fn picks_at(&self, batch: u32) -> f32 {
        self.picks * KEPT.powi(batch.wrapping_sub(self.batch).min(1000) as i32)
    }
}
