//! Each kernel on real scenes: it gets what the twins made of the stages before, and must make what its own twin does.

use super::{Bound, Case, Context, Loaded, ROUNDING, Roundings, Verdict, World, roundings};
use crate::{
    error::Result,
    reference::{
        self,
        accumulate::accumulate as twin_accumulate,
        begin::begin as twin_begin,
        count::count as twin_count,
        primary::primary as twin_primary,
        random,
        reflect::reflect as twin_reflect,
        resolve::resolve as twin_resolve,
        reuse::{Lit, Stage, light, reuse as twin_reuse},
        sample::sample as twin_sample,
        screen::reproject as twin_reproject,
        single::single as twin_single,
        strict,
        sums::Contribution,
    },
    shared::*,
};
use glam::{DVec3, UVec4, Vec3, Vec4Swizzles};
use rayon::prelude::*;

/// Samples from different batches and strata, for cases by turns.
pub const SAMPLES: [u32; 2] = [37, 1003];

/// Roundings of the longest chain from a pixel to light: geometry, profile, densities, boundary and light, each as their
/// own tests have it, most of whose errors are of one sign by chance alone.
const SHADING: Roundings = roundings(100, 6, 4);

/// Part of the samples in which rounding may decide a choice: on which side of an edge a ray passes, which technique,
/// component or hit a number picks.
const CHOICES: f64 = 1e-3;

/// A case, and what the twins give for one sample of every pixel.
pub struct Staged {
    pub case: Case,
    pub step: Step,
    pub surfaces: Vec<Surface>,
    pub probes: Vec<Probe>,
    pub hits: Vec<Hits>,
    /// What `accumulate` leaves for the pixels of a tile.
    pub lit: Vec<Option<Lit>>,
}

impl Staged {
    /// The stages of a sample.
    pub fn new(case: Case, sample_index: u32) -> Staged {
        let inputs = case.inputs();
        let step = reference::step(&inputs, sample_index, case.prepared.rows.clone(), 0..2048);
        let pixels = || (0..step.pixel_count).into_par_iter();
        let surfaces: Vec<_> = pixels().map(|i| twin_primary(&inputs, &step, i)).collect();
        let probes: Vec<_> = pixels().map(|i| twin_sample(&inputs, &step, i, &surfaces[i as usize])).collect();
        let hits = pixels().map(|i| twin_reproject(&inputs, &step, i, &surfaces, &probes[i as usize]));
        let hits: Vec<Hits> = hits.collect();
        let stage = Stage { surfaces: &surfaces, probes: &probes };
        let lit = pixels().map(|i| light(&inputs, &step, i, &stage, &hits[i as usize]));
        let lit = if inputs.features.reuse == 0 { vec![None; hits.len()] } else { lit.collect() };
        Staged { step, surfaces, probes, hits, lit, case }
    }

    /// Where the surfaces and sums of the step's batch are among those of all batches.
    fn batch(&self) -> std::ops::Range<usize> {
        let start = (self.step.sample_index % BATCHES) as usize * self.surfaces.len();
        start..start + self.surfaces.len()
    }

    /// The G-buffers of all batches, of which the step's batch holds the surfaces.
    fn g_buffers(&self) -> Vec<Surface> {
        let mut all = vec![Surface { triangle: MISS, ..Surface::default() }; self.surfaces.len() * BATCHES as usize];
        all[self.batch()].copy_from_slice(&self.surfaces);
        all
    }

    fn run(&self, context: &mut Context, stem: &'static str, buffers: &[(Slot, &[u8])]) -> Result<Loaded> {
        context.bench.run(stem, &self.case.inputs(), &self.case.scene.nodes, &self.step, buffers)
    }

