//! Usage is counted on the GPU, and comes back to the instances that it belongs to.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use girandole::glam::{DVec3, Vec3};
use girandole::gpu::{DEFAULT_USAGE_INTERVAL, GpuLights, ReservoirRecord, SampleRecord, SampleRequest, UploadReport};
use girandole::{CandidateCount, Effects, InstanceKey, Light, LightWorld, Placement, Policy, TreeKey, wgpu};

use crate::gpu::{buffer, gpu, limited_gpu, read, requests};
use testbed::testing::effect_sets::effect_sets;
use testbed::testing::support::Rng;

type Counts = BTreeMap<InstanceKey, u32>;

fn encoder() -> wgpu::CommandEncoder {
    gpu().0.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
}

fn submit(encoder: wgpu::CommandEncoder) {
    gpu().1.submit([encoder.finish()]);
}

/// Lets all collections arrive, as a frame or two would.
fn wait() {
    gpu().0.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
}

/// The counts that have arrived, each instance once.
fn take(lights: &mut GpuLights) -> Option<Counts> {
    let usage = lights.take_usage()?;
    let counts: Counts = usage.iter().collect();
    assert_eq!(counts.len(), usage.iter().count());
    assert_eq!(usage.total(), counts.values().map(|count| u64::from(*count)).sum::<u64>());
    Some(counts)
}

/// Collects, submits, waits and takes.
fn collect(lights: &mut GpuLights) -> Counts {
    let mut encoder = encoder();
    lights.collect_usage(&mut encoder);
    submit(encoder);
    wait();
    take(lights).expect("it was collected")
}

fn upload(lights: &mut GpuLights, world: &mut LightWorld) -> UploadReport {
    lights.upload(world).expect("room enough")
}

/// Records a pass of an engine's own shader that calls `light_record_usage` for each of these
/// slots, the i-th time with random numbers made from i.
fn use_slots(lights: &GpuLights, encoder: &mut wgpu::CommandEncoder, slots: &[u32]) {
    static PIPELINE: OnceLock<(wgpu::BindGroupLayout, wgpu::ComputePipeline)> = OnceLock::new();
    let (device, queue) = gpu();
    let (own, pipeline) = PIPELINE.get_or_init(|| {
        let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: true },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let shader = lights.usage_shader(1, Effects::all());
        let text = "
            @group(0) @binding(0) var<storage, read> slots: array<u32>;
            fn number(seed: u32) -> f32 { return f32(light_hash(seed) >> 8u) / 16777216.0; }
            @compute @workgroup_size(64) fn use_slots(@builtin(global_invocation_id) id: vec3<u32>) {
                if id.x >= arrayLength(&slots) { return; }
                let seed = id.x * 4u;
                let u = vec4(number(seed), number(seed + 1u), number(seed + 2u), number(seed + 3u));
                light_record_usage(slots[id.x], u);
            }";
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(shader.join(text).into()),
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&own), Some(&shader.layout)],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: Some(&layout),
            module: &module,
            entry_point: Some("use_slots"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        (own, pipeline)
    });
    let slots_buffer = buffer(&device, &queue, bytemuck::cast_slice(slots));
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: own,
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: slots_buffer.as_entire_binding() }],
    });
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.set_bind_group(1, lights.usage_bind_group(), &[]);
    pass.dispatch_workgroups((slots.len() as u32).div_ceil(64), 1, 1);
}

/// Uses these instances, and collects nothing.
fn use_now(lights: &GpuLights, world: &LightWorld, instances: &[InstanceKey]) {
    let slots: Vec<u32> = instances.iter().map(|key| world.slot(*key).expect("it lives")).collect();
    let mut encoder = encoder();
    use_slots(lights, &mut encoder, &slots);
    submit(encoder);
}

fn instance(world: &mut LightWorld, tree: TreeKey) -> InstanceKey {
    world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid")
}

/// A world with some instances of one lamp, uploaded, with every use counted.
fn lamps(count: usize) -> (LightWorld, TreeKey, Vec<InstanceKey>, GpuLights) {
    let mut world = LightWorld::new();
    let tree = world.add_tree(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid");
    let instances = (0..count).map(|_| instance(&mut world, tree)).collect();
    let (device, queue) = gpu();
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    lights.count_usage(1);
    upload(&mut lights, &mut world);
    (world, tree, instances, lights)
}

/// How often records name each instance.
fn named<'a>(world: &LightWorld, records: impl Iterator<Item = &'a SampleRecord>) -> Counts {
    let mut counts = Counts::new();
    for record in records.filter(|record| record.pmf > 0.0 && record.instance != u32::MAX) {
        *counts.entry(world.instance_at(record.instance).expect("a live slot")).or_default() += 1;
    }
    counts
}

