//! The stages as such: camera rays, hit lists, sums, variance, and the reference renderer made of them.

use crate::common::*;
use glam::{DVec3, Vec3, dvec3, vec3};
use translucent::Normalisation::Energy;
use translucent::reference::accumulate::accumulate;
use translucent::reference::primary::{camera_ray, primary};
use translucent::reference::random::{hash, key, unit};
use translucent::reference::reflect::reflect;
use translucent::reference::reproject::reproject;
use translucent::reference::resolve::{batch_count, resolve};
use translucent::reference::sample::sample;
use translucent::reference::sums::add;
use translucent::reference::{render, step};
use translucent::shared::*;

/// A cube of three-coloured matter on a matt floor, under a lamp and uniform light; width x height pixels.
fn still_life(projection: u32, width: u32, height: u32) -> World {
    let matter = standard(dvec3(4.0, 8.0, 2.0), dvec3(0.3, 0.1, 0.02), 1.4, Energy, 1e-6);
    let mut world = World::new(Material { alpha: 0.2, ..matter }, projection, width);
    world.materials.push(Material { ior: 1.5, alpha: 0.3, base_color: Vec3::splat(0.5), ..Default::default() });
    cuboid(dvec3(-0.5, -0.5, 0.0), dvec3(0.5, 0.5, 1.0)).into_iter().for_each(|t| world.triangle(t));
    world.triangle([dvec3(-1.5, -1.5, 0.0), dvec3(3.5, -1.5, 0.0), dvec3(-1.5, 3.5, 0.0)]);
    (world.triangles[12].set, world.shadings[12].material) = (1, 1);
    world.light(sun(dvec3(-1.0, 0.4, -1.0), 2.0));
    world.look(dvec3(2.0, -3.0, 3.0), dvec3(0.0, 0.0, 0.4), 2.0);
    world.view.height = height;
    world
}

#[test]
fn camera_rays_pass_through_their_pixels() {
    let mut world = still_life(PROJECTION_MIS, 8, 6);
    world.view.crop_x = 2;
    world.view.crop_width = 3;
    for perspective in [true, false] {
        if !perspective {
            world.look_along(-DVec3::Z, DVec3::ZERO, 5.0, 2.0);
        }
        let view = world.view;
        for sample_index in [0, 13, 100] {
            let step = Step { first_row: 4, ..step(&world.inputs(), sample_index, 4..6, 0..1) };
            for index in 0..6 {
                let ray = camera_ray(&Features::default(), &view, &step, index);
                let from = ray.origin - view.pivot.as_dvec3();
                let (right, up) = (view.right.as_dvec3(), view.up.as_dvec3());
                let x = (from.dot(right) / right.length_squared() + 1.0) / 2.0 * 8.0;
                let y = (1.0 - from.dot(up) / up.length_squared()) / 2.0 * 6.0;
                let (px, py) = (2.0 + f64::from(index % 3), 4.0 + f64::from(index / 3));
                assert!((px - 1e-5..px + 1.00001).contains(&x) && (py - 1e-5..py + 1.00001).contains(&y), "{x} {y}");
                let eye = ray.origin - ray.reach * ray.direction;
                if perspective {
                    assert!(eye.distance(dvec3(2.0, -3.0, 3.0)) < 1e-6);
                } else {
                    assert!((eye.z - 5.0).abs() < 1e-6 && ray.direction.distance(-DVec3::Z) < 1e-9);
                }
                let centre = camera_ray(&Features::default(), &view, &Step { pixel_centre: 1, ..step }, index).origin;
                let expected = view.pivot.as_dvec3()
                    + right * (2.0 * (px + 0.5) / 8.0 - 1.0)
                    + up * (1.0 - 2.0 * (py + 0.5) / 6.0);
                assert!(centre.distance(expected) < 1e-6);
            }
        }
    }
}

