//! Small glTF documents that tests write: JSON with a buffer and images as data URIs.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

/// A document under construction: its buffer, its views and its accessors.
#[derive(Default)]
pub struct Document {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Document {
    /// Adds an accessor, and returns its index. `fields` are those after the view and the count, such as
    /// `'componentType':5126,'type':'VEC3'`, with ' for quotes.
    pub fn accessor(&mut self, bytes: &[u8], count: usize, fields: &str) -> usize {
        let view = self.view(bytes);
        self.accessors.push(format!("{{'bufferView':{view},'count':{count},{fields}}}"));
        self.accessors.len() - 1
    }

    /// Adds a view of the buffer, and returns its index.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (offset, length) = (self.bytes.len(), bytes.len());
        self.views.push(format!("{{'buffer':0,'byteOffset':{offset},'byteLength':{length}}}"));
        self.bytes.extend_from_slice(bytes);
        self.views.len() - 1
    }

    /// Adds positions or other vectors of three floats, with bounds that are not checked.
    pub fn vec3(&mut self, vectors: &[[f32; 3]]) -> usize {
        let bounds = "'componentType':5126,'type':'VEC3','min':[0,0,0],'max':[0,0,0]";
        self.accessor(&floats(vectors.as_flattened()), vectors.len(), bounds)
    }

    /// Adds texture coordinates.
    pub fn vec2(&mut self, vectors: &[[f32; 2]]) -> usize {
        self.accessor(&floats(vectors.as_flattened()), vectors.len(), "'componentType':5126,'type':'VEC2'")
    }

    /// The text of the document. `fields` are its other fields, with ' for quotes.
    pub fn text(&self, fields: &str) -> String {
        let (views, accessors) = (self.views.join(","), self.accessors.join(","));
        let (length, data) = (self.bytes.len(), STANDARD.encode(&self.bytes));
        format!(
            "{{'asset':{{'version':'2.0'}},'buffers':[{{'byteLength':{length},\
             'uri':'data:;base64,{data}'}}],'bufferViews':[{views}],'accessors':[{accessors}],{fields}}}"
        )
        .replace('\'', "\"")
    }
}

/// The bytes of floats.
pub fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A PNG file.
pub fn png(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let data: Vec<u8> = pixels.flat_map(|(x, y)| pixel(x, y)).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().expect("memory");
    writer.write_image_data(&data).expect("as many bytes as pixels");
    writer.finish().expect("memory");
    bytes
}

/// A file as a data URI.
pub fn data_uri(bytes: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(bytes))
}

/// The corners of a square from -1 to 1 along x and y, and its texture coordinates: the image stands
/// upright.
pub const SQUARE: ([[f32; 3]; 4], [[f32; 2]; 4]) = (
    [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]],
    [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]],
);

/// The indices of a square's two triangles.
pub const SQUARE_INDICES: [u8; 6] = [0, 1, 2, 0, 2, 3];

/// A document with the square, whose accessors are 0, 1 and 2: positions, coordinates and indices.
pub fn square() -> Document {
    let mut document = Document::default();
    document.vec3(&SQUARE.0);
    document.vec2(&SQUARE.1);
    document.accessor(&SQUARE_INDICES, 6, "'componentType':5121,'type':'SCALAR'");
    document
}

/// The primitive of [`square`] with a material.
pub fn square_primitive(material: usize) -> String {
    format!("{{'attributes':{{'POSITION':0,'TEXCOORD_0':1}},'indices':2,'material':{material}}}")
}

/// A scene for the city that uses every kind of texture and opacity: a floor with a transformed checker,
/// a sign with an emissive texture, a panel with a roughness texture, a fence with holes, and a pane of
/// opacity 0.1 under a lamp.
pub fn textured_scene() -> String {
    let checker = png(4, 4, |x, y| if (x + y) % 2 == 0 { [240, 200, 150, 255] } else { [60, 90, 160, 255] });
    let sign = png(32, 16, |x, y| if x / 4 % 2 == 0 && y % 8 < 4 { [255, 80, 160, 255] } else { [0, 0, 0, 255] });
    let rough = png(8, 1, |x, _| [0, 30 + 30 * x as u8, if x < 4 { 0 } else { 255 }, 255]);
    let fence = png(16, 16, |x, y| [200, 200, 120, if x % 4 < 2 || y % 8 == 0 { 255 } else { 0 }]);
    let images: Vec<String> =
        [checker, sign, rough, fence].iter().map(|png| format!("{{'uri':'{}'}}", data_uri(png))).collect();
    let meshes: Vec<String> =
        (0..5).map(|material| format!("{{'primitives':[{}]}}", square_primitive(material))).collect();
    square().text(&format!(
        "'extensionsRequired':['KHR_texture_transform'],\
         'extensions':{{'KHR_lights_punctual':{{'lights':[{{'type':'point','color':[1,0.9,0.7],'intensity':60}}]}}}},\
         'nodes':[\
         {{'mesh':0,'rotation':[-0.7071068,0,0,0.7071068],'scale':[4,4,4]}},\
         {{'mesh':1,'translation':[-1.5,1.2,-1.5],'scale':[1.4,0.7,1]}},\
         {{'mesh':2,'translation':[1.8,1,-1.8],'rotation':[0,-0.2588,0,0.9659]}},\
         {{'mesh':3,'translation':[-1.2,0.9,0.8],'rotation':[0,0.2588,0,0.9659],'scale':[0.8,0.9,1]}},\
         {{'mesh':4,'translation':[1.4,1.2,0.6],'rotation':[-0.6,0,0,0.8]}},\
         {{'translation':[0.9,3.2,0.6],'extensions':{{'KHR_lights_punctual':{{'light':0}}}}}},\
         {{'camera':0,'translation':[0,2.4,6.5],'rotation':[-0.1305,0,0,0.9914]}}],\
         'cameras':[{{'type':'perspective','perspective':{{'yfov':0.7,'znear':0.1}}}}],\
         'meshes':[{}],'images':[{}],\
         'samplers':[{{'magFilter':9728}},{{'wrapS':33071,'wrapT':33071}}],\
         'textures':[{{'source':0,'sampler':0}},{{'source':1,'sampler':1}},{{'source':2}},{{'source':3,'sampler':0}}],\
         'materials':[\
         {{'pbrMetallicRoughness':{{'metallicFactor':0,'baseColorTexture':{{'index':0,\
         'extensions':{{'KHR_texture_transform':{{'scale':[2,2],'rotation':0.3,'offset':[0.1,0.2]}}}}}}}}}},\
         {{'emissiveFactor':[1,1,1],'emissiveTexture':{{'index':1}},\
         'pbrMetallicRoughness':{{'metallicFactor':0,'baseColorFactor':[0.1,0.1,0.1,1]}},\
         'extensions':{{'KHR_materials_emissive_strength':{{'emissiveStrength':25}}}}}},\
         {{'doubleSided':true,'pbrMetallicRoughness':{{'baseColorFactor':[0.9,0.8,0.7,1],\
         'metallicRoughnessTexture':{{'index':2}}}}}},\
         {{'alphaMode':'MASK','pbrMetallicRoughness':{{'metallicFactor':0,'baseColorTexture':{{'index':3}}}}}},\
         {{'alphaMode':'BLEND','pbrMetallicRoughness':{{'metallicFactor':0,'baseColorFactor':[0.2,0.9,0.3,0.1]}}}}]",
        meshes.join(","),
        images.join(",")
    ))
}
