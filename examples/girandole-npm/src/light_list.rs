//! Lists of lights, from which trees are made.

use girandole::Light;
use wasm_bindgen::prelude::wasm_bindgen;

use crate::failure::Failure;
use crate::vectors::{vector, vectors};

/// The lights of a tree, in the space of the tree: metres, radians, and linear colours in candela or nits. Their
/// indices count from 0. A call that takes a list uses it up.
#[wasm_bindgen]
#[derive(Default)]
pub struct LightList(Vec<Light>);

fn within(light: Light, range: Option<f32>) -> Light {
    range.map_or(light, |range| light.with_range(range))
}

fn with_sides(light: Light, two_sided: Option<bool>) -> Light {
    if two_sided == Some(true) { light.two_sided() } else { light }
}

impl LightList {
    pub fn into_lights(self) -> Vec<Light> {
        self.0
    }
}

#[wasm_bindgen]
impl LightList {
    /// Creates an empty list.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        Self::default()
    }

    /// The number of lights.
    #[wasm_bindgen(getter)]
    pub fn length(&self) -> u32 {
        self.0.len() as u32
    }

    /// Adds a point light. It is dark from `range` metres on, if that is given.
    pub fn point(
        &mut self,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] position: &[f32],
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] candela: &[f32],
        range: Option<f32>,
    ) -> Result<(), Failure> {
        let light = Light::point(vector("position", position)?, vector("candela", candela)?);
        self.0.push(within(light, range));
        Ok(())
    }

    /// Adds a spot light along the unit vector `direction`. Its intensity is full up to the inner angle from
    /// the axis, and 0 from the outer angle on.
    #[wasm_bindgen]
    pub fn spot(
        &mut self,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] position: &[f32],
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] direction: &[f32],
        #[wasm_bindgen(js_name = innerAngle)] inner_angle: f32,
        #[wasm_bindgen(js_name = outerAngle)] outer_angle: f32,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] candela: &[f32],
        range: Option<f32>,
    ) -> Result<(), Failure> {
        let [position, direction] = [vector("position", position)?, vector("direction", direction)?];
        let light = Light::spot(position, direction, inner_angle, outer_angle, vector("candela", candela)?);
        self.0.push(within(light, range));
        Ok(())
    }

    /// Adds a sphere.
    pub fn sphere(
        &mut self,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] center: &[f32],
        radius: f32,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] nits: &[f32],
    ) -> Result<(), Failure> {
        self.0.push(Light::sphere(vector("center", center)?, radius, vector("nits", nits)?));
        Ok(())
    }

    /// Adds a parallelogram with edges of 2 `halfU` and 2 `halfV`. It shines to the side of their cross
    /// product, or to both sides.
    pub fn rectangle(
        &mut self,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] center: &[f32],
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>", js_name = halfU)] half_u: &[f32],
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>", js_name = halfV)] half_v: &[f32],
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] nits: &[f32],
        #[wasm_bindgen(js_name = twoSided)] two_sided: Option<bool>,
    ) -> Result<(), Failure> {
        let [center, half_u, half_v] = [vector("center", center)?, vector("halfU", half_u)?, vector("halfV", half_v)?];
        self.0.push(with_sides(Light::rectangle(center, half_u, half_v, vector("nits", nits)?), two_sided));
        Ok(())
    }

    /// Adds triangles of nine numbers each. A triangle shines to the side from which its corners are
    /// counter-clockwise, or to both sides.
    pub fn triangles(
        &mut self,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] corners: &[f32],
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] nits: &[f32],
        #[wasm_bindgen(js_name = twoSided)] two_sided: Option<bool>,
    ) -> Result<(), Failure> {
        let (corners, nits) = (vectors("corners", corners)?, vector("nits", nits)?);
        let (triangles, rest) = corners.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(Failure::Plain(format!("corners: {} points, which is no multiple of 3", corners.len())));
        }
        self.0.extend(triangles.iter().map(|corners| with_sides(Light::triangle(*corners, nits), two_sided)));
        Ok(())
    }
}
