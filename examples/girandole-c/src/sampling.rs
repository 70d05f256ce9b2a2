//! Sampling on the CPU, in batches.

use girandole::{DirectionalKey, Incident, InstanceKey, LightId, LightSample, LightSampler, ShadingPoint};

use crate::memory::{Output, array, list, object, output};
use crate::shading_point::{GirandoleShadingPoint, shading_point};
use crate::status::{Failure, GirandoleStatus, call};
use crate::vectors::GirandoleVec3;
use crate::world::GirandoleWorld;

/// What a GirandoleLightId names: one of GIRANDOLE_ID_*.
pub type GirandoleIdKind = u32;
/// No light: a sample that counts as black.
pub const GIRANDOLE_ID_NONE: GirandoleIdKind = 0;
/// A light of an instance.
pub const GIRANDOLE_ID_INSTANCE: GirandoleIdKind = 1;
/// A directional light.
pub const GIRANDOLE_ID_DIRECTIONAL: GirandoleIdKind = 2;

/// Identifies a light that can be sampled.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GirandoleLightId {
    /// The key of the instance or of the directional light; 0 for GIRANDOLE_ID_NONE.
    pub key: u64,
    /// One of GIRANDOLE_ID_*.
    pub kind: GirandoleIdKind,
    /// The index in the instance's tree; 0 for other kinds.
    pub light: u32,
}

impl From<LightId> for GirandoleLightId {
    fn from(id: LightId) -> Self {
        match id {
            LightId::Local { instance, light } => Self { key: instance.into(), kind: GIRANDOLE_ID_INSTANCE, light },
            LightId::Directional(key) => Self { key: key.into(), kind: GIRANDOLE_ID_DIRECTIONAL, light: 0 },
            _ => unreachable!("this version has no others"),
        }
    }
}

/// `None` names no light.
fn id(given: &GirandoleLightId) -> Result<Option<LightId>, Failure> {
    match given.kind {
        GIRANDOLE_ID_NONE => Ok(None),
        GIRANDOLE_ID_INSTANCE => {
            Ok(Some(LightId::Local { instance: InstanceKey::from(given.key), light: given.light }))
        }
        GIRANDOLE_ID_DIRECTIONAL => Ok(Some(LightId::Directional(DirectionalKey::from(given.key)))),
        other => Err(Failure::bad_value("kind of light id", other)),
    }
}

/// A light, a point on it, and the light that arrives from there without shadows.
///
/// Unless a shadow ray to the point is blocked, brdf * cosine * radiance * weight estimates the reflected
/// light of all lights. A blocked sample counts as black, and so does a sample without a light, whose weight
/// is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct GirandoleSample {
    /// The light.
    pub light: GirandoleLightId,
    /// Unit vector from the shading point to the point on the light.
    pub direction: GirandoleVec3,
    /// Metres to the light; INFINITY for a directional light.
    pub dist: f32,
    /// Nits; if is_delta is 1, lux on a surface that faces the light.
    pub radiance: GirandoleVec3,
    /// Density of the direction per steradian; 1 if is_delta is 1.
    pub pdf: f32,
    /// The probability of the light, in (0, 1]; 0 without a light, and 1 for girandole_world_sample_lights.
    pub pmf: f32,
    /// 1 / (pmf * pdf), or after resampling the weight of the sample that was kept.
    pub weight: f32,
    /// For a segment, metres from its start to the point at which the light arrives.
    pub along: f32,
    /// 1 for lights without size (point, spot, directional), which rays cannot hit; else 0.
    pub is_delta: u32,
    /// What girandole_world_set_user_data has set for the instance.
    pub user_data: u32,
}

fn of_incident(light: LightId, pmf: f32, incident: &Incident) -> GirandoleSample {
    let Incident { direction, dist, radiance, pdf, is_delta, along, .. } = *incident;
    GirandoleSample {
        light: light.into(),
        direction: direction.into(),
        dist,
        radiance: radiance.into(),
        pdf,
        pmf,
        weight: 1.0 / (pmf * pdf),
        along,
        is_delta: is_delta.into(),
        user_data: 0,
    }
}

