//! Surfaces that emit an image, and the lights that take their place.

use girandole::glam::{Vec2, Vec3};
use girandole::{Light, Shape};
use girandole_assets::texture::{Texture, TextureWrap, TexturedSurface};

use crate::light::{
    GIRANDOLE_LIGHT_PARALLELOGRAM, GIRANDOLE_LIGHT_TRIANGLE, GirandoleLight, girandole_parallelogram_light,
    girandole_triangle_light, light,
};
use crate::memory::{array, list, object, output};
use crate::status::{Failure, GIRANDOLE_ERROR_BAD_LENGTH, GIRANDOLE_ERROR_BAD_VALUE, GirandoleStatus, call};
use crate::vectors::{GirandoleVec2, GirandoleVec3};

/// What a texture shows beyond the sides of its image: one of GIRANDOLE_WRAP_*.
pub type GirandoleWrap = u32;
/// The image again.
pub const GIRANDOLE_WRAP_REPEAT: GirandoleWrap = 0;
/// The image again, each copy mirrored.
pub const GIRANDOLE_WRAP_MIRROR: GirandoleWrap = 1;
/// The texels at its sides.
pub const GIRANDOLE_WRAP_CLAMP: GirandoleWrap = 2;

/// An image that surfaces emit: that of a sign, or a frame of a film on a screen. Its rows go from the top
/// down. Either linear or srgb is NULL.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleTexture {
    /// width * height linear colours, each channel from 0 to 1e15; or NULL.
    pub linear: *const GirandoleVec3,
    /// 4 * width * height bytes; or NULL. Red, green and blue are sRGB-encoded. Alpha is ignored: texels that
    /// are cut out have to be black.
    pub srgb: *const u8,
    /// Columns, 1 to 32768.
    pub width: u32,
    /// Rows, 1 to 32768.
    pub height: u32,
    /// What lies beyond the sides, along rows and along columns: GIRANDOLE_WRAP_*.
    pub wrap: [GirandoleWrap; 2],
}

/// A surface that emits an image or a part of one.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleTexturedSurface {
    /// The light for a texture that is white: a GIRANDOLE_LIGHT_PARALLELOGRAM or GIRANDOLE_LIGHT_TRIANGLE.
    pub white: GirandoleLight,
    /// Texture coordinates of three corners: the vertices of a triangle; of a parallelogram the corners at
    /// -half_u - half_v, at half_u - half_v and at half_v - half_u. (0, 0) is the upper left corner of the image,
    /// (1, 1) the lower right one. So {0, 1}, {1, 1}, {0, 0} is the whole image, upright if half_u points to the
    /// right and half_v up.
    pub tex_coords: [GirandoleVec2; 3],
}

fn wrap(given: GirandoleWrap) -> Result<TextureWrap, Failure> {
    match given {
        GIRANDOLE_WRAP_REPEAT => Ok(TextureWrap::Repeat),
        GIRANDOLE_WRAP_MIRROR => Ok(TextureWrap::Mirror),
        GIRANDOLE_WRAP_CLAMP => Ok(TextureWrap::Clamp),
        other => Err(Failure::bad_value("wrap mode", other)),
    }
}

/// The texture of the caller.
///
/// # Safety
/// As [`object`], and as [`array`] for its texels.
unsafe fn texture<'a>(pointer: *const GirandoleTexture) -> Result<Texture<'a>, Failure> {
    // SAFETY: the caller's promise.
    let GirandoleTexture { linear, srgb, width, height, wrap: wraps } = *unsafe { object(pointer, "texture")? };
    let width = width as usize;
    let count = |of_texel: usize| {
        let count = width.checked_mul(height as usize).and_then(|texels| texels.checked_mul(of_texel));
        let too_many = || Failure::new(GIRANDOLE_ERROR_BAD_LENGTH, format!("{width} x {height} texels are too many"));
        count.ok_or_else(too_many)
    };
    let texture = if srgb.is_null() {
        // SAFETY: the caller's promise.
        let texels = unsafe { array(linear, count(1)?, "linear")? };
        Texture::linear(width, texels.iter().map(|texel| (*texel).into()).collect::<Vec<Vec3>>())?
    } else if linear.is_null() {
        // SAFETY: the caller's promise.
        Texture::srgb(width, unsafe { array(srgb, count(4)?, "srgb")? })?
    } else {
        return Err(Failure::new(GIRANDOLE_ERROR_BAD_VALUE, "a texture has linear and srgb; one of them must be NULL"));
    };
    Ok(texture.with_wrap([wrap(wraps[0])?, wrap(wraps[1])?]))
}

