//! Features of glTF files in the lights that they become: emissive textures, quantized meshes, instances
//! of meshes, and sparse accessors.

use girandole_assets::AssetError;
use girandole_assets::girandole::glam::{DVec3, Mat3, Vec3, vec3};
use girandole_assets::girandole::{Light, LightId, LightWorld, ShadingPoint, Shape, Sky};
use girandole_assets::gltf::gltf::Semantic;
use girandole_assets::gltf::{
    GltfFile, GltfLights, GltfOptions, LightSource, TextureImage, load, load_bytes, load_lights, parse,
    primitive_attribute, read_image,
};

use testbed::testing::gltf_documents::{
    Document, SQUARE, SQUARE_INDICES, data_uri, floats, png, square, square_primitive,
};

fn open(text: &str) -> GltfFile {
    load_bytes(text.as_bytes(), &GltfOptions::default()).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// The lights of the world's only tree.
fn lights(world: &LightWorld) -> Vec<Light> {
    let keys: Vec<_> = world.trees().collect();
    assert_eq!(keys.len(), 1);
    world.tree(keys[0]).expect("a tree").lights().to_vec()
}

/// An image of black and white pixels.
fn pixels(width: u32, height: u32, is_white: impl Fn(u32, u32) -> bool) -> Vec<u8> {
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    places.flat_map(|(x, y)| if is_white(x, y) { [255; 4] } else { [0, 0, 0, 255] }).collect()
}

/// A square image.
fn image(side: u32, rgba: &[u8]) -> Option<TextureImage<'_>> {
    Some(TextureImage { width: side, height: side, rgba })
}

/// A square that emits 10 nits times a texture; `texture` are more fields of the texture's use.
fn textured_square(texture: &str) -> String {
    square().text(&format!(
        "'nodes':[{{'mesh':0}}],'meshes':[{{'primitives':[{}]}}],'images':[{{'uri':'white.png'}}],\
         'textures':[{{'source':0}}],'materials':[{{'emissiveFactor':[1,1,1],\
         'emissiveTexture':{{'index':0{texture}}},\
         'extensions':{{'KHR_materials_emissive_strength':{{'emissiveStrength':10}}}}}}]",
        square_primitive(0)
    ))
}

/// Loads a document with one image, and one light for a triangle. `None` is an image that is not decoded.
fn load_textured(text: &str, image: Option<TextureImage<'_>>) -> (LightWorld, Result<GltfLights, AssetError>) {
    load_in_parts(text, &[image], 0)
}

