//! Packs clusters into a node and unpacks them, as the CPU sees them.
//!
//! Only this file and `shaders/node.wgsl` know the encoding; `gpu/tests/top.rs` compares what both
//! pack. Boxes are quantised as in Ylitie, Karras and Laine (2017). Everything else has a byte or
//! two: at the leaves, where most bytes are, the importance needs no more (docs/decisions.md, 1).
//! Rounding is outward wherever it could hide a light.

use glam::Vec3;

use super::node::{Bytes, EMPTY_SLOT, NO_PARENT, Node, WIDTH};
use super::wide::WideCluster;
use crate::cluster::bounds::Aabb;
use crate::cluster::{Cluster, Emitters, Linear, MIN_AXIS};
use crate::light::UNLIMITED_RANGE;

/// Steps of a box, of a share and of a length.
pub(crate) const STEPS: f32 = 255.0;
/// Steps of a coordinate of a direction.
pub(crate) const DIRECTION_STEPS: f32 = 127.0;
/// Steps from a cosine of 1 to a cosine of 0. Twice this number reaches -1; the last value of the
/// byte is beyond it.
pub(crate) const CAP_STEPS: f32 = 127.0;

/// How the flux of a child is divided between lights without size and surfaces.
#[derive(Clone, Copy)]
pub(crate) struct FluxShares {
    pub punctual: f32,
    pub area: f32,
    /// Whether the axis of emission is that of surfaces: points have none, so surfaces decide it
    /// unless they have much less flux than the others in the instance that the tree was built for.
    pub has_normal: bool,
}

impl FluxShares {
    #[inline(always)]
    pub fn emitters(self) -> Emitters {
        Emitters::of(self.punctual, self.area, self.has_normal)
    }
}

/// The least code of [`Node::area_ratios`] for which the axis of emission is that of surfaces: they
/// have an eighth of the flux of other lights. From half of all flux on, sigma is 0.50 in place of
/// 0.44 in a scene that is squashed by 0.01.
pub(crate) const LEAST_NORMAL_CODE: u32 = 4;

/// The code of [`Node::area_ratios`] for surfaces alone.
pub(crate) const ALL_SURFACES: u32 = 15;

/// The whole number s for which 2^3s is nearest to the factor by which a map changes areas, within
/// the limits of four bits.
fn area_shift(map: &Linear) -> i32 {
    (map.mean_area_scale().log2() / 3.0).round().clamp(-8.0, 7.0) as i32
}

/// An unpacked child. Positions are relative to the viewpoint.
#[derive(Clone, Copy)]
pub(crate) struct Unpacked {
    /// From the viewpoint to the mean position.
    pub toward: [f32; 3],
    /// From the viewpoint to the centre of the box.
    pub center: [f32; 3],
    /// Half the box's edges.
    pub half: [f32; 3],
    /// Squared length of `half`.
    pub radius_sq: f32,
    pub variance: f32,
    /// `variance` over `radius_sq`.
    pub deviation_sq: f32,
    /// A unit vector.
    pub axis: [f32; 3],
    /// Length of the mean direction of emission, in [0, 1].
    pub length: f32,
    pub cos_half_angle: f32,
    pub flux: f32,
    pub range: f32,
}

impl Unpacked {
    /// Squared distance of the box, less `margin` along each axis.
    #[inline(always)]
    pub(crate) fn gap_sq(&self, margin: f32) -> f32 {
        let mut gap_sq = 0.0;
        for k in 0..3 {
            let outside = self.center[k].abs() - (self.half[k] + margin);
            let outside = if outside > 0.0 { outside } else { 0.0 };
            gap_sq += outside * outside;
        }
        gap_sq
    }
}

/// The grid of a node's boxes, relative to a viewpoint.
#[derive(Clone, Copy)]
pub(crate) struct NodeGrid {
    /// From the viewpoint to the grid's origin.
    origin: [f32; 3],
    half_step: [f32; 3],
}