    /// The sums that a kernel adds to, which were zero, those of the step's batch, and the probes it leaves.
    fn run_sums(&self, context: &mut Context, stem: &'static str) -> Result<(Vec<Sums>, Vec<Vec3>, Vec<Probe>)> {
        let surfaces = self.g_buffers();
        let sums = vec![Sums::default(); self.surfaces.len()];
        let batch_sums = vec![Vec3::ZERO; self.surfaces.len() * BATCHES as usize];
        // A pixel without a probe has no hits, whatever its list says.
        let lists = self.hits.iter().zip(&self.probes);
        let hits: Vec<Hits> =
            lists.map(|(hits, probe)| if probe.t_min <= probe.t_max { *hits } else { STALE }).collect();
        let probes = if stem == "reuse" { self.lit_probes() } else { self.probes.clone() };
        let buffers: [(Slot, &[u8]); 5] = [
            (Slot::Surfaces, bytemuck::cast_slice(&surfaces)),
            (Slot::Probes, bytemuck::cast_slice(&probes)),
            (Slot::HitLists, bytemuck::cast_slice(&hits)),
            (Slot::RunningSums, bytemuck::cast_slice(&sums)),
            (Slot::BatchSums, bytemuck::cast_slice(&batch_sums)),
        ];
        let loaded = self.run(context, stem, &buffers)?;
        let batch = context.bench.read::<Vec3>(&loaded, Slot::BatchSums)?;
        let probes = context.bench.read(&loaded, Slot::Probes)?;
        Ok((context.bench.read(&loaded, Slot::RunningSums)?, batch[self.batch()].to_vec(), probes))
    }

    /// The probes as `accumulate` leaves them.
    fn lit_probes(&self) -> Vec<Probe> {
        let with = |(probe, lit): (&Probe, &Option<Lit>)| {
            let mut probe = *probe;
            lit.unwrap_or_default().into_probe(&mut probe);
            probe
        };
        self.probes.iter().zip(&self.lit).map(with).collect()
    }

    /// What a twin adds to each pixel.
    fn contributions(&self, twin: impl Fn(u32) -> Contribution + Send + Sync) -> Vec<Contribution> {
        (0..self.step.pixel_count).into_par_iter().map(twin).collect()
    }
}

/// What an earlier sample may have left: hits of triangles that do not exist.
const STALE: Hits = Hits { count: 99, t: [1.0; 8], triangle: [MISS; 8] };

/// A kernel on all cases of this program.
///
/// # Errors
/// As [`super::Test::run`].
pub fn each(context: &mut Context, stage: fn(&mut Context, &[Staged]) -> Result<Verdict>) -> Result<Verdict> {
    stage(context, &super::staged()?)
}

/// The first surfaces: the bits of the same operations in f32, and near the twin.
///
/// # Errors
/// As [`super::Test::run`].
pub fn primary(context: &mut Context, staged: &[Staged]) -> Result<Verdict> {
    let mut verdict = context.exact(roundings(48, 3, 2))?;
    // Hits at one distance, from either of which the position may come.
    verdict.exempt = if verdict.bound == Bound::Exact { 0.0 } else { CHOICES };
    for staged in staged {
        let (name, inputs) = (&staged.case.name, staged.case.inputs());
        let blank = vec![Surface::default(); staged.surfaces.len() * BATCHES as usize];
        let loaded = staged.run(context, "primary", &[(Slot::Surfaces, bytemuck::cast_slice(&blank))])?;
        let all: Vec<Surface> = context.bench.read(&loaded, Slot::Surfaces)?;
        let expected: Vec<Surface> =
            (0..staged.step.pixel_count).into_par_iter().map(|i| strict::primary(&inputs, &staged.step, i)).collect();
        let found = &all[staged.batch()];
        let mut far = 0;
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let at = || format!("{name}, pixel {i}");
            verdict.words(u32::from(found.triangle == MISS), u32::from(expected.triangle == MISS), at);
            for c in 0..3 {
                verdict.bits(found.position[c], expected.position[c], 16.0, || format!("{}, position {c}", at()));
            }
            for c in 0..2 {
                verdict.bits(found.barycentric[c], expected.barycentric[c], 64.0, || format!("{}, weight {c}", at()));
            }
            let twin = &staged.surfaces[i];
            let both = (found.triangle == MISS) == (twin.triangle == MISS);
            let scale = twin.position.length().max(1.0);
            far += usize::from(!both || (found.position - twin.position).length() > 1e-5 * scale);
        }
        verdict
            .require(far as f64 <= CHOICES * found.len() as f64, || format!("{name}: {far} are far from the twin's"));
        let elsewhere = all.iter().enumerate().filter(|(i, _)| !staged.batch().contains(i));
        let written = elsewhere.filter(|(_, surface)| **surface != Surface::default()).count();
        verdict.require(written == 0, || format!("{name}: {written} surfaces of other batches are written"));
        for shown in [false, true] {
            listed(context, staged, found, shown, &mut verdict)?;
        }
    }
    Ok(verdict)
}

