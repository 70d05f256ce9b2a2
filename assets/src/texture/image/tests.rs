use super::*;
use glam::vec2;

/// A triangle.
const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];
const WHITE: [u8; 4] = [255; 4];
const BLACK: [u8; 4] = [0, 0, 0, 255];

/// An image of black and white pixels.
fn image(width: u32, height: u32, is_white: impl Fn(u32, u32) -> bool) -> Vec<u8> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels.flat_map(|(x, y)| if is_white(x, y) { WHITE } else { BLACK }).collect()
}

/// The average over a triangle of an image of black and white pixels.
fn average((width, _): (u32, u32), rgba: &[u8], wrap: TextureWrap, corners: [Vec2; 3]) -> f32 {
    let mut texture = Texture::srgb(width as usize, rgba).unwrap().with_wrap([wrap; 2]);
    texture.light(&TexturedSurface::triangle(CORNERS, corners, Vec3::ONE).unwrap()).emission.x
}

/// The average over both triangles of a rectangle, which have the same area.
fn quad(size: (u32, u32), rgba: &[u8], wrap: TextureWrap, [low, high]: [Vec2; 2]) -> f32 {
    let [a, b, c, d] = [low, vec2(high.x, low.y), high, vec2(low.x, high.y)];
    0.5 * (average(size, rgba, wrap, [a, b, c]) + average(size, rgba, wrap, [a, c, d]))
}

fn assert_close(found: f32, expected: f32, what: &str) {
    assert!((found - expected).abs() < 1e-5, "{what}: {found} instead of {expected}");
}

#[test]
fn half_of_a_texture_that_is_half_white_is_white() {
    for (width, height) in [(2, 1), (64, 8), (1000, 3), (2048, 2048)] {
        let rgba = image(width, height, |x, _| x < width / 2);
        let whole = [Vec2::ZERO, Vec2::ONE];
        for wrap in [TextureWrap::Repeat, TextureWrap::Mirror, TextureWrap::Clamp] {
            assert_close(quad((width, height), &rgba, wrap, whole), 0.5, &format!("{width} x {height}, {wrap:?}"));
        }
    }
    // Of the triangle (0, 0), (1, 0), (0, 1), three quarters lie to the left of the middle.
    let rgba = image(64, 64, |x, _| x < 32);
    let corners = [Vec2::ZERO, Vec2::X, Vec2::Y];
    assert_close(average((64, 64), &rgba, TextureWrap::Clamp, corners), 0.75, "left of the middle");
}

#[test]
fn half_of_a_checkerboard_is_white() {
    let rgba = image(16, 16, |x, y| (x + y) % 2 == 0);
    for wrap in [TextureWrap::Repeat, TextureWrap::Mirror] {
        for scale in [1.0, 3.0, 50.0] {
            let found = quad((16, 16), &rgba, wrap, [Vec2::splat(-scale), Vec2::splat(scale)]);
            assert_close(found, 0.5, &format!("{wrap:?}, {scale}"));
        }
    }
    // A large triangle along no axis: its 40,000 texels leave an error of its border only.
    let corners = [vec2(0.1, 0.2), vec2(17.3, 3.1), vec2(4.4, 15.9)];
    assert!((average((16, 16), &rgba, TextureWrap::Repeat, corners) - 0.5).abs() < 2e-3);
}

#[test]
fn triangles_within_one_texel_have_its_colour() {
    let rgba = image(16, 16, |x, y| (x, y) == (3, 5));
    let within = |x: f32, y: f32, size: f32| {
        let low = vec2(x, y) / 16.0;
        let corners = [low, low + Vec2::X * size, low + Vec2::Y * size];
        average((16, 16), &rgba, TextureWrap::Repeat, corners)
    };
    for size in [0.0, 1e-7, 1e-4, 0.02] {
        assert_eq!(within(3.4, 5.4, size), 1.0, "{size}");
        assert_eq!(within(2.4, 5.4, size), 0.0, "{size}");
        // Copies of the image.
        assert_eq!(within(3.4 - 16.0, 5.4 + 32.0, size), 1.0, "{size}");
    }
    // A line through the texel and its neighbour.
    let line = [vec2(3.0, 5.5), vec2(4.0, 5.5), vec2(5.0, 5.5)].map(|corner| corner / 16.0);
    assert_close(average((16, 16), &rgba, TextureWrap::Repeat, line), 0.5, "line");
}

#[test]
fn what_lies_beyond_the_sides_depends_on_the_wrap() {
    // White on the left half; from 1 to 1.5 the copy shows white, the mirrored copy black, and
    // the right side goes on in black.
    let rgba = image(8, 8, |x, _| x < 4);
    let beyond = |wrap| quad((8, 8), &rgba, wrap, [vec2(1.0, 0.0), vec2(1.5, 1.0)]);
    assert_close(beyond(TextureWrap::Repeat), 1.0, "repeat");
    assert_close(beyond(TextureWrap::Mirror), 0.0, "mirror");
    assert_close(beyond(TextureWrap::Clamp), 0.0, "clamp");
    // To the left: black, white, white.
    let before = |wrap| quad((8, 8), &rgba, wrap, [vec2(-0.5, 0.0), vec2(0.0, 1.0)]);
    assert_close(before(TextureWrap::Repeat), 0.0, "repeat");
    assert_close(before(TextureWrap::Mirror), 1.0, "mirror");
    assert_close(before(TextureWrap::Clamp), 1.0, "clamp");
    // Three quarters of [-1, 1] are white, however far it reaches along y.
    let far = quad((8, 8), &rgba, TextureWrap::Clamp, [vec2(-1.0, -1e6), vec2(1.0, 1e6)]);
    assert_close(far, 0.75, "far");
}

#[test]
fn reduced_images_keep_their_average() {
    // One white pixel in an image whose sides are no powers of two, at each of some places.
    let size = (301, 517);
    for place in [(0, 0), (150, 77), (300, 516), (127, 128)] {
        let rgba = image(size.0, size.1, |x, y| (x, y) == place);
        let found = quad(size, &rgba, TextureWrap::Repeat, [Vec2::ZERO, Vec2::ONE]);
        let expected = 1.0 / (size.0 * size.1) as f32;
        assert!((found / expected - 1.0).abs() < 1e-3, "{place:?}: {found} instead of {expected}");
    }
}

#[test]
fn colours_are_averaged_in_linear_light() {
    let rgba = [188, 188, 188, 255, 0, 128, 255, 255];
    let mut texture = Texture::srgb(2, &rgba[..]).unwrap();
    let mut average =
        |corners| texture.light(&TexturedSurface::triangle(CORNERS, corners, Vec3::ONE).unwrap()).emission;
    let found = average([vec2(0.5, 0.0), vec2(1.0, 0.0), vec2(1.0, 1.0)]);
    assert!(found.abs_diff_eq(Vec3::new(0.0, 0.215_860_5, 1.0), 1e-5), "{found}");
    assert!((average([vec2(0.0, 0.0), vec2(0.5, 0.0), vec2(0.0, 1.0)]).x - 0.502_886_5).abs() < 1e-5);
}