/// Loads a document with images, and some lights beyond those of triangles.
fn load_in_parts(
    text: &str,
    images: &[Option<TextureImage<'_>>],
    texture_parts: usize,
) -> (LightWorld, Result<GltfLights, AssetError>) {
    let (file, mut world) = (open(text), LightWorld::new());
    let options = GltfOptions { texture_parts, ..GltfOptions::default() };
    let result = load_lights(&mut world, &file, images, &options);
    (world, result)
}

fn emissions(text: &str, image: Option<TextureImage<'_>>) -> Vec<f32> {
    let (world, result) = load_textured(text, image);
    result.expect("a valid document");
    lights(&world).iter().map(|light| light.emission.x).collect()
}

#[test]
fn each_triangle_emits_the_average_of_its_texture() {
    // White above the diagonal from the upper left to the lower right corner of the image; both
    // triangles, which the other diagonal separates, have a half of it.
    let rgba = pixels(64, 64, |x, y| x > y);
    let halves = emissions(&textured_square(""), image(64, &rgba));
    assert!(halves.iter().all(|emission| (emission - 5.0).abs() < 0.1), "{halves:?}");
    // White in the lower half: three quarters of the first triangle, and a quarter of the second.
    let rgba = pixels(64, 64, |_, y| y >= 32);
    let found = emissions(&textured_square(""), image(64, &rgba));
    assert!((found[0] - 7.5).abs() < 1e-4 && (found[1] - 2.5).abs() < 1e-4, "{found:?}");
    // Without the image, and with an image that is not decoded, the texture is white.
    assert_eq!(emissions(&textured_square(""), None), [10.0, 10.0]);
    let (file, mut world) = (open(&textured_square("")), LightWorld::new());
    load_lights(&mut world, &file, &[], &GltfOptions::default()).expect("a valid document");
    assert_eq!(lights(&world).len(), 2);
}

#[test]
fn triangles_whose_texture_is_black_have_no_lights() {
    let of_white = |texel| emissions(&textured_square(""), image(4, &pixels(4, 4, |x, y| (x, y) == texel)));
    // One texel is an eighth of a triangle. That in the lower right corner is part of the first
    // triangle only, and that in the lower left corner of a half of both.
    let found = of_white((3, 3));
    assert!(found.len() == 1 && (found[0] - 1.25).abs() < 1e-4, "{found:?}");
    let found = of_white((0, 3));
    assert!(found.len() == 2 && found.iter().all(|emission| (emission - 0.625).abs() < 1e-4), "{found:?}");
    // A mesh of black triangles becomes no tree and no instance.
    let (world, result) = load_textured(&textured_square(""), image(4, &pixels(4, 4, |_, _| false)));
    assert_eq!(result.map(|lights| lights.nodes.len()), Ok(0));
    assert_eq!((world.trees().len(), world.instances().len()), (0, 0));
}

#[test]
fn triangles_whose_texture_varies_are_cut_into_parts_within_the_limits() {
    // A bright bar, an eighth of the image.
    let rgba = pixels(64, 64, |_, y| (16..24).contains(&y));
    let loaded = |parts: usize| {
        let (world, result) = load_in_parts(&textured_square(""), &[image(64, &rgba)], parts);
        result.expect("a valid document");
        let lights = lights(&world);
        (lights.len(), lights.iter().map(|light| f64::from(light.flux())).sum::<f64>())
    };
    let (whole, flux) = loaded(0);
    assert_eq!(whole, 2);
    for (parts, most) in [(2, 2), (3, 5), (4, 5), (40, 41)] {
        let (count, same) = loaded(parts);
        assert!(count <= most && (same / flux - 1.0).abs() < 1.0e-5, "{parts}: {count} {same} {flux}");
    }
    // A primitive has at most 1,024 more, whatever the document may have.
    let rgba = pixels(64, 64, |x, y| (x * 7 + y * 13) % 5 == 0);
    for (parts, most) in [(1023, 1025), (1024, 1026), (1025, 1026), (10_240, 1026)] {
        let (world, _) = load_in_parts(&textured_square(""), &[image(64, &rgba)], parts);
        assert!((500..=most).contains(&world.light_count()), "{parts}: {}", world.light_count());
    }
    // A document may not have more lights with its parts either.
    let file = open(&textured_square(""));
    for (max_lights, most) in [(2, 2), (4, 4), (5, 5)] {
        let options = GltfOptions { max_lights, ..GltfOptions::default() };
        let mut world = LightWorld::new();
        load_lights(&mut world, &file, &[image(64, &rgba)], &options).expect("a valid document");
        assert!(world.light_count() <= most, "{max_lights}: {}", world.light_count());
    }
}

#[test]
fn what_the_alpha_of_the_base_colour_cuts_out_does_not_emit() {
    // The right half is transparent, the left half half so.
    let mut rgba = pixels(2, 1, |_, _| true);
    (rgba[3], rgba[7]) = (128, 0);
    let (cut, white) = (TextureImage { width: 2, height: 1, rgba: &rgba }, pixels(4, 4, |_, _| true));
    let text = |base: &str, alpha: &str, emissive: &str| {
        square().text(&format!(
            "'nodes':[{{'mesh':0}}],'meshes':[{{'primitives':[{}]}}],'images':[{{'uri':'a.png'}},{{'uri':'b.png'}}],\
             'textures':[{{'source':0}},{{'source':1}}],'materials':[{{'emissiveFactor':[1,1,1],{emissive}\
             'pbrMetallicRoughness':{{'baseColorTexture':{base}}}{alpha},\
             'extensions':{{'KHR_materials_emissive_strength':{{'emissiveStrength':10}}}}}}]",
            square_primitive(0)
        ))
    };
    let mean = |base: &str, alpha: &str, emissive: &str| {
        let (world, result) = load_in_parts(&text(base, alpha, emissive), &[Some(cut), image(4, &white)], 0);
        result.expect("a valid document");
        lights(&world).iter().map(|light| light.emission.x).sum::<f32>() / 2.0
    };
    for emissive in ["", "'emissiveTexture':{'index':1},"] {
        let plain = "{'index':0}";
        let found = |alpha: &str| mean(plain, alpha, emissive);
        let close = |found: f32, expected: f32| assert!((found - expected).abs() < 1.0e-3, "{found} not {expected}");
        close(found(""), 10.0);
        close(found(",'alphaMode':'MASK'"), 5.0);
        close(found(",'alphaMode':'BLEND'"), 5.0 * 128.0 / 255.0);
        close(found(",'alphaMode':'MASK','alphaCutoff':0.1"), 5.0);
        let (_, result) = load_in_parts(
            &text(plain, ",'alphaMode':'MASK','alphaCutoff':0.6", emissive),
            &[Some(cut), image(4, &white)],
            0,
        );
        assert_eq!(result.map(|lights| lights.nodes.len()), Ok(0));
    }
    // Without a texture the factor's alpha counts; beyond 1 it counts as 1.
    for (mode, factor, expected) in
        [("MASK", 0.4, 0.0), ("MASK", 0.6, 10.0), ("BLEND", 0.3, 3.0), ("BLEND", 4.0, 10.0), ("OPAQUE", 0.1, 10.0)]
    {
        let text = square().text(&format!(
            "'nodes':[{{'mesh':0}}],'meshes':[{{'primitives':[{}]}}],'materials':[{{'emissiveFactor':[1,1,1],\
             'pbrMetallicRoughness':{{'baseColorFactor':[1,1,1,{factor}]}},'alphaMode':'{mode}',\
             'extensions':{{'KHR_materials_emissive_strength':{{'emissiveStrength':10}}}}}}]",
            square_primitive(0)
        ));
        let (world, result) = load_in_parts(&text, &[], 0);
        result.expect("a valid document");
        let found: Vec<f32> = world
            .trees()
            .flat_map(|tree| world.tree(tree).expect("it lives").lights().to_vec())
            .map(|l| l.emission.x)
            .collect();
        let sum = found.iter().sum::<f32>() / 2.0;
        assert!((sum - expected).abs() < 1.0e-4, "{mode} {factor}: {sum}");
    }
    // A long image and a high one would take one of a thousand million texels together: the mask does not count.
    let [long, high] = [vec![255; 4 * 32_768], vec![0; 4 * 32_768]];
    let long = TextureImage { width: 32_768, height: 1, rgba: &long };
    let high = TextureImage { width: 1, height: 32_768, rgba: &high };
    let masked = text("{'index':0}", ",'alphaMode':'MASK'", "'emissiveTexture':{'index':1},");
    let (world, result) = load_in_parts(&masked, &[Some(high), Some(long)], 0);
    result.expect("a valid document");
    assert!(lights(&world).iter().all(|light| light.emission.x == 10.0));
    // Two images that lie differently: the emissive one alone counts.
    let turned = "{'index':0,'extensions':{'KHR_texture_transform':{'scale':[0.5,1]}}}";
    assert_eq!(mean(turned, ",'alphaMode':'MASK'", "'emissiveTexture':{'index':1},"), 10.0);
}

#[test]
fn texture_transforms_and_sets_of_coordinates_are_regarded() {
    let rgba = pixels(2, 1, |x, _| x == 0);
    let image = Some(TextureImage { width: 2, height: 1, rgba: &rgba });
    let transformed = |transform: &str| {
        let transform = format!(",'extensions':{{'KHR_texture_transform':{{{transform}}}}}");
        emissions(&textured_square(&transform), image)
    };
    let white = transformed("'scale':[0.5,1]");
    assert!(white.iter().all(|emission| (emission - 10.0).abs() < 1e-4), "{white:?}");
    let black = load_textured(
        &textured_square(",'extensions':{'KHR_texture_transform':{'scale':[0.5,1],'offset':[0.5,0]}}"),
        image,
    );
    assert_eq!(black.1.map(|lights| lights.nodes.len()), Ok(0));
    // The primitive lacks the set, so that the texture counts as white.
    assert_eq!(emissions(&textured_square(",'texCoord':1"), image), [10.0, 10.0]);
    assert_eq!(transformed("'texCoord':1"), [10.0, 10.0]);
}

#[test]
fn invalid_textures_are_refused() {
    fn refused(text: &str, image: TextureImage<'_>) -> AssetError {
        let (world, result) = load_textured(text, Some(image));
        let error = result.expect_err("an invalid texture");
        assert_eq!((world.trees().len(), world.instances().len()), (0, 0));
        assert!(!error.to_string().contains('\n'), "{error}");
        error
    }
    for (width, height, bytes) in [(2, 2, 15), (2, 2, 17), (0, 2, 0), (u32::MAX, u32::MAX, 4)] {
        let rgba = vec![0; bytes];
        let error = refused(&textured_square(""), TextureImage { width, height, rgba: &rgba });
        assert!(error.to_string().starts_with("image 0: "), "{error}");
    }
    let white = TextureImage { width: 1, height: 1, rgba: &[255; 4] };
    let error = refused(&textured_square(",'extensions':{'KHR_texture_transform':{'scale':[1e39,1]}}"), white);
    assert!(error.to_string().starts_with("image 0: "), "{error}");
    // A coordinate that is NaN.
    let mut document = Document::default();
    document.vec3(&SQUARE.0);
    let mut coordinates = SQUARE.1;
    coordinates[3][0] = f32::NAN;
    document.vec2(&coordinates);
    document.accessor(&SQUARE_INDICES, 6, "'componentType':5121,'type':'SCALAR'");
    let fields = textured_square("");
    let fields = &fields[fields.find("\"nodes\"").expect("its nodes")..fields.len() - 1];
    let error = refused(&document.text(fields), white);
    assert!(error.to_string().starts_with("accessor 1: "), "{error}");
}

#[test]
fn images_are_read_from_views_uris_and_files_of_the_folder() {
    let bytes = png(1, 1, |_, _| [9; 4]);
    let mut document = Document::default();
    let view = document.view(&bytes);
    let text = |image: &str| document.text(&format!("'images':[{image}]"));
    let in_folder = |image: &str, folder: Option<&std::path::Path>| {
        let mut file = open(&text(image));
        file.folder = folder.map(std::path::Path::to_owned);
        file
    };
    let read = |image: &str, folder: Option<&std::path::Path>| {
        read_image(&in_folder(image, folder), 0, &GltfOptions::default())
    };
    assert_eq!(read(&format!("{{'bufferView':{view},'mimeType':'image/png'}}"), None), Ok(bytes.clone()));
    assert_eq!(read(&format!("{{'uri':'{}'}}", data_uri(&bytes)), None), Ok(bytes.clone()));
    let folder = std::env::temp_dir().join(format!("girandole_images_{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a writable folder");
    std::fs::write(folder.join("a b.png"), &bytes).expect("a writable folder");
    assert_eq!(read("{'uri':'a%20b.png'}", Some(&folder)), Ok(bytes.clone()));
    for (uri, hint) in [("../a.png", "has .. in it"), ("/a.png", "absolute"), ("http://a/b.png", "scheme")] {
        let error = read(&format!("{{'uri':'{uri}'}}"), Some(&folder)).expect_err("a refused URI");
        assert!(error.to_string().starts_with("image 0: ") && error.to_string().contains(hint), "{error}");
    }
    let missing = read("{'uri':'missing.png'}", Some(&folder)).expect_err("no such file");
    assert!(matches!(missing, AssetError::Read { .. }), "{missing}");
    let unknown = read("{'uri':'a%20b.png'}", None).expect_err("no folder");
    assert!(unknown.to_string().contains("folder of the document is unknown"), "{unknown}");
    let file = in_folder("{'uri':'a%20b.png'}", Some(&folder));
    let small = GltfOptions { max_bytes: 10, ..GltfOptions::default() };
    let limited = read_image(&file, 0, &small);
    assert_eq!(limited, Err(AssetError::Limit { option: "max_bytes", needed: bytes.len() as u64, limit: 10 }));
    let none = read_image(&file, 1, &small).expect_err("one image");
    assert_eq!(none.to_string(), "image 1: the document has no such image");
    std::fs::remove_dir_all(&folder).expect("a folder of this test");
}

/// An emissive triangle whose positions are an accessor of these bytes and fields.
fn emissive_triangle(bytes: &[u8], fields: &str) -> String {
    let mut document = Document::default();
    document.accessor(bytes, 3, &format!("{fields},'type':'VEC3','min':[0,0,0],'max':[1,1,1]"));
    document.text(
        "'extensionsRequired':['KHR_mesh_quantization','EXT_mesh_gpu_instancing','KHR_texture_transform'],\
         'nodes':[{'mesh':0}],'meshes':[{'primitives':[{'attributes':{'POSITION':0},'material':0}]}],\
         'materials':[{'emissiveFactor':[1,1,1]}]",
    )
}

#[test]
fn quantized_positions_are_read() {
    let vertices = |bytes: &[u8], fields: &str| {
        let (file, mut world) = (open(&emissive_triangle(bytes, fields)), LightWorld::new());
        load_lights(&mut world, &file, &[], &GltfOptions::default()).expect("a valid document");
        let Shape::Triangle { vertices, .. } = lights(&world)[0].shape else { panic!("not a triangle") };
        vertices
    };
    let bytes = [0, 0, 0, 127, 0, 0, 0, 129, 1];
    let unsigned = [Vec3::ZERO, vec3(127.0, 0.0, 0.0), vec3(0.0, 129.0, 1.0)];
    assert_eq!(vertices(&bytes, "'componentType':5121"), unsigned);
    assert_eq!(vertices(&bytes, "'componentType':5120")[2], vec3(0.0, -127.0, 1.0));
    assert_eq!(vertices(&bytes, "'componentType':5120,'normalized':true")[2], vec3(0.0, -1.0, 1.0 / 127.0));
    assert_eq!(vertices(&bytes, "'componentType':5121,'normalized':true")[2], vec3(0.0, 129.0, 1.0) / 255.0);
    let shorts: Vec<u8> = [0, 0, 0, 300, 0, 0, 0, -300, 32767].iter().flat_map(|x: &i16| x.to_le_bytes()).collect();
    assert_eq!(vertices(&shorts, "'componentType':5122")[2], vec3(0.0, -300.0, 32767.0));
    assert_eq!(vertices(&shorts, "'componentType':5122,'normalized':true")[2].z, 1.0);
    assert_eq!(vertices(&shorts, "'componentType':5123")[1], vec3(300.0, 0.0, 0.0));
    // Integers of 32 bits are no positions.
    let file = open(&emissive_triangle(&[0; 36], "'componentType':5125"));
    let result = load_lights(&mut LightWorld::new(), &file, &[], &GltfOptions::default());
    assert!(result.expect_err("no vectors").to_string().starts_with("accessor 0: "));
}

/// A square that a node places many times, with these attributes of its instances and this extension.
fn instanced(document: &mut Document, extension: &str) -> String {
    document.text(&format!(
        "'extensionsRequired':['EXT_mesh_gpu_instancing'],'nodes':[{{'mesh':0,'translation':[10,0,0],\
         'extensions':{{'EXT_mesh_gpu_instancing':{extension}}}}}],'meshes':[{{'primitives':[{}]}}],\
         'materials':[{{'emissiveFactor':[1,1,1]}}]",
        square_primitive(0)
    ))
}

#[test]
fn instances_of_a_mesh_become_instances_of_its_lights() {
    let mut document = square();
    let places = document.vec3(&[[0.0; 3], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]);
    let scales = document.vec3(&[[1.0; 3], [2.0; 3], [0.0, 1.0, 1.0]]);
    let text =
        instanced(&mut document, &format!("{{'attributes':{{'TRANSLATION':{places},'SCALE':{scales},'_ID':0}}}}"));
    let (file, mut world) = (open(&text), LightWorld::new());
    let found = load_lights(&mut world, &file, &[], &GltfOptions::default()).expect("valid");
    assert_eq!((world.trees().len(), world.instances().len(), found.nodes.len()), (1, 3, 3));
    let placements: Vec<_> =
        found.nodes.iter().filter_map(|node| world.instance(node.instance).map(|i| i.placement)).collect();
    assert_eq!(placements[1].translation, DVec3::new(10.0, 2.0, 0.0));
    assert_eq!(placements[1].linear.x_axis, vec3(2.0, 0.0, 0.0));
    // The third is flat, and hidden.
    assert_eq!(placements[2].linear, Mat3::ZERO);
    assert_eq!(found.nodes[2].local.translation, DVec3::new(0.0, 0.0, 3.0));
    // The limit counts instances.
    let options = GltfOptions { max_instances: 2, ..GltfOptions::default() };
    let result = load_lights(&mut LightWorld::new(), &file, &[], &options);
    assert_eq!(result, Err(AssetError::Limit { option: "max_instances", needed: 3, limit: 2 }));
}

#[test]
fn invalid_instances_are_refused() {
    let mut document = square();
    let two = document.vec3(&[[0.0; 3]; 2]);
    let infinite = document.vec3(&[[f32::INFINITY; 3]; 2]);
    let turned = document.accessor(&floats(&[0.0; 8]), 2, "'componentType':5126,'type':'VEC4'");
    let cases = [
        ("{}".to_owned(), 700),
        ("7".into(), 700),
        ("{'attributes':{}}".into(), 700),
        ("{'attributes':{'TRANSLATION':'a'}}".into(), 700),
        ("{'attributes':{'TRANSLATION':99}}".into(), 700),
        (format!("{{'attributes':{{'TRANSLATION':{two},'SCALE':0}}}}"), 700),
        (format!("{{'attributes':{{'TRANSLATION':{turned}}}}}"), 700),
        (format!("{{'attributes':{{'TRANSLATION':{infinite}}}}}"), 700),
        (format!("{{'attributes':{{'ROTATION':{turned}}}}}"), 700),
    ];
    for (extension, code) in cases {
        let (file, mut world) = (open(&instanced(&mut document, &extension)), LightWorld::new());
        let error = load_lights(&mut world, &file, &[], &GltfOptions::default()).expect_err(&extension);
        assert_eq!(error.code(), code, "{extension}: {error}");
        assert!(!error.to_string().contains('\n') && world.trees().len() == 0, "{extension}: {error}");
    }
}

#[test]
fn files_of_other_versions_are_refused_by_their_version() {
    let whole = r#"{"asset":{"version":"1.0"}}"#;
    // Of the first version, lists are objects, which the second does not allow.
    let objects = r#"{"asset":{"version":"1.0"},"meshes":{"mesh":{"primitives":[]}}}"#;
    for text in [whole, objects] {
        let error = parse(text.as_bytes(), &GltfOptions::default()).expect_err("the first version");
        assert!(error.to_string().contains("its version is \"1.0\"; only 2.x is supported"), "{error}");
    }
    let later = r#"{"asset":{"version":"2.1"}}"#;
    assert!(parse(later.as_bytes(), &GltfOptions::default()).is_ok());
    let needing = r#"{"asset":{"version":"2.1","minVersion":"2.1"}}"#;
    let error = parse(needing.as_bytes(), &GltfOptions::default()).expect_err("a later reader");
    assert!(error.to_string().contains("its minVersion is \"2.1\"; readers of 2.0 are supported"), "{error}");
}

#[test]
fn textures_without_another_image_have_the_one_of_their_webp_extension() {
    let parse = |source: &str| {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["EXT_texture_webp"],"images":[{{"uri":"a"}},{{"uri":"b"}}],
               "textures":[{{{source}"extensions":{{"EXT_texture_webp":{{"source":1}}}}}}]}}"#
        );
        parse(text.as_bytes(), &GltfOptions::default()).expect("a valid document").document
    };
    let image = |source: &str| parse(source).textures().next().expect("a texture").source().index();
    assert_eq!((image(""), image("\"source\":0,")), (1, 0));
}