/// That `primary` with lists traces every third pixel that is listed and no other, and lists those that see something, as
/// `surfaces` says; all of them where the environment is shown.
fn listed(
    context: &mut Context,
    staged: &Staged,
    surfaces: &[Surface],
    shown: bool,
    verdict: &mut Verdict,
) -> Result<()> {
    let mut inputs = staged.case.inputs();
    let view = View { show_environment: shown.into(), ..*inputs.view };
    (inputs.view, inputs.features.listed) = (&view, 1);
    let count = staged.surfaces.len();
    let traced: Vec<u32> = (0..count as u32).step_by(3).collect();
    let step = Step { traced: traced.len() as u32, ..staged.step };
    let mut words = vec![0; ACTIVE_HEADER as usize + (1 + BATCHES as usize) * count];
    words[ACTIVE_HEADER as usize..][..traced.len()].copy_from_slice(&traced);
    let blank = vec![Surface::default(); count * BATCHES as usize];
    let buffers: [(Slot, &[u8]); 2] =
        [(Slot::Surfaces, bytemuck::cast_slice(&blank)), (Slot::Actives, bytemuck::cast_slice(&words))];
    let loaded = context.bench.run("primary", &inputs, &staged.case.scene.nodes, &step, &buffers)?;
    let (all, words): (Vec<Surface>, Vec<u32>) =
        (context.bench.read(&loaded, Slot::Surfaces)?, context.bench.read(&loaded, Slot::Actives)?);
    let seen = |i: &u32| shown || surfaces[*i as usize].triangle != MISS;
    let expected: Vec<u32> = traced.iter().copied().filter(seen).collect();
    let batch = staged.step.sample_index % BATCHES;
    let header = &words[4 * batch as usize..][..4];
    let list = ACTIVE_HEADER as usize + (1 + batch as usize) * count;
    let mut found = words[list..][..expected.len()].to_vec();
    found.sort_unstable();
    let name = &staged.case.name;
    let groups = (expected.len() as u32).div_ceil(WORKGROUP);
    verdict.require(header[0] == groups && header[3] == expected.len() as u32, || {
        format!("{name}: {header:?} for {groups} workgroups of {} pixels", expected.len())
    });
    verdict.require(found == expected, || format!("{name}: other pixels are listed"));
    let right = |(i, surface): (usize, &Surface)| match i % 3 {
        0 => *surface == surfaces[i],
        _ => *surface == Surface::default(),
    };
    let traced_alone = all[staged.batch()].iter().enumerate().all(right);
    verdict.require(traced_alone, || format!("{name}: other pixels are traced"));
    Ok(())
}