impl Node {
    /// A node without children and without a parent.
    pub const EMPTY: Self = Self {
        origin: [0.0; 3],
        steps: 0,
        children: [EMPTY_SLOT; WIDTH],
        flux: [0; WIDTH],
        low: [[0; WIDTH]; 3],
        high: [[0; WIDTH]; 3],
        mean: [[0; WIDTH]; 3],
        deviation: [0; WIDTH],
        parent: NO_PARENT,
        area_ratios: 0,
        shortness: [STEPS as u8; WIDTH],
        axis: [[0; WIDTH], [0; WIDTH], [DIRECTION_STEPS as i8; WIDTH]],
        cap: [2 * CAP_STEPS as u8; WIDTH],
        range: [packed_range(UNLIMITED_RANGE); WIDTH],
    };

    /// Decodes the cluster of the child in a slot. Rounding makes its bounds wider than the packed
    /// cluster's. [`Cluster::EMPTY`] for a dark child, an unused slot, and a slot outside the node
    /// (from [`WIDTH`] on).
    ///
    pub fn cluster(&self, slot: usize) -> Cluster {
        if slot >= WIDTH {
            return Cluster::EMPTY;
        }
        let grid = self.grid(Vec3::ZERO);
        let child = self.unpack(slot, &grid);
        if child.flux <= 0.0 {
            return Cluster::EMPTY;
        }
        let shares = self.flux_shares(slot);
        let corner = |bytes: &[Bytes; 3]| {
            Vec3::from([0, 1, 2].map(|k| self.origin[k] + f32::from(bytes[k][slot]) * (2.0 * grid.half_step[k])))
        };
        Cluster {
            aabb: Aabb { min: corner(&self.low), max: corner(&self.high) },
            flux: child.flux,
            area_flux: child.flux * shares.area,
            punctual_flux: child.flux * shares.punctual,
            mean: child.toward.into(),
            variance: child.variance,
            // The cap keeps its direction even if the length of the axis packs to 0.
            axis: Vec3::from(child.axis) * child.length.max(MIN_AXIS),
            cos_half_angle: child.cos_half_angle,
            range: child.range,
        }
    }

    /// Packs eight clusters whose boxes are all inside `bounds`. Targets and parent stay as they
    /// are.
    #[inline(always)]
    pub(crate) fn pack(&mut self, wide: &WideCluster, bounds: &Aabb, count: usize) {
        self.steps = (count as u32) << 24;
        if bounds.is_empty() {
            *self = Self { steps: self.steps, parent: self.parent, children: self.children, ..Self::EMPTY };
            return;
        }
        let mut half_diagonal_sq = [0.0; WIDTH];
        for k in 0..3 {
            let origin = bounds.min[k];
            let step_bits = step_bits(origin, bounds.max[k]);
            let step = f32::from_bits(step_bits << 23);
            let per_step = if step > 0.0 { 1.0 / step } else { 0.0 };
            self.origin[k] = origin;
            self.steps |= step_bits << (8 * k);
            for i in 0..WIDTH {
                let is_lit = wide.flux[i] > 0.0;
                let (min, max) = if is_lit { (wide.min[k][i], wide.max[k][i]) } else { (origin, origin) };
                // Rounding may be off by one step either way, so compare what is decoded.
                let low = nearest((min - origin) * per_step);
                let low = if origin + low * step > min { low - 1.0 } else { low };
                let high = nearest((max - origin) * per_step);
                let high = if origin + high * step < max { high + 1.0 } else { high };
                let (from, to) = (origin + low * step, origin + high * step);
                let width = to - from;
                let share = (wide.mean[k][i] - from) / if width > 0.0 { width } else { 1.0 };
                self.low[k][i] = byte(low);
                self.high[k][i] = byte(high);
                self.mean[k][i] = byte(if is_lit { share * STEPS } else { 0.0 });
                half_diagonal_sq[i] += 0.25 * width * width;
            }
        }
        let mut axis = [[0.0; WIDTH]; 3];
        for i in 0..WIDTH {
            let [x, y, z] = [wide.axis[0][i], wide.axis[1][i], wide.axis[2][i]];
            let length = (x * x + y * y + z * z).sqrt();
            let length = if wide.flux[i] > 0.0 { length } else { 0.0 };
            let inverse = if length > 0.0 { 1.0 / length } else { 0.0 };
            let quantised = [x, y, z].map(|v| nearest_signed(v * inverse * DIRECTION_STEPS));
            // Store some direction even where there is none: unpacking divides by its length.
            let quantised = if length > 0.0 { quantised } else { [0.0, 0.0, DIRECTION_STEPS] };
            let [x, y, z] = quantised;
            let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
            for k in 0..3 {
                self.axis[k][i] = signed_byte(quantised[k]);
                axis[k][i] = quantised[k] * inverse;
            }
            let shortness = 1.0 - if length < 1.0 { length } else { 1.0 };
            self.shortness[i] = byte(shortness.sqrt() * STEPS);
            let ratio_sq = wide.variance[i] / if half_diagonal_sq[i] > 0.0 { half_diagonal_sq[i] } else { 1.0 };
            self.deviation[i] = byte(ratio_sq.sqrt() * STEPS);
        }
        let caps = wide.caps_about(axis);
        for i in 0..WIDTH {
            let is_lit = wide.flux[i] > 0.0;
            let steps = if is_lit { (1.0 - caps[i]) * CAP_STEPS } else { 2.0 * CAP_STEPS };
            let whole = nearest(steps);
            self.cap[i] = byte(if whole < steps { whole + 1.0 } else { whole });
            let has_range = is_lit & (wide.range[i] < UNLIMITED_RANGE);
            self.range[i] = packed_range(if has_range { wide.range[i] } else { UNLIMITED_RANGE });
            self.flux[i] = packed_flux(wide.flux[i]);
        }
    }

