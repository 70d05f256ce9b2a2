//! What the program says about the lamps of files, and what it leaves dark.

use std::fs;
use std::path::Path;

use crate::gltf::stage;
use city::app::options::{Options, Parsed};
use testbed::testing::gltf_documents::{square, square_primitive};

/// An IES file, which a URI can hold as it is.
fn ies(candela: &str) -> String {
    format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 10\n0 90\n0\n{candela}\n")
}

#[test]
fn lamps_with_profiles_are_used_without_a_warning() {
    let mut document = square();
    let file = ies("500 0");
    let profile = document.view(file.as_bytes());
    let text = document.text(&format!(
        "'extensionsUsed':['EXT_lights_ies'],'extensions':{{'EXT_lights_ies':{{'lights':[{{'bufferView':{profile}}}]}}}},\
         'nodes':[{{'mesh':0}},{{'extensions':{{'EXT_lights_ies':{{'light':0}}}}}}],\
         'meshes':[{{'primitives':[{}]}}],'materials':[{{}}]",
        square_primitive(0)
    ));
    let stage = stage("ies_lamps", &text);
    assert_eq!((stage.world.light_count(), stage.scene.warnings), (1, Vec::<String>::new()));
}

#[test]
fn hidden_nodes_are_neither_shown_nor_lit() {
    let hidden = "'extensions':{'KHR_node_visibility':{'visible':false}}";
    let text = square().text(&format!(
        "'extensionsUsed':['KHR_node_visibility'],'nodes':[{{'mesh':0}},{{'children':[2],{hidden}}},\
         {{'mesh':0,'translation':[9,0,0]}},{{'mesh':0,{hidden}}}],\
         'meshes':[{{'primitives':[{}]}}],'materials':[{{'emissiveFactor':[1,1,1]}}]",
        square_primitive(0)
    ));
    let stage = stage("hidden_nodes", &text);
    let shown: Vec<bool> = stage.scene.objects.iter().map(|object| object.visible).collect();
    let lit: Vec<_> = stage
        .world
        .instances()
        .map(|instance| stage.world.instance(instance).map(|i| i.appearance.is_enabled))
        .collect();
    assert_eq!((shown, lit.len()), (vec![true, false, false], 3));
    assert_eq!(lit.iter().filter(|lit| **lit == Some(true)).count(), 1);
    assert_eq!(stage.scene.warnings, Vec::<String>::new());
}

#[test]
fn a_profile_without_light_is_named_once() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("profile-{}.ies", std::process::id()));
    let warnings = |candela: &str| {
        fs::write(&path, ies(candela)).expect("a writable target folder");
        let arguments = ["city", "--dusk", "--ies", path.to_str().expect("a UTF-8 path")];
        let Ok(Parsed::Run(options)) = Options::read(arguments) else { panic!("{arguments:?}") };
        options.scene.load(options.size).expect("the city").scene.warnings
    };
    let expected = format!("{}: all its intensities are 0 candela, so street lamps are dark", path.display());
    assert_eq!(warnings("0 0"), [expected]);
    assert_eq!(warnings("1e-3 0"), Vec::<String>::new());
    fs::remove_file(&path).expect("a file that exists");
}