/// Probes, against their own size.
///
/// # Errors
/// As [`super::Test::run`].
pub fn sample(context: &mut Context, staged: &[Staged]) -> Result<Verdict> {
    let mut verdict = Verdict::new(Bound::Relative(SHADING));
    verdict.exempt = CHOICES;
    for staged in staged {
        let name = &staged.case.name;
        let surfaces = staged.g_buffers();
        // What an earlier sample may have left.
        let stale = Probe { t_max: 2.0, lit: UVec4::new(1.0f32.to_bits(), 0, 0, 7), ..Probe::default() };
        let probes = vec![stale; staged.probes.len()];
        let buffers: [(Slot, &[u8]); 2] =
            [(Slot::Surfaces, bytemuck::cast_slice(&surfaces)), (Slot::Probes, bytemuck::cast_slice(&probes))];
        let loaded = staged.run(context, "sample", &buffers)?;
        let found: Vec<Probe> = context.bench.read(&loaded, Slot::Probes)?;
        for (i, (found, twin)) in found.iter().zip(&staged.probes).enumerate() {
            let at = |what: &str| format!("{name}, pixel {i}, {what}");
            let exists = |p: &Probe| p.t_min <= p.t_max;
            verdict.words(found.share(), twin.share(), || at("share"));
            verdict.compare(found.reach2(), twin.reach2().into(), twin.reach2().into(), || at("reach"));
            verdict.require(found.seat.xyz() == twin.seat.xyz(), || at("seat"));
            verdict.require(found.light() == Vec3::ZERO, || at("light"));
            verdict.words(found.table_node, twin.table_node, || at("node"));
            verdict.compare(found.table_weight, twin.table_weight.into(), 1.0, || at("weight"));
            let bend = twin.table_bend.as_dvec2().extend(twin.table_scale.into());
            verdict.vector(found.table_bend.extend(found.table_scale), bend, 1.0, || at("bend"));
            verdict.words(u32::from(exists(found)), u32::from(exists(twin)), || at("probe"));
            if !exists(twin) || !exists(found) {
                continue;
            }
            let size = f64::from(twin.t_max - twin.t_min).min(1.0).max(f64::from(twin.offset.length()));
            verdict.vector(found.offset, twin.offset.as_dvec3(), size, || at("offset"));
            verdict.vector(found.direction, twin.direction.as_dvec3(), 1.0, || at("direction"));
            verdict.compare(found.radius, twin.radius.into(), size, || at("radius"));
            let ends = [(found.t_min, twin.t_min, "start"), (found.t_max, twin.t_max, "end")];
            for (found, twin, what) in ends {
                let far = f64::from(twin.abs());
                verdict.compare(found, twin.into(), if far < 1e29 { size.max(far) } else { far }, || at(what));
            }
        }
    }
    Ok(verdict)
}

/// Hits of probes: the bits of the same operations in f32, and near the twin.
///
/// # Errors
/// As [`super::Test::run`].
pub fn reproject(context: &mut Context, staged: &[Staged]) -> Result<Verdict> {
    let mut verdict = context.exact(roundings(24, 2, 0))?;
    verdict.exempt = if verdict.bound == Bound::Exact { 0.0 } else { CHOICES };
    let loose = verdict.bound != Bound::Exact;
    let mut several = 0;
    for staged in staged {
        let (name, inputs) = (&staged.case.name, staged.case.inputs());
        if !staged.case.prepared.has_probes {
            continue;
        }
        let surfaces = staged.g_buffers();
        let hits = vec![STALE; staged.hits.len()];
        let buffers: [(Slot, &[u8]); 3] = [
            (Slot::Surfaces, bytemuck::cast_slice(&surfaces)),
            (Slot::Probes, bytemuck::cast_slice(&staged.probes)),
            (Slot::HitLists, bytemuck::cast_slice(&hits)),
        ];
        let loaded = staged.run(context, "reproject", &buffers)?;
        let found: Vec<Hits> = context.bench.read(&loaded, Slot::HitLists)?;
        let looks_up = inputs.features.reproject == REPROJECT_SCREEN;
        let expected: Vec<Vec<strict::Hit>> = (staged.surfaces.par_iter().zip(&staged.probes).enumerate())
            .map(|(i, (surface, probe))| match looks_up {
                true => strict::look_up(&inputs, &staged.step, i as u32, &staged.surfaces, probe),
                false => strict::reproject(&inputs, surface, probe),
            })
            .collect();
        let mut far = 0;
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let at = |what: &str| format!("{name}, pixel {i}, {what}");
            let twin = &staged.hits[i];
            several += usize::from(twin.count > 1);
            far += usize::from(found.count != twin.count);
            verdict.words(found.count, expected.len() as u32, || at("count"));
            let kept = expected.len().min(MAX_HITS as usize);
            if found.count as usize != expected.len() {
                continue;
            }
            verdict.require(found.t[..kept].is_sorted(), || at("order"));
            if expected.len() > kept {
                continue;
            }
            let size = f64::from(staged.probes[i].offset.length()).max(1.0);
            for (k, hit) in expected.iter().enumerate() {
                verdict.bits(found.t[k], hit.t, size, || at("distance"));
                let same = expected.iter().any(|hit| hit.t == found.t[k] && hit.triangle == found.triangle[k]);
                verdict.require(same || loose, || at("triangle"));
            }
        }
        let allowed = CHOICES * staged.hits.len() as f64;
        verdict.require(far as f64 <= allowed.max(1.0), || format!("{name}: {far} lists are not the twin's"));
    }
    verdict.require(several > 100, || format!("only {several} probes have several hits"));
    Ok(verdict)
}

