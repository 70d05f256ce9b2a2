//! The filter of the noise where surfaces that emit and others share pixels.

use girandole::light::luminance;

use crate::gltf::stage;
use crate::images::{frame, rel_mse, session, settings};
use testbed::render::backend::BackendChoice;
use testbed::testing::gltf_documents::{square, square_primitive};

/// A lit window that fills the picture, behind bars of about half a pixel.
fn window() -> String {
    let bars = (0..15).map(|bar| {
        let x = 0.23 * f64::from(bar) - 1.6;
        format!("{{'mesh':1,'scale':[0.015,2,1],'translation':[{x},0,0.02]}}")
    });
    square().text(&format!(
        "'cameras':[{{'type':'perspective','perspective':{{'yfov':0.6,'znear':0.1}}}}],\
         'nodes':[{{'mesh':0,'scale':[4,4,1]}},{{'camera':0,'translation':[0,0,5]}},{}],\
         'meshes':[{{'primitives':[{}]}},{{'primitives':[{}]}}],\
         'materials':[{{'emissiveFactor':[1,0.8,0.5]}},{{'pbrMetallicRoughness':{{'baseColorFactor':[0.1,0.1,0.1,1]}}}}]",
        bars.collect::<Vec<_>>().join(","),
        square_primitive(0),
        square_primitive(1),
    ))
}

#[test]
fn no_dots_remain_of_thin_frames_before_a_light() {
    let render = |spp| {
        let mut session = session(stage("window", &window()), settings(96, 54, spp, 3), BackendChoice::Cpu);
        let image = frame(&mut session).image;
        let filtered = session.denoise(&image);
        (image, filtered)
    };
    let (reference, filtered_reference) = render(1024);
    let (noisy, filtered) = render(1);
    let dots = |image: &testbed::render::image::Image| {
        let pixels = image.pixels.iter().zip(&reference.pixels);
        pixels.filter(|(pixel, expected)| luminance(**pixel) < 0.5 * luminance(**expected)).count()
    };
    assert!(dots(&noisy) > 200, "{}", dots(&noisy));
    assert_eq!(dots(&filtered), 0);
    let (before, after) = (rel_mse(&noisy, &reference), rel_mse(&filtered, &reference));
    assert!(after < 0.1 * before, "relMSE {before} before, {after} after");
    // With many samples, frames are as sharp as they were.
    let change = rel_mse(&filtered_reference, &reference);
    assert!(change < 0.01 * before, "relMSE {change} of the filtered reference, {before} of the picture of 1 sample");
}
