//! Records that go to scattered places of their pools.

use super::Rig;
use super::pool::TestPool;
use crate::math::dice::hash;
use crate::plan::draft::Growth;
use crate::plan::scatter::{Scattered, UNIFORM_BYTES, scatter, staged_bytes};

/// Two pools of records of different sizes, and two targets without any records.
#[test]
fn scattered_records_arrive_in_their_places_and_no_others_change() {
    let mut rig = Rig::new();
    let mut small = TestPool::<[u32; 4]>::new(&mut rig, 5000, 128 << 20);
    let mut large = TestPool::<[u32; 20]>::new(&mut rig, 5000, 128 << 20);
    small.alloc(&mut rig, 5000).expect("room enough");
    large.alloc(&mut rig, 5000).expect("room enough");
    let (mut expected_small, mut expected_large) = (vec![[7; 4]; 5000], vec![[9; 20]; 5000]);
    small.write(&mut rig, 0, &expected_small);
    large.write(&mut rig, 0, &expected_large);
    let new = rig.draft(Growth::Exact, |draft| {
        [draft.storage("staged records", 1 << 20), draft.uniform("scatter", UNIFORM_BYTES)]
    });
    rig.play(&[], |commands| {
        let [mut some, mut others] = [Scattered::default(), Scattered::default()];
        // Odd counts, so that places do not fill whole units of 16 bytes; each run apart from the
        // others.
        for i in 0..333 {
            let place = i * 15 + hash(i) % 10;
            let run = place..place + 1 + i % 3;
            for place in run.clone() {
                expected_small[place as usize] = [i, place, !i, 1];
            }
            let records = run.clone().map(|place| [i, place, !i, 1]);
            small.pool.write(commands, Some(&mut some), run, records);
        }
        for i in 0..77 {
            let place = (i * 61) as usize;
            expected_large[place] = std::array::from_fn(|word| hash(i) ^ word as u32);
            let run = place as u32..place as u32 + 1;
            large.pool.write(commands, Some(&mut others), run, std::iter::once(expected_large[place]));
        }
        assert_eq!(commands.len(), 0, "short runs are collected");
        let ids = [small.pool.buffer(), large.pool.buffer()];
        let none = Scattered::default;
        let targets = [(ids[0], 16, some), (ids[0], 16, none()), (ids[1], 80, others), (ids[1], 80, none())];
        assert!((1..1 << 20).contains(&staged_bytes(&targets, 1 << 20)));
        scatter(commands, &targets, Some(new));
        assert_eq!(commands.len(), 5, "one write of records, and a uniform and a dispatch for each pool");
    });
    assert_eq!(rig.read::<[u32; 4]>(small.pool.buffer()), expected_small);
    assert_eq!(rig.read::<[u32; 20]>(large.pool.buffer()), expected_large);
}
