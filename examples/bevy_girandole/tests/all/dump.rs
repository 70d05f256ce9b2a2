//! The light world of an application, as a pass or a file of it sees it.

use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy_girandole::{GirandoleLight, GirandoleLights};
use girandole::{LightWorld, ShadingPoint};

use crate::harness::{Setup, app, report, settle};

#[test]
fn a_dump_has_the_lights_where_they_are() {
    let mut app = app(Setup::default());
    let place = Vec3::new(1.0, 2.0, -3.0);
    for i in 0..5 {
        let lamp = PointLight { intensity: 100.0 * (i + 1) as f32, range: 50.0, ..default() };
        app.world_mut().spawn((lamp, GirandoleLight, Transform::from_translation(place + i as f32 * Vec3::X)));
    }
    settle(&mut app);
    assert_eq!(report(&app).lights, 5);
    let lights = app.sub_app(RenderApp).world().resource::<GirandoleLights>();
    let mut bytes = Vec::new();
    lights.world().write_dump(&mut bytes).expect("memory takes all");
    let (dumped, _) = LightWorld::from_dump(&bytes).expect("it was just written");
    let point = ShadingPoint::surface(Vec3::new(0.0, -1.0, 0.0), Vec3::Y);
    for i in 0..64 {
        let u = [i as f32 / 64.0, 0.3, 0.7, 0.1];
        let [ours, theirs] = [lights.world(), &dumped]
            .map(|world| world.sampler().sample(&point, u).expect("every lamp is above the point"));
        assert_eq!(ours, theirs);
        let lamp = point.position + ours.incident.direction * ours.incident.dist;
        let offset = (lamp.x - place.x).round() * Vec3::X;
        assert!((lamp - place - offset).length() < 1e-4, "{lamp} is no lamp");
    }
}