fn surface(given: &GirandoleTexturedSurface) -> Result<TexturedSurface, Failure> {
    if ![GIRANDOLE_LIGHT_PARALLELOGRAM, GIRANDOLE_LIGHT_TRIANGLE].contains(&given.white.kind) {
        return Err(Failure::bad_value("kind of light that can have a texture", given.white.kind));
    }
    let white = light(&given.white)?;
    white.validate()?;
    let tex_coords = given.tex_coords.map(Vec2::from);
    let (surface, two_sided) = match white.shape {
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            let whole = TexturedSurface::rectangle(center, half_u, half_v, white.emission);
            (whole.with_tex_coords(tex_coords)?, two_sided)
        }
        Shape::Triangle { vertices, two_sided } => {
            (TexturedSurface::triangle(vertices, tex_coords, white.emission)?, two_sided)
        }
        _ => unreachable!("the kind is one of these two"),
    };
    let surface = surface.with_range(white.range);
    Ok(if two_sided { surface.two_sided() } else { surface })
}

/// The surfaces of a list; the message of a refusal names the index.
///
/// # Safety
/// As [`array`].
unsafe fn surfaces(
    pointer: *const GirandoleTexturedSurface,
    count: usize,
    what: &str,
) -> Result<Vec<TexturedSurface>, Failure> {
    let named = |(index, given)| {
        let name = |failure: Failure| Failure { message: format!("surface {index}: {}", failure.message), ..failure };
        surface(given).map_err(name)
    };
    // SAFETY: the caller's promise.
    unsafe { array(pointer, count, what)? }.iter().enumerate().map(named).collect()
}

/// The light of a surface as a plain value.
fn plain(light: &Light) -> GirandoleLight {
    let nits = light.emission.into();
    let (unlimited, two_sided) = match light.shape {
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            (girandole_parallelogram_light(center.into(), half_u.into(), half_v.into(), nits), two_sided)
        }
        Shape::Triangle { vertices: [a, b, c], two_sided } => {
            (girandole_triangle_light(a.into(), b.into(), c.into(), nits), two_sided)
        }
        _ => unreachable!("surfaces have no other shape"),
    };
    GirandoleLight { two_sided: two_sided.into(), range: light.range, ..unlimited }
}

fn plain_surface(surface: &TexturedSurface) -> GirandoleTexturedSurface {
    let corners = [Vec2::ZERO, Vec2::X, Vec2::Y];
    let tex_coords = corners.map(|corner| surface.tex_coord(corner).into());
    GirandoleTexturedSurface { white: plain(&surface.light(Vec3::ONE)), tex_coords }
}

/// Cuts surfaces into parts, smaller where the texels differ. Parts are surfaces too, and
/// girandole_texture_lights makes their lights. Dark parts are among them, so a film can light them later.
///
/// Surfaces are cut by four, the noisiest part first. The call ends when the texels within parts add a relative
/// standard deviation of at most noise to a sample of all that the surfaces emit, or when another cut would need
/// more than capacity parts. A noise of 0.3 is little beside the noise of shadows and of distances.
///
/// parts has room for capacity elements. count gets the number of parts. If the surfaces alone are more than
/// capacity, count gets their number, and the call stores nothing else and returns GIRANDOLE_ERROR_NO_SPACE.
/// Returns 700 for an image without texels or with more than 32768 rows or columns, for a texel that is
/// refused, and for texture coordinates that are not finite. Takes O(texels * log(parts)).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_texture_split(
    image: *const GirandoleTexture,
    surface_list: *const GirandoleTexturedSurface,
    surface_count: usize,
    noise: f32,
    parts: *mut GirandoleTexturedSurface,
    capacity: usize,
    count: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let mut texture = unsafe { texture(image)? };
        // SAFETY: see the crate's documentation.
        let surfaces = unsafe { surfaces(surface_list, surface_count, "surface_list")? };
        if noise.is_nan() || noise < 0.0 {
            return Err(Failure::bad_value("relative noise, which is 0 or above", noise));
        }
        let split = texture.split(&surfaces, noise, capacity);
        // SAFETY: see the crate's documentation.
        unsafe { list(split.iter().map(plain_surface), parts, capacity, count) }
    })
}

