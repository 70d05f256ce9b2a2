//! The same part of the picture by several samplers in equal time.

use super::measured::{Measured, Panel};
use girandole::glam::Vec3;
use testbed::common::table::short;
use testbed::measuring::crops::{Crops, Window};
use testbed::tone_mapping::agx;

/// The part of a picture that is shown, in pixels, at most.
const CROP: (usize, usize) = (160, 100);

/// Cuts the part with the most contrast out of all pictures and out of the reference.
pub fn crops(measured: &Measured, exposure: f32) -> Result<Crops, String> {
    let window = Window::of_most_contrast(&measured.reference, measured.view.view.width, CROP);
    let to_screen = |pixel: Vec3| agx((pixel * exposure).max(Vec3::ZERO));
    let mut all = Vec::new();
    for Panel { row, picture } in &measured.equal_time {
        let caption = format!("{:.1} samples, relMSE {}", row.setting.samples, short(row.errors.rel_mse.mean));
        all.push(window.cut(picture, to_screen, row.setting.sampler.name(), caption)?);
    }
    let caption = format!("relMSE below {}", short(measured.reference_error.max(1.0e-6)));
    all.push(window.cut(&measured.reference, to_screen, "Reference".into(), caption)?);
    Ok(Crops { all, size: window.size })
}