/// How far the count of `n` uses, each counted with probability `p`, may be from its mean: five
/// standard deviations. One count in 1.7 million is further away. The tests look at 34 counts,
/// which never change.
fn max_deviation(n: f64, p: f64) -> f64 {
    5.0 * (n * p * (1.0 - p)).sqrt()
}

#[test]
fn our_kernels_count_all_that_they_return_or_one_in_an_interval() {
    let (device, queue) = gpu();
    let mut rng = Rng(90);
    let mut world = rng.world(5, 20, 4, 15.0);
    let requests: Vec<SampleRequest> = requests(&mut rng, 8192, 20.0);
    let count = requests.len() as u32;
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    upload(&mut lights, &mut world);
    let input = buffer(&device, &queue, bytemuck::cast_slice(&requests));
    let [samples, reservoirs] = [size_of::<SampleRecord>(), size_of::<ReservoirRecord>()]
        .map(|bytes| buffer(&device, &queue, &vec![0; bytes * requests.len()]));
    let mut frame = |interval| {
        lights.count_usage(interval);
        upload(&mut lights, &mut world);
        let mut encoder = encoder();
        lights.build_top(&mut encoder);
        lights.sample(&mut encoder, &input, &samples, count);
        lights.collect_usage(&mut encoder);
        lights.resample(&mut encoder, &input, &reservoirs, count, CandidateCount::of::<4>());
        submit(encoder);
        wait();
        let counts = (interval > 0).then(|| (take(&mut lights).expect("it arrived"), collect(&mut lights)));
        let samples: Vec<SampleRecord> = read(&device, &queue, &samples);
        let reservoirs: Vec<ReservoirRecord> = read(&device, &queue, &reservoirs);
        (counts, [named(&world, samples.iter()), named(&world, reservoirs.iter().map(|r| &r.chosen))])
    };
    let (all, [sampled, resampled]) = frame(1);
    assert!(sampled.len() > 10 && sampled != resampled, "{sampled:?}");
    assert_eq!(all, Some((sampled.clone(), resampled.clone())));
    let (share, _) = frame(DEFAULT_USAGE_INTERVAL);
    let share = share.expect("it was counted");
    for (share, all) in [(share.0, sampled), (share.1, resampled)] {
        assert!(share.iter().all(|(key, count)| *count <= all[key]));
        let [some, n] = [&share, &all].map(|counts| f64::from(counts.values().sum::<u32>()));
        let p = 1.0 / f64::from(DEFAULT_USAGE_INTERVAL);
        assert!((some - n * p).abs() < max_deviation(n, p), "{some} of {n}");
    }
    assert!(frame(0).0.is_none() && lights.take_usage().is_none());
}

#[test]
fn each_slot_counts_one_use_in_an_interval() {
    let (world, _, instances, mut lights) = lamps(8);
    let used: Vec<InstanceKey> = instances.iter().copied().cycle().take(1 << 18).collect();
    // 1 counts all; 3 divides no power of two.
    for interval in [1, 3, DEFAULT_USAGE_INTERVAL, 1000] {
        lights.count_usage(interval);
        use_now(&lights, &world, &used);
        let counts = collect(&mut lights);
        let (n, p) = ((used.len() / 8) as f64, 1.0 / f64::from(interval));
        for key in &instances {
            let count = f64::from(counts[key]);
            assert!((count - n * p).abs() <= max_deviation(n, p), "{count} of {n}, one in {interval}");
        }
    }
}

#[test]
fn directional_lights_and_no_light_and_slots_past_the_end_are_not_counted() {
    let (_, _, instances, mut lights) = lamps(3);
    // Twice, because the word of slot 0 holds the interval and must not change.
    for _ in 0..2 {
        let mut encoder = encoder();
        use_slots(&lights, &mut encoder, &[0, 0, u32::MAX, 1_000_000, 2, 0, u32::MAX]);
        submit(encoder);
    }
    assert_eq!(collect(&mut lights), Counts::from([(instances[1], 2)]));
}

