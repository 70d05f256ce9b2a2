//! The placement of an instance: a linear part in f32 and a translation in f64, which resolves
//! centimetres 10^7 m from the origin.

use glam::{Affine3A, DAffine3, DVec3, Mat3, Mat4, Vec3};

pub use crate::cluster::MAX_SCALE;
use crate::cluster::{Linear, RIGID_TOLERANCE};
use crate::effects::Effects;
use crate::error::{ValueError, check_point, check_range};
use crate::instance::sector::SectorPoint;
use crate::instance::transform::InstanceTransform;
use crate::shading::importance::{CANDELA_PER_LUMEN, LocalShadingPoint, POSITION_MARGIN};
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;
use crate::shading::world_map::WorldMap;
use crate::tree::LEAF;

/// Largest distance of instances and of [`LightWorld::origin`](crate::LightWorld::origin) from zero along each axis,
/// in metres.
pub const MAX_DISTANCE: f64 = 1.0e9;

/// An affine map from the space of a tree to the world: rotation, scale, mirror or shear, and a
/// translation.
///
/// Points and spots keep their intensity and range under any scale, as glTF specifies; surfaces
/// keep their radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The linear part. Its columns are the images of the axes. Entries are at most [`MAX_SCALE`].
    ///
    /// If it has no inverse in single precision, or a scale below 1 / [`MAX_SCALE`], the instance is
    /// hidden: it keeps its key, slot and policy, and contributes nothing until it is moved to another
    /// placement. Engines hide objects by a scale of zero, and animate scales through it.
    pub linear: Mat3,
    /// The translation to the world, in metres: along each axis at most [`MAX_DISTANCE`] from
    /// [`LightWorld::origin`](crate::LightWorld::origin), or from zero where the origin lies on a
    /// grid.
    pub translation: DVec3,
}

impl Placement {
    /// The identity: the space of the tree is that of the world.
    pub const IDENTITY: Self = Self { linear: Mat3::IDENTITY, translation: DVec3::ZERO };

    /// Creates a placement that only translates, in metres.
    pub fn at(translation: DVec3) -> Self {
        Self { translation, ..Self::IDENTITY }
    }
}

impl Default for Placement {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl From<Affine3A> for Placement {
    fn from(a: Affine3A) -> Self {
        Self { linear: a.matrix3.into(), translation: Vec3::from(a.translation).as_dvec3() }
    }
}

impl From<Mat4> for Placement {
    /// Takes an affine matrix; the last row is ignored.
    fn from(m: Mat4) -> Self {
        Self { linear: Mat3::from_mat4(m), translation: m.w_axis.truncate().as_dvec3() }
    }
}

impl From<DAffine3> for Placement {
    /// Rounds the linear part to f32.
    fn from(a: DAffine3) -> Self {
        Self { linear: a.matrix3.as_mat3(), translation: a.translation }
    }
}

/// A placement with what sampling derives from it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub linear: Linear,
    /// The linear part of the inverse.
    pub to_local: Mat3,
    pub determinant: f32,
    /// Whether the placement only rotates and translates.
    pub is_rigid: bool,
    /// The translation.
    pub place: SectorPoint,
}

impl Placed {
    /// Checks a placement and derives the rest; `None` for a linear part that hides the instance.
    pub fn new(placement: &Placement) -> Result<Option<Self>, ValueError> {
        check_entries(&placement.linear)?;
        let place = place(placement.translation)?;
        let exact = placement.linear.as_dmat3();
        let determinant = exact.determinant() as f32;
        // Normal numbers only: a denormal determinant has lost the digits that the inverse needs.
        // Checked before anything is inverted, since glam's assertions panic where there is no
        // inverse.
        if !determinant.is_normal() {
            return Ok(None);
        }
        let to_local = exact.inverse().as_mat3();
        let linear = Linear::new(placement.linear);
        if !(to_local.is_finite() && linear.least_scale >= 1.0 / MAX_SCALE) {
            return Ok(None);
        }
        Ok(Some(Self { linear, to_local, determinant, is_rigid: linear.is_rigid(), place }))
    }

    /// Moves an instance, whose placement is `present`, and from which `placed` was derived, to `placement`. Bit for
    /// bit the same as [`Placed::new`], and faster where the linear part stays the same. Changes nothing if it fails.
    pub fn move_to(
        placed: &mut Option<Self>,
        present: &mut Placement,
        placement: &Placement,
    ) -> Result<(), ValueError> {
        if placement.linear == present.linear {
            let place = place(placement.translation)?;
            placed.iter_mut().for_each(|placed| placed.place = place);
        } else {
            *placed = Self::new(placement)?;
        }
        *present = *placement;
        Ok(())
    }

