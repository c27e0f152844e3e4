//! The layer over Vulkan, on whatever device there is: choosing a device, bytes there and back, order of commands.
//! Every test ends with a silent validation layer, after the device is gone.

mod clock;
mod module;

use rspirv::spirv::Capability;
use translucent::{
    Error,
    gpu::{Bindings, Buffer, Device, DeviceOptions, Kernel, Layout, Location, Recorder, download, upload},
    shared::{Features, Slot, Step},
};

/// Runs `test` on a validated device; with the device destroyed, validation must have found nothing.
fn with_device(staging: bool, test: impl FnOnce(&Device)) {
    let options = DeviceOptions { validation: true, profiling: true, staging, ..Default::default() };
    let device = Device::open(&options).expect("a device with the validation layer");
    let log = device.validation_log();
    test(&device);
    drop(device);
    assert_eq!(log.messages(), Vec::<String>::new());
}

/// The words of a buffer, by way of [`download`].
fn words(device: &Device, buffer: &Buffer) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(&download(device, buffer, buffer.bytes()).expect("a device that works"))
}

fn counting(words: usize) -> Vec<u32> {
    (0..words as u32).map(|i| i.wrapping_mul(0x9e37_79b9)).collect()
}

#[test]
fn devices_are_found_by_index_name_and_uuid() {
    let list = Device::list().expect("a driver is installed");
    let usable = list.iter().find(|info| info.lacks.is_empty()).expect("one device can be used");
    for wanted in [usable.index.to_string(), usable.uuid.to_uppercase(), usable.uuid.replace('-', "")] {
        let device = Device::open(&DeviceOptions { device: Some(wanted), ..Default::default() });
        assert_eq!(device.expect("it was listed").info(), usable);
    }
    let part = usable.name[1..].to_uppercase();
    let device = Device::open(&DeviceOptions { device: Some(part.clone()), ..Default::default() });
    assert!(device.expect("it was listed").info().name.to_uppercase().contains(&part));
}

#[test]
fn an_unknown_device_is_an_input_error_that_lists_what_there_is() {
    for wanted in ["9999", "no such device", ""] {
        let error = Device::open(&DeviceOptions { device: Some(wanted.into()), ..Default::default() });
        let error = error.expect_err("there is no such device");
        assert!(error.is_input(), "{error}");
        let name = &Device::list().expect("a driver is installed")[0].name;
        assert!(error.to_string().contains(name), "{error}");
    }
}

#[test]
fn bytes_come_back_whole_from_host_memory() {
    with_device(false, |device| {
        let buffer = Buffer::new(device, "words", 4000, Location::Upload).expect("memory");
        let data = counting(1000);
        buffer.write(&data);
        assert_eq!(buffer.read::<u32>(), data);
        // Whole elements only; a shorter write leaves the rest alone.
        buffer.write(&[7u8]);
        assert_eq!(buffer.read::<[u32; 3]>().len(), 333);
        assert_eq!(buffer.read::<u8>()[..4], [7, 0, 0, 0]);
        assert_eq!(Buffer::new(device, "empty", 0, Location::Readback).expect("memory").bytes(), 4);
    });
}

#[test]
fn bytes_come_back_whole_from_device_memory() {
    // More than two staging buffers (8 MiB each) and no multiple of them.
    let data = counting(5_000_001);
    for staging in [false, true] {
        with_device(staging, |device| {
            for count in [1, 3, data.len()] {
                let buffer = Buffer::new(device, "words", 4 * count as u64, Location::Device).expect("memory");
                upload(device, &buffer, bytemuck::cast_slice(&data[..count])).expect("a device that works");
                assert!(words(device, &buffer) == data[..count]);
            }
        });
    }
}

#[test]
fn a_buffer_beyond_the_device_is_a_memory_error_that_names_it() {
    with_device(false, |device| {
        let error = Buffer::new(device, "sums", device.max_storage_buffer_range() + 1, Location::Device);
        match error.err() {
            Some(Error::Memory { step, .. }) => assert!(step.contains("sums"), "{step}"),
            other => panic!("expected a memory error, got {other:?}"),
        }
        assert!(device.heap_size() >= device.max_storage_buffer_range());
        assert!((1..=device.heap_size()).contains(&device.heap_left()));
        let (left, limit) = device.host_left();
        assert!(left > 0 && !limit.is_empty());
    });
}

#[test]
fn fills_and_copies_happen_in_order() {
    with_device(true, |device| {
        let new = |name, location| Buffer::new(device, name, 400, location).expect("memory");
        let (one, two, back) =
            (new("one", Location::Device), new("two", Location::Device), new("back", Location::Readback));
        let mut recorder = Recorder::new(device).expect("a device that works");
        for word in [1, 0xffff_ffff] {
            recorder.begin().expect("a device that works");
            recorder.fill(&one, word);
            recorder.fill(&two, word ^ 5);
            recorder.copy(&one, &two, 200);
            recorder.fill(&one, 0);
            recorder.copy(&two, &back, 400);
            recorder.submit_and_wait().expect("a device that works");
            let words = back.read::<u32>();
            assert!(words[..50].iter().all(|&w| w == word) && words[50..].iter().all(|&w| w == word ^ 5));
        }
    });
}

