use girandole::Effects;

use super::*;

fn even_sky(nits: f32) -> Box<Sky> {
    Box::new(Sky::equirectangular(16, &[Vec3::splat(nits); 128]).expect("the map is sound"))
}

fn apply(lights: &mut GirandoleLights, edits: impl IntoIterator<Item = Edit>) {
    lights.edits.edits.extend(edits);
    lights.apply();
}

#[test]
fn a_sky_comes_turns_and_goes() {
    let mut lights = GirandoleLights::default();
    let turn = Quat::from_rotation_y(0.5);
    apply(
        &mut lights,
        [Edit::SetSky { kind: 3, map: even_sky(800.0) }, Edit::AdjustSky { rotation: turn, factor: 0.25 }],
    );
    let (key, map) = lights.world.sky().expect("there is a sky");
    assert!((map.radiance(Vec3::Y).x - 800.0).abs() < 4.0);
    assert_eq!(lights.world.instance(key).map(|i| i.appearance.factor), Some(Vec3::splat(0.25)));
    assert_eq!(lights.world.instance(key).map(|i| i.placement.linear), Some(Mat3::from_quat(turn)));
    assert_eq!(lights.world.instance(key).map(|i| i.appearance.user_data), Some(3));
    let record = lights.records[3];
    assert_eq!(record, KindRecord::sky(record.lights as usize));
    assert!(record.lights > 0 && lights.world.slot(key).is_some_and(|slot| slot < lights.slot_count));
    assert!(lights.world.active_effects().contains(Effects::SKY));

    // Another map keeps the instance with its turn and its factor.
    apply(&mut lights, [Edit::SetSky { kind: 3, map: even_sky(100.0) }]);
    let (same, map) = lights.world.sky().expect("there is a sky");
    assert!(same == key && map.radiance(Vec3::Y).x < 101.0);
    assert_eq!(lights.world.instance(key).map(|i| i.appearance.factor), Some(Vec3::splat(0.25)));

    apply(&mut lights, [Edit::RemoveSky]);
    assert!(lights.world.sky().is_none());
    assert_eq!((lights.world.instances().len(), lights.world.trees().len()), (0, 0));
    assert_eq!(lights.counts.refused, 0);
}

#[test]
fn a_sky_that_is_refused_is_dark_until_it_is_right() {
    let mut lights = GirandoleLights::default();
    let adjust = |factor| Edit::AdjustSky { rotation: Quat::IDENTITY, factor };
    apply(&mut lights, [Edit::SetSky { kind: 1, map: even_sky(800.0) }, adjust(-1.0)]);
    let (key, _) = lights.world.sky().expect("there is a sky");
    assert_eq!((lights.world.instance(key).map(|i| i.appearance.is_enabled), lights.counts.refused), (Some(false), 1));
    apply(&mut lights, [adjust(1.0)]);
    assert_eq!((lights.world.instance(key).map(|i| i.appearance.is_enabled), lights.counts.refused), (Some(true), 1));
    apply(&mut lights, [Edit::AdjustSky { rotation: Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0), factor: 1.0 }]);
    assert_eq!((lights.world.instance(key).map(|i| i.appearance.is_enabled), lights.counts.refused), (Some(false), 2));
}
