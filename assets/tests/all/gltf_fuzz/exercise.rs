//! What is done with each damaged file. The fuzz target in `fuzz/` includes this file.

use std::hint::black_box;

use girandole_assets::AssetError;
use girandole_assets::girandole::glam::Vec3;
use girandole_assets::girandole::{FrameBudget, LightWorld, ShadingPoint};
use girandole_assets::gltf::gltf::Semantic;
use girandole_assets::gltf::{
    GltfFile, GltfOptions, TextureImage, TextureUse, accessor_values, load_bytes, load_lights, node_instances,
    primitive_attribute, read_image,
};

/// Limits that keep a file of some kilobytes from taking seconds.
pub fn options() -> GltfOptions {
    GltfOptions { max_lights: 1 << 14, max_instances: 1 << 14, max_bytes: 1 << 26, ..GltfOptions::default() }
}

/// Loads a file, reads all of its document, adds its lights to a world, updates the world, and
/// samples it. Returns the number of lights, or the error that refused the file.
pub fn exercise(bytes: &[u8]) -> Result<usize, AssetError> {
    let file = load_bytes(bytes, &options())?;
    read(&file);
    for image in 0..=file.document.images().len() {
        look(read_image(&file, image, &options()));
    }
    // With every image white, textures change no light that is finite.
    let white = TextureImage { width: 1, height: 1, rgba: &[255; 4] };
    let images = vec![Some(white); file.document.images().len()];
    let mut world = LightWorld::new();
    let lights = load_lights(&mut world, &file, &images, &options());
    assert_eq!(lights.ok().and_then(|lights| lights.sky), world.sky().map(|(sky, _)| sky));
    let mut world = LightWorld::new();
    if let Err(error) = load_lights(&mut world, &file, &[], &options()) {
        assert_eq!((world.trees().len(), world.instances().len(), world.light_count()), (0, 0, 0), "{error}");
        return Err(error);
    }
    world.update(FrameBudget::UNLIMITED);
    let sampler = world.sampler();
    for (i, position) in [Vec3::ZERO, Vec3::new(1.0, 2.0, -3.0), Vec3::splat(1e6)].into_iter().enumerate() {
        let point = if i == 1 { ShadingPoint::volume(position) } else { ShadingPoint::surface(position, Vec3::Y) };
        let Some(sample) = sampler.sample(&point, [0.1, 0.7, 0.3, 0.9]) else { continue };
        assert!(sample.pmf > 0.0 && sample.pmf <= 1.0, "a light of probability {}", sample.pmf);
        let pmf = sampler.pmf(&point, sample.light);
        assert!((pmf - sample.pmf).abs() <= 1e-5 * pmf, "probabilities {pmf} and {}", sample.pmf);
    }
    Ok(world.light_count())
}

/// Reads everything in a document that the gltf crate looks up by an index or unwraps.
fn read(file: &GltfFile) {
    let (document, buffers) = (&file.document, &file.buffers);
    look(document.default_scene());
    document.scenes().flat_map(|scene| scene.nodes()).for_each(look);
    for node in document.nodes() {
        node.children().for_each(look);
        look(node.transform().decomposed());
        look((node.camera().map(|camera| camera.index()), node.skin().map(|skin| skin.index())));
        look(node.light().map(|light| light.index()));
        look(node_instances(file, &node));
    }
    for skin in document.skins() {
        look((skin.skeleton(), skin.inverse_bind_matrices()));
        skin.joints().for_each(look);
    }
    for mesh in document.meshes() {
        for primitive in mesh.primitives() {
            primitive.attributes().for_each(look);
            primitive.morph_targets().for_each(look);
            look((primitive.bounding_box(), primitive.material().index(), primitive.indices()));
            // Bad accessors are errors.
            look(primitive_attribute::<3>(mesh.index(), &primitive, &Semantic::Positions, buffers));
            look(primitive_attribute::<2>(mesh.index(), &primitive, &Semantic::TexCoords(0), buffers));
            look(primitive_attribute::<4>(mesh.index(), &primitive, &Semantic::Colors(0), buffers));
        }
    }
    for accessor in document.accessors() {
        look((accessor.data_type(), accessor.dimensions(), accessor.size()));
        look(accessor.view().map(|view| (view.buffer().index(), view.target())));
        if let Some(sparse) = accessor.sparse() {
            look((sparse.indices().index_type(), sparse.indices().view(), sparse.values().view()));
        }
        look(accessor_values::<1>(&accessor, buffers));
        look(accessor_values::<3>(&accessor, buffers));
        look(accessor_values::<4>(&accessor, buffers));
    }
    for channel in document.animations().flat_map(|animation| animation.channels()) {
        let (target, sampler) = (channel.target(), channel.sampler());
        look((target.node().index(), target.property(), sampler.interpolation()));
        look((sampler.input().index(), sampler.output().index()));
    }
    for texture in document.textures() {
        let sampler = texture.sampler();
        look((sampler.mag_filter(), sampler.min_filter(), sampler.wrap_s(), sampler.wrap_t()));
        look(texture.source().source());
    }
    document.images().for_each(|image| look(image.source()));
    document.cameras().for_each(|camera| look(camera.projection()));
    document.lights().into_iter().flatten().for_each(|light| look(light.kind()));
    for material in document.materials() {
        let surface = material.pbr_metallic_roughness();
        look((surface.base_color_texture(), surface.metallic_roughness_texture(), material.alpha_mode()));
        look((material.normal_texture(), material.occlusion_texture(), material.emissive_texture()));
        look(material.emissive_texture().map(|info| TextureUse::of(&info)));
    }
}

/// Keeps the compiler from leaving out what computes a value.
fn look<T>(value: T) {
    black_box(value);
}