#[test]
fn dispatches_happen_in_order_with_their_constants() {
    const COUNT: u32 = 1000;
    with_device(true, |device| {
        let layout = Layout::new(device).expect("a device that works");
        let features = Features { projection: 5, ..Default::default() };
        let kernel = Kernel::new(&layout, "module", &module::triple_and_add(None), &features, 64).expect("it compiles");
        let counters = Buffer::new(device, "counters", 4 * u64::from(COUNT + 64), Location::Device).expect("memory");
        let bindings = Bindings::new(&layout, &[(Slot::Counters, &counters)]).expect("a device that works");
        let mut recorder = Recorder::profiled(device).expect("a device that works");
        recorder.begin().expect("a device that works");
        recorder.fill(&counters, 0);
        for sample_index in 0..20 {
            recorder.dispatch(&kernel, &bindings, COUNT, &Step { pixel_count: COUNT, sample_index, ..Step::default() });
        }
        // The recording alone keeps these alive.
        drop((kernel, bindings, layout));
        recorder.submit_and_wait().expect("a device that works");
        let expected = (0..20u32).fold(0u32, |sum, index| sum.wrapping_mul(3).wrapping_add(index + 5));
        let words = words(device, &counters);
        assert!(words[..COUNT as usize].iter().all(|&word| word == expected));
        assert!(words[COUNT as usize..].iter().all(|&word| word == 0));
        // Timestamps are optional in Vulkan; where they are, each dispatch has one.
        let timing = recorder.timing().expect("it is profiled");
        let scopes = &timing.scopes;
        assert!(scopes.len() == if device.has_timestamps() { 20 } else { 0 });
        assert!(scopes.iter().zip(0..).all(|(scope, i)| scope.kernel == "module" && scope.step.sample_index == i));
        assert!(scopes.iter().all(|scope| scope.begin <= scope.end));
        assert!(scopes.windows(2).all(|pair| pair[0].end <= pair[1].begin));
        // Between submission and end, but for a nanosecond of rounding.
        assert!(scopes.iter().all(|scope| scope.begin >= -1.0 && scope.end <= timing.ended + 1.0), "{timing:?}");
    });
}

#[test]
fn more_groups_than_one_dimension_holds_reach_every_item_once() {
    // Vulkan promises 65,535 groups in one dimension, and lavapipe has no more.
    const COUNT: u32 = 3 * 65_536 + 7;
    with_device(false, |device| {
        let layout = Layout::new(device).expect("a device that works");
        let kernel = Kernel::new(&layout, "module", &module::triple_and_add(None), &Features::default(), 1);
        let kernel = kernel.expect("it compiles");
        let counters = Buffer::new(device, "counters", 4 * u64::from(COUNT), Location::Device).expect("memory");
        let bindings = Bindings::new(&layout, &[(Slot::Counters, &counters)]).expect("a device that works");
        let mut recorder = Recorder::new(device).expect("a device that works");
        recorder.begin().expect("a device that works");
        recorder.fill(&counters, 1);
        recorder.dispatch(&kernel, &bindings, COUNT, &Step { pixel_count: COUNT, sample_index: 2, ..Step::default() });
        recorder.submit_and_wait().expect("a device that works");
        assert!(words(device, &counters).iter().all(|&word| word == 5));
    });
}

#[test]
fn kernels_that_cannot_be_are_errors() {
    with_device(false, |device| {
        let layout = Layout::new(device).expect("a device that works");
        let module = module::triple_and_add(None);
        for workgroup in [0, 1 << 20] {
            let error = Kernel::new(&layout, "module", &module, &Features::default(), workgroup).err();
            assert!(error.is_some_and(|error| error.is_input()));
        }
        let error = Kernel::new(&layout, "module", b"not SPIR-V", &Features::default(), 64).err();
        assert!(error.is_some_and(|error| error.to_string().contains("module")));
    });
}

#[test]
fn validation_speaks_up() {
    // Proof that its silence means something: a kernel that declares 64-bit floats, which no device here enables.
    let device = Device::open(&DeviceOptions { validation: true, ..Default::default() });
    let device = device.expect("a device with the validation layer");
    let layout = Layout::new(&device).expect("a device that works");
    let module = module::triple_and_add(Some(Capability::Float64));
    let _ = Kernel::new(&layout, "module", &module, &Features::default(), 64);
    assert!(device.validation_messages().iter().any(|message| message.contains("Float64")));
}

#[test]
fn two_devices_live_side_by_side_and_buffers_outlive_their_handle() {
    let open = || Device::open(&DeviceOptions::default()).expect("a device");
    let (first, second) = (open(), open());
    let on_first = Buffer::new(&first, "first", 40, Location::Upload).expect("memory");
    let on_second = Buffer::new(&second, "second", 40, Location::Upload).expect("memory");
    drop(first);
    on_first.write(&counting(10));
    on_second.write(&[3u32; 10]);
    drop(second);
    assert_eq!(on_first.read::<u32>(), counting(10));
    assert_eq!(on_second.read::<u32>(), [3; 10]);
}