/// Stores a light for each part, which emits the average of the part's texels. The parts may come from another
/// image, for example from another frame of a film, and they may be surfaces that were not cut.
///
/// lights has room for count elements. The codes are those of girandole_texture_split. Takes O(texels).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_texture_lights(
    image: *const GirandoleTexture,
    parts: *const GirandoleTexturedSurface,
    count: usize,
    lights: *mut GirandoleLight,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (mut texture, parts) = unsafe { (texture(image)?, surfaces(parts, count, "parts")?) };
        // SAFETY: see the crate's documentation.
        let lights = unsafe { output(lights, count, "lights")? };
        lights.fill(parts.iter().map(|part| plain(&texture.light(part))));
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::lights;
    use crate::status::GIRANDOLE_OK;

    /// 16 x 16 bytes of four channels: noise.
    fn bytes() -> Vec<u8> {
        (0..16 * 16 * 4_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
    }

    #[test]
    fn parts_and_lights_are_those_of_the_library() {
        let bytes = bytes();
        let image = GirandoleTexture {
            linear: std::ptr::null(),
            srgb: bytes.as_ptr(),
            width: 16,
            height: 16,
            wrap: [GIRANDOLE_WRAP_MIRROR, GIRANDOLE_WRAP_CLAMP],
        };
        let vertices = [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.1), Vec3::Y];
        let tex_coords = [Vec2::new(-0.3, 0.1), Vec2::new(1.7, 0.2), Vec2::new(0.4, 1.3)];
        let white = Vec3::new(900.0, 800.0, 700.0);
        let triangle = TexturedSurface::triangle(vertices, tex_coords, white).expect("finite").two_sided();
        let sign = TexturedSurface::rectangle(Vec3::Z, Vec3::X, Vec3::Y, white).with_range(40.0);
        let mut texture = Texture::srgb(16, &bytes[..]).expect("whole rows");
        texture = texture.with_wrap([TextureWrap::Mirror, TextureWrap::Clamp]);
        let expected = texture.split(&[triangle, sign], 0.2, 100);
        assert!(expected.len() > 90);

        let given = [triangle, sign].map(|surface| plain_surface(&surface));
        let mut parts = [given[0]; 100];
        let mut count = 0;
        // SAFETY: all that is pointed to lives, and nothing else uses it.
        let status = unsafe {
            girandole_texture_split(&raw const image, given.as_ptr(), 2, 0.2, parts.as_mut_ptr(), 100, &raw mut count)
        };
        assert_eq!((status, count), (GIRANDOLE_OK, expected.len()));
        let mut made = [given[0].white; 100];
        // SAFETY: as above.
        let status = unsafe { girandole_texture_lights(&raw const image, parts.as_ptr(), count, made.as_mut_ptr()) };
        assert_eq!(status, GIRANDOLE_OK);
        // Texture coordinates of parts are stored in f32, so averages are over areas that differ by 1e-7 of the image.
        for ((part, expected), made) in parts.iter().zip(&expected).zip(lights(&made[..count]).expect("surfaces")) {
            let light = texture.light(expected);
            assert_eq!((made.shape, made.range), (light.shape, light.range));
            assert!((made.emission - light.emission).abs().max_element() < 1e-3, "{made:?} {light:?}");
            let place = Vec2::new(0.3, 0.2);
            let [a, b, c] = part.tex_coords.map(Vec2::from);
            assert!((a + (b - a) * place.x + (c - a) * place.y).distance(expected.tex_coord(place)) < 1e-6);
        }
    }
}