#[test]
fn attributes_follow_the_triangles_of_their_primitive() {
    let mut document = square();
    let colors = document.accessor(
        &[0, 51, 102, 255].map(|byte| [byte; 4]).concat(),
        4,
        "'componentType':5121,'normalized':true,'type':'VEC4'",
    );
    let primitive = square_primitive(0).replace("'TEXCOORD_0':1", &format!("'COLOR_0':{colors}"));
    let file = open(&document.text(&format!("'meshes':[{{'primitives':[{primitive}]}}],'materials':[{{}}]")));
    let primitive = file.document.meshes().next().and_then(|mesh| mesh.primitives().next()).expect("a primitive");
    let read = primitive_attribute::<4>(0, &primitive, &Semantic::Colors(0), &file.buffers);
    let expected = [[0.0, 0.2, 0.4], [0.0, 0.4, 1.0]].map(|corners| corners.map(|value| [value; 4]));
    assert_eq!(read.expect("a valid accessor").expect("colours"), expected);
    assert_eq!(primitive_attribute::<3>(0, &primitive, &Semantic::Normals, &file.buffers), Ok(None));
    let error = primitive_attribute::<3>(0, &primitive, &Semantic::Colors(0), &file.buffers);
    assert!(error.expect_err("four components").to_string().contains("wrong number of components"));
}