    /// Packs how the flux of each child is divided between surfaces and lights without size, after
    /// [`Node::pack`]. The ratios are most exact for the map `reference` of the tree.
    pub(crate) fn pack_area_ratios(&mut self, wide: &WideCluster, reference: Option<&Linear>) {
        let shift = reference.map_or(0, area_shift);
        self.steps = self.steps & 0x0fff_ffff | (shift as u32) << 28;
        self.area_ratios = 0;
        for i in 0..WIDTH {
            let (area, punctual) = (wide.area_flux[i], wide.punctual_flux[i]);
            let code = if area <= 0.0 {
                0
            } else if punctual <= 0.0 {
                ALL_SURFACES
            } else {
                // A quotient that leaves f32 has the last code on its side.
                let ratio = (area / punctual).log2() + (3 * shift) as f32;
                (ratio + 7.0).round().clamp(1.0, 14.0) as u32
            };
            self.area_ratios |= code << (4 * i);
        }
    }

    /// How the flux of the child in slot `i` is divided.
    #[inline(always)]
    pub(crate) fn flux_shares(&self, i: usize) -> FluxShares {
        let code = self.area_ratios >> (4 * i) & 15;
        let shift = self.steps as i32 >> 28;
        // 2^(k - 7 - 3s) from its exponent.
        let ratio = f32::from_bits(((code as i32 + 120 - 3 * shift) as u32) << 23);
        let punctual = 1.0 / (1.0 + ratio);
        let [punctual, area] = match code {
            0 => [1.0, 0.0],
            ALL_SURFACES => [0.0, 1.0],
            _ => [punctual, ratio * punctual],
        };
        FluxShares { punctual, area, has_normal: code >= LEAST_NORMAL_CODE }
    }

    /// The grid of the children's boxes, relative to a viewpoint.
    #[inline(always)]
    pub(crate) fn grid(&self, viewpoint: Vec3) -> NodeGrid {
        let half_step = [0, 8, 16].map(|shift| 0.5 * f32::from_bits((self.steps >> shift & 0xff) << 23));
        NodeGrid { origin: (Vec3::from(self.origin) - viewpoint).to_array(), half_step }
    }

    /// An upper bound of the sum of absolute coordinates of any point of the boxes, in metres.
    #[inline(always)]
    pub(crate) fn reach(&self, grid: &NodeGrid) -> f32 {
        let mut sum = 0.0;
        for k in 0..3 {
            sum += self.origin[k].abs() + 2.0 * STEPS * grid.half_step[k];
        }
        sum
    }