/// Light through matter.
///
/// # Errors
/// As [`super::Test::run`].
pub fn accumulate(context: &mut Context, staged: &[Staged]) -> Result<Verdict> {
    let mut verdict = Verdict::new(Bound::Relative(SHADING));
    verdict.exempt = CHOICES;
    let mut lit = 0;
    for staged in staged {
        let (name, inputs) = (&staged.case.name, staged.case.inputs());
        let (sums, batch, probes) = staged.run_sums(context, "accumulate")?;
        let twins = staged.contributions(|i| {
            let at = i as usize;
            let (surface, probe, hits) = (&staged.surfaces[at], &staged.probes[at], &staged.hits[at]);
            twin_accumulate(&inputs, &staged.step, i, surface, probe, hits)
        });
        for (i, (sums, twin)) in sums.iter().zip(&twins).enumerate() {
            let at = || format!("{name}, pixel {i}");
            let covered = u32::from(staged.surfaces[i].triangle != MISS);
            let counts = (sums.samples, sums.covered, sums.invalid);
            verdict.require(counts == (0, covered, u32::from(twin.invalid)), || format!("{}: {counts:?}", at()));
            verdict.require(batch[i] == sums.subsurface, || format!("{}: the batch's sum is another", at()));
            if twin.radiance != DVec3::ZERO || sums.subsurface != Vec3::ZERO {
                lit += 1;
                verdict.vector(sums.subsurface, twin.radiance, twin.radiance.length(), at);
            }
        }
        if inputs.features.reuse == 0 {
            continue;
        }
        for (i, (found, twin)) in probes.iter().zip(&staged.lit).enumerate() {
            let at = |what: &str| format!("{name}, pixel {i}, {what}");
            verdict.words(u32::from(found.light() != Vec3::ZERO), twin.is_some().into(), || at("lit"));
            if let Some(Lit { position, distance, light }) = twin {
                lit += 1;
                verdict.vector(found.hit, *position, position.length().max(1.0), || at("place"));
                verdict.compare(found.hit_r2, distance.powi(2), distance.powi(2), || at("distance"));
                verdict.vector(found.light(), *light, light.length(), || at("light"));
            }
        }
    }
    verdict.require(lit > 100 * staged.len(), || format!("only {lit} samples are lit"));
    Ok(verdict)
}

/// Light of a tile's hits.
///
/// # Errors
/// As [`super::Test::run`].
pub fn reuse(context: &mut Context, staged: &[Staged]) -> Result<Verdict> {
    let mut verdict = Verdict::new(Bound::Relative(SHADING));
    verdict.exempt = CHOICES;
    let mut lit = 0;
    for staged in staged.iter().filter(|staged| staged.case.prepared.features.reuse != 0) {
        let (name, inputs) = (&staged.case.name, staged.case.inputs());
        let (sums, batch, _) = staged.run_sums(context, "reuse")?;
        let stage = Stage { surfaces: &staged.surfaces, probes: &staged.lit_probes() };
        let twins = staged.contributions(|i| twin_reuse(&inputs, &staged.step, i, &stage));
        for (i, (sums, twin)) in sums.iter().zip(&twins).enumerate() {
            let at = || format!("{name}, pixel {i}");
            let counts = (sums.samples, sums.covered, sums.invalid);
            verdict.require(counts == (0, 0, u32::from(twin.invalid)), || format!("{}: {counts:?}", at()));
            verdict.require(batch[i] == sums.subsurface, || format!("{}: the batch's sum is another", at()));
            if twin.radiance != DVec3::ZERO || sums.subsurface != Vec3::ZERO {
                lit += 1;
                verdict.vector(sums.subsurface, twin.radiance, twin.radiance.length(), at);
            }
        }
    }
    verdict.require(lit > 200, || format!("only {lit} pixels are lit"));
    Ok(verdict)
}

