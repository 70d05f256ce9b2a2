//! The city's glTF scenes: textures and opacity on both backends, cameras and exposures for files without
//! a camera, and what the user is told.

use std::f32::consts::{PI, TAU};
use std::fs;
use std::path::{Path, PathBuf};

use girandole::glam::{Vec2, Vec3};

use crate::images::{PACE, assert_same_pictures};
use city::app::session::Session;
use testbed::render::backend::{self, BackendChoice};
use testbed::render::geometry::Geometry;
use testbed::render::settings::{LightChoice, Settings};
use testbed::render::shading::View;
use testbed::render::textures::OpacitySeed;
use testbed::scene::{Scene, SceneError, Stage, gltf_scene};
use testbed::testing::gltf_documents::{
    Document, SQUARE, SQUARE_INDICES, data_uri, floats, png, square, square_primitive, textured_scene,
};
use testbed::tone_mapping::agx;

/// Writes a document into a folder of its own and returns its path.
fn write(name: &str, text: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("city_gltf").join(name);
    fs::create_dir_all(&folder).expect("a writable target folder");
    let path = folder.join("scene.gltf");
    fs::write(&path, text).expect("a writable target folder");
    path
}

pub fn stage(name: &str, text: &str) -> Stage {
    gltf_scene::stage(&write(name, text), None).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn refusal(name: &str, text: &str) -> String {
    let SceneError(line) =
        gltf_scene::stage(&write(name, text), None).err().unwrap_or_else(|| panic!("{name} is valid"));
    assert!(!line.contains('\n') && line.contains("scene.gltf: "), "{name}: {line}");
    line
}

#[test]
fn both_backends_render_the_same_picture_of_a_textured_scene() {
    assert_same_pictures("textured", || stage("textured", &textured_scene()), 2);
}

/// A square in the plane of x and y with a material and textures.
fn one_square(material: &str, images: &str) -> String {
    square().text(&format!(
        "'nodes':[{{'mesh':0}}],'meshes':[{{'primitives':[{}]}}],{images}'materials':[{{{material}}}]",
        square_primitive(0)
    ))
}

/// The share of the light that passes a point of the square.
fn transmittance(stage: &Stage, x: f32, y: f32) -> f32 {
    let geometry = Geometry::new(&stage.scene).expect("a valid scene");
    geometry.transmittance(Vec3::new(x, y, 1.0), Vec3::NEG_Z, 2.0)
}

#[test]
fn a_pane_stops_the_share_of_light_that_its_opacity_states() {
    let pane = |mode: &str, opacity: f32| {
        let material = format!("{mode}'pbrMetallicRoughness':{{'baseColorFactor':[1,1,1,{opacity}]}}");
        stage("pane", &one_square(&material, ""))
    };
    assert!((transmittance(&pane("'alphaMode':'BLEND',", 0.1), 0.3, 0.2) - 0.9).abs() < 1e-6);
    assert_eq!(transmittance(&pane("", 0.1), 0.3, 0.2), 0.0);
    assert_eq!(transmittance(&pane("'alphaMode':'MASK',", 0.1), 0.3, 0.2), 1.0);
    assert_eq!(transmittance(&pane("'alphaMode':'MASK','alphaCutoff':0.1,", 0.1), 0.3, 0.2), 0.0);
    let glass = "'extensions':{'KHR_materials_transmission':{'transmissionFactor':0.75}}";
    assert_eq!(transmittance(&stage("glass", &one_square(glass, "")), 0.3, 0.2), 0.75);
    // A camera ray meets the pane for a tenth of all pixels and samples. The standard deviation of the
    // share is at most 0.003 for 10,000 pixels, and five of them are exceeded once in a million; the
    // seed is fixed. The samples of one pixel are evenly distributed.
    let geometry = Geometry::new(&pane("'alphaMode':'BLEND',", 0.1).scene).expect("a valid scene");
    // Off the edge that the square's triangles share.
    let above = Vec3::new(0.3, 0.2, 1.0);
    let meets = |seed: OpacitySeed| geometry.nearest_at_random(above, Vec3::NEG_Z, seed).is_some();
    let share = (0..10_000).filter(|&pixel| meets(OpacitySeed::new(pixel, 3, 1))).count() as f32 / 10_000.0;
    assert!((share - 0.1).abs() < 0.015, "{share}");
    let count = (0..1000).filter(|&sample| meets(OpacitySeed::new(7, sample, 1))).count();
    assert!(count.abs_diff(100) < 5, "{count} of 1000");
    assert!(geometry.nearest(above, Vec3::NEG_Z).is_none());
}

#[test]
fn opacity_is_the_factor_times_the_texture() {
    // The left half is opaque, the right half has an alpha of 102 / 255 = 0.4.
    let image = png(2, 1, |x, _| [255, 255, 255, if x == 0 { 255 } else { 102 }]);
    let images = format!(
        "'images':[{{'uri':'{}'}}],'samplers':[{{'magFilter':9728}}],'textures':[{{'source':0,'sampler':0}}],",
        data_uri(&image)
    );
    let with = |mode: &str| {
        let surface = "'pbrMetallicRoughness':{'baseColorFactor':[1,1,1,0.5],'baseColorTexture':{'index':0}}";
        stage("opacity", &one_square(&format!("'alphaMode':'{mode}','alphaCutoff':0.3,{surface}"), &images))
    };
    let blend = with("BLEND");
    let found = [-0.5, 0.5].map(|x| transmittance(&blend, x, 0.1));
    assert!((found[0] - 0.5).abs() < 1e-6 && (found[1] - 0.8).abs() < 1e-6, "{found:?}");
    let mask = with("MASK");
    assert_eq!([-0.5, 0.5].map(|x| transmittance(&mask, x, 0.1)), [0.0, 1.0]);
}

#[test]
fn invalid_textures_are_refused_in_one_line() {
    let with = |uri: &str| {
        let images = format!("'images':[{{'uri':'{uri}'}}],'textures':[{{'source':0}}],");
        one_square("'pbrMetallicRoughness':{'baseColorTexture':{'index':0}}", &images)
    };
    assert!(refusal("parent", &with("../a.png")).contains("has .. in it"));
    assert!(refusal("absolute", &with("/a.png")).contains("absolute"));
    assert!(refusal("base64", &with("data:image/png;base64,a*")).contains("base64"));
    let SceneError(missing) = gltf_scene::stage(&write("missing", &with("missing.png")), None).err().expect("no image");
    assert!(missing.contains("missing.png: ") && !missing.contains('\n'), "{missing}");
    let whole = png(4, 4, |_, _| [1; 4]);
    let damaged = with(&data_uri(&whole[..whole.len() / 2])).replace("{\"uri\":", "{\"name\":\"wood\",\"uri\":");
    assert!(refusal("damaged", &damaged).contains("scene.gltf: image 0 (wood): it is not a valid PNG"));
    // Other formats are left out with a warning.
    let other = stage("other", &with("data:image/webp;base64,UklGRg=="));
    assert!(
        other.scene.warnings.iter().any(|line| line.contains("not PNG, JPEG or WebP")),
        "{:?}",
        other.scene.warnings
    );
    assert!(other.scene.textures.is_empty());
}

#[test]
fn buffers_outside_of_the_folder_and_unsupported_extensions_are_refused_in_one_line() {
    let text = one_square("", "");
    let start = text.find("data:;base64,").expect("a buffer");
    let end = start + text[start..].find('"').expect("its end");
    let outside = format!("{}../a.bin{}", &text[..start], &text[end..]);
    assert!(refusal("buffer", &outside).contains("has .. in it"));
    let required = "\"extensionsRequired\":[\"EXT_a\",\"KHR_mesh_quantization\",\"EXT_b\",\"EXT_a\"],\"nodes\"";
    // Named before the buffer is missed.
    let line = refusal("extensions", &outside.replacen("\"nodes\"", required, 1));
    assert!(line.ends_with("the file requires extensions that are not supported: EXT_a, EXT_b"), "{line}");
}

#[test]
fn what_is_not_used_is_named_once_with_its_count() {
    let coat = "'extensions':{'KHR_materials_clearcoat':{'clearcoatFactor':1},'KHR_materials_unlit':{}}";
    let bumpy = "'normalTexture':{'index':0}";
    let primitive = square_primitive(0);
    let points = primitive.replacen('{', "{'mode':0,", 1);
    let morphed = primitive.replacen('{', "{'targets':[{'POSITION':0}],", 1);
    let text = square().text(&format!(
        "'extensionsUsed':['KHR_materials_clearcoat','KHR_materials_unlit','MSFT_lod'],'nodes':[{{'mesh':0}}],\
         'meshes':[{{'primitives':[{primitive},{points}]}},\
         {{'primitives':[{morphed}]}}],'images':[{{'uri':'{}'}}],'textures':[{{'source':0}}],\
         'materials':[{{{coat}}},{{{coat},{bumpy}}},{{}}]",
        data_uri(&png(1, 1, |_, _| [0; 4])),
    ));
    let mut found = stage("unused", &text).scene.warnings;
    found.retain(|line| !line.contains("moon"));
    let expected = [
        "KHR_materials_clearcoat is not used (1)",
        "MSFT_lod is not used (1)",
        "morph targets are not used (1)",
        "normal textures are not used (1)",
        "points and lines are not shown (1)",
    ];
    assert_eq!(found, expected);
}

/// The square with a colour for each corner, given as an accessor.
fn colored_square(name: &str, bytes: &[u8], fields: &str) -> Stage {
    let mut document = square();
    let colors = document.accessor(bytes, 4, fields);
    let primitive = square_primitive(0).replace("'TEXCOORD_0':1", &format!("'COLOR_0':{colors}"));
    let material = "'alphaMode':'BLEND','pbrMetallicRoughness':{'baseColorFactor':[0.5,1,1,0.5]}";
    stage(
        name,
        &document.text(&format!(
            "'nodes':[{{'mesh':0}}],'meshes':[{{'primitives':[{primitive}]}}],'materials':[{{{material}}}]"
        )),
    )
}

#[test]
fn colours_of_vertices_are_interpolated_and_multiply_the_material() {
    // Red grows along x from 0.2 to 1 and green along y; blue is 0.6, and alpha is 0.4 if there is one.
    let corner = |x: f32, y: f32| [[0.2, 1.0][x as usize], [0.2, 1.0][y as usize], 0.6, 0.4];
    let corners = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
    let of_three: Vec<f32> = corners.iter().flat_map(|corner| corner[..3].to_vec()).collect();
    let of_four = corners.as_flattened();
    let bytes: Vec<u8> = of_four.iter().map(|value| (value * 255.0).round() as u8).collect();
    let words: Vec<u8> = of_four.iter().flat_map(|value| ((value * 65535.0).round() as u16).to_le_bytes()).collect();
    let cases = [
        ("rgb", floats(&of_three), "'componentType':5126,'type':'VEC3'", 1.0),
        ("rgba", floats(of_four), "'componentType':5126,'type':'VEC4'", 0.4),
        ("bytes", bytes, "'componentType':5121,'normalized':true,'type':'VEC4'", 0.4),
        ("words", words, "'componentType':5123,'normalized':true,'type':'VEC4'", 0.4),
    ];
    for (name, bytes, fields, alpha) in cases {
        let stage = colored_square(name, &bytes, fields);
        let geometry = Geometry::new(&stage.scene).expect("a valid scene");
        let (x, y) = (0.5, -0.25);
        let seed = (0..).map(|pixel| OpacitySeed::new(pixel, 0, 1));
        let mut hits = seed.filter_map(|seed| geometry.nearest_at_random(Vec3::new(x, y, 1.0), Vec3::NEG_Z, seed));
        let material = geometry.material(&stage.scene, &hits.next().expect("endless seeds"));
        // 0.5 of the material times 0.2 + 0.8 * 0.75, and 0.2 + 0.8 * 0.375.
        assert!(material.base_color.abs_diff_eq(Vec3::new(0.4, 0.5, 0.6), 1e-5), "{name}: {}", material.base_color);
        assert!((transmittance(&stage, x, y) - (1.0 - 0.5 * alpha)).abs() < 1e-5, "{name}");
        assert!(!stage.scene.warnings.iter().any(|line| line.contains("colours")), "{:?}", stage.scene.warnings);
    }
    let beyond = colored_square("beyond", &floats(&[2.0; 12]), "'componentType':5126,'type':'VEC3'");
    let expected = "colours of vertices outside of 0 to 1 are clamped (6)";
    assert!(beyond.scene.warnings.iter().any(|line| line == expected), "{:?}", beyond.scene.warnings);
}

/// A sphere of radius 1 from few triangles, with the normals of the sphere: its positions, which are also
/// its normals, and its indices.
fn sphere(columns: u16, rows: u16) -> (Vec<[f32; 3]>, Vec<u8>) {
    let at = |row: u16, column: u16| {
        let (sin, cos) = (PI * f32::from(row) / f32::from(rows)).sin_cos();
        let (sin_side, cos_side) = (TAU * f32::from(column) / f32::from(columns)).sin_cos();
        [sin * cos_side, cos, -sin * sin_side]
    };
    let corners = (0..=rows).flat_map(|row| (0..=columns).map(move |column| at(row, column))).collect();
    let quads = (0..rows).flat_map(|row| (0..columns).map(move |column| row * (columns + 1) + column));
    let triangles = quads.flat_map(|a| [a, a + columns + 1, a + 1, a + 1, a + columns + 1, a + columns + 2]);
    (corners, triangles.flat_map(u16::to_le_bytes).collect())
}

/// A smooth sphere over a floor with colours, and an unlit sign.
fn smooth_scene() -> String {
    let mut document = square();
    let (corners, indices) = sphere(10, 7);
    let positions = document.vec3(&corners);
    let colors = document.vec3(&SQUARE.0.map(|[x, y, _]| [x * 0.5 + 0.5, 0.5, y * 0.5 + 0.5]));
    let indices = document.accessor(&indices, indices.len() / 2, "'componentType':5123,'type':'SCALAR'");
    document.text(&format!(
        "'extensionsRequired':['KHR_materials_unlit'],'nodes':[{{'mesh':0,'scale':[1,1.2,1],'translation':[0,1.2,0]}},\
         {{'mesh':1,'rotation':[-0.7071068,0,0,0.7071068],'scale':[4,4,4]}},{{'mesh':2,'translation':[2,1,-1]}}],\
         'meshes':[{{'primitives':[{{'attributes':{{'POSITION':{positions},'NORMAL':{positions}}},'indices':{indices},\
         'material':0}}]}},{{'primitives':[{{'attributes':{{'POSITION':0,'COLOR_0':{colors}}},'indices':2,\
         'material':0}}]}},{{'primitives':[{}]}}],\
         'materials':[{{'pbrMetallicRoughness':{{'metallicFactor':0,'roughnessFactor':0.5}}}},\
         {{'pbrMetallicRoughness':{{'baseColorFactor':[0.25,0.5,1,1]}},'extensions':{{'KHR_materials_unlit':{{}}}}}}]",
        square_primitive(1)
    ))
}

#[test]
fn both_backends_render_the_same_picture_of_a_smooth_scene() {
    assert_same_pictures("smooth", || stage("smooth", &smooth_scene()), 1);
}

#[test]
fn unlit_surfaces_show_their_colour_and_are_no_lights() {
    let stage = stage("unlit", &smooth_scene());
    assert_eq!(stage.world.trees().len(), 0);
    let geometry = Geometry::new(&stage.scene).expect("a valid scene");
    let hit = geometry.nearest(Vec3::new(2.1, 1.0, 5.0), Vec3::NEG_Z).expect("the sign");
    let material = geometry.material(&stage.scene, &hit);
    let shown = material.emission * stage.scene.exposure;
    assert!(shown.abs_diff_eq(Vec3::new(0.25, 0.5, 1.0), 1e-5) && material.base_color == Vec3::ZERO, "{shown}");
}

#[test]
fn a_smooth_sphere_has_the_normals_of_a_sphere_and_no_shadow_of_itself_where_it_is_lit() {
    let stage = stage("sphere", &smooth_scene());
    let geometry = Geometry::new(&stage.scene).expect("a valid scene");
    let (middle, radii) = (Vec3::new(0.0, 1.2, 0.0), Vec3::new(1.0, 1.2, 1.0));
    let light = Vec3::new(-1.0, 0.4, 0.0).normalize();
    let (mut lit, mut blocked, mut blocked_flat) = (0, 0, 0);
    for index in 0..40_000 {
        let x = (index % 200) as f32 / 100.0 - 0.995;
        let y = (index / 200) as f32 / 100.0 * 1.2 - 1.194;
        let Some(hit) = geometry.nearest(middle + Vec3::new(x, y, 5.0), Vec3::NEG_Z) else { continue };
        if hit.object != 0 {
            continue;
        }
        let place = middle + Vec3::new(x, y, 5.0 - hit.distance);
        let normal = geometry.shading_normal(&hit);
        // Of an ellipsoid: each coordinate over the square of the radius.
        let expected = ((place - middle) / radii / radii).normalize();
        assert!(normal.dot(expected) > 0.98, "{normal} in place of {expected}");
        if normal.dot(light) < 0.05 {
            continue;
        }
        let smooth = place + geometry.to_smooth_surface(&hit, true);
        let is_blocked = |from: Vec3| geometry.occluded(from + geometry.normal(&hit) * 1e-4, light, 3.0);
        lit += 1;
        blocked += usize::from(is_blocked(smooth));
        blocked_flat += usize::from(is_blocked(place));
    }
    assert!(lit > 10_000 && blocked == 0 && blocked_flat > lit / 50, "{blocked} or {blocked_flat} of {lit}");
}

/// The geometry of one triangle between the points at 1 on the axes, twice as large.
fn octant(name: &str, normals: &[[f32; 3]; 3]) -> Geometry {
    let mut document = Document::default();
    let positions = document.vec3(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let attributes = format!("{{'POSITION':{positions},'NORMAL':{}}}", document.vec3(normals));
    let meshes = format!("'meshes':[{{'primitives':[{{'attributes':{attributes}}}]}}]");
    let stage = stage(name, &document.text(&format!("'nodes':[{{'mesh':0,'scale':[2,2,2]}}],{meshes}")));
    Geometry::new(&stage.scene).expect("a valid scene")
}

#[test]
fn the_smooth_surface_over_a_triangle_is_between_the_tangent_planes_of_its_corners() {
    let toward = Vec3::NEG_ONE.normalize();
    // Normals that point to the back are turned.
    for side in [1.0, -1.0] {
        let geometry = octant("octant", &[[side, 0.0, 0.0], [0.0, side, 0.0], [0.0, 0.0, side]]);
        let hit = geometry.nearest(Vec3::splat(3.0), toward).expect("the triangle");
        // Each plane is 2/3 away from the middle, and each corner has a share of 1/3; then the scale.
        let moved = geometry.to_smooth_surface(&hit, true);
        assert!(moved.abs_diff_eq(Vec3::splat(4.0 / 9.0), 1e-5), "{moved}");
        assert_eq!(geometry.to_smooth_surface(&hit, false), Vec3::ZERO);
        assert!(geometry.shading_normal(&hit).abs_diff_eq(-toward, 1e-6));
    }
    // A flat triangle needs no memory for its normals.
    assert!(octant("flat", &[[0.5, 0.5, 0.5]; 3]).attributes.is_empty());
    assert!(octant("no normals", &[[0.0; 3]; 3]).attributes.is_empty());
}

#[test]
fn instances_are_placed_and_flat_nodes_are_hidden() {
    let mut document = square();
    let places = document.vec3(&[[0.0; 3], [0.0, 5.0, 0.0], [0.0, 0.0, 3.0]]);
    let scales = document.vec3(&[[1.0; 3], [1.0, 0.0, 1.0], [2.0; 3]]);
    let text = document.text(&format!(
        "'extensionsUsed':['EXT_mesh_gpu_instancing'],'nodes':[{{'mesh':0,'translation':[10,0,0],'extensions':\
         {{'EXT_mesh_gpu_instancing':{{'attributes':{{'TRANSLATION':{places},'SCALE':{scales}}}}}}}}},\
         {{'mesh':0,'scale':[0,1,1]}}],'meshes':[{{'primitives':[{}]}}],\
         'materials':[{{'emissiveFactor':[1,1,1],'doubleSided':true}}]",
        square_primitive(0)
    ));
    let stage = stage("instances", &text);
    let geometry = Geometry::new(&stage.scene).expect("a valid scene");
    assert_eq!(geometry.objects.iter().map(|object| object.visible).collect::<Vec<_>>(), [true, false, true, false]);
    let hit = geometry.nearest(Vec3::new(11.5, 1.5, 9.0), Vec3::NEG_Z).expect("the third instance");
    assert_eq!((hit.object, hit.distance), (2, 6.0));
    assert_eq!((stage.world.trees().len(), stage.world.instances().len()), (1, 4));
}

/// A floor and a block on it that are `size` metres wide, at an offset. `lamp` is a point light above
/// them; `emission` is that of the block.
fn still_life(size: f32, offset: [f32; 3], lamp: bool, emission: f32, floor: bool) -> String {
    let mut document = square();
    let corner = |i: u32| [(i & 1) as f32 - 0.5, (i >> 1 & 1) as f32, (i >> 2) as f32 - 0.5];
    let corners: Vec<[f32; 3]> = (0..8).map(corner).collect();
    let block = document.vec3(&corners);
    let faces: [u8; 36] =
        [0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5];
    let faces = document.accessor(&faces, 36, "'componentType':5121,'type':'SCALAR'");
    let (intensity, [x, y, z]) = (500.0 * size * size, offset);
    let light = format!("'lights':[{{'type':'point','intensity':{intensity}}}]");
    let lights = format!("'extensions':{{'KHR_lights_punctual':{{{light}}}}},");
    let node = ",{'translation':[0.8,1.5,0.8],'extensions':{'KHR_lights_punctual':{'light':0}}}";
    document.text(&format!(
        "{}'scenes':[{{'nodes':[0]}}],'nodes':[{{'scale':[{size},{size},{size}],'translation':[{x},{y},{z}],\
         'children':[{}2{}]}},{{'mesh':0,'rotation':[-0.7071068,0,0,0.7071068]}},\
         {{'mesh':1,'scale':[0.5,0.5,0.5]}}{}],\
         'meshes':[{{'primitives':[{}]}},{{'primitives':[{{'attributes':{{'POSITION':{block}}},'indices':{faces},\
         'material':1}}]}}],'materials':[{{'pbrMetallicRoughness':{{'metallicFactor':0}}}},{{'pbrMetallicRoughness':{{'metallicFactor':0,'baseColorFactor':\
         [0.8,0.3,0.2,1]}},'emissiveFactor':[{emission},{emission},{emission}]}}]",
        if lamp { &lights } else { "" },
        if floor { "1," } else { "" },
        if lamp { ",3" } else { "" },
        if lamp { node } else { "" },
        square_primitive(0),
    ))
}

#[test]
fn a_camera_that_is_turned_about_its_axis_turns_the_picture() {
    let rotations = [("upright", [0.0, 0.0, 0.0, 1.0]), ("rolled", [0.0, 0.0, 0.5_f32.sqrt(), 0.5_f32.sqrt()])];
    let views = rotations.map(|(name, [x, y, z, w])| {
        let text = still_life(2.0, [0.0; 3], true, 1.0, true).replacen(
            "\"nodes\":[{",
            &format!(
                "\"cameras\":[{{\"type\":\"perspective\",\"perspective\":{{\"yfov\":0.8,\"znear\":0.1}}}}],\
                 \"nodes\":[{{\"camera\":0,\"rotation\":[{x},{y},{z},{w}],"
            ),
            1,
        );
        View::new(&stage(name, &text).scene.camera, 100, 100)
    });
    // A quarter of a turn to the left: what was on the left is above.
    assert!(views[0].up.abs_diff_eq(Vec3::Y * views[0].up.length(), 1e-5));
    assert!(views[1].up.abs_diff_eq(-views[0].right, 1e-5) && views[1].right.abs_diff_eq(views[0].up, 1e-5));
}

#[test]
fn files_without_a_camera_give_a_usable_picture() {
    let near = [0.0; 3];
    let cases = [
        ("object-10cm", still_life(0.1, near, true, 0.0, true), 0),
        ("scene-1km", still_life(1000.0, near, true, 0.0, true), 0),
        ("scene-20m", still_life(20.0, near, true, 0.0, true), 0),
        ("far-away", still_life(10.0, [20_000.0, -3000.0, 50_000.0], true, 0.0, true), 0),
        ("emissive-only", still_life(2.0, near, false, 1.0, false), 0),
        ("emissive-block", still_life(2.0, near, false, 1.0, true), 0),
        ("no-lights", still_life(2.0, near, false, 0.0, true), 1),
    ];
    for (name, text, warnings) in cases {
        let stage = stage(name, &text);
        let told = stage.scene.warnings.iter().filter(|line| line.contains("has no lights")).count();
        assert_eq!(told, warnings, "{name}: {:?}", stage.scene.warnings);
        let camera = stage.scene.camera;
        let (shown, sky) = shown(stage);
        let mean = shown.iter().sum::<f32>() / shown.len().max(1) as f32;
        // What shows geometry is neither dark nor burnt out, stands out from the sky, and is a good part of
        // the picture.
        assert!(shown.len() > 60, "{name}: {} of 576 pixels, {camera:?}", shown.len());
        assert!((0.1..0.8).contains(&mean) && mean > 3.0 * sky, "{name}: mean {mean}, sky {sky}, {camera:?}");
    }
}

#[test]
fn a_scene_without_a_camera_is_all_in_pictures_of_any_shape() {
    let scenes =
        [still_life(1.0, [30_000.0, -500.0, 7.0], true, 0.0, true), still_life(3.0, [0.0; 3], false, 1.0, false)];
    for (index, text) in scenes.iter().enumerate() {
        let path = write(&format!("fill-{index}"), text);
        for (width, height) in [(400, 900), (500, 500), (1600, 900), (1500, 300)] {
            let aspect = width as f32 / height as f32;
            let Scene { camera, objects, meshes, .. } =
                gltf_scene::stage_in_frame(&path, None, aspect).expect("a valid scene").scene;
            let view = View::new(&camera, width, height);
            let place = |vertex: Vec3| {
                let toward = vertex - view.eye;
                let across = Vec2::new(toward.dot(view.right), toward.dot(view.up));
                across / Vec2::new(view.right.length_squared(), view.up.length_squared()) / toward.dot(view.forward)
            };
            let corners = objects.iter().flat_map(|object| {
                let triangles = meshes[object.mesh as usize].triangles.iter();
                triangles.flat_map(|triangle| triangle.vertices.map(|v| place(object.transform.transform_point3(v))))
            });
            let (low, high) = corners.fold((Vec2::MAX, Vec2::MIN), |(low, high), at| (low.min(at), high.max(at)));
            // From -1 to 1 is the whole picture.
            let (filled, most) = ((high - low) * 0.5, low.abs().max(high.abs()).max_element());
            assert!(most < 1.0 && filled.max_element() > 0.5, "{width}x{height}: {low}, {high}");
        }
    }
}

/// The green of the pixels that show geometry in a picture of 32 by 18 pixels, from 0 to 1, and that of the
/// sky at the horizon.
fn shown(stage: Stage) -> (Vec<f32>, f32) {
    let (camera, geometry) = (stage.scene.camera, Geometry::new(&stage.scene).expect("a valid scene"));
    let settings = Settings {
        width: 32,
        height: 18,
        spp: 32,
        splits: 6,
        candidates: 4,
        reused_frames: 0,
        seed: 3,
        light_choice: LightChoice::Girandole,
    };
    let chosen = backend::choose(BackendChoice::Cpu).expect("threads");
    let mut session = Session::new(stage, settings, PACE, chosen).expect("a valid scene");
    let image = session.frame(&|_| {}).expect("a scene that renders").image;
    let (view, size) = (View::new(&camera, 32, 18), Vec2::new(32.0, 18.0));
    let shows_geometry = |index: usize| {
        let at = Vec2::new((index % 32) as f32 + 0.5, (index / 32) as f32 + 0.5);
        geometry.nearest(view.eye, view.direction(at, size)).is_some()
    };
    let on_screen = |radiance: Vec3| agx(radiance * session.scene().exposure).y;
    let covered = (0..image.pixels.len()).filter(|&index| shows_geometry(index));
    (covered.map(|index| on_screen(image.pixels[index])).collect(), on_screen(session.scene().sky.horizon))
}

#[test]
fn emissive_textures_light_what_is_around_them() {
    // A texture whose left half is white: the tree has half the flux.
    let halves = |is_white: fn(u32) -> bool| {
        let image = png(2, 1, |x, _| if is_white(x) { [255; 4] } else { [0, 0, 0, 255] });
        let images = format!("'images':[{{'uri':'{}'}}],'textures':[{{'source':0}}],", data_uri(&image));
        let stage = stage("flux", &one_square("'emissiveFactor':[1,1,1],'emissiveTexture':{'index':0}", &images));
        let trees: Vec<_> = stage.world.trees().filter_map(|key| stage.world.tree(key)).collect();
        trees.iter().flat_map(|tree| tree.lights()).map(|light| light.flux()).sum::<f32>()
    };
    let (all, half) = (halves(|_| true), halves(|x| x == 0));
    assert!(all > 0.0 && (half / all - 0.5).abs() < 1e-5, "{half} of {all}");
    assert_eq!(halves(|_| false), 0.0);
}

#[test]
fn primitives_without_coordinates_show_their_plain_material() {
    let mut document = Document::default();
    document.vec3(&SQUARE.0);
    document.accessor(&SQUARE_INDICES, 6, "'componentType':5121,'type':'SCALAR'");
    let text = document.text(&format!(
        "'nodes':[{{'mesh':0}}],'meshes':[{{'primitives':[{{'attributes':{{'POSITION':0}},'indices':1,'material':0}}]}}],\
         'images':[{{'uri':'{}'}}],'textures':[{{'source':0}}],\
         'materials':[{{'pbrMetallicRoughness':{{'baseColorTexture':{{'index':0}}}}}}]",
        data_uri(&png(1, 1, |_, _| [0, 0, 0, 255]))
    ));
    let stage = stage("plain", &text);
    let geometry = Geometry::new(&stage.scene).expect("a valid scene");
    let hit = geometry.nearest(Vec3::Z, Vec3::NEG_Z).expect("the square");
    assert_eq!(geometry.material(&stage.scene, &hit).base_color, Vec3::ONE);
}
