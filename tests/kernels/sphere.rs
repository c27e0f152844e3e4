//! The sampling and accumulating kernels on the analytic sphere, which no mesh blurs: the device draws the probes, the
//! host meets them with the sphere in f64, and the device weighs and lights the hits on tangent triangles. Nothing casts
//! a shadow. Under uniform light every point shows the profile's mass within 2R, times Ft(wo).

use crate::{bench, check, common::sphere::*, common::*};
use glam::{DVec3, UVec4, Vec2, Vec3, dvec3};
use translucent::{
    Normalisation::Energy,
    reference::{
        boundary::transmittance,
        projection::{fractions, seen},
        step,
    },
    shared::*,
    verify::{Bench, Loaded},
};

/// A BVH node without children.
const NOTHING: [UVec4; 5] = [UVec4::ZERO; 5];

/// Places on the sphere, each seen by `replicas` pixels of a band.
struct Disk {
    world: World,
    places: Vec<DVec3>,
    surfaces: Vec<Surface>,
    replicas: u32,
}

impl Disk {
    /// A triangle of material m at each of the angles, for every m.
    fn new(materials: &[Material], projection: u32, eye: Eye, replicas: u32) -> Disk {
        let angles = eye.angles();
        let count = materials.len() * angles.len();
        let mut world = World::new(materials[0], projection, count as u32 * replicas);
        world.features.batches = 0;
        world.materials = materials.to_vec();
        eye.look(&mut world);
        let places: Vec<DVec3> = (0..count).map(|case| place(angles[case % angles.len()])).collect();
        for (case, position) in places.iter().enumerate() {
            world.triangle(tangent(*position));
            world.shadings[case].material = (case / angles.len()) as u32;
        }
        let surface = |(triangle, position): (u32, &DVec3)| Surface {
            position: position.as_vec3(),
            triangle,
            barycentric: Vec2::ZERO,
        };
        let surfaces = (0..).zip(&places).map(surface).collect();
        Disk { world, places, surfaces, replicas }
    }

    fn pixels(&self) -> u32 {
        self.places.len() as u32 * self.replicas
    }

    /// The disk on the device, with room for two triangles a pixel.
    fn load(&self, bench: &Bench) -> Loaded {
        let pixels = self.pixels() as usize;
        let mut world = self.world.clone();
        world.triangles.resize(self.places.len() + 2 * pixels, Triangle::default());
        world.shadings.resize(self.places.len() + 2 * pixels, Shading::default());
        let of_pixel = |i: usize| self.surfaces[i / self.replicas as usize];
        let surfaces: Vec<Surface> = (0..pixels * BATCHES as usize).map(|i| of_pixel(i % pixels)).collect();
        let buffers: [(Slot, &[u8]); 4] = [
            (Slot::Surfaces, bytemuck::cast_slice(&surfaces)),
            (Slot::Probes, &vec![0; pixels * size_of::<Probe>()]),
            (Slot::HitLists, &vec![0; pixels * size_of::<Hits>()]),
            (Slot::RunningSums, &vec![0; pixels * size_of::<Sums>()]),
        ];
        bench.load(&world.inputs(), &NOTHING, &buffers).expect("load")
    }

    /// One sample of every pixel; returns the number of hits of each.
    fn add_sample(&self, bench: &mut Bench, loaded: &Loaded, sample_index: u32) -> Vec<u32> {
        let step = step(&self.world.inputs(), sample_index, 0..1, 0..1);
        bench.dispatch("sample", loaded, &step).expect("dispatch");
        let probes: Vec<Probe> = bench.read(loaded, Slot::Probes).expect("read");
        let (mut triangles, mut shadings) = (self.world.triangles.clone(), self.world.shadings.clone());
        let mut lists = vec![Hits::default(); probes.len()];
        for (pixel, (probe, hits)) in probes.iter().zip(&mut lists).enumerate() {
            let case = pixel / self.replicas as usize;
            for (t, point) in meetings(self.places[case], probe, self.world.features.projection) {
                hits.t[hits.count as usize] = t as f32;
                hits.triangle[hits.count as usize] = triangles.len() as u32;
                hits.count += 1;
                triangles.push(Triangle { vertices: tangent(point).map(|vertex| vertex.as_vec3()), set: 0 });
                let normal = point.as_vec3();
                let material = shadings[case].material;
                shadings.push(Shading { normal0: normal, normal1: normal, normal2: normal, material });
            }
        }
        bench.write(loaded, Slot::Triangles, &triangles).expect("write");
        bench.write(loaded, Slot::Shadings, &shadings).expect("write");
        bench.write(loaded, Slot::HitLists, &lists).expect("write");
        bench.dispatch("accumulate", loaded, &step).expect("dispatch");
        lists.iter().map(|hits| hits.count).collect()
    }

    /// Lo / Ft(wo) of each case from `samples` samples.
    fn render(&self, samples: u32) -> Vec<Estimate> {
        let mut bench = bench();
        let loaded = self.load(&bench);
        for sample_index in 0..samples {
            self.add_sample(&mut bench, &loaded, sample_index);
        }
        check(&bench);
        let sums: Vec<Sums> = bench.read(&loaded, Slot::RunningSums).expect("read");
        assert!(sums.iter().all(|s| s.covered == samples && s.invalid == 0));
        let inputs = self.world.inputs();
        let estimate = |(case, sums): (usize, &[Sums])| {
            let seen = seen(&inputs, &self.surfaces[case]);
            let factor = 1.0 / f64::from(samples) / transmittance(IOR, seen.shading_normal.dot(seen.wo));
            let radiance = |s: &Sums| (s.subsurface.as_dvec3() + s.subsurface_carry.as_dvec3()) * factor;
            Estimate::of(&sums.iter().map(radiance).collect::<Vec<_>>())
        };
        sums.chunks(self.replicas as usize).enumerate().map(estimate).collect()
    }
}