impl From<LightSample> for GirandoleSample {
    fn from(sample: LightSample) -> Self {
        let LightSample { light, pmf, incident, user_data, .. } = sample;
        Self { user_data, ..of_incident(light, pmf, &incident) }
    }
}

/// The sampler of a const world.
unsafe fn sampler<'a>(world: *const GirandoleWorld) -> Result<LightSampler<'a>, Failure> {
    // SAFETY: see the crate's documentation. No call that changes the world runs before this one returns.
    Ok(unsafe { object(world, "world")? }.read()?.sampler())
}

unsafe fn points(pointer: *const GirandoleShadingPoint, count: usize) -> Result<Vec<ShadingPoint>, Failure> {
    // SAFETY: see the crate's documentation.
    unsafe { array(pointer, count, "shading_points")? }.iter().map(shading_point).collect()
}

/// Random numbers, `N` for each sample.
unsafe fn numbers<'a, const N: usize>(pointer: *const f32, count: usize) -> Result<&'a [[f32; N]], Failure> {
    // SAFETY: an array of arrays has the alignment and layout of its elements, one after the other.
    unsafe { array(pointer.cast::<[f32; N]>(), count, "u") }
}

unsafe fn ids(pointer: *const GirandoleLightId, count: usize) -> Result<Vec<Option<LightId>>, Failure> {
    // SAFETY: see the crate's documentation.
    unsafe { array(pointer, count, "light_ids")? }.iter().map(id).collect()
}

/// Chooses a light and a point on it for each shading point.
///
/// Lights are as of the last update. The first call after a change builds the top level, in O(n log n) for n
/// instances. Any number of threads may sample one world at once. The arrays:
///
///   points   count shading points
///   u        4 * count random numbers, uniform in [0, 1): two choose the light, two the point. The same numbers
///            give the same light. Numbers outside are clamped, and NaN counts as 0.
///   samples  room for count samples
///
/// A sample takes one to two microseconds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_sample(
    world: *const GirandoleWorld,
    shading_points: *const GirandoleShadingPoint,
    u: *const f32,
    count: usize,
    samples: *mut GirandoleSample,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (sampler, points) = unsafe { (sampler(world)?, points(shading_points, count)?) };
        // SAFETY: see the crate's documentation.
        let (u, samples) = unsafe { (numbers::<4>(u, count)?, output(samples, count, "samples")?) };
        let chosen = points.iter().zip(u).map(|(point, u)| sampler.sample(point, *u));
        samples.fill(chosen.map(|sample| sample.map_or_else(GirandoleSample::default, Into::into)));
        Ok(())
    })
}

/// As girandole_world_sample, and keeps one of several candidates in proportion to its unshadowed light. A
/// single shadow ray then gives about as little noise as several. The estimate is brdf * cosine * radiance *
/// weight.
///
/// Of 0 candidates none is kept. u: 5 * count random numbers, of which the fifth of each sample chooses among
/// the candidates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_resample(
    world: *const GirandoleWorld,
    candidates: u32,
    shading_points: *const GirandoleShadingPoint,
    u: *const f32,
    count: usize,
    samples: *mut GirandoleSample,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (sampler, points) = unsafe { (sampler(world)?, points(shading_points, count)?) };
        // SAFETY: see the crate's documentation.
        let (u, samples) = unsafe { (numbers::<5>(u, count)?, output(samples, count, "samples")?) };
        let kept = points
            .iter()
            .zip(u)
            .map(|(point, u)| sampler.reservoir_sample(point, &sampler.resample(point, *u, candidates)));
        samples.fill(kept.map(|sample| sample.map_or_else(GirandoleSample::default, Into::into)));
        Ok(())
    })
}

