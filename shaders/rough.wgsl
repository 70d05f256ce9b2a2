// The estimate that walks below the cut of a cell choose by. Twin of src/shading/rough.rs, which explains it and
// owns the constants. Binds nothing.

fn light_rough(packed: LightPackedChild, local: LightLocalShadingPoint, view: LightNodeView) -> f32 {
    let child = light_child(packed, view, view.margin, local);
    let dist_sq = max(child.dist_sq, LIGHT_MIN_IMPORTANCE);
    let dist = sqrt(dist_sq);
    let inverse = 1.0 / dist;
    let inverse_sq = 1.0 / (dist_sq + child.variance);
    let spread = child.variance * inverse_sq;

    let rounded = max(child.along * inverse, LIGHT_ROUGH_COSINE) + LIGHT_ROUGH_RISE * spread;
    let facing_up = select(rounded, LIGHT_BELOW * rounded, child.highest <= 0.0);
    let cosine = select(1.0, facing_up, local.has_normal);

    var flux = child.flux * (1.0 / LIGHT_FOUR_PI);
    // #if FACTORS
    flux *= local.brightness;
    // #endif
    var is_unlikely = false;
    // #if CONES
    let lobe = light_lobe(child, spread, dist_sq, dist);
    // 1 for lights that shine to all sides alike, so that all variants give them the same bits.
    flux *= lobe.value / (dist * lobe.width_sq);
    let toward = LIGHT_ROUGH_SPILL * spread + LIGHT_COSINE_MARGIN - child.facing * inverse;
    is_unlikely = toward < child.cos_half_angle;
    // #endif
    // #if RANGES
    is_unlikely = is_unlikely || dist > child.range;
    // #endif
    var lux = select(flux, flux * LIGHT_UNLIKELY, is_unlikely) * (cosine * inverse_sq);
    // #if GLOSSY
    if local.gloss.alpha > 0.0 {
        lux *= light_reflected(
            local.gloss, child.tangents.x * inverse, child.tangents.y * inverse, cosine, spread,
        ).value;
    }
    // #endif
    return light_limited_importance(lux);
}