/// sigma_tr R and angle of a disk's cases, in their order.
fn cases(eye: Eye) -> impl Iterator<Item = (f64, f64)> {
    SIGMAS.into_iter().flat_map(move |sigma_tr| eye.angles().map(|angle| (sigma_tr, angle)))
}

fn disk(projection: u32, eye: Eye, directions: u32) -> Disk {
    let materials = SIGMAS.map(|sigma_tr| matter(sigma_tr, ALBEDO, IOR, Energy));
    let mut disk = Disk::new(&materials, projection, eye, 64);
    disk.world.view.directions = directions;
    disk
}

#[test]
fn uniform_light_shows_a_flat_disk() {
    // 72 comparisons of 64 independent pixels: one is beyond 4 standard errors by chance with probability .012.
    let mut errors = vec![];
    for eye in EYES {
        let found = disk(PROJECTION_MIS, eye, 3).render(256);
        for ((sigma_tr, angle), found) in cases(eye).zip(found) {
            // 1e-6 of the energy is outside the ball; f32 positions of a probe are 1e-7 of R.
            found.check(flat(sigma_tr), 1e-6 + 1e-7 * sigma_tr, &format!("{eye:?} {sigma_tr} at {angle}"));
            errors.push(found.error.x / found.mean.x);
        }
    }
    errors.sort_by(f64::total_cmp);
    let (median, largest) = (errors[errors.len() / 2], errors[errors.len() - 1]);
    println!("relative standard errors: median {median:.1e}, largest {largest:.1e}");
    assert!(median < 4e-3 && largest < 0.02, "no force: {errors:?}");
}

#[test]
fn normal_axis_alone_shows_a_flat_disk() {
    // The variance is log-infinite from hits at the equator: where 64 pixels met none of the rare large weights, their
    // spread is too small. One comparison in twenty may be beyond 4 standard errors, and none may be far off.
    let mut outliers = vec![];
    for eye in EYES {
        let found = disk(PROJECTION_NORMAL, eye, 1).render(256);
        for ((sigma_tr, angle), found) in cases(eye).zip(found) {
            let expected = flat(sigma_tr);
            let difference = (found.mean.x - expected).abs();
            if difference > 4.0 * found.error.x + 1e-5 * expected {
                outliers.push(format!("{eye:?} {sigma_tr} at {angle}: {} +- {}", found.mean.x, found.error.x));
            }
            assert!(difference < 0.05 * expected, "{eye:?} {sigma_tr} at {angle}: {} for {expected}", found.mean.x);
        }
    }
    println!("{} outliers: {outliers:#?}", outliers.len());
    assert!(outliers.len() * 20 <= 72, "{outliers:#?}");
}

#[test]
fn weights_are_bounded() {
    // Without a boundary a sample under radiance 1 is pi times its weight. One hit weighs, per channel, at most what it
    // weighs on a plane, strength / density, over the least fraction of the three axes: f_c / p <= planar_c / a_min. Of
    // several, one is lit with the sum of their weights over channels, each at most the largest planar_c / a_min.
    let (sigma_s, sigma_a) = (dvec3(2.19, 2.62, 3.0) * 3.0, dvec3(0.0021, 0.0041, 0.0071) * 3.0);
    let material = standard(sigma_s, sigma_a, 1.0, Energy, 1e-6);
    let planar = material.strength.as_dvec3() / material.density.as_dvec3();
    let mut largest = 0f64;
    for eye in EYES {
        let disk = Disk::new(&[material], PROJECTION_MIS, eye, 256);
        let inputs = disk.world.inputs();
        let least: Vec<f64> = disk
            .surfaces
            .iter()
            .map(|surface| {
                let seen = seen(&inputs, surface);
                fractions(PROJECTION_MIS, seen.normal.dot(seen.wo))[..3].iter().copied().fold(1.0, f64::min)
            })
            .collect();
        let mut bench = bench();
        let loaded = disk.load(&bench);
        for sample_index in 0..24 {
            bench.write(&loaded, Slot::RunningSums, &vec![Sums::default(); disk.pixels() as usize]).expect("write");
            let counts = disk.add_sample(&mut bench, &loaded, sample_index);
            let sums: Vec<Sums> = bench.read(&loaded, Slot::RunningSums).expect("read");
            for (pixel, (sums, count)) in sums.iter().zip(counts).enumerate() {
                if count == 0 {
                    assert_eq!(sums.subsurface, Vec3::ZERO);
                    continue;
                }
                let factor = sums.subsurface.as_dvec3() / std::f64::consts::PI;
                let least = least[pixel / disk.replicas as usize];
                let share = if count == 1 {
                    (factor / planar).max_element() * least
                } else {
                    factor.element_sum() / planar.max_element() * least / f64::from(count)
                };
                assert!(share <= 1.0 + 1e-5, "{eye:?}, pixel {pixel}, sample {sample_index}, {count} hits: {share}");
                largest = largest.max(share);
            }
        }
        check(&bench);
    }
    println!("largest weight over its bound {largest:.3}");
    assert!(largest > 0.1, "the bound would be void: {largest}");
}
