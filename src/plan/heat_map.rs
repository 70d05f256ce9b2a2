//! What a heat map shows.

/// What the WGSL function `light_heat_map` shows of the choice of lights, as a colour: see
/// [`ShaderParts::heat_map`](super::ShaderParts::heat_map).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
#[non_exhaustive]
pub enum HeatMap {
    /// The relative standard deviation of one sample's illuminance without shadows, estimated from 16 samples: dark
    /// blue for none, green for 1.2, yellow for 4, which is the most that 16 samples can show. Black where no light
    /// arrives.
    Noise = 0,
    /// A colour for each cell that has a cut. Black where lights are chosen from the roots.
    Cuts = 1,
    /// The share of samples that end without a light, of 16: dark blue for none, green for half, yellow for all.
    Misses = 2,
    /// A colour for the first light that is chosen. Black if none of 16 samples finds one.
    Lights = 3,
}

impl HeatMap {
    /// What `light_heat_map` takes.
    #[must_use]
    pub fn number(self) -> u32 {
        self as u32
    }
}
