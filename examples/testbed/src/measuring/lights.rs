//! The lights of a world one by one, moved out of their instances, so that all samplers get the
//! same lights.

use crate::measuring::irradiance::irradiance;
use crate::measuring::reflection::reflection;
use girandole::glam::{Mat3, Quat, Vec3};
use girandole::light::luminance;
use girandole::{Incident, Light, LightId, LightSampler, LightWorld, Placement, ShadingPoint, Shape};

/// Every light of a world in the world's space, in the order of [`LightSampler::all_lights`].
pub fn carried(world: &LightWorld) -> Vec<Light> {
    let mut lights = Vec::with_capacity(world.light_count());
    for instance in world.instances() {
        let tree = world.instance(instance).and_then(|i| world.tree(i.tree));
        if let (Some(placement), Some(tree)) = (world.instance(instance).map(|i| i.placement), tree) {
            lights.extend(tree.lights().iter().map(|light| carry(light, &placement)));
        }
    }
    lights
}

/// The illuminance by each light at a shading point, in lux and without shadows: that of
/// [`contribution`].
pub fn contributions(sampler: &LightSampler<'_>, lights: &[LightId], shading_point: &ShadingPoint) -> Vec<f32> {
    lights.iter().map(|light| contribution(sampler, *light, shading_point).map_or(0.0, |(_, lux)| lux)).collect()
}

/// A point on a light as seen from a shading point, and the illuminance by the light in lux without
/// shadows. `None` if that point sends nothing to the shading point.
///
/// The illuminance is exact for points and spots. For lights with a surface it is the estimate from
/// one point, at `u = (0.5, 0.5)`: the radiance times the cosine over the pdf.
pub fn contribution(
    sampler: &LightSampler<'_>,
    light: LightId,
    shading_point: &ShadingPoint,
) -> Option<(Incident, f32)> {
    let incident = sampler.sample_light(shading_point, light, [0.5, 0.5])?;
    let cosine = incident.direction.dot(shading_point.normal).max(0.0);
    Some((incident, luminance(incident.radiance) * cosine / incident.pdf))
}

/// The exact illuminance by each light at a shading point, in lux and without shadows. The lights
/// are in the world's space.
pub fn illuminances(lights: &[Light], shading_point: &ShadingPoint) -> Vec<f32> {
    lights.iter().map(|light| irradiance(light, shading_point) as f32).collect()
}

/// The exact light that a surface reflects of each light toward the viewer, without shadows; for
/// matte surfaces the illuminance. The lights are in the world's space.
pub fn reflections(lights: &[Light], shading_point: &ShadingPoint) -> Vec<f32> {
    lights.iter().map(|light| reflection(light, shading_point) as f32).collect()
}

/// Moves a light from the space of its tree to the world. A sphere that the instance flattens
/// becomes the sphere of the same volume; all other shapes are exact.
fn carry(light: &Light, placement: &Placement) -> Light {
    let linear = placement.linear;
    let point = |p: Vec3| (placement.translation + (linear * p).as_dvec3()).as_vec3();
    let is_mirrored = linear.determinant() < 0.0;
    let shape = match light.shape {
        Shape::Point { position } => Shape::Point { position: point(position) },
        Shape::Spot { position, direction, inner_angle, outer_angle } => Shape::Spot {
            position: point(position),
            direction: (linear * direction).normalize_or(Vec3::Z),
            inner_angle,
            outer_angle,
        },
        // Exact for turns and one scale: a mirrored or sheared beam is turned as its -Z and +X are.
        Shape::Profile { position, rotation, profile } => {
            let axes = linear * Mat3::from_quat(Quat::from_array(rotation));
            let back = axes.z_axis.normalize_or(Vec3::Z);
            let right = axes.x_axis.reject_from_normalized(back).normalize_or(back.any_orthonormal_vector());
            let turned = Mat3::from_cols(right, back.cross(right), back);
            let rotation = Quat::from_mat3(&turned).normalize().to_array();
            Shape::Profile { position: point(position), rotation, profile }
        }
        // In a mirrored instance two corners change places, or the front would become the back.
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            let (u, v) = if is_mirrored { (half_v, half_u) } else { (half_u, half_v) };
            Shape::Rectangle { center: point(center), half_u: linear * u, half_v: linear * v, two_sided }
        }
        Shape::Triangle { vertices: [a, b, c], two_sided } => {
            let vertices = if is_mirrored { [a, c, b] } else { [a, b, c] };
            Shape::Triangle { vertices: vertices.map(point), two_sided }
        }
        Shape::Sphere { center, radius } => {
            Shape::Sphere { center: point(center), radius: radius * linear.determinant().abs().cbrt() }
        }
        _ => unreachable!("this version has no others"),
    };
    light.with_shape(shape)
}
