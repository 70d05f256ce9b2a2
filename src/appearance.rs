//! What an instance changes about the lights of its tree, besides their place.

/// Properties of an instance that scale, hide or mark its lights. Setting them copies no tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Appearance {
    /// Whether the lights shine.
    pub is_enabled: bool,
    /// What every sample of the instance's lights returns to the engine.
    pub user_data: u32,
}

impl Default for Appearance {
    /// The lights are as the tree has them.
    fn default() -> Self {
        Self { is_enabled: true, user_data: 0 }
    }
}

impl Appearance {
    /// Whether the lights shine at all.
    pub fn is_shown(&self) -> bool {
        self.is_enabled
    }

    /// Whether both look the same to everything but the engine that reads the user data.
    pub fn is_alike(&self, other: &Self) -> bool {
        Self { user_data: 0, ..*self } == Self { user_data: 0, ..*other }
    }
}
