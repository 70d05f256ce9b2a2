//! A dump of a light world, which has no surfaces: what the window and `--open` show.

use std::path::Path;

use girandole::cluster::Aabb;
use girandole::glam::DVec3;
use girandole::{LeftOut, LightWorld};

use super::{Camera, Scene, SceneError, Stage, Still};

/// Reads a dump. The camera sees all lights in pictures of this width over their height; its coordinates are relative to the origin of the world.
pub fn stage(path: &Path, aspect: f32) -> Result<Stage, SceneError> {
    let refuse = |error: &dyn std::fmt::Display| SceneError(format!("{}: {error}", path.display()));
    let bytes = std::fs::read(path).map_err(|error| refuse(&error))?;
    let (world, left_out) = LightWorld::from_dump(&bytes).map_err(|error| refuse(&error))?;
    // A single lamp has no extent.
    let lit = bounds(&world);
    let camera = Camera::around(&Aabb { min: lit.min - 1.0, max: lit.max + 1.0 }, aspect);
    let warnings = warnings(&left_out, world.origin());
    let scene = Scene { camera, lamp_clearance: 0.0, warnings, ..Scene::default() };
    Ok(Stage { scene, world, animation: Box::new(Still) })
}

/// The box around all lights that shine, relative to the origin of the world.
pub fn bounds(world: &LightWorld) -> Aabb {
    let root = world.top_nodes().first();
    let boxes = root.into_iter().flat_map(|root| (0..root.count()).map(|slot| root.cluster(slot).aabb));
    boxes.fold(Aabb::EMPTY, |all, one| all.union(&one))
}

/// What the user should know: what the dump lacks, and where its coordinates begin.
fn warnings(left_out: &LeftOut, origin: DVec3) -> Vec<String> {
    let counted = [
        (left_out.skies, "the sky"),
        (left_out.portals, "portals"),
        (left_out.waiting_trees, "trees whose changes waited for the next update"),
        (left_out.gpu_trees, "trees whose lights a GPU moved, shown as the CPU knew them"),
    ];
    let mut warnings: Vec<String> = counted
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("the dump lacks: {what} ({count})"))
        .collect();
    if origin != DVec3::ZERO {
        warnings.push(format!("coordinates are relative to the origin of the world, {origin} m"));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::Vec3;
    use girandole::{Light, LightTree, Placement, Policy};

    #[test]
    fn the_camera_sees_all_lights_and_the_user_learns_where_coordinates_begin() {
        let mut world = LightWorld::new();
        let lights = (0..300).map(|i| Light::point(Vec3::new(i as f32, (i % 7) as f32, (i % 90) as f32), Vec3::ONE));
        let tree = world.add_tree(LightTree::new(lights.collect()).expect("valid lights"));
        let origin = DVec3::new(2048.0e3, 0.0, 0.0);
        world.set_origin_near(origin).expect("finite");
        world.add_instance(tree, Placement::at(origin), Policy::Budgeted).expect("valid");
        let path = std::env::temp_dir().join(format!("girandole-{}.dump", std::process::id()));
        world.write_dump(&mut std::fs::File::create(&path).expect("a folder for temporary files")).expect("room");
        let stage = stage(&path, 2.0);
        std::fs::remove_file(&path).expect("it is there");
        let Stage { scene, mut world, .. } = stage.expect("a dump");
        assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
        let Camera { eye, target, vertical_fov, .. } = scene.camera;
        let (forward, slope) = ((target - eye).normalize(), (0.5 * vertical_fov).tan());
        let (right, mut most) = (forward.cross(Vec3::Y).normalize(), 0.0f32);
        for light in world.tree(world.trees().next().expect("a tree")).expect("it lives").lights() {
            let toward = light.aabb().center() - eye;
            let [x, y, z] = [right, right.cross(forward), forward].map(|axis| toward.dot(axis));
            let place = (x / (2.0 * slope * z)).abs().max((y / (slope * z)).abs());
            assert!(z > 0.0 && place < 1.0, "{light:?}");
            most = most.max(place);
        }
        assert!(most > 0.7, "they fill the picture: {most}");
        // The camera does not take the origin along.
        world.set_viewpoint(eye.as_dvec3()).expect("finite");
        assert_eq!(world.origin(), origin);
    }
}
