//! A festival on a crossing: a fire of sparks and a dancer in a suit of lamps, whose lights kernels move.
//!
//! Data flows one way: the animation states what is to be seen at a time, here and in
//! [`Scene::festival`], and `render/gpu/festival.rs` has kernels write the lights and draw the sparks.
//!
//! Read in this order: `fire`, `dancer`, then this file, which puts both on a stage.

pub mod dancer;
pub mod fire;

use girandole::glam::{Affine3A, Vec3, vec3};
use girandole::{Light, LightTree, LightWorld, Placement, Policy, TreeKey, TreeSource};
use std::sync::Arc;

use super::assembly::Assembly;
use super::palette::Palette;
use super::part::Part;
use super::{Animation, Camera, Scene, SceneError, Stage};
use dancer::{BONES, Lamp, Pose};

/// The middle of the fire, and the place of the dancer beside it, in metres.
const FIRE: Vec3 = vec3(0.0, 0.0, 104.0);
const DANCER: Vec3 = vec3(1.3, 0.0, 110.4);

/// What kernels on a GPU have to know of a festival.
#[derive(Clone, Debug)]
pub struct Festival {
    /// The lights of the sparks, in metres from [`Festival::base`].
    pub sparks: TreeKey,
    /// The middle of the fire.
    pub base: Vec3,
    /// Steps of the sparks from the start to the present time, of which each takes [`fire::STEP`].
    pub steps: u32,
    /// The lights of the dancer's suit.
    pub suit: TreeKey,
    /// The lamps of the suit, in the order of its lights.
    pub lamps: Arc<[Lamp]>,
    /// The bones of the dancer at the present time.
    pub pose: Pose,
}

/// Moves the dancer, and the rest of the scene.
struct Dance {
    rest: Box<dyn Animation>,
    /// The objects of the bones.
    bones: [usize; BONES],
}

/// Puts a festival on the crossing before the camera, which steps nearer.
pub fn celebrate(stage: Stage) -> Result<Stage, SceneError> {
    let Stage { scene, world, animation } = stage;
    let mut assembly = Assembly { scene, world };
    let sparks = add_lights(&mut assembly, fire::lights(), FIRE, TreeSource::GpuParticles)?;
    let mut palette = Palette { materials: std::mem::take(&mut assembly.scene.materials), ..Palette::default() };
    let basket = fire::basket(palette.metal([0.05; 3], 0.5), palette.glossy([0.06; 3], 0.9));
    let cloth = palette.glossy([0.02; 3], 0.3);
    let glows = dancer::COLORS.map(|color| palette.glow(color, dancer::NITS).material);
    assembly.scene.materials = palette.materials;
    let place = |assembly: &mut Assembly, part: Part, at: Vec3| {
        let mesh = assembly.mesh(part.mesh);
        assembly.object(mesh, Affine3A::from_translation(at))
    };
    place(&mut assembly, basket, FIRE);
    let lamps = dancer::lamps();
    let pose = dancer::pose(0.0);
    let suit = add_lights(&mut assembly, dancer::lights(&lamps, &pose), DANCER, TreeSource::GpuMesh)?;
    let bones = std::array::from_fn(|bone| place(&mut assembly, dancer::limb(bone, &lamps, cloth, glows), DANCER));
    let Assembly { mut scene, world } = assembly;
    scene.camera = Camera { eye: vec3(-2.6, 2.1, 116.5), target: vec3(0.5, 4.3, 100.0), ..scene.camera };
    scene.festival = Some(Festival { sparks, base: FIRE, steps: 0, suit, lamps: lamps.into(), pose });
    Ok(Stage { scene, world, animation: Box::new(Dance { rest: animation, bones }) })
}

fn add_lights(
    assembly: &mut Assembly,
    lights: Vec<Light>,
    at: Vec3,
    source: TreeSource,
) -> Result<TreeKey, SceneError> {
    let tree = assembly.world.add_tree(LightTree::new(lights)?);
    assembly.world.add_instance(tree, Placement::at(at.as_dvec3()), Policy::Budgeted)?;
    assembly.world.set_light_source(tree, source)?;
    Ok(tree)
}

impl Animation for Dance {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        self.rest.advance(time, scene, world)?;
        let pose = dancer::pose(time);
        for (bone, object) in self.bones.into_iter().enumerate() {
            scene.objects[object].transform = Affine3A::from_translation(DANCER) * pose.bones[bone];
            scene.objects[object].emission_scale = pose.glow[bone];
        }
        if let Some(festival) = &mut scene.festival {
            festival.pose = pose;
            festival.steps = (time / f64::from(fire::STEP) + 1e-6) as u32;
        }
        Ok(())
    }
}