/// A lamp of 100 candela straight ahead and 50 to the right, none to the left.
const IES: &[u8] =
    b"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 4 1 2 0 0 0 1 1 0\n0 90\n0 90 180 270\n100 50\n100 20\n100 0\n100 20\n";

/// Two nodes with the same lamp, one of them turned and scaled, and a dimmed one.
fn lamps(profile: &str) -> String {
    format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"extensionsRequired\":[\"EXT_lights_ies\"],\"extensionsUsed\":[\"EXT_lights_ies\"],\
         \"extensions\":{{\"EXT_lights_ies\":{{\"lights\":[{profile}]}}}},\
         \"nodes\":[{{\"extensions\":{{\"EXT_lights_ies\":{{\"light\":0}}}}}},\
         {{\"rotation\":[0,0.70710678,0,0.70710678],\"scale\":[2,3,4],\"translation\":[0,5,0],\
         \"extensions\":{{\"EXT_lights_ies\":{{\"light\":0}}}}}},\
         {{\"extensions\":{{\"EXT_lights_ies\":{{\"light\":0,\"multiplier\":3,\"color\":[1,0.5,0]}}}}}}]}}"
    )
}

#[test]
fn lamps_with_profiles_shine_along_z_and_are_turned_with_their_nodes() {
    let file = open(&lamps(&format!("{{\"uri\":\"{}\"}}", data_uri(IES))));
    let mut world = LightWorld::new();
    let loaded = load_lights(&mut world, &file, &[], &GltfOptions::default()).expect("lamps");
    assert!(loaded.nodes.iter().all(|node| node.source == LightSource::Profile));
    // Nodes with the same lamp share a tree.
    assert_eq!((loaded.nodes.len(), world.trees().count()), (3, 2));
    let arriving = |node: usize, at: Vec3| {
        let light = LightId::Local { instance: loaded.nodes[node].instance, light: 0 };
        let found = world.sampler().sample_light(&ShadingPoint::surface(at, Vec3::ZERO), light, [0.5; 2]);
        found.map_or(Vec3::ZERO, |incident| incident.radiance)
    };
    let close = |a: Vec3, b: Vec3| assert!((a - b).length() < 1.0e-3, "{a} {b}");
    close(arriving(0, vec3(0.0, 0.0, -2.0)), Vec3::splat(25.0));
    close(arriving(0, vec3(1.0, 0.0, -1.0e-6)), Vec3::splat(50.0));
    close(arriving(0, vec3(-1.0, 0.0, -1.0e-6)), Vec3::ZERO);
    close(arriving(0, vec3(0.0, 0.0, 1.0)), Vec3::ZERO);
    // A quarter of a turn about +Y: ahead is -X, right is -Z. The scale does not change the intensity.
    close(arriving(1, vec3(-2.0, 5.0, 0.0)), Vec3::splat(25.0));
    close(arriving(1, vec3(-1.0e-6, 5.0, -1.0)), Vec3::splat(50.0));
    close(arriving(2, vec3(0.0, 0.0, -2.0)), Vec3::new(75.0, 37.5, 0.0));
    let options = GltfOptions { punctual: false, ..GltfOptions::default() };
    let none = load_lights(&mut LightWorld::new(), &file, &[], &options).expect("no lamps");
    assert_eq!(none.nodes.len(), 0);
}

