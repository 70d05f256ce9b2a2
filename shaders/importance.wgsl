// How much light a cluster probably sends to a receiver; zero only where its bounds prove it. Twin of
// src/importance.rs, which explains it and owns the constants. Binds nothing.

struct LightReceiver {
    // Metres, relative to the world's origin.
    position: vec3<f32>,
    // Unit normal of the side that light arrives at; zero for a point in a volume.
    normal: vec3<f32>,
}

// A receiver in the space of the nodes that are walked.
struct LightView {
    position: vec3<f32>,
    normal: vec3<f32>,
    range_scale: f32,
    margin: f32,
    keeps_angles: bool,
}

fn light_importance(child: LightChild, view: LightView) -> f32 {
    if child.flux <= 0.0 || light_provably_dark(child, view) {
        return 0.0;
    }
    let toward = child.mean - view.position;
    let dist_sq = dot(toward, toward);
    let spread = child.variance / max(dist_sq + child.variance, LIGHT_TINY);
    var direction = vec3(0.0);
    if dist_sq > 0.0 {
        direction = toward / sqrt(dist_sq);
    }

    var cosine = 1.0;
    if any(view.normal != vec3(0.0)) {
        let cos = dot(view.normal, direction);
        let width = LIGHT_COSINE_WIDTH * LIGHT_COSINE_WIDTH * spread;
        cosine = max(0.5 * (cos + sqrt(cos * cos + width)), LIGHT_FLOOR);
    }

    let length = min(light_lobe_length(child), LIGHT_LONGEST_LOBE);
    let share = LIGHT_LOBE_SHARE * min(length / LIGHT_LAMBERTIAN, 1.0) * (1.0 - spread);
    let cos = -dot(light_unpack_direction(child.lobe_axis), direction);
    let half = clamp(0.5 + 0.5 * cos, 1.0e-6, 1.0);
    var peak = 5.0 * (half * half) * (half * half);
    if length > LIGHT_LAMBERTIAN {
        let exponent = 2.0 * length / (1.0 - length);
        peak = (exponent + 1.0) * pow(half, exponent);
    }
    let lobe = 1.0 - share + share * peak;

    let reach = LIGHT_FOUR_PI * max(dist_sq + LIGHT_VARIANCE_SHARE * child.variance, LIGHT_LEAST);
    return clamp(child.flux * lobe * cosine / reach, LIGHT_LEAST, LIGHT_MOST);
}

fn light_provably_dark(child: LightChild, view: LightView) -> bool {
    let half = 0.5 * (child.box_max - child.box_min);
    let center = child.box_min + half - view.position;
    let size = abs(child.box_min) + abs(child.box_max) + abs(view.position);
    let margin = (size.x + size.y + size.z) * view.margin;

    let highest = dot(view.normal, center) + dot(abs(view.normal), half);
    let normal_sum = abs(view.normal.x) + abs(view.normal.y) + abs(view.normal.z);
    if highest + normal_sum * margin <= 0.0 && any(view.normal != vec3(0.0)) {
        return true;
    }

    let outside = max(abs(center) - half - vec3(margin), vec3(0.0));
    let reach = child.range * view.range_scale * (1.0 + LIGHT_COSINE_MARGIN);
    let gap = length(outside);
    if child.range < LIGHT_FARTHEST && gap > reach && gap <= LIGHT_LONGEST {
        return true;
    }

    let cos_half_angle = light_cos_half_angle(child);
    if !view.keeps_angles || cos_half_angle <= -1.0 {
        return false;
    }
    let radius = length(half) * (1.0 + LIGHT_COSINE_MARGIN) + margin;
    let distance = length(center);
    if distance <= radius || distance > LIGHT_LONGEST {
        return false;
    }
    let cos_axis = -dot(light_unpack_direction(child.cone_axis), center) / distance;
    let sin_box = radius / distance;
    let cos_box = sqrt(max(1.0 - sin_box * sin_box, 0.0));
    if cos_axis >= cos_box {
        return false;
    }
    let sin_axis = sqrt(max(1.0 - cos_axis * cos_axis, 0.0));
    let cos_nearest = cos_axis * cos_box + sin_axis * sin_box;
    return cos_nearest + LIGHT_COSINE_MARGIN < cos_half_angle;
}