    /// Whether [`Placed::move_to`] accepts a placement. Derives nothing if the linear part is nearly a rotation, or
    /// stays the same.
    pub fn check(present: &Placement, placement: &Placement) -> Result<(), ValueError> {
        if is_nearly_rotation(&placement.linear) || placement.linear == present.linear {
            return place(placement.translation).map(drop);
        }
        Self::new(placement).map(drop)
    }

    /// The translation relative to the world's origin, which is the centre `home` of a sector.
    pub fn translation(&self, home: Vec3) -> Vec3 {
        self.place.relative_to(home)
    }

    /// The map to the world relative to its origin, which is the centre `home` of a sector.
    pub fn frame(&self, home: Vec3) -> InstanceTransform {
        InstanceTransform {
            to_world: self.linear.linear,
            translation: self.translation(home),
            to_local: self.to_local,
            determinant: self.determinant,
        }
    }

    /// The effects of an instance that is placed here.
    pub fn effects(&self) -> Effects {
        if self.is_rigid { Effects::empty() } else { Effects::NON_RIGID }
    }

    /// A shading point of the world, relative to the centre `home` of a sector, as seen in the
    /// space of the tree or in the axes of the instance. `brightness` is what the flux of the
    /// instance's lights is multiplied by.
    pub fn local_shading_point(
        &self,
        shading_point: &ShadingPoint,
        home: Vec3,
        brightness: f32,
    ) -> LocalShadingPoint<'_> {
        let map = (!self.is_rigid).then(|| WorldMap::new(&self.linear, &self.to_local));
        let (axes, into) = match &map {
            Some(map) => (map.axes, map.axes.transpose()),
            None => (self.linear.linear, self.to_local),
        };
        // Normals are carried back by the transpose: the horizon stays the horizon.
        let normal = (axes.transpose() * shading_point.normal).normalize_or_zero();
        LocalShadingPoint {
            position: into * (shading_point.position - self.translation(home)),
            normal,
            has_normal: normal != Vec3::ZERO,
            margin: POSITION_MARGIN + RIGID_TOLERANCE,
            light_bit: LEAF,
            is_sky: false,
            candela_per_lumen: CANDELA_PER_LUMEN * brightness,
            gloss: LocalShadingPoint::gloss_of(shading_point).map(|gloss| gloss.carried(&axes)),
            segment: LocalSegment::of(shading_point).map(|segment| segment.carried(&into)),
            map,
        }
    }

    /// The largest rounding error of a position in the space of the tree, per metre of its
    /// coordinates. It grows where the instance is squashed.
    pub fn tree_margin(&self) -> f32 {
        POSITION_MARGIN * (self.linear.mean_square_scale.sqrt() * self.inverse_scale()).max(1.0) + RIGID_TOLERANCE
    }

    /// The most metres in the space of the tree per metre of the world.
    pub fn inverse_scale(&self) -> f32 {
        1.0 / self.linear.least_scale
    }
}

fn check_entries(linear: &Mat3) -> Result<(), ValueError> {
    match linear.to_cols_array().into_iter().find(|entry| !(-MAX_SCALE..=MAX_SCALE).contains(entry)) {
        Some(entry) => check_range("an entry of the linear part", entry, -MAX_SCALE, MAX_SCALE),
        None => Ok(()),
    }
}

/// A translation as it is stored.
fn place(translation: DVec3) -> Result<SectorPoint, ValueError> {
    check_point("a coordinate of the translation", translation, MAX_DISTANCE)?;
    Ok(SectorPoint::new(translation))
}