/// Stores the probability with which girandole_world_sample chooses light_ids[i] for
/// shading_points[i]. 0 for a light that does not exist, is dark or cannot reach the point.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_pmf(
    world: *const GirandoleWorld,
    shading_points: *const GirandoleShadingPoint,
    light_ids: *const GirandoleLightId,
    count: usize,
    pmf: *mut f32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (sampler, points) = unsafe { (sampler(world)?, points(shading_points, count)?) };
        // SAFETY: see the crate's documentation.
        let (ids, pmf) = unsafe { (ids(light_ids, count)?, output(pmf, count, "pmf")?) };
        let pairs = points.iter().zip(ids);
        pmf.fill(pairs.map(|(point, id)| id.map_or(0.0, |id| sampler.pmf(point, id))));
        Ok(())
    })
}

/// Stores numbers that change when the names of light_ids[i] come to mean other lights, as light_generation
/// returns them in shaders: at least 1, or 0 for a stale key, an instance that is not shown, and an index
/// beyond those of the tree.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_generations(
    world: *const GirandoleWorld,
    light_ids: *const GirandoleLightId,
    count: usize,
    generations: *mut u32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (world, ids) = unsafe { (object(world, "world")?.read()?, ids(light_ids, count)?) };
        // SAFETY: see the crate's documentation.
        let generations: Output<'_, u32> = unsafe { output(generations, count, "generations")? };
        generations.fill(ids.into_iter().map(|id| id.and_then(|id| world.generation(id)).unwrap_or(0)));
        Ok(())
    })
}

/// Stores the density with which girandole_world_sample chooses light_ids[i] and the direction to hits[i], a
/// point on that light in metres relative to the origin: pmf * pdf, per steradian. For multiple importance
/// sampling of rays that hit lights.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_pdf(
    world: *const GirandoleWorld,
    shading_points: *const GirandoleShadingPoint,
    light_ids: *const GirandoleLightId,
    hits: *const GirandoleVec3,
    count: usize,
    pdf: *mut f32,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (sampler, points) = unsafe { (sampler(world)?, points(shading_points, count)?) };
        // SAFETY: see the crate's documentation.
        let (ids, hits) = unsafe { (ids(light_ids, count)?, array(hits, count, "hits")?) };
        // SAFETY: see the crate's documentation.
        let pdf: Output<'_, f32> = unsafe { output(pdf, count, "pdf")? };
        let triples = points.iter().zip(ids).zip(hits);
        pdf.fill(triples.map(|((point, id), hit)| id.map_or(0.0, |id| sampler.pdf(point, id, (*hit).into()))));
        Ok(())
    })
}

/// Chooses a point on light_ids[i] as seen from shading_points[i], for sums over all lights: the pmf of these
/// samples is 1. u: 2 * count random numbers. If no light arrives from the chosen point, the sample has no
/// light and a weight of 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_sample_lights(
    world: *const GirandoleWorld,
    shading_points: *const GirandoleShadingPoint,
    light_ids: *const GirandoleLightId,
    u: *const f32,
    count: usize,
    samples: *mut GirandoleSample,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (sampler, points) = unsafe { (sampler(world)?, points(shading_points, count)?) };
        // SAFETY: see the crate's documentation.
        let (ids, u) = unsafe { (ids(light_ids, count)?, numbers::<2>(u, count)?) };
        // SAFETY: see the crate's documentation.
        let samples = unsafe { output(samples, count, "samples")? };
        let arriving = points.iter().zip(ids).zip(u).map(|((point, id), u)| {
            let incident = id.and_then(|id| Some((id, sampler.sample_light(point, id, *u)?)));
            incident.map_or_else(GirandoleSample::default, |(id, incident)| of_incident(id, 1.0, &incident))
        });
        samples.fill(arriving);
        Ok(())
    })
}

/// Lists all lights that can be sampled. The lights of a tree are listed once for each of its instances.
///
/// light_ids has room for capacity elements, and may be NULL if capacity is 0. count gets the number of
/// elements; if it is above capacity, the call stores nothing else and returns GIRANDOLE_ERROR_NO_SPACE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_world_lights(
    world: *const GirandoleWorld,
    light_ids: *mut GirandoleLightId,
    capacity: usize,
    count: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let ids: Vec<_> = unsafe { sampler(world)? }.all_lights().map(GirandoleLightId::from).collect();
        // SAFETY: see the crate's documentation.
        unsafe { list(ids.into_iter(), light_ids, capacity, count) }
    })
}