/// Light that was scattered once.
///
/// # Errors
/// As [`super::Test::run`].
pub fn single(context: &mut Context, staged: &[Staged]) -> Result<Verdict> {
    let mut verdict = Verdict::new(Bound::Relative(SHADING));
    verdict.exempt = CHOICES;
    let mut lit = 0;
    for staged in staged.iter().filter(|staged| staged.case.prepared.has_single) {
        let (name, inputs) = (&staged.case.name, staged.case.inputs());
        let (sums, batch, _) = staged.run_sums(context, "single")?;
        let twins = staged.contributions(|i| twin_single(&inputs, &staged.step, i, &staged.surfaces[i as usize]));
        // An exponential of many mean free paths, or of a way that grazes the surface, has lost digits; what it leaves is
        // little beside the mean.
        let bright: Vec<f64> = twins.iter().map(|twin| twin.radiance.length()).filter(|length| *length > 0.0).collect();
        let mean = bright.iter().sum::<f64>() / bright.len().max(1) as f64;
        for (i, (sums, twin)) in sums.iter().zip(&twins).enumerate() {
            let at = || format!("{name}, pixel {i}");
            let counts = (sums.samples, sums.invalid);
            verdict.require(counts == (0, u32::from(twin.invalid)), || format!("{}: {counts:?}", at()));
            verdict.require(batch[i] == sums.subsurface, || format!("{}: the batch's sum is another", at()));
            if twin.radiance == DVec3::ZERO && sums.subsurface == Vec3::ZERO {
                continue;
            }
            lit += 1;
            // A length of matter is known to two roundings of a position.
            let shading = &inputs.shadings[staged.surfaces[i].triangle as usize];
            let extinction = inputs.materials[shading.material as usize].extinction;
            let lost = f64::from(extinction.max_element()) * 2.0 * ROUNDING / SHADING.relative();
            verdict.vector(sums.subsurface, twin.radiance, twin.radiance.length().max(mean) * (1.0 + lost), at);
        }
    }
    verdict.require(lit > 100, || format!("only {lit} samples are lit"));
    Ok(verdict)
}

/// Light from the first surface.
///
/// # Errors
/// As [`super::Test::run`].
pub fn reflect(context: &mut Context, staged: &[Staged]) -> Result<Verdict> {
    let mut verdict = Verdict::new(Bound::Relative(SHADING));
    verdict.exempt = CHOICES;
    let mut lit = 0;
    for staged in staged {
        let (name, inputs) = (&staged.case.name, staged.case.inputs());
        let (sums, ..) = staged.run_sums(context, "reflect")?;
        let twins = staged.contributions(|i| twin_reflect(&inputs, &staged.step, i, &staged.surfaces[i as usize]));
        for (i, (sums, twin)) in sums.iter().zip(&twins).enumerate() {
            let at = || format!("{name}, pixel {i}");
            verdict.require(sums.invalid == u32::from(twin.invalid), || format!("{}: invalid", at()));
            if twin.radiance != DVec3::ZERO || sums.reflection != Vec3::ZERO {
                lit += 1;
                verdict.vector(sums.reflection, twin.radiance, twin.radiance.length(), at);
            }
        }
    }
    verdict.require(lit > 20 * staged.len(), || format!("only {lit} samples are lit"));
    Ok(verdict)
}

