//! Spans of the crate tracing.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use girandole::glam::Vec3;
use girandole::plan::{LightPlanner, PlanLimits};
use girandole::{FrameBudget, Light, Policy};
use testbed::testing::support::world_of;
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};

/// Notes when spans begin and end.
#[derive(Clone, Default)]
struct Notes(Arc<Mutex<Vec<String>>>, Arc<AtomicU64>);

impl Subscriber for Notes {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn new_span(&self, span: &Attributes<'_>) -> Id {
        self.0.lock().expect("one thread").push(format!("{} begins", span.metadata().name()));
        Id::from_u64(1 + self.1.fetch_add(1, Ordering::Relaxed))
    }

    fn exit(&self, _: &Id) {
        self.0.lock().expect("one thread").push("ends".into());
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn event(&self, _: &Event<'_>) {}
    fn enter(&self, _: &Id) {}
}

#[test]
fn a_frame_has_spans_for_its_refit_its_rebuild_and_its_plan() {
    let notes = Notes::default();
    tracing::subscriber::with_default(notes.clone(), || {
        let lights = (0..100).map(|i| Light::point(Vec3::X * (i * i % 97) as f32, Vec3::ONE)).collect();
        let (mut world, tree, _) = world_of(lights, Policy::Budgeted);
        let elsewhere = |i: u32| Light::point(Vec3::new((i * 37 % 100) as f32, (i % 7) as f32, 0.0), Vec3::ONE);
        let changes: Vec<_> = (0..100).map(|i| (i, elsewhere(i))).collect();
        world.set_lights(tree, &changes).expect("valid");
        world.update(FrameBudget::UNLIMITED);
        let plan = LightPlanner::new(PlanLimits::default()).reserve(&world).expect("there is room").plan();
        assert!(plan.upload.iter().next().is_some());
    });
    let notes = notes.0.lock().expect("one thread").join(", ");
    let expected = "girandole update begins, girandole refit begins, ends, girandole rebuild begins, ends, ends, \
                    girandole reserve begins, ends";
    assert_eq!(notes, expected);
}