#[test]
fn profiles_are_read_from_files_beside_the_document_and_flaws_name_the_profile_and_the_line() {
    let folder = std::env::temp_dir().join(format!("girandole_ies_{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("lamp.ies"), IES).expect("a file");
    let path = folder.join("scene.gltf");
    let file = |profile: &str| {
        std::fs::write(&path, lamps(profile)).expect("a file");
        load(&path, &GltfOptions::default())
    };
    let lights = |file: &GltfFile| load_lights(&mut LightWorld::new(), file, &[], &GltfOptions::default());
    let with_file = file("{\"uri\":\"lamp.ies\"}").expect("the file is there");
    assert_eq!(lights(&with_file).expect("lamps").nodes.len(), 3);
    let refused = |profile: &str| match file(profile).and_then(|file| lights(&file)) {
        Err(error) => (error.code(), error.to_string()),
        Ok(loaded) => panic!("{loaded:?}"),
    };
    assert_eq!(refused("{\"uri\":\"../lamp.ies\"}").0, 700);
    assert_eq!(refused("{\"uri\":\"none.ies\"}").0, 716);
    assert_eq!(refused("{}"), (700, "profile 0: it has neither a URI nor a view of a buffer".into()));
    let short = data_uri(&IES[..60]);
    assert_eq!(
        refused(&format!("{{\"uri\":\"{short}\"}}")),
        (700, "profile 0: line 5: a horizontal angle is missing".into())
    );
    // Without a folder.
    let unknown = open(&lamps("{\"uri\":\"lamp.ies\"}"));
    assert!(lights(&unknown).expect_err("no folder").to_string().starts_with("profile 0: its URI is that of a file"));
    for (from, to) in [
        ("\"light\":0}", "\"light\":7}"),
        ("\"light\":0}", "\"lamp\":0}"),
        ("\"multiplier\":3", "\"multiplier\":-3"),
        ("[1,0.5,0]", "[1,0.5]"),
    ] {
        let text = lamps(&format!("{{\"uri\":\"{}\"}}", data_uri(IES))).replacen(from, to, 1);
        assert!(lights(&open(&text)).is_err(), "{to}");
    }
    std::fs::remove_dir_all(&folder).expect("the folder of this test");
}

/// The side of the faces of [`cube`].
const SIDE: u32 = 32;

/// A document whose scene has the light of a cube, with more fields of the light.
fn image_based(faces: &str, fields: &str) -> String {
    let images = "{\"uri\":\"face.png\"},".repeat(6);
    let text = format!(
        "{{'asset':{{'version':'2.0'}},'extensionsRequired':['EXT_lights_image_based'],\
         'extensions':{{'EXT_lights_image_based':{{'lights':[{{}},{{{fields}'specularImages':{faces},\
         'specularImageSize':32,'irradianceCoefficients':[]}}]}}}},\
         'images':[{}],'scenes':[{{'nodes':[],'extensions':{{'EXT_lights_image_based':{{'light':1}}}}}}]}}",
        images.trim_end_matches(',')
    );
    text.replace('\'', "\"")
}

const FACES: &str = "[[0,1,2,3,4,5],[5,5,5,5,5,5]]";

/// Faces of six colours, each with a white quarter in its upper right corner.
fn cube() -> [Vec<u8>; 6] {
    [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0], [255, 0, 255], [0, 255, 255]].map(|[r, g, b]| {
        let pixel = |i: u32| if i % SIDE >= SIDE / 2 && i / SIDE < SIDE / 2 { [255; 4] } else { [r, g, b, 255] };
        (0..SIDE * SIDE).flat_map(pixel).collect()
    })
}

/// Loads the lights of a document into a world, with faces of one size.
fn load_cube(world: &mut LightWorld, text: &str, side: u32, faces: &[Vec<u8>]) -> Result<GltfLights, AssetError> {
    let file = open(text);
    let images: Vec<_> = faces.iter().map(|rgba| image(side, rgba)).collect();
    load_lights(world, &file, &images, &GltfOptions::default())
}

#[test]
fn the_cube_of_an_image_based_light_becomes_the_sky() {
    let mut world = LightWorld::new();
    let lights = load_cube(&mut world, &image_based(FACES, ""), SIDE, &cube()).expect("a valid document");
    let (key, sky) = world.sky().expect("a sky");
    assert_eq!((lights.sky, sky.size()), (Some(key), [4 * SIDE as usize, 2 * SIDE as usize]));
    assert_eq!(world.instance(key).map(|i| i.placement.linear), Some(Mat3::IDENTITY));
    // What is ahead and above when each image is seen from the middle, with the colour of the image.
    let faces = [
        (Vec3::X, Vec3::Y, vec3(1.0, 0.0, 0.0)),
        (Vec3::NEG_X, Vec3::Y, vec3(0.0, 1.0, 0.0)),
        (Vec3::Y, Vec3::NEG_Z, vec3(0.0, 0.0, 1.0)),
        (Vec3::NEG_Y, Vec3::Z, vec3(1.0, 1.0, 0.0)),
        (Vec3::Z, Vec3::Y, vec3(1.0, 0.0, 1.0)),
        (Vec3::NEG_Z, Vec3::Y, vec3(0.0, 1.0, 1.0)),
    ];
    for (ahead, up, color) in faces {
        let right = ahead.cross(up);
        for (along, upwards) in [(0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5), (0.8, 0.1), (0.1, 0.8)] {
            let expected = if along > 0.0 && upwards > 0.0 { Vec3::ONE } else { color };
            let found = sky.radiance(ahead + right * along + up * upwards);
            assert!((found - expected).length() < 0.01, "{ahead} {along} {upwards}: {found}");
        }
    }
    // The light of the cube is kept: a sixth of each colour.
    let steps = 200;
    let mean: Vec3 = (0..steps * steps)
        .map(|i| {
            let y = (2.0 * (i % steps) as f32 + 1.0) / steps as f32 - 1.0;
            let (sin, cos) = (std::f32::consts::TAU * (i / steps) as f32 / steps as f32).sin_cos();
            sky.radiance(vec3((1.0 - y * y).sqrt() * cos, y, (1.0 - y * y).sqrt() * sin))
        })
        .sum();
    let expected = Vec3::splat(0.25) + 0.75 * vec3(0.5, 0.5, 0.5);
    assert!((mean / (steps * steps) as f32 - expected).abs().max_element() < 0.01, "{mean}");
}

#[test]
fn image_based_lights_are_decoded_scaled_and_turned() {
    // An alpha of 51 multiplies by 5, and one of 0 by 255. A channel of 188 is half as bright as one of 255.
    let face = |alpha: u8| [188, 255, 0, alpha].repeat(16);
    let faces = [255, 51, 0, 255, 51, 1].map(face);
    let mut world = LightWorld::new();
    let fields = "'intensity':3,'rotation':[0,1.4142136,0,1.4142136],";
    let lights = load_cube(&mut world, &image_based(FACES, fields), 4, &faces).expect("a valid document");
    let (key, sky) = world.sky().expect("a sky");
    assert_eq!(lights.sky, Some(key));
    for (direction, factor) in [(Vec3::X, 3.0), (Vec3::NEG_X, 15.0), (Vec3::Y, 765.0), (Vec3::NEG_Z, 765.0)] {
        let expected = factor * vec3(0.5, 1.0, 0.0);
        let found = sky.radiance(direction);
        assert!((found - expected).length() < 0.01 * factor, "{direction}: {found}");
    }
    // A quarter of a turn about +Y, which takes +X to -Z.
    let turned = world.instance(key).expect("an instance").placement.linear;
    assert!((turned * Vec3::X - Vec3::NEG_Z).length() < 1.0e-6, "{turned}");
    // As samples have it: below is as bright as +X is.
    let place = ShadingPoint::surface(Vec3::ZERO, Vec3::NEG_Z);
    let seen = world.sampler().hit(&place, Vec3::NEG_Z, f32::INFINITY).expect("the sky");
    let below = world.sampler().hit(&ShadingPoint::surface(Vec3::ZERO, Vec3::NEG_Y), Vec3::NEG_Y, f32::INFINITY);
    assert!((seen.incident.radiance - below.expect("the sky").incident.radiance).length() < 0.02, "{seen:?}");
}

#[test]
fn a_sky_that_is_there_stays_and_missing_images_make_none() {
    let (text, faces) = (image_based(FACES, ""), cube());
    let mut world = LightWorld::new();
    let none = load_cube(&mut world, &text, SIDE, &faces[..5]).expect("a valid document");
    assert_eq!((none.sky, world.instances().len(), world.trees().len()), (None, 0, 0));
    let file = open(&text);
    let options = GltfOptions::default();
    let none = load_lights(&mut world, &file, &[], &options).expect("a valid document");
    assert_eq!((none.sky, world.sky().is_none()), (None, true));
    let own = world.set_sky(Sky::from_fn(8, |_| Vec3::splat(7.0)).expect("a sound map"));
    let none = load_cube(&mut world, &text, SIDE, &faces).expect("a valid document");
    assert_eq!((none.sky, world.sky().map(|(key, sky)| (key, sky.size()))), (None, Some((own, [8, 4]))));
    // Another scene than the one that is loaded.
    let other = text.replace("\"scenes\":[", "\"scene\":1,\"scenes\":[").replace("}}}]}", "}}},{\"nodes\":[]}]}");
    let none = load_cube(&mut LightWorld::new(), &other, SIDE, &faces).expect("a valid document");
    assert_eq!(none.sky, None);
}

#[test]
fn malformed_image_based_lights_are_refused() {
    let sound = image_based(FACES, "");
    let changed = |from: &str, to: &str| {
        assert!(sound.contains(from), "{from}");
        sound.replacen(from, to, 1)
    };
    let faces = cube();
    let refused = |text: &str, side: u32, faces: &[Vec<u8>]| {
        let mut world = LightWorld::new();
        let error = load_cube(&mut world, text, side, faces).expect_err(text);
        assert_eq!((world.trees().len(), world.instances().len(), world.sky().is_none()), (0, 0, true), "{error}");
        assert!(!error.to_string().contains('\n'), "{error}");
        error.code()
    };
    let light = |fields: &str| image_based(FACES, fields);
    for text in [
        changed("\"light\":1", "\"light\":2"),
        changed("\"light\":1", "\"light\":0"),
        image_based("[[0,1,2,3,4]]", ""),
        image_based("[[0,1,2,3,4,6]]", ""),
        image_based("[[0,1,2,3,4,-1]]", ""),
        image_based("[]", ""),
        image_based("7", ""),
        light("'intensity':-1,"),
        light("'intensity':1e39,"),
        light("'intensity':'a',"),
        light("'intensity':1e20,"),
        light("'rotation':[0,0,0],"),
        light("'rotation':[0,0,0,0],"),
        light("'rotation':[1e308,1e308,0,1],"),
        light("'rotation':7,"),
    ] {
        assert_eq!(refused(&text, SIDE, &faces), 700, "{text}");
    }
    assert_eq!(refused(&changed("\"light\":1", "\"lamp\":1"), SIDE, &faces), 700);
    // Images that have not as many bytes as they say, and that are no squares of one size.
    assert_eq!(refused(&sound, SIDE + 1, &faces), 700);
    let file = open(&sound);
    for [width, height] in [[SIDE / 2, SIDE * 2], [SIDE / 2, SIDE / 2]] {
        let mut images: Vec<_> = faces.iter().map(|rgba| image(SIDE, rgba)).collect();
        images[4] = Some(TextureImage { width, height, rgba: &faces[4][..(4 * width * height) as usize] });
        let mut world = LightWorld::new();
        let options = GltfOptions::default();
        let result = load_lights(&mut world, &file, &images, &options);
        assert!(result.expect_err("no cube").to_string().contains("is no face of a cube of 32"));
        assert!(world.sky().is_none());
    }
}
