//! What the main world sends to the render world: the changes of one frame.

use std::sync::Arc;
use std::time::Duration;

use bevy::ecs::entity::Entity;
use bevy::math::{Quat, Vec3};
use girandole::{DirectionalLight, Light, Placement, Sky, TreeSource};

use crate::kinds::KindRecord;
use crate::rigs::{Pose, PosedMesh};

/// One change. Numbers name lights and kinds; the main world gives them out.
#[derive(Clone, Debug)]
pub enum Edit {
    /// A kind of light, which is one tree.
    AddKind {
        kind: u32,
        tree: Tree,
    },
    /// A mesh that has changed.
    ReplaceKind {
        kind: u32,
        tree: Tree,
    },
    /// The last light of a kind is gone.
    RemoveKind {
        kind: u32,
    },
    /// A light, which is one instance of the tree of its kind.
    Add {
        light: u32,
        state: State,
    },
    /// The light has a new kind, placement, brightness or visibility.
    Set {
        light: u32,
        state: State,
    },
    Show {
        light: u32,
        shown: bool,
    },
    /// Adds a directional light or changes it.
    Directional {
        light: u32,
        shown: bool,
        value: DirectionalLight,
    },
    Remove {
        light: u32,
    },
    /// Makes a map the sky, in place of the one that there was.
    SetSky {
        kind: u32,
        map: Box<Sky>,
    },
    /// Turns the sky, and sets what its map is multiplied by.
    AdjustSky {
        rotation: Quat,
        factor: f32,
    },
    RemoveSky,
}

/// The tree of a kind.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    pub lights: Vec<Light>,
    /// What the shader knows of them.
    pub record: KindRecord,
    /// Who writes the lights on the GPU; `None` for most.
    pub written: Option<Written>,
}

/// What writes the lights of a tree on the GPU.
#[derive(Clone, Debug)]
pub enum Written {
    /// The plugin, by the pose of an entity.
    Posed(Arc<PosedMesh>),
    /// A pass of the application, for an entity.
    Pass(Entity, TreeSource),
}

/// Everything about a light except its number.
#[derive(Clone, Copy, Debug)]
pub struct State {
    pub kind: u32,
    pub placement: Placement,
    /// Multiplies the emission of the kind.
    pub factor: Vec3,
    pub shown: bool,
}

/// The changes of one frame: first the edits in order, then the moves and the poses.
#[derive(Debug, Default)]
pub struct Edits {
    pub edits: Vec<Edit>,
    pub moves: Vec<(u32, Placement)>,
    /// The kinds of meshes that are posed, and their poses.
    pub poses: Vec<(u32, Pose)>,
    /// Whether materials, images or meshes of surfaces changed.
    pub has_new_surfaces: bool,
    /// The time that it took to find them.
    pub gather: Duration,
}