/// Means and variances of sums of many magnitudes, some near the end of f32.
///
/// # Errors
/// As [`super::Test::run`].
pub fn resolve(context: &mut Context) -> Result<Verdict> {
    const PIXELS: u32 = 500;
    let world = World::new(Material::default(), PROJECTION_MIS, PIXELS);
    let (begin, end) = (5, 41);
    let step = Step { pixel_count: PIXELS, range_begin: begin, range_end: end, ..Step::default() };
    let number = |i: u32| 10f32.powf((random::hash(i) % 4000) as f32 / 1000.0 - 2.0);
    let greatness = |i: u32| if (i % PIXELS).is_multiple_of(10) { 3e36 } else { 1.0 };
    let vector = |i: u32| Vec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2)) * greatness(i);
    let sums: Vec<Sums> = (0..PIXELS)
        .map(|i| Sums {
            subsurface: vector(i),
            subsurface_carry: vector(i + 14 * PIXELS) * 1e-7,
            reflection: vector(i + 2 * PIXELS),
            reflection_carry: vector(i + 18 * PIXELS) * 1e-7,
            samples: end - begin,
            covered: i % (end - begin + 1),
            invalid: i,
        })
        .collect();
    let batch_sums: Vec<Vec3> = (0..PIXELS * BATCHES).map(|i| vector(i + 40 * PIXELS)).collect();
    let out = vec![Pixel::default(); PIXELS as usize];
    let buffers: [(Slot, &[u8]); 3] = [
        (Slot::RunningSums, bytemuck::cast_slice(&sums)),
        (Slot::BatchSums, bytemuck::cast_slice(&batch_sums)),
        (Slot::Pixels, bytemuck::cast_slice(&out)),
    ];
    let loaded = context.bench.run("resolve", &world.inputs(), &[], &step, &buffers)?;
    let found: Vec<Pixel> = context.bench.read(&loaded, Slot::Pixels)?;
    let mut verdict = Verdict::new(Bound::Relative(roundings(96, 6, 0)));
    for (i, found) in found.iter().enumerate() {
        let at = |what: &str| format!("{what} of pixel {i}");
        let mine: Vec<Vec3> = (0..BATCHES as usize).map(|b| batch_sums[b * PIXELS as usize + i]).collect();
        let twin = twin_resolve(&world.features, &step, &sums[i], &mine);
        let counts = [(found.samples, twin.samples), (found.invalid, twin.invalid)];
        verdict.require(counts.iter().all(|(a, b)| a == b), || at("counts"));
        verdict.relative(found.alpha, twin.alpha.into(), || at("alpha"));
        let layers = [
            (found.subsurface, twin.subsurface, "light"),
            (found.reflection, twin.reflection, "reflection"),
            (found.variance, twin.variance, "variance"),
        ];
        for (found, twin, what) in layers {
            verdict.vector(found, twin.as_dvec3(), twin.as_dvec3().length(), || at(what));
        }
    }
    let overflown = found.iter().filter(|pixel| pixel.variance.max_element() == f32::MAX).count();
    verdict.require(overflown > 20, || format!("only {overflown} variances overflow"));
    Ok(verdict)
}

