//! What an application adds to its entities.

use bevy::camera::Hdr;
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass, MotionVectorPrepass};
use bevy::prelude::*;
use girandole::plan::HeatMap;
use girandole::{Light, TreeSource};

/// Hands the light of an entity to Girandole.
///
/// The entity has one of [`PointLight`], [`SpotLight`] and [`DirectionalLight`], or a [`Mesh3d`] whose
/// [`StandardMaterial`] is emissive, with or without a texture. An entity with both a mesh and a light
/// component is left to Bevy: put the light on a child.
///
/// Bevy no longer lights the scene with the entity, so nothing is counted twice: the plugin removes
/// [`ViewVisibility`] from entities with a light component, without which Bevy neither clusters nor
/// extracts them. The plugin inserts it again when this marker is removed. The light component
/// stays, and the application may change it as before. Meshes stay as they are, since Bevy still
/// draws them.
///
/// [`GirandoleSettings::all_lights`](crate::GirandoleSettings::all_lights) adds the marker to every
/// entity with a light component that has no [`NoGirandole`].
#[derive(Component, Clone, Copy, Debug, Default)]
pub struct GirandoleLight;

/// Leaves the light of an entity to Bevy, whatever
/// [`GirandoleSettings::all_lights`](crate::GirandoleSettings::all_lights) says. A [`GirandoleLight`]
/// beside it takes precedence.
#[derive(Component, Clone, Copy, Debug, Default)]
pub struct NoGirandole;

/// Lights that a compute pass of the application writes on the GPU, in each frame: particles, or the parts of a film.
///
/// The entity has as many lights as the pass may write, of the kinds, ranges, sides and opening angles that they keep;
/// see [`LightWorld::set_light_source`](girandole::LightWorld::set_light_source). They are in the space of the entity,
/// whose transform places them, in candela and nits, and fall off at their range as the library says. `docs/bevy.md`
/// shows the pass, which finds its lights by [`GirandoleGpu::source_number`](crate::GirandoleGpu::source_number).
///
/// The entity has no [`GirandoleLight`]. A change of the component sends the lights again.
#[derive(Component, Clone, Debug)]
#[require(Transform, Visibility)]
pub struct GirandoleSource {
    /// The lights until the pass has written them.
    pub lights: Vec<Light>,
    /// How the tree follows: [`TreeSource::GpuMesh`] or [`TreeSource::GpuParticles`].
    pub source: TreeSource,
}

/// Makes an image the sky, which lights the scene from all around. Any entity may have it, such as the camera;
/// its transform and its visibility count for nothing.
///
/// The image is a cubemap in the layout of Bevy's, or equirectangular: rows from the zenith down, whose middle is at
/// +X. It must be readable in the main world (`RenderAssetUsages::MAIN_WORLD`) and not compressed; until it is loaded
/// there is no sky. The default handle is that of a white image. Texels that are negative or NaN are black.
///
/// There is one sky. If several entities have the component, one of them counts until it loses it.
///
/// The plugin draws no background: add Bevy's `Skybox` to the camera. An [`EnvironmentMapLight`] with the same image
/// would light the scene once more, so remove it from the camera.
#[derive(Component, Clone, Debug)]
pub struct GirandoleSky {
    /// A cubemap or an equirectangular map.
    pub image: Handle<Image>,
    /// Radiance in nits of a texel of 1, at most 10⁸. With 0 the sky is dark.
    pub intensity: f32,
    /// Turns the map in the world.
    pub rotation: Quat,
}

impl Default for GirandoleSky {
    fn default() -> Self {
        Self { image: Handle::default(), intensity: 1.0, rotation: Quat::IDENTITY }
    }
}

/// The sky that Bevy's light stands for: its specular map, which is the sharp one.
impl From<&EnvironmentMapLight> for GirandoleSky {
    fn from(light: &EnvironmentMapLight) -> Self {
        Self { image: light.specular_map.clone(), intensity: light.intensity, rotation: light.rotation }
    }
}

/// Adds the light of all entities with [`GirandoleLight`] and of the [`GirandoleSky`] to the picture of a camera.
///
/// It requires Bevy's deferred renderer, whose buffers it reads, and a target in high dynamic range.
/// Spawn it with [`Msaa::Off`], which Bevy's deferred renderer requires, and make materials deferred:
/// `DefaultOpaqueRendererMethod::deferred()` does so for all of them. Surfaces that are drawn by the
/// forward renderer, such as transparent ones, get none of this light.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
#[require(Camera3d, Hdr, DepthPrepass, DeferredPrepass, MotionVectorPrepass)]
pub struct GirandoleCamera {
    /// Lights that are drawn for each sample, of which one is kept: 1 to 32. More candidates lower
    /// the noise where nothing is reused, and take longer. The shader clamps other numbers to this range.
    pub candidates: u32,
    /// Samples for each pixel and frame. Twice as many halve the variance and take twice as long.
    /// With 0 there are no new samples, and the light fades from the mean.
    pub samples: u32,
    /// Frames that the light which a pixel has kept stands for, at most: each pixel reuses that of the last frame and that of
    /// a neighbour. More lower the noise, and let changes of lights and shadows lag behind. 0 reuses nothing, and so does a picture whose
    /// pixels take more than the device can bind, at 28 bytes each.
    pub reused_frames: u32,
    /// Frames over which the mean is taken while the surface in a pixel moves or any light changes.
    /// More frames lower the noise, and let the picture lag further behind.
    pub moving_frames: u32,
    /// Frames over which the mean is taken while nothing changes; should be at least
    /// `moving_frames`.
    pub still_frames: u32,
    /// Seeds the random numbers. Two cameras with different seeds have independent noise.
    pub seed: u32,
    /// What the pass computes.
    pub estimate: Estimate,
    /// A change of this number discards the mean of all earlier frames. Change it when materials change that are no
    /// `StandardMaterial`.
    pub history: u32,
}

/// What the pass of a camera computes for each pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimate {
    /// Light samples that the trees choose.
    #[default]
    Sampled,
    /// The sum over all lights, for comparisons. It takes time in proportion to their number. Only
    /// the points on lights that are surfaces are random.
    Exhaustive,
    /// How much a pixel has kept of former frames, in place of the picture: black for nothing, and white for all that
    /// [`GirandoleCamera::reused_frames`] allows, of its own and of a neighbour.
    History,
    /// Colours in place of the picture, which show how lights are chosen. What is transparent or has no deferred
    /// material is drawn over them. They go through the camera's tone mapping: [`Tonemapping::None`] shows them as
    /// they are.
    ///
    /// [`Tonemapping::None`]: bevy::core_pipeline::tonemapping::Tonemapping::None
    HeatMap(HeatMap),
}

impl Default for GirandoleCamera {
    fn default() -> Self {
        Self {
            candidates: 1,
            samples: 1,
            reused_frames: 8,
            moving_frames: 12,
            still_frames: 4096,
            seed: 0,
            estimate: Estimate::Sampled,
            history: 0,
        }
    }
}