#[test]
fn strata_cover_the_pixel() {
    // The 64 strata of one batch: one in each of 8 x 8 squares; the four samples of a stratum share it.
    let world = still_life(PROJECTION_MIS, 4, 4);
    let mut seen = [false; 64];
    for stratum in 0..64 {
        let origin = |sample: u32| {
            let index = (stratum * STRATUM + sample) * BATCHES + 3;
            camera_ray(&Features::default(), &world.view, &step(&world.inputs(), index, 0..4, 0..1), 5).origin
        };
        assert_eq!(origin(0), origin(3));
        let from = origin(0) - world.view.pivot.as_dvec3();
        let coordinate = |axis: Vec3| {
            let ndc = from.dot(axis.as_dvec3()) / axis.as_dvec3().length_squared();
            let pixel = (ndc + 1.0) / 2.0 * 4.0;
            ((pixel - pixel.floor()) * 8.0) as usize
        };
        seen[coordinate(world.view.right) * 8 + coordinate(world.view.up)] = true;
    }
    assert!(seen.into_iter().all(|s| s));
}

#[test]
fn primary_finds_the_nearest_surface() {
    let world = still_life(PROJECTION_MIS, 16, 16);
    let inputs = world.inputs();
    let step = step(&inputs, 0, 0..16, 0..1);
    let (mut matter, mut floor, mut sky) = (0, 0, 0);
    for index in 0..256 {
        let surface = primary(&inputs, &step, index);
        match surface.triangle {
            MISS => {
                sky += 1;
                continue;
            }
            12 => floor += 1,
            _ => matter += 1,
        }
        let ray = camera_ray(&inputs.features, inputs.view, &step, index);
        let to = surface.position.as_dvec3() - ray.origin;
        assert!((to - to.dot(ray.direction) * ray.direction).length() < 1e-6, "off the ray");
        let at = world.surface(surface.triangle, surface.position.as_dvec3()).barycentric;
        assert!((at - surface.barycentric).length() < 1e-5);
        // What faces away from the eye is behind something.
        let normal = world.shadings[surface.triangle as usize].normal0.as_dvec3();
        assert!(normal.dot(ray.direction) < 0.0);
    }
    assert!(matter > 10 && floor > 10 && sky > 10, "{matter} {floor} {sky}");
}

/// Twenty sheets above and below each other; xo is on sheet 0, a probe meets all.
fn sheets(projection: u32) -> (World, Surface) {
    let (mut world, surface) = plane(matter(0.1, 0.95, 1.3, Energy), projection, 64, 0.0, false);
    for k in 1..20 {
        let z = if k % 2 == 0 { 0.1 } else { -0.1 } * f64::from(k);
        let (x, y) = (DVec3::X * 200.0, DVec3::Y * 200.0);
        quad([-x - y, x - y, x + y, y - x]).into_iter().for_each(|[a, b, c]| {
            world.triangle([a + z * DVec3::Z, b + z * DVec3::Z, c + z * DVec3::Z]);
        });
    }
    (world, surface)
}

#[test]
fn long_hit_lists_are_kept_fairly() {
    let (world, surface) = sheets(PROJECTION_NORMAL);
    let mut kept = [0u32; 20];
    let runs = 2000;
    for seed in 0..runs {
        let mut world = world.clone();
        world.view.seed = seed;
        let inputs = world.inputs();
        let step = step(&inputs, seed, 0..1, 0..1);
        let probe = sample(&inputs, &step, seed % 64, &surface);
        let hits = reproject(&inputs, &step, seed % 64, &surface, &probe);
        assert_eq!(hits.count, 20);
        assert!(hits.t.is_sorted_by(|a, b| a < b));
        hits.triangle.iter().for_each(|&t| kept[t as usize / 2] += 1);
    }
    // Each sheet with probability 8/20. Chi-square of 20 shares with 19 degrees of freedom, over the variance of the
    // hypergeometric choice: above 62 has probability 2e-6.
    let expected = f64::from(runs) * 0.4;
    let chi2: f64 =
        kept.iter().map(|&k| (f64::from(k) - expected).powi(2)).sum::<f64>() / (expected * 0.6) * 19.0 / 20.0;
    assert!(chi2 < 62.0, "{chi2}: {kept:?}");
}