    /// Unpacks the child in slot `i`. Has no branches, so that the compiler vectorises a loop over
    /// all children.
    #[inline(always)]
    pub(crate) fn unpack(&self, i: usize, grid: &NodeGrid) -> Unpacked {
        let (mut toward, mut center, mut half, mut axis) = ([0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]);
        let mut radius_sq = 0.0;
        for k in 0..3 {
            let (low, high) = (f32::from(self.low[k][i]), f32::from(self.high[k][i]));
            let width = high - low;
            half[k] = width * grid.half_step[k];
            center[k] = grid.origin[k] + (high + low) * grid.half_step[k];
            toward[k] = grid.origin[k]
                + (low + width * (f32::from(self.mean[k][i]) * (1.0 / STEPS))) * (2.0 * grid.half_step[k]);
            axis[k] = f32::from(self.axis[k][i]);
            radius_sq += half[k] * half[k];
        }
        let length_sq = axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2];
        let inverse = 1.0 / if length_sq > 1.0 { length_sq } else { 1.0 }.sqrt();
        let deviation = f32::from(self.deviation[i]) * (1.0 / STEPS);
        let shortness = f32::from(self.shortness[i]) * (1.0 / STEPS);
        let cos = 1.0 - f32::from(self.cap[i]) * (1.0 / CAP_STEPS);
        Unpacked {
            toward,
            center,
            half,
            radius_sq,
            variance: deviation * deviation * radius_sq,
            deviation_sq: deviation * deviation,
            axis: [axis[0] * inverse, axis[1] * inverse, axis[2] * inverse],
            length: 1.0 - shortness * shortness,
            cos_half_angle: if cos > -1.0 { cos } else { -1.0 },
            flux: f32::from_bits(u32::from(self.flux[i]) << 16),
            range: f32::from_bits(u32::from(self.range[i]) << 16),
        }
    }
}

/// Biased exponent of the least power of two of which [`STEPS`] steps reach from `min` to `max`; 0
/// if both are equal.
#[inline(always)]
fn step_bits(min: f32, max: f32) -> u32 {
    if max <= min {
        return 0;
    }
    let bits = (((max - min) / STEPS).to_bits() >> 23).max(1);
    // The power of two of the quotient's exponent is at most the quotient. The next one is enough
    // except for rounding.
    let reaches = |bits: u32| min + STEPS * f32::from_bits(bits << 23) >= max;
    if reaches(bits) {
        bits
    } else if reaches(bits + 1) {
        bits + 1
    } else {
        bits + 2
    }
}

/// The upper half of a flux, rounded to the nearest.
#[inline(always)]
pub(super) const fn packed_flux(flux: f32) -> u16 {
    ((flux.to_bits() + 0x8000) >> 16) as u16
}

/// The upper half of a range, rounded up.
#[inline(always)]
pub(super) const fn packed_range(range: f32) -> u16 {
    ((range.to_bits() + 0xffff) >> 16) as u16
}

/// Adding this to a number in [0, 2^22] leaves the nearest whole number in the last bits.
/// Conversions that check their range are slow and are not vectorised.
const WHOLE: f32 = 8_388_608.0;

/// As [`WHOLE`], for numbers of either sign.
const WHOLE_SIGNED: f32 = 1.5 * WHOLE;

/// The nearest whole number, for numbers in [0, 2^22].
#[inline(always)]
fn nearest(x: f32) -> f32 {
    (x + WHOLE) - WHOLE
}

/// As [`nearest`], for numbers of either sign.
#[inline(always)]
fn nearest_signed(x: f32) -> f32 {
    (x + WHOLE_SIGNED) - WHOLE_SIGNED
}

/// The nearest byte. Clamps the values that rounding moved out of a byte's range.
#[inline(always)]
fn byte(x: f32) -> u8 {
    let x = if x > 0.0 { x } else { 0.0 };
    ((if x < STEPS { x } else { STEPS }) + WHOLE).to_bits() as u8
}

/// The nearest signed byte.
#[inline(always)]
fn signed_byte(x: f32) -> i8 {
    (x + WHOLE_SIGNED).to_bits() as i8
}