#[test]
fn an_instance_is_not_credited_with_the_usage_of_its_slots_former_owner() {
    let (mut world, tree, keys, mut lights) = lamps(3);
    let [a, b, c] = [keys[0], keys[1], keys[2]];
    // A collection that is under way while b is removed and d gets its slot.
    use_now(&lights, &world, &[a, b, b, c]);
    let mut encoder = encoder();
    lights.collect_usage(&mut encoder);
    submit(encoder);
    wait();
    // Usage that is not even collected.
    use_now(&lights, &world, &[a, b, b, b]);
    let slot = world.slot(b);
    world.remove_instance(b).expect("it lives");
    let d = instance(&mut world, tree);
    assert_eq!(world.slot(d), slot, "the slot is used again");
    upload(&mut lights, &mut world);
    use_now(&lights, &world, &[d]);
    assert_eq!(take(&mut lights), Some(Counts::from([(a, 1), (c, 1)])));
    assert_eq!(collect(&mut lights), Counts::from([(a, 1), (d, 1)]));

    // d is removed and its slot stays empty. Until the upload says so, shaders may go on using it.
    use_now(&lights, &world, &[a, d, d]);
    let slot = world.slot(d).expect("it lives");
    world.remove_instance(d).expect("it lives");
    upload(&mut lights, &mut world);
    assert_eq!(collect(&mut lights), Counts::from([(a, 1)]));
    // The slot is filled one upload later.
    let e = instance(&mut world, tree);
    assert_eq!(world.slot(e), Some(slot));
    upload(&mut lights, &mut world);
    assert_eq!(collect(&mut lights), Counts::new());
    use_now(&lights, &world, &[e]);
    // An instance that moves keeps its usage.
    world.move_instance(e, Placement::at(DVec3::X)).expect("valid");
    upload(&mut lights, &mut world);
    assert_eq!(collect(&mut lights), Counts::from([(e, 1)]));
}

#[test]
fn many_slots_are_cleared_by_one_upload() {
    let (mut world, tree, keys, mut lights) = lamps(700);
    use_now(&lights, &world, &keys);
    // All except some, so that neighbouring slots form runs of many lengths.
    let stays = |i: usize| [0, 1, 3, 300, 699].contains(&i);
    for (_, key) in keys.iter().enumerate().filter(|(i, _)| !stays(*i)) {
        world.remove_instance(*key).expect("it lives");
    }
    let others: Vec<_> = (0..695).map(|_| instance(&mut world, tree)).collect();
    upload(&mut lights, &mut world);
    use_now(&lights, &world, &others);
    assert_eq!(collect(&mut lights), world.instances().map(|key| (key, 1)).collect());
}

#[test]
fn counts_that_are_under_way_survive_the_growth_of_the_world() {
    let (mut world, tree, mut keys, mut lights) = lamps(2);
    let mut expected = Counts::new();
    for round in 1..=3 {
        // One collection is under way, and some usage is not collected yet.
        for is_collected in [true, false] {
            use_now(&lights, &world, &keys);
            keys.iter().for_each(|key| *expected.entry(*key).or_default() += 1);
            let mut encoder = encoder();
            if is_collected {
                lights.collect_usage(&mut encoder);
            }
            submit(encoder);
        }
        keys.extend((0..100_usize.pow(round)).take(5000).map(|_| instance(&mut world, tree)));
        upload(&mut lights, &mut world);
    }
    wait();
    let mut counts = take(&mut lights).expect("three have arrived");
    for (key, count) in collect(&mut lights) {
        *counts.entry(key).or_default() += count;
    }
    assert_eq!(counts, expected);
    use_now(&lights, &world, &keys);
    assert_eq!(collect(&mut lights), keys.iter().map(|key| (*key, 1)).collect());
}

#[test]
fn while_all_buffers_are_in_use_counts_wait_for_a_later_collection() {
    let (world, _, keys, mut lights) = lamps(4);
    for _ in 0..5 {
        use_now(&lights, &world, &keys);
        let mut encoder = encoder();
        lights.collect_usage(&mut encoder);
        submit(encoder);
    }
    wait();
    let each = |count| keys.iter().map(|key| (*key, count)).collect::<Counts>();
    assert_eq!(take(&mut lights), Some(each(3)));
    assert_eq!(take(&mut lights), None);
    assert_eq!(collect(&mut lights), each(2));
    assert_eq!(collect(&mut lights), Counts::new());
}

#[test]
fn an_encoder_that_is_never_submitted_loses_no_counts() {
    let (world, _, keys, mut lights) = lamps(4);
    use_now(&lights, &world, &keys);
    for i in 0..10 {
        let mut encoder = encoder();
        lights.collect_usage(&mut encoder);
        if i % 2 == 0 {
            drop(encoder.finish());
        }
    }
    wait();
    assert_eq!(take(&mut lights), None);
    assert_eq!(collect(&mut lights), keys.iter().map(|key| (*key, 1)).collect());
}

#[test]
fn counts_arrive_with_the_submissions_of_later_frames() {
    let (world, _, keys, mut lights) = lamps(1);
    use_now(&lights, &world, &keys);
    let mut first = encoder();
    lights.collect_usage(&mut first);
    assert!(take(&mut lights).is_none(), "nothing is submitted");
    submit(first);
    // Nothing polls here except empty submissions, which take a few microseconds each.
    let arrived = (0..2_000_000).find_map(|_| {
        submit(encoder());
        take(&mut lights)
    });
    assert_eq!(arrived, Some(Counts::from([(keys[0], 1)])));
}

