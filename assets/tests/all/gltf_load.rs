//! Files that are loaded by path and from bytes: where their buffers may lie, and how much they may
//! take.

use std::fs;
use std::path::{Path, PathBuf};

use girandole_assets::AssetError;
use girandole_assets::girandole::LightWorld;
use girandole_assets::gltf::gltf::{Glb, binary as container};
use girandole_assets::gltf::{GltfFile, GltfOptions, load, load_bytes, load_lights};

/// A folder of a test, with the sample file in it. Removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("girandole_load_{name}_{}", std::process::id()));
        fs::create_dir_all(folder.join("scene")).expect("a writable folder");
        Self(folder)
    }

    /// Writes a file, and returns its path.
    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        fs::write(&path, bytes).expect("a writable folder");
        path
    }

    /// Writes the sample document with another URI of its buffer.
    fn scene(&self, uri: &str) -> PathBuf {
        self.write("scene/scene.gltf", document(uri, 372))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.0).expect("a folder of this test");
    }
}

const BUFFER: &[u8] = include_bytes!("../../../tests/data/small.bin");

/// The sample document with another buffer.
fn document(uri: &str, length: u64) -> String {
    let buffer = "{ \"uri\": \"small.bin\", \"byteLength\": 372 }";
    let text = include_str!("../../../tests/data/small.gltf");
    assert!(text.contains(buffer));
    text.replace(buffer, &format!("{{ \"uri\": \"{uri}\", \"byteLength\": {length} }}"))
}

fn open(path: &Path) -> Result<GltfFile, AssetError> {
    load(path, &GltfOptions::default())
}

fn is_refused_uri(result: &Result<GltfFile, AssetError>) -> bool {
    result.as_ref().is_err_and(|error| error.to_string().starts_with("buffer 0: its URI "))
}

/// The error of a buffer that is shorter than stated.
fn too_short(length: u64, stated: u64) -> Option<AssetError> {
    let message = format!("buffer 0 has {length} bytes; the document states {stated}");
    Some(AssetError::Invalid { message })
}

/// The number of lights of a file.
fn light_count(file: &GltfFile) -> usize {
    let mut world = LightWorld::new();
    load_lights(&mut world, file, &[], &GltfOptions::default()).expect("a valid file");
    world.light_count()
}

#[test]
fn a_file_is_loaded_with_its_buffers_from_a_path_and_from_bytes() {
    let folder = Folder::new("sources");
    let text = document("buffer%20of%20ten%25.bin", 372);
    let path = folder.write("scene/scene.gltf", &text);
    folder.write("scene/buffer of ten%.bin", BUFFER);
    let by_path = open(&path).expect("a valid file");
    assert_eq!((by_path.buffers.len(), by_path.buffers[0].as_slice(), light_count(&by_path)), (1, BUFFER, 6));
    let by_name = load(path.to_str().expect("a name in ASCII"), &GltfOptions::default()).expect("a valid file");
    assert_eq!(by_name.buffers, by_path.buffers);
    let from_bytes = load_bytes(text.as_bytes(), &GltfOptions::default());
    assert!(is_refused_uri(&from_bytes), "{from_bytes:?}");
    // Folders below that of the document.
    fs::create_dir(folder.0.join("scene/below")).expect("a writable folder");
    folder.write("scene/below/a.bin", BUFFER);
    assert_eq!(light_count(&open(&folder.scene("./below/a.bin")).expect("a valid file")), 6);
}

#[test]
fn buffers_outside_of_the_folder_of_the_document_are_refused_though_they_exist() {
    let folder = Folder::new("outside");
    let outside = folder.write("a.bin", BUFFER);
    let absolute = outside.to_str().expect("a name in ASCII").to_owned();
    let back = format!("../{}/scene/a.bin", folder.0.file_name().and_then(|name| name.to_str()).expect("a name"));
    folder.write("scene/a.bin", BUFFER);
    for uri in
        ["../a.bin", "%2e%2e%2fa.bin", "./../a.bin", "x/../../a.bin", &absolute, &format!("file://{absolute}"), &back]
    {
        let result = open(&folder.scene(&uri.replace('\\', "/")));
        assert!(is_refused_uri(&result), "{uri}: {result:?}");
    }
    assert!(open(&folder.scene("a.bin")).is_ok());
}

#[test]
fn a_buffer_has_the_stated_length() {
    let folder = Folder::new("lengths");
    let path = folder.scene("a.bin");
    folder.write("scene/a.bin", [BUFFER, &[7; 100]].concat());
    assert_eq!(open(&path).expect("a valid file").buffers, [BUFFER]);
    folder.write("scene/a.bin", &BUFFER[..371]);
    assert_eq!(open(&path).err(), too_short(371, 372));
    // The memory for what is stated is not allocated.
    let path = folder.write("scene/scene.gltf", document("a.bin", u64::MAX));
    assert_eq!(open(&path).err(), too_short(371, u64::MAX));
    let inline =
        |stated: u64| load_bytes(document("data:;base64,AQIDBAUG", stated).as_bytes(), &GltfOptions::default());
    assert_eq!(inline(4).expect("a valid document").buffers, [[1, 2, 3, 4]]);
    assert_eq!(inline(6).expect("a valid document").buffers, [[1, 2, 3, 4, 5, 6]]);
    assert_eq!(inline(7).err(), too_short(6, 7));
}