#[cfg(test)]
mod tests {
    use glam::Mat3;

    use super::*;
    use crate::cluster::cone::angle;

    fn pack(clusters: &[Cluster]) -> Node {
        let mut wide = WideCluster::EMPTY;
        clusters.iter().enumerate().for_each(|(lane, cluster)| wide.set(lane, cluster));
        let mut node = Node::EMPTY;
        node.pack(&wide, &wide.merged().cluster.aabb, clusters.len());
        node
    }

    #[test]
    fn a_packed_cap_contains_the_original_cap_and_packed_moments_are_close() {
        for i in 0..20_000 {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / 20_000.0;
            let (s, c) = (i as f32 * 2.399_963_2).sin_cos();
            let d = (Vec3::new(c, s, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z).normalize();
            let half_angle = i as f32 / 20_000.0 * 3.1;
            let length = 0.05 + 0.949 * ((i * 7) % 1000) as f32 / 1000.0;
            let cluster = Cluster {
                aabb: Aabb::around([Vec3::ONE, Vec3::new(4.0, 1.0, -2.0)]),
                flux: 3.7,
                mean: Vec3::new(2.0, 1.0, 0.5),
                variance: 1.3,
                axis: d * length,
                cos_half_angle: half_angle.cos(),
                ..Cluster::EMPTY
            };
            let back = pack(&[cluster]).cluster(0);
            let axis = back.axis.normalize();
            // Each coordinate is off by half a step of 1/127.
            assert!(angle(axis, d) < 7.0e-3, "{d}");
            let outer = back.cos_half_angle.acos();
            assert!(back.cos_half_angle <= -1.0 || angle(axis, d) + half_angle <= outer, "{half_angle}");
            // The cap grows by the angle between both axes and by one step of 1/127.
            let grown = (angle(axis, d) + half_angle).min(std::f32::consts::PI).cos() - 1.0 / CAP_STEPS - 1.0e-3;
            assert!(back.cos_half_angle >= grown.max(-1.0), "{half_angle} {} {grown}", back.cos_half_angle);
            assert!((back.axis.length() - length).abs() < 4.0e-3, "{length} {}", back.axis.length());
            assert!((back.flux / 3.7 - 1.0).abs() < 4.0e-3 && (back.variance / 1.3 - 1.0).abs() < 1.0e-2);
            assert!(back.mean.distance(cluster.mean) < 0.02, "{}", back.mean);
        }
    }

    #[test]
    fn packed_boxes_and_ranges_contain_the_original_ones_at_any_scale_and_distance() {
        for scale in [1.0e-30_f32, 1.0e-3, 1.0, 1.0e9] {
            for shift in [0.0_f32, 1.0, 1.0e6, -1.0e9] {
                let corner = |i: u32| {
                    let f = |k: u32| ((i * (2 * k + 3) * 7919) % 1000) as f32 / 1000.0;
                    Vec3::new(f(0), f(1) - 0.5, 0.0) * scale + shift
                };
                let cluster = |i: u32| Cluster {
                    aabb: Aabb::around([corner(i), corner(i + 50)]),
                    flux: 1.0,
                    range: 0.01 + i as f32 * scale,
                    ..Cluster::EMPTY
                };
                let clusters: Vec<Cluster> = (1..9).map(cluster).collect();
                let node = pack(&clusters);
                for (lane, cluster) in clusters.iter().enumerate() {
                    let back = node.cluster(lane);
                    assert!(back.aabb.contains(&cluster.aabb), "{scale} {shift}: {back:?} {cluster:?}");
                    assert!(back.range >= cluster.range.min(UNLIMITED_RANGE));
                    let slack = node.cluster(lane).aabb.extent() - cluster.aabb.extent();
                    let most = (corner(1) - corner(9)).abs().max_element().max(scale) / 50.0 + shift.abs() * 3.0e-7;
                    assert!(slack.max_element() <= most.max(1.0e-36), "{scale} {shift} {slack}");
                }
            }
        }
    }

    #[test]
    fn a_dark_cluster_packs_to_zero_flux_and_no_cone_or_range() {
        let lamp = Cluster { aabb: Aabb::point(Vec3::X), flux: 1.0e-18, mean: Vec3::X, ..Cluster::EMPTY };
        let node = pack(&[Cluster { mean: Vec3::Y, ..Cluster::EMPTY }, lamp]);
        assert_eq!((node.flux[0], node.count()), (0, 2));
        assert!(node.cluster(0).aabb.is_empty() && node.cluster(1).flux > 0.0);
        assert_eq!(pack(&[Cluster::EMPTY]).flux, [0; WIDTH]);
        // A GPU that does not store cones or ranges reads their defaults without looking at the
        // flux, so a dark child has to have these defaults too.
        let dark = Cluster { axis: Vec3::X, range: 1.0, ..Cluster::EMPTY };
        let node = pack(&[dark, lamp, Cluster { range: f32::INFINITY, cos_half_angle: -1.0, ..lamp }]);
        assert_eq!(
            (node.axis, node.shortness, node.range[0]),
            (Node::EMPTY.axis, Node::EMPTY.shortness, node.range[2])
        );
        assert_eq!((node.cap[0], node.cap[2], node.range[0]), (254, 254, Node::EMPTY.range[0]));
    }

    #[test]
    fn the_cluster_of_an_unused_slot_or_of_one_outside_the_node_is_empty() {
        let node = pack(&[Cluster { aabb: Aabb::point(Vec3::X), flux: 1.0, mean: Vec3::X, ..Cluster::EMPTY }]);
        assert!(node.cluster(0).flux > 0.0);
        for slot in [1, WIDTH - 1, WIDTH, WIDTH + 1, usize::MAX] {
            assert_eq!(node.cluster(slot), Cluster::EMPTY);
            assert_eq!(Node::EMPTY.child(slot), None);
        }
    }

    #[test]
    fn packed_shares_are_near_the_exact_ones_for_every_ratio_of_fluxes_and_every_scale() {
        // The shift is -8 at a scale of 1/256 and below, and 7 from 2^10.5 on.
        for scale in [1.0e-9, 1.0 / 256.0, 0.01, 0.5, 1.0, 100.0, 1.0e9_f32] {
            let map = Linear::new(Mat3::from_diagonal(Vec3::splat(scale)));
            for i in -3000_i32..=3000 {
                // Ratios from 1e-30 to 1e30, and fluxes from the least to the greatest.
                let slot = i.unsigned_abs() as usize % WIDTH;
                let ratio = 10.0_f64.powf(f64::from(i) / 100.0);
                for total in [1.0e-18, 1.0, 1.0e34] {
                    let [area_flux, punctual_flux] =
                        [ratio / (1.0 + ratio), 1.0 / (1.0 + ratio)].map(|share| (total * share) as f32);
                    let mut wide = WideCluster::EMPTY;
                    wide.set(slot, &Cluster { flux: total as f32, area_flux, punctual_flux, ..Cluster::EMPTY });
                    let mut node = Node::EMPTY;
                    node.set_count(WIDTH);
                    node.pack_area_ratios(&wide, Some(&map));
                    assert_eq!(node.count(), WIDTH);
                    let FluxShares { punctual, area, .. } = node.flux_shares(slot);
                    assert_eq!((area == 0.0, punctual == 0.0), (area_flux == 0.0, punctual_flux == 0.0), "{ratio}");
                    // As the map changes the fluxes.
                    let factor = f64::from(scale).powi(2).clamp(2.0_f64.powi(-25), 2.0_f64.powi(22));
                    let share = |area: f64, punctual: f64| area * factor / (area * factor + punctual);
                    let packed = share(area.into(), punctual.into());
                    let exact = share(area_flux.into(), punctual_flux.into());
                    // A ratio is at most a factor of √2 off; beyond 2^(6 - 1.5) it may be that of the
                    // last code.
                    let ratio_of = |share: f64| share / (1.0 - share);
                    let off = ratio_of(packed) / ratio_of(exact);
                    let is_near = (0.7..1.42).contains(&off) || (packed - exact).abs() < 0.045;
                    assert!(is_near, "{ratio} at {scale}: {packed} and not {exact}");
                }
            }
        }
    }
}