#[test]
fn long_hit_lists_are_unbiased() {
    // Under uniform light without shadows every sheet would give its share; here all but the outermost faces are dark,
    // so compare the weights: their mean is the integral of f over all sheets, which is a sum of closed forms.
    use translucent::reference::accumulate::choose;
    use translucent::reference::math::integrate;
    use translucent::reference::profile::shapes;
    use translucent::reference::projection::seen;
    for projection in [PROJECTION_NORMAL, PROJECTION_MIS] {
        let (world, surface) = sheets(projection);
        let inputs = world.inputs();
        let seen = seen(&inputs, &surface);
        let material = &world.materials[0];
        let radius = f64::from(material.radius_max);
        let expected: f64 = (0..20)
            .map(|k| {
                let z = 0.1 * f64::from(k);
                // In the ball, by the distance rho from xo: dA = 2 pi rho d rho.
                integrate(z.max(1e-9).ln(), radius.ln(), 40, |x| {
                    let rho = x.exp();
                    f64::from(material.strength.x) * shapes(material.into(), rho).x * std::f64::consts::TAU * rho * rho
                })
            })
            .sum();
        let found = estimate(&world, 128, |index, step| {
            let probe = sample(&inputs, step, index, &surface);
            let hits = reproject(&inputs, step, index, &surface, &probe);
            if hits.count == 0 {
                return DVec3::ZERO;
            }
            choose(&inputs, step, index, material.into(), &seen, &probe, &hits)
                .map_or(DVec3::ZERO, |(_, factor)| factor)
        });
        found.check(expected, 1e-5, &format!("projection {projection}"));
    }
}

#[test]
fn the_given_method_keeps_the_first_hit_of_its_set() {
    let (mut world, surface) = sheets(PROJECTION_CAMERA);
    // The uppermost sheet (18) belongs to something else.
    (world.triangles[36].set, world.triangles[37].set) = (1, 1);
    let inputs = world.inputs();
    for sample_index in 0..32 {
        let step = step(&inputs, sample_index, 0..1, 0..1);
        let probe = sample(&inputs, &step, 0, &surface);
        let hits = reproject(&inputs, &step, 0, &surface, &probe);
        assert_eq!((hits.count, hits.triangle[0] / 2), (1, 16));
    }
}

#[test]
fn nothing_is_probed_where_nothing_is_translucent() {
    let world = still_life(PROJECTION_MIS, 4, 4);
    let inputs = world.inputs();
    let step = step(&inputs, 0, 0..4, 0..1);
    let miss = Surface { triangle: MISS, ..Default::default() };
    let floor = world.surface(12, dvec3(-1.0, -1.0, 0.0));
    for surface in [miss, floor] {
        let probe = sample(&inputs, &step, 0, &surface);
        assert!(probe.t_min > probe.t_max);
        let hits = reproject(&inputs, &step, 0, &surface, &probe);
        assert_eq!(hits.count, 0);
        assert_eq!(valid(accumulate(&inputs, &step, 0, &surface, &probe, &hits)), DVec3::ZERO);
    }
    let mut black = world.clone();
    black.materials[0] = standard(DVec3::ZERO, DVec3::ONE, 1.3, Energy, 1e-6);
    let top = black.surface(10, dvec3(0.1, 0.2, 1.0));
    let probe = sample(&black.inputs(), &step, 0, &top);
    assert!(probe.t_min > probe.t_max, "matter that does not scatter");
}

#[test]
fn both_sides_of_a_surface_are_the_same_matter() {
    // The cube with all triangles turned inside out looks the same.
    let world = still_life(PROJECTION_MIS, 8, 8);
    let mut turned = world.clone();
    for (t, s) in turned.triangles.iter_mut().zip(&mut turned.shadings).take(12) {
        t.vertices.swap(1, 2);
        (s.normal0, s.normal1, s.normal2) = (-s.normal0, -s.normal2, -s.normal1);
    }
    let (a, b) = (render(&world.inputs(), 0..8, 0..16), render(&turned.inputs(), 0..8, 0..16));
    for (a, b) in a.iter().zip(&b) {
        assert!((a.subsurface - b.subsurface).length() <= 1e-4 * a.subsurface.length(), "{a:?} {b:?}");
    }
}

