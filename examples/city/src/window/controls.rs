//! What the panel and the keys change.

use testbed::render::settings::LightChoice;

/// What the window shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ViewKind {
    /// The picture.
    #[default]
    Picture,
    /// The relative standard error of each pixel.
    Noise,
    /// The boxes of the light trees, coloured by their age and by whether they wait for a rebuild.
    Trees,
}

impl ViewKind {
    /// All views, in the order of their keys: 1 to 3.
    pub const ALL: [Self; 3] = [Self::Picture, Self::Noise, Self::Trees];

    /// The name in the panel.
    pub fn name(self) -> &'static str {
        match self {
            Self::Picture => "Picture",
            Self::Noise => "Noise",
            Self::Trees => "Trees",
        }
    }
}

/// The samplers that the panel offers, with their names.
pub const SAMPLERS: [(LightChoice, &str); 3] = [
    (LightChoice::Girandole, "Girandole"),
    (LightChoice::SharedCuts, "Girandole, shared cuts"),
    (LightChoice::Roots, "Girandole, from the roots"),
];

/// The values of all sliders and switches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controls {
    /// What is shown.
    pub view: ViewKind,
    /// The level of the trees that their view shows: see [`tree_boxes`](super::tree_boxes::tree_boxes).
    pub level: i32,
    /// Whether the view of trees shows lights.
    pub has_lights: bool,
    /// How lights are chosen.
    pub sampler: LightChoice,
    /// Time that rebuilds may take per frame, milliseconds.
    pub budget_ms: f64,
    /// Clusters that are split before a light is chosen.
    pub splits: usize,
    /// Candidates of which a sample keeps one.
    pub candidates: u32,
    /// Samples per pixel and frame.
    pub spp: u32,
    /// Cars; `None` if the scene has a number of its own.
    pub cars: Option<usize>,
    /// Exposure correction, powers of two.
    pub exposure_ev: f32,
    /// Pixels of the window along each side of a pixel of the picture.
    pub pixel_size: u32,
    /// Whether the noise is filtered.
    pub is_filtered: bool,
    /// Whether pixels of one sample keep lights from frame to frame while anything moves.
    pub is_reused: bool,
    /// Whether several frames are accumulated.
    pub is_accumulated: bool,
    /// Whether the scene's time stands still.
    pub is_frozen: bool,
}
