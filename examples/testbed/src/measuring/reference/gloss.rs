//! The reflectance of a glossy surface for a cluster (docs/math.md, Glossy surfaces).

use girandole::glam::{DMat2, DVec2};

/// A surface and its viewer. Names are those of the formula.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    pub alpha: f64,
    pub diffuse: f64,
    pub specular: f64,
    /// The view along the tangent and along the normal.
    pub view: DVec2,
}

/// The reflectance, and how it magnifies the rounding of its terms.
#[derive(Clone, Copy, Debug)]
pub struct Reflected {
    pub reflectance: f64,
    pub condition: f64,
}

fn outer(v: DVec2) -> DMat2 {
    DMat2::from_cols(v * v.x, v * v.y)
}

/// For the unit vector (x, y, z) to the mean position of a cluster with the angular size p.
pub fn reflected(surface: &Surface, across: DVec2, z: f64, p: f64) -> Reflected {
    let Surface { alpha, diffuse, specular, view } = *surface;
    let w = view.y;
    let s = DVec2::new(across.x + view.x, across.y) / (z + w);
    let q = across - s * z;
    let widened = (DMat2::IDENTITY + outer(s) - outer(q)) * (0.4 * p / (z + w).powi(2));
    let sigma = DMat2::IDENTITY * (alpha * alpha) + widened;
    let trace = sigma.x_axis.x + sigma.y_axis.y;
    let area = 1.0 + 2.0 * alpha * alpha * s.length_squared() / trace;
    let cosine = 0.5 * (z + w) * area.sqrt();
    let fresnel = specular + (1.0 - specular) * (1.0 - cosine).max(0.0).powi(5);
    let outside = s.dot(sigma.inverse() * s);
    let shadowing = 2.0 * z * w + alpha * (z + w - 2.0 * z * w);
    let determinant = sigma.determinant();
    let lobe = fresnel * area * area / (2.0 * determinant.sqrt() * (1.0 + outside).powi(2) * shadowing);
    // The determinant and the quadratic form are differences of products.
    let products = sigma.x_axis.x * sigma.y_axis.y + sigma.x_axis.y * sigma.y_axis.x;
    // So is what Fresnel's term raises to the fifth power.
    let grazing = 5.0 * (1.0 - cosine).max(0.0).powi(4) / fresnel;
    // And the slopes, which a narrow lobe divides by its width.
    let slope = 2.0 * (across.x.abs() + view.x) / (z + w) * s.length() * trace / determinant / (1.0 + outside);
    let reflectance = diffuse + 0.02 * (diffuse + specular) + lobe;
    let share = lobe / reflectance;
    Reflected {
        reflectance,
        condition: 1.0 + share * (grazing + 2.0 * slope + products / determinant * (1.0 + s.length_squared())),
    }
}
