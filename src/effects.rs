//! Which effects a world calls for: what no light has is neither stored, nor tested, nor uploaded.

bitflags::bitflags! {
    /// A set of effects. Shaders made for a set serve every world that calls for no other.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub struct Effects: u8 {
        /// Some light shines into less than all directions: a spot, or a surface with one side.
        const CONES = 1;
        /// Some light has a range.
        const RANGES = 1 << 1;
        /// Some light is a surface: a rectangle, a triangle or a sphere.
        const AREAS = 1 << 2;
        /// Some surface emits from both sides.
        const TWO_SIDED = 1 << 3;
        /// There is a light at infinity.
        const DIRECTIONAL = 1 << 4;
        /// Some instance is scaled, sheared or mirrored, not only turned and moved.
        const NON_RIGID = 1 << 5;
        /// The lights of some tree change.
        const MOVING = 1 << 6;
    }
}

impl Default for Effects {
    /// Nothing but points in instances that are turned and moved.
    fn default() -> Self {
        Self::empty()
    }
}
