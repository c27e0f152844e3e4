//! What counts the samples of a recording.

use crate::{common::World, run};
use glam::Vec3;
use translucent::{
    reference::{begin::begin, clear::clear, random},
    shared::*,
};

fn world() -> World {
    World::new(Material::default(), PROJECTION_MIS, 1)
}

#[test]
fn begin_numbers_samples_as_the_twin_bit_for_bit() {
    let world = world();
    let progress = |first, begin, end| Progress { first, begin, end, restart: 7 };
    // Sums that go on, that do not follow, that were forgotten; counts that wrap.
    let cases = [
        (progress(0, 0, NO_SAMPLES), 0, 64),
        (progress(0, 0, 64), 64, 100),
        (progress(0, 3, 64), 63, 1),
        (progress(100, 64, 128), 28, 9),
        (progress(1_000_000, 2, 5), 77, 4096),
        (progress(u32::MAX, 9, NO_SAMPLES), 0, 2),
        (progress(0xdead_beef, 0, 0xdead_bef0), 1, 500),
    ];
    for (before, start, count) in cases {
        let step = Step { sample_index: start, pixel_count: count, ..Step::default() };
        let samples = vec![Sample::default(); MAX_RECORDED as usize];
        let progresses = [before];
        let buffers: [(Slot, &[u8]); 2] =
            [(Slot::Progresses, bytemuck::cast_slice(&progresses)), (Slot::Samples, bytemuck::cast_slice(&samples))];
        let out = run("begin", &world.inputs(), &[], &step, &buffers);
        let (after, expected) = begin(before, &step);
        assert_eq!(out.get::<Progress>(Slot::Progresses), [after]);
        let found = out.get::<Sample>(Slot::Samples);
        assert_eq!(found[..count as usize], expected);
        assert!(found[count as usize..].iter().all(|sample| *sample == Sample::default()));
    }
}

#[test]
fn clear_forgets_where_sums_start_anew() {
    const PIXELS: u32 = 150;
    let world = world();
    let number = |i: u32| random::unit(random::hash(i)) as f32 + 1.0;
    let sums: Vec<Sums> = (0..PIXELS)
        .map(|i| Sums { subsurface: Vec3::splat(number(i)), samples: i, invalid: 1, ..Sums::default() })
        .collect();
    let batch_sums: Vec<Vec3> = (0..PIXELS * BATCHES).map(|i| Vec3::splat(number(i))).collect();
    for restart in [0, 1] {
        let progress = [Progress { restart, ..Progress::default() }];
        let buffers: [(Slot, &[u8]); 3] = [
            (Slot::Progresses, bytemuck::cast_slice(&progress)),
            (Slot::RunningSums, bytemuck::cast_slice(&sums)),
            (Slot::BatchSums, bytemuck::cast_slice(&batch_sums)),
        ];
        let step = Step { pixel_count: PIXELS, ..Step::default() };
        let out = run("clear", &world.inputs(), &[], &step, &buffers);
        let (mut sums, mut batch_sums) = (sums.clone(), batch_sums.clone());
        for (i, sums) in sums.iter_mut().enumerate() {
            let mut mine: Vec<Vec3> = (0..BATCHES as usize).map(|b| batch_sums[b * PIXELS as usize + i]).collect();
            clear(&progress[0], sums, &mut mine);
            (0..BATCHES as usize).for_each(|b| batch_sums[b * PIXELS as usize + i] = mine[b]);
        }
        assert_eq!(out.get::<Sums>(Slot::RunningSums), sums);
        assert_eq!(out.get::<Vec3>(Slot::BatchSums), batch_sums);
    }
}