#[test]
fn rays_may_be_dispatched_in_parts() {
    let mut world = still_life(PROJECTION_MIS, 4, 4);
    world.view.directions = 5;
    let inputs = world.inputs();
    let surface = world.surface(10, dvec3(0.1, 0.2, 1.0));
    for sample_index in 0..16 {
        let whole = step(&inputs, sample_index, 0..4, 0..1);
        assert_eq!(whole.ray_count, 6);
        let parts = [(0, 2), (2, 1), (3, 3)].map(|(ray_begin, ray_count)| Step {
            ray_begin,
            ray_count,
            first: u32::from(ray_begin == 0),
            ..whole
        });
        let subsurface = |step: &Step| subsurface(&inputs, step, 2, &surface);
        let reflection = |step: &Step| valid(reflect(&inputs, step, 2, &surface));
        for (all, sum) in [
            (subsurface(&whole), parts.iter().map(subsurface).sum::<DVec3>()),
            (reflection(&whole), parts.iter().map(reflection).sum::<DVec3>()),
        ] {
            assert!(all.distance(sum) < 1e-12, "{all} {sum}");
        }
    }
}

#[test]
fn what_is_not_finite_is_counted_and_left_out() {
    let mut world = still_life(PROJECTION_MIS, 4, 4);
    world.light(Light {
        intensity: vec3(f32::INFINITY, 0.0, 0.0),
        position: vec3(0.0, 0.0, 9.0),
        ..Default::default()
    });
    let pixels = render(&world.inputs(), 0..4, 0..16);
    assert!(pixels.iter().map(|p| p.invalid).sum::<u32>() > 0);
    assert!(pixels.iter().all(|p| p.subsurface.is_finite() && p.reflection.is_finite() && p.variance.is_finite()));
}

#[test]
fn compensated_sums_lose_nothing() {
    // A million additions: a plain f32 sum is wrong in the third digit.
    let (mut sum, mut carry, mut plain, mut exact) = (Vec3::ZERO, Vec3::ZERO, 0f32, 0f64);
    for i in 0..1_000_000u32 {
        let x = unit(hash(i)) as f32 + 0.1;
        add(&mut sum, &mut carry, Vec3::splat(x));
        plain += x;
        exact += f64::from(x);
    }
    let found = f64::from(sum.x) + f64::from(carry.x);
    assert!((found / exact - 1.0).abs() < 1e-8, "{found} for {exact}");
    assert!((f64::from(plain) / exact - 1.0).abs() > 1e-6, "the test is void");
}

#[test]
fn variance_between_batches_is_unbiased() {
    // Samples with variance 1/12: the mean of n has 1 / (12 n), whatever range the samples fill.
    for range in [0..64, 3..23, 5..13, 7..40] {
        let n = range.len() as f64;
        let counts: Vec<u32> = (0..BATCHES).map(|b| batch_count(range.start, range.end, b)).collect();
        for b in 0..BATCHES {
            assert_eq!(counts[b as usize] as usize, range.clone().filter(|s| s % BATCHES == b).count());
        }
        let runs = 20_000u32;
        let (mut sum, mut squares) = (0.0, 0.0);
        for run in 0..runs {
            let mut batch_sums = [Vec3::ZERO; 8];
            for s in range.clone() {
                batch_sums[(s % BATCHES) as usize] += Vec3::splat(unit(key(run, s, 0, 0, 0)) as f32);
            }
            let sums = Sums { samples: range.len() as u32, ..Default::default() };
            let step = Step { range_begin: range.start, range_end: range.end, ..Default::default() };
            let features = Features { batches: 1, ..Default::default() };
            let variance = f64::from(resolve(&features, &step, &sums, &batch_sums).variance.x);
            sum += variance;
            squares += variance * variance;
        }
        let mean = sum / f64::from(runs);
        let error = ((squares / f64::from(runs) - mean * mean) / f64::from(runs)).sqrt();
        let expected = 1.0 / (12.0 * n);
        assert!((mean - expected).abs() < 4.0 * error, "{range:?}: {mean} +- {error} for {expected}");
    }
}