#[test]
fn what_is_not_a_regular_file_is_refused() {
    let folder = Folder::new("irregular");
    let is_refused = |result: Result<GltfFile, AssetError>, name: &str| {
        let Err(AssetError::Read { path, message }) = result else { panic!("{result:?}") };
        assert!(path.to_string_lossy().ends_with(name) && message == "it is not a regular file", "{path:?}: {message}");
    };
    is_refused(open(&folder.0.join("scene")), "scene");
    is_refused(open(&folder.scene(".")), ".");
    // A pipe without a writer would block whoever opens it.
    #[cfg(unix)]
    {
        let pipe = std::ffi::CString::new(folder.0.join("scene/pipe").to_str().expect("ASCII")).expect("no zero");
        // SAFETY: the path is a string that ends with a zero, and lives during the call.
        #[allow(unsafe_code, reason = "the standard library makes no pipes")]
        let made = unsafe { libc::mkfifo(pipe.as_ptr(), 0o600) };
        assert_eq!(made, 0);
        is_refused(open(&folder.scene("pipe")), "pipe");
        is_refused(open(&folder.0.join("scene/pipe")), "pipe");
    }
    let missing = open(&folder.scene("missing.bin")).expect_err("there is no such file");
    assert!(matches!(missing, AssetError::Read { .. }) && missing.to_string().contains("missing.bin: "), "{missing}");
}

#[test]
fn memory_is_limited_over_the_document_and_all_of_its_buffers() {
    let folder = Folder::new("limit");
    folder.write("scene/a.bin", vec![0; 1 << 20]);
    let buffers = vec!["{\"uri\":\"a.bin\",\"byteLength\":1048576}"; 20].join(",");
    let text = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"buffers\":[{buffers}]}}");
    let path = folder.write("scene/scene.gltf", &text);
    let within = |max_bytes: u64| load(&path, &GltfOptions { max_bytes, ..GltfOptions::default() });
    // 22 objects, 40 commas, 1 list, and the document.
    let needed = (20 << 20) + 3 * text.len() as u64 + 22 * 1280 + 42 * 256;
    assert_eq!(within(needed).expect("enough").buffers.len(), 20);
    let refused = within(needed - 1).err();
    assert_eq!(refused, Some(AssetError::Limit { option: "max_bytes", needed, limit: needed - 1 }));
    // A file that is too large is refused before it is parsed.
    for max_bytes in [0, text.len() as u64 - 1] {
        let refused = within(max_bytes).err();
        assert_eq!(
            refused,
            Some(AssetError::Limit { option: "max_bytes", needed: text.len() as u64, limit: max_bytes })
        );
    }
}

#[test]
fn buffers_within_the_file_count_too() {
    let needed = |bytes: &[u8]| {
        let within = |max_bytes: u64| load_bytes(bytes, &GltfOptions { max_bytes, ..GltfOptions::default() });
        // The largest limit that is refused, by bisection.
        let (mut low, mut high) = (0, 1 << 20);
        while low + 1 < high {
            let middle = (low + high) / 2;
            if within(middle).is_ok() { high = middle } else { low = middle }
        }
        assert_eq!(within(low).err(), Some(AssetError::Limit { option: "max_bytes", needed: high, limit: low }));
        high
    };
    let inline = |length: usize| {
        let data = "A".repeat(length);
        let buffer = format!("{{\"uri\":\"data:;base64,{data}\",\"byteLength\":{}}}", length / 4 * 3);
        format!("{{\"asset\":{{\"version\":\"2.0\"}},\"buffers\":[{buffer}]}}").into_bytes()
    };
    // The text counts twice in the document, and once more when it is decoded.
    assert_eq!(needed(&inline(8000)) - needed(&inline(4000)), 3 * 4000);
    let binary = |length: usize| {
        let json = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"buffers\":[{{\"byteLength\":{length}}}]}}");
        let header = container::Header { magic: *b"glTF", version: 2, length: 0 };
        let file = Glb { header, json: json.into_bytes().into(), bin: Some(vec![0; length].into()) };
        file.to_vec().expect("a small file")
    };
    assert_eq!(needed(&binary(8000)) - needed(&binary(4000)), 4000);
}

#[test]
fn required_extensions_that_are_not_supported_are_named_together_before_all_else() {
    let name = |i: usize| format!("\"EXT_{i}\"");
    let many: Vec<String> = (0..40).map(name).collect();
    // Supported, not supported, and a document that is wrong in other ways too.
    let others = "\"KHR_lights_punctual\",\"KHR_draco_mesh_compression\",\"EXT_meshopt_compression\",\
                  \"KHR_mesh_quantization\",\"KHR_draco_mesh_compression\"";
    for wrong in
        ["", ",\"scene\":7", ",\"nodes\":3", ",\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":7}}]}]"]
    {
        let text = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"extensionsRequired\":[{others}]{wrong}}}");
        let error = load_bytes(text.as_bytes(), &GltfOptions::default()).expect_err("not supported");
        let expected = "the file requires extensions that are not supported: KHR_draco_mesh_compression, \
                        EXT_meshopt_compression";
        assert_eq!(error.to_string(), expected, "{wrong}");
    }
    let text = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"extensionsRequired\":[{}]}}", many.join(","));
    let error = load_bytes(text.as_bytes(), &GltfOptions::default()).expect_err("not supported");
    let AssetError::Extensions { names } = error else { panic!("{error}") };
    assert_eq!((names.len(), names[15].as_str()), (16, "EXT_15"));
}
