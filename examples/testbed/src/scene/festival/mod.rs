//! A festival on a crossing: a fire of sparks and a dancer in a suit of lamps, whose lights kernels move.
//!
//! Data flows one way: the animation states what is to be seen at a time, here and in
//! [`Scene::festival`], and `render/gpu/festival.rs` has kernels write the lights and draw the sparks.
//!
//! Read in this order: `fire`, `dancer`, then this file, which puts both on a stage.

pub mod dancer;
pub mod fire;

use girandole::glam::{Affine3A, Vec3, vec3};
use girandole::{LightTree, LightWorld, Placement, Policy, TreeKey, TreeSource};
use std::sync::Arc;

use super::part::Part;
use super::{Animation, Camera, Material, Object, Scene, SceneError, Stage};
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
    let Stage { mut scene, mut world, animation } = stage;
    let sparks = add_lights(&mut world, fire::lights(), FIRE, TreeSource::GpuParticles)?;
    let [steel, wood, cloth] =
        [(0.05, 0.5, 1.0), (0.06, 0.9, 0.0), (0.02, 0.3, 0.0)].map(|(tone, roughness, metallic)| {
            let base_color = Vec3::splat(tone);
            add_material(&mut scene, Material { base_color, roughness, metallic, ..Material::default() })
        });
    add_object(&mut scene, fire::basket(steel, wood), FIRE);
    let glows = dancer::COLORS.map(|emission| {
        let material = Material { base_color: Vec3::splat(0.1), emission, ..Material::default() };
        add_material(&mut scene, material)
    });
    let lamps = dancer::lamps();
    let pose = dancer::pose(0.0);
    let suit = add_lights(&mut world, dancer::lights(&lamps, &pose), DANCER, TreeSource::GpuMesh)?;
    let bones = std::array::from_fn(|bone| add_object(&mut scene, dancer::limb(bone, &lamps, cloth, glows), DANCER));
    scene.camera = Camera { eye: vec3(-2.6, 2.1, 116.5), target: vec3(0.5, 4.3, 100.0), ..scene.camera };
    scene.festival = Some(Festival { sparks, base: FIRE, steps: 0, suit, lamps: lamps.into(), pose });
    Ok(Stage { scene, world, animation: Box::new(Dance { rest: animation, bones }) })
}

fn add_lights(
    world: &mut LightWorld,
    lights: Vec<girandole::Light>,
    at: Vec3,
    source: TreeSource,
) -> Result<TreeKey, SceneError> {
    let tree = world.add_tree(LightTree::new(lights)?);
    world.add_instance(tree, Placement::at(at.as_dvec3()), Policy::Budgeted)?;
    world.set_light_source(tree, source)?;
    Ok(tree)
}

fn add_material(scene: &mut Scene, material: Material) -> u32 {
    scene.materials.push(material);
    scene.materials.len() as u32 - 1
}

fn add_object(scene: &mut Scene, part: Part, at: Vec3) -> usize {
    let mesh = scene.meshes.len() as u32;
    scene.meshes.push(part.mesh);
    let transform = Affine3A::from_translation(at);
    scene.objects.push(Object { mesh, transform, emission_scale: 1.0, visible: true });
    scene.objects.len() - 1
}

impl Animation for Dance {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        self.rest.advance(time, scene, world)?;
        let pose = dancer::pose(time);
        for (bone, object) in pose.bones.iter().zip(self.bones) {
            scene.objects[object].transform = Affine3A::from_translation(DANCER) * *bone;
        }
        for (glow, object) in pose.glow.iter().zip(self.bones) {
            scene.objects[object].emission_scale = *glow;
        }
        if let Some(festival) = &mut scene.festival {
            festival.pose = pose;
            festival.steps = (time / f64::from(fire::STEP) + 1e-6) as u32;
        }
        Ok(())
    }
}