/// Numbers of a recording's samples: sums that go on, that do not follow, that were forgotten; counts that wrap.
///
/// # Errors
/// As [`super::Test::run`].
pub fn begin(context: &mut Context) -> Result<Verdict> {
    let world = World::new(Material::default(), PROJECTION_MIS, 1);
    let progress = |first, begin, end| Progress { first, begin, end, restart: 7 };
    let cases = [
        (progress(0, 0, NO_SAMPLES), 0, 64),
        (progress(0, 0, 64), 64, 100),
        (progress(0, 3, 64), 63, 1),
        (progress(100, 64, 128), 28, 9),
        (progress(1_000_000, 2, 5), 77, 4096),
        (progress(u32::MAX, 9, NO_SAMPLES), 0, 2),
        (progress(0xdead_beef, 0, 0xdead_bef0), 1, 500),
    ];
    let mut verdict = Verdict::new(Bound::Exact);
    for (case, (before, start, count)) in cases.into_iter().enumerate() {
        let step = Step { sample_index: start, pixel_count: count, ..Step::default() };
        let samples = vec![Sample::default(); MAX_RECORDED as usize];
        let progresses = [before];
        let buffers: [(Slot, &[u8]); 2] =
            [(Slot::Progresses, bytemuck::cast_slice(&progresses)), (Slot::Samples, bytemuck::cast_slice(&samples))];
        let loaded = context.bench.run("begin", &world.inputs(), &[], &step, &buffers)?;
        let (after, mut expected) = twin_begin(before, &step);
        expected.resize(samples.len(), Sample::default());
        let found: Vec<Progress> = context.bench.read(&loaded, Slot::Progresses)?;
        verdict.require(found == [after], || format!("case {case}: {found:?}, not {after:?}"));
        let found: Vec<Sample> = context.bench.read(&loaded, Slot::Samples)?;
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            verdict.words(found.index, expected.index, || format!("case {case}, index {i}"));
            for d in 0..DIMENSIONS as usize {
                verdict.words(found.point[d], expected.point[d], || format!("case {case}, sample {i}, dimension {d}"));
            }
        }
    }
    Ok(verdict)
}

/// Samples and sums where a recording starts anew, and where it does not.
///
/// # Errors
/// As [`super::Test::run`].
pub fn count(context: &mut Context) -> Result<Verdict> {
    const PIXELS: u32 = 150;
    let mut world = World::new(Material::default(), PROJECTION_MIS, 1);
    world.features.recorded = 1;
    let number = |i: u32| random::unit(random::hash(i)) as f32 + 1.0;
    let sums: Vec<Sums> = (0..PIXELS)
        .map(|i| Sums {
            subsurface: Vec3::splat(number(i)),
            subsurface_carry: Vec3::splat(number(i + 1)),
            reflection: Vec3::splat(number(i + 2)),
            reflection_carry: Vec3::splat(number(i + 3)),
            samples: i,
            covered: 1,
            invalid: 1,
        })
        .collect();
    let batch_sums: Vec<Vec3> = (0..PIXELS * BATCHES).map(|i| Vec3::splat(number(i))).collect();
    let mut verdict = Verdict::new(Bound::Exact);
    for restart in [0, 1] {
        let progress = [Progress { restart, ..Progress::default() }];
        let buffers: [(Slot, &[u8]); 3] = [
            (Slot::Progresses, bytemuck::cast_slice(&progress)),
            (Slot::RunningSums, bytemuck::cast_slice(&sums)),
            (Slot::BatchSums, bytemuck::cast_slice(&batch_sums)),
        ];
        let step = Step { pixel_count: PIXELS, count: 5, ..Step::default() };
        let loaded = context.bench.run("count", &world.inputs(), &[], &step, &buffers)?;
        let (mut sums, mut batch_sums) = (sums.clone(), batch_sums.clone());
        for (i, sums) in sums.iter_mut().enumerate() {
            let mut mine: Vec<Vec3> = (0..BATCHES as usize).map(|b| batch_sums[b * PIXELS as usize + i]).collect();
            twin_count(&step, &progress[0], sums, &mut mine);
            (0..BATCHES as usize).for_each(|b| batch_sums[b * PIXELS as usize + i] = mine[b]);
        }
        let found: Vec<u32> = context.bench.read(&loaded, Slot::RunningSums)?;
        let words: &[u32] = bytemuck::cast_slice(&sums);
        for (i, (found, expected)) in found.iter().zip(words).enumerate() {
            verdict.words(*found, *expected, || format!("word {i} of the sums, restart {restart}"));
        }
        let found: Vec<u32> = context.bench.read(&loaded, Slot::BatchSums)?;
        let words: &[u32] = bytemuck::cast_slice(&batch_sums);
        for (i, (found, expected)) in found.iter().zip(words).enumerate() {
            verdict.words(*found, *expected, || format!("word {i} of the batches' sums, restart {restart}"));
        }
    }
    Ok(verdict)
}