/// Whether lengths change by less than a factor of 4 and angles stay near: such a linear part is
/// never refused. By Gershgorin's theorem the squared scales lie between 0.1 and 2.4. False for NaN.
fn is_nearly_rotation(linear: &Mat3) -> bool {
    let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
    let is_near_one = |column: Vec3| (0.5..2.0).contains(&column.length_squared());
    let is_small = |product: f32| product.abs() < 0.2;
    [x, y, z].into_iter().all(is_near_one) && [x.dot(y), y.dot(z), z.dot(x)].into_iter().all(is_small)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::dice::hash;

    fn place(placement: Placement) -> Result<Option<Placed>, ValueError> {
        Placed::new(&placement)
    }

    fn scaled(x: f32, y: f32, z: f32) -> Placement {
        Placement { linear: Mat3::from_diagonal(Vec3::new(x, y, z)), ..Placement::IDENTITY }
    }

    #[test]
    fn scales_are_refused_above_the_limit_and_hide_below_it() {
        let placed = place(scaled(MAX_SCALE, MAX_SCALE, MAX_SCALE)).unwrap().unwrap();
        assert!(placed.linear.flux(1.0, 1.0, Vec3::X).is_finite());
        let above = MAX_SCALE.next_up();
        assert!(place(scaled(above, above, above)).is_err());
        let least = 1.001 / MAX_SCALE;
        assert!(place(scaled(least, least, least)).unwrap().unwrap().linear.is_similarity);
        let below = 0.9 / MAX_SCALE;
        assert!(place(scaled(below, below, below)).unwrap().is_none());
    }

    #[test]
    fn a_linear_part_without_inverse_hides() {
        let least = f32::from_bits(1);
        let rank_2 = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::X + Vec3::Y);
        let singular = [
            scaled(0.0, 0.0, 0.0),
            scaled(-0.0, 0.0, -0.0),
            scaled(1.0, 0.0, 1.0),
            scaled(0.0, 0.0, 1.0),
            scaled(0.0, least, 0.0),
            scaled(least, least, least),
            Placement { linear: rank_2, ..Placement::IDENTITY },
            Placement { linear: Mat3::from_cols(Vec3::ONE, Vec3::ONE, Vec3::ONE), ..Placement::IDENTITY },
        ];
        for placement in singular {
            assert!(place(placement).unwrap().is_none(), "{placement:?}");
        }
    }

    #[test]
    fn a_hidden_placement_is_refused_for_its_translation_like_any_other() {
        let hidden = |x| Placement { linear: Mat3::ZERO, translation: DVec3::X * x };
        assert!(place(hidden(f64::NAN)).is_err());
        assert!(place(hidden(2.0 * MAX_DISTANCE)).is_err());
    }

    #[test]
    fn translations_are_accepted_up_to_the_limit_and_refused_beyond_it() {
        let nan = Placement::at(DVec3::new(0.0, f64::NAN, 0.0));
        assert!(place(nan).is_err());
        assert!(place(Placement::at(DVec3::X * MAX_DISTANCE)).is_ok());
        let beyond = Placement::at(DVec3::X * MAX_DISTANCE.next_up());
        assert!(place(beyond).is_err());
        assert!(place(Placement::at(DVec3::NEG_Y * f64::INFINITY)).is_err());
    }

    #[test]
    fn a_check_accepts_what_a_move_accepts_and_a_move_is_the_same_as_a_new_placement() {
        let random = |i: u32| (hash(i) >> 8) as f32 / (1 << 23) as f32 - 1.0;
        let bad = [f32::NAN, f32::INFINITY, 0.0, MAX_SCALE, 2.0 * MAX_SCALE, 1.0e-12, 1.0];
        let (mut refused, mut quick) = (0, 0);
        let mut present = Placement::IDENTITY;
        for i in 0..20_000 {
            let r = |j: u32| random(12 * i + j);
            let mut linear = match i % 4 {
                0 => present.linear,
                1 => Mat3::from_rotation_y(9.0 * r(0)) * Mat3::from_rotation_x(9.0 * r(1)) * (1.0 + 0.6 * r(2)),
                _ => Mat3::from_cols_array(&std::array::from_fn(|j| r(j as u32))),
            };
            if i % 7 == 0 {
                linear.col_mut(i as usize % 3)[i as usize / 3 % 3] = bad[i as usize % bad.len()];
            }
            let far = if i % 11 == 0 { MAX_DISTANCE } else { 100.0 };
            let translation = DVec3::new(r(9).into(), r(10).into(), r(11).into()) * far * 1.5;
            let placement = Placement { linear, translation };
            let before = Placed::new(&present).expect("it was accepted");
            let expected = Placed::new(&placement);
            let (mut moved, mut stood) = (before, present);
            let result = Placed::move_to(&mut moved, &mut stood, &placement);
            // NaN differs from itself, so errors and placements are compared as text.
            let (state, place) = match &expected {
                Ok(state) => (state, placement),
                Err(_) => (&before, present),
            };
            assert_eq!(format!("{:?}", result.err()), format!("{:?}", expected.as_ref().err()), "{placement:?}");
            assert_eq!(format!("{moved:?} {stood:?}"), format!("{state:?} {place:?}"), "{placement:?}");
            let checked = Placed::check(&present, &placement);
            assert_eq!(format!("{checked:?}"), format!("{:?}", expected.as_ref().map(|_| ())), "{placement:?}");
            quick += usize::from(is_nearly_rotation(&linear));
            match expected {
                Ok(_) => present = placement,
                Err(_) => refused += 1,
            }
        }
        assert!(refused > 1000 && quick > 1000, "{refused} {quick}");
    }

    #[test]
    fn centimetres_are_kept_ten_thousand_kilometres_from_zero() {
        let home = DVec3::new(9_766.0, 0.0, -9_766.0) * 1024.0;
        let placed = place(Placement::at(home + DVec3::X * 0.01)).unwrap().unwrap();
        assert_eq!(placed.translation(home.as_vec3()), Vec3::X * 0.01);
    }
}