#[test]
fn variance_needs_all_batches() {
    let step = Step { range_begin: 3, range_end: 10, ..Default::default() };
    let features = Features { batches: 1, ..Default::default() };
    let sums = Sums { samples: 7, covered: 3, subsurface: Vec3::splat(14.0), ..Default::default() };
    let pixel = resolve(&features, &step, &sums, &[Vec3::ONE; 8]);
    assert_eq!((pixel.variance, pixel.alpha, pixel.subsurface), (Vec3::ZERO, 3.0 / 7.0, Vec3::splat(2.0)));
}

#[test]
fn rendered_variance_is_honest() {
    // Squared deviations from a long render, over the written variance, average 1: the estimate has 7 degrees of freedom
    // and is unbiased, so the sum over pixels and seeds of both is compared. Pixels with the same coordinates but other
    // seeds are independent.
    let mut world = still_life(PROJECTION_MIS, 6, 6);
    let truth = render(&world.inputs(), 0..6, 0..2048);
    let seeds = 32;
    let mut ratios = Vec::new();
    for seed in 100..100 + seeds {
        world.view.seed = seed;
        let (mut deviation, mut variance) = (0.0, 0.0);
        for (pixel, truth) in render(&world.inputs(), 0..6, 0..32).iter().zip(&truth) {
            deviation += f64::from((pixel.subsurface.x - truth.subsurface.x).powi(2));
            variance += f64::from(pixel.variance.x);
        }
        ratios.push(DVec3::new(deviation - variance, deviation, variance));
    }
    let found = Estimate::of(&ratios);
    // The long render has 1/64 of the variance, or less.
    let allowed = 4.0 * found.error.x + found.mean.z / 64.0;
    assert!(found.mean.x.abs() < allowed, "{found:?}");
    assert!(found.error.x < 0.5 * found.mean.z, "weak: {found:?}");
}

#[test]
fn the_image_does_not_depend_on_crop_band_or_order() {
    let world = still_life(PROJECTION_MIS, 8, 6);
    let whole = render(&world.inputs(), 0..6, 0..16);
    assert_eq!(whole, render(&world.inputs(), 0..6, 0..16), "two runs");
    let mut cropped = world.clone();
    (cropped.view.crop_x, cropped.view.crop_width) = (3, 2);
    let part = render(&cropped.inputs(), 2..5, 0..16);
    for (i, pixel) in part.iter().enumerate() {
        assert_eq!(*pixel, whole[(2 + i / 2) * 8 + 3 + i % 2]);
    }
    assert!(whole.iter().any(|p| p.alpha > 0.0 && p.alpha < 1.0), "an edge is anti-aliased");
    assert!(whole.iter().all(|p| p.samples == 16 && (p.alpha > 0.0 || p.subsurface == Vec3::ZERO)));
}

#[test]
fn any_range_of_samples_is_unbiased() {
    // One sample a pixel, of any number, has the mean of many: no technique is tied to the index.
    let (world, surface) = plane(matter(1.0, 0.95, 1.3, Energy), PROJECTION_MIS, 20_000, 0.5, true);
    let inputs = world.inputs();
    let truth =
        estimate(&plane(matter(1.0, 0.95, 1.3, Energy), PROJECTION_MIS, 64, 0.5, true).0, 512, |index, step| {
            subsurface(&inputs, step, index, &surface)
        });
    for sample_index in [0, 5, 17] {
        let found = estimate(&world, 1, |index, _| {
            subsurface(&inputs, &step(&inputs, sample_index, 0..1, 0..1), index, &surface)
        });
        let error = found.error.x.hypot(truth.error.x);
        assert!((found.mean.x - truth.mean.x).abs() < 4.0 * error, "sample {sample_index}: {found:?} {truth:?}");
        assert!(error < 0.01 * truth.mean.x);
    }
}