#[test]
fn without_counting_there_is_no_usage_and_an_upload_without_changes_sends_nothing() {
    let (device, queue) = gpu();
    let mut world = Rng(91).world(2, 10, 3, 10.0);
    let mut plain = GpuLights::new(&device, &queue).expect("default limits are enough");
    let mut counting = GpuLights::new(&device, &queue).expect("default limits are enough");
    counting.count_usage(DEFAULT_USAGE_INTERVAL);
    let [without, with] = [&mut plain, &mut counting].map(|l| l.upload(&world).expect("room enough").bytes);
    assert_eq!(with, without + 4, "the interval");
    for lights in [&mut plain, &mut counting] {
        assert_eq!(upload(lights, &mut world), UploadReport::default());
    }
    plain.count_usage(0);
    let mut encoder = encoder();
    plain.collect_usage(&mut encoder);
    submit(encoder);
    wait();
    assert!(plain.take_usage().is_none());
    // The shader and the bind group without counters do not change.
    let (shader, group) = (plain.shader(0, Effects::all()), plain.bind_group().clone());
    plain.count_usage(1);
    assert_eq!(upload(&mut plain, &mut world).bytes, 4);
    assert!(*plain.bind_group() == group && plain.shader(0, Effects::all()).wgsl == shader.wgsl);
    assert!(!shader.wgsl.contains("light_record_usage") && shader.layout == *plain.bind_group_layout());
}

#[test]
fn counting_that_was_stopped_starts_again_from_zero() {
    let (mut world, tree, mut keys, mut lights) = lamps(2);
    use_now(&lights, &world, &keys);
    lights.count_usage(0);
    use_now(&lights, &world, &keys);
    // Instances that come and go meanwhile are noticed when counting starts again.
    world.remove_instance(keys[0]).expect("it lives");
    keys[0] = instance(&mut world, tree);
    keys.push(instance(&mut world, tree));
    upload(&mut lights, &mut world);
    let mut idle = encoder();
    lights.collect_usage(&mut idle);
    submit(idle);
    wait();
    assert_eq!(take(&mut lights), None);
    lights.count_usage(1);
    upload(&mut lights, &mut world);
    use_now(&lights, &world, &keys);
    assert_eq!(collect(&mut lights), keys.iter().map(|key| (*key, 1)).collect());
    // The longest interval: hardly any use is counted.
    lights.count_usage(u32::MAX);
    use_now(&lights, &world, &keys);
    assert_eq!(collect(&mut lights), Counts::new());
}

#[test]
fn a_lost_device_brings_no_usage_and_does_no_harm() {
    let (device, queue) = limited_gpu(wgpu::Limits::default().max_storage_buffer_binding_size);
    let mut world = Rng(92).world(2, 10, 3, 10.0);
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    lights.count_usage(1);
    upload(&mut lights, &mut world);
    // One collection has arrived, one is under way, and one is recorded.
    let encoder = || device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut collected: Vec<_> = (0..3).map(|_| encoder()).collect();
    collected.iter_mut().for_each(|encoder| lights.collect_usage(encoder));
    let mut collected = collected.into_iter().map(wgpu::CommandEncoder::finish);
    queue.submit(collected.next());
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    queue.submit(collected.next());
    device.destroy();
    // What had arrived before the loss may still be readable.
    assert!(lights.take_usage().is_none_or(|usage| usage.total() == 0));
    for _ in 0..2 {
        assert!(lights.take_usage().is_none());
        let mut encoder = encoder();
        lights.collect_usage(&mut encoder);
        drop(encoder);
        lights.count_usage(2);
        assert!(lights.upload(&world).is_err());
    }
    drop(collected);
    assert!(lights.take_usage().is_none());
}

#[test]
fn the_text_with_usage_is_valid_for_all_effects_and_binds_five_storage_buffers() {
    let (device, queue) = gpu();
    let lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    let shader = lights.usage_shader(2, Effects::all());
    for effects in effect_sets(Effects::all().bits(), 0).into_iter().map(Effects::from_bits_truncate) {
        let shader = shader.with_effects(effects);
        assert!(shader.records_usage && shader.layout != *lights.bind_group_layout());
        let text = shader.join("@fragment fn main() { light_record_usage(1u, vec4(0.5)); }");
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
            .validate(&module)
            .map_err(|e| e.emit_to_string(&text))
            .expect("it is valid");
        let mut storage: Vec<_> = module
            .global_variables
            .iter()
            .filter(|(_, v)| matches!(v.space, naga::AddressSpace::Storage { .. }))
            .filter_map(|(_, v)| v.binding.map(|b| (b.group, b.binding)))
            .collect();
        storage.sort_unstable();
        assert_eq!(storage, [(2, 1), (2, 2), (2, 3), (2, 4), (2, 5)]);
    }
}
