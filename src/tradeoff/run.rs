//! Renders what is missing, and measures it.

use super::{
    Converged, Errors, Grid, Measured, Outcome, Row, Times, Variant,
    store::{Kept, Store},
    variant::DEFAULTS,
};
use crate::{
    Error, Image, Model, Result,
    gpu::Device,
    render::{Renderer, spirv_hash},
    scene::{self, Scene},
    settings::{Integrator, Precision, Projection, Settings},
    timeline::Timeline,
};
use std::{
    ops::{ControlFlow, Range},
    path::Path,
    time::Instant,
};

/// Short renders are repeated until they took this long together (s), but no more than [`REPEATS`] times.
const LONG_ENOUGH: f64 = 0.25;
const REPEATS: usize = 5;

/// How far a run is.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Pixel samples rendered or found, over everything.
    pub done: u64,
    /// Pixel samples asked for.
    pub total: u64,
    /// The image at hand.
    pub name: &'a str,
    /// It was there from an earlier run.
    pub kept: bool,
}

/// Renders `scene` in all ways of `grid`, which takes the place of `settings` in what it varies, and keeps images and
/// times in `folder`. What is there already from the same scene, settings, kernels, version, device and driver is not
/// rendered again. `watch` hears of every submission and may stop the run; what is done by then is in the outcome.
///
/// A model or variant that the renderer refuses is a row that says why.
///
/// # Errors
/// As [`Renderer::new`] and [`Renderer::render`], if every variant is refused or for anything that is not a refusal;
/// [`Error::File`] if an image cannot be kept.
pub fn run(
    device: &Device,
    scene: &Scene,
    settings: &Settings,
    grid: &Grid,
    folder: &Path,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Outcome> {
    let info = device.info();
    let identity = [
        &scene::hash(scene, scene::geometry(scene))[..],
        &spirv_hash(),
        env!("CARGO_PKG_VERSION"),
        &info.name,
        &info.uuid,
        &info.driver,
    ];
    let settings = Settings { variance: false, timeline: None, ..settings.clone() };
    let [x0, y0, x1, y1] = match settings.crop {
        Some(crop) => crop,
        None => crate::prepare::resolution(scene, &settings).map(|(width, height)| [0, 0, width, height])?,
    };
    let mut run = Run {
        device,
        scene,
        settings,
        grid,
        store: Store::new(folder, identity.join("\n")),
        watch,
        pixels: u64::from(x1.saturating_sub(x0)) * u64::from(y1.saturating_sub(y0)),
        done: 0,
        total: 0,
    };
    run.all()
}

struct Run<'a> {
    device: &'a Device,
    scene: &'a Scene,
    settings: Settings,
    grid: &'a Grid,
    store: Store,
    watch: &'a mut dyn FnMut(Progress) -> ControlFlow<()>,
    /// Of the rendered part.
    pixels: u64,
    done: u64,
    total: u64,
}

/// Why a step was not done.
enum Left {
    /// The renderer refuses these settings.
    Refused(Error),
    Stopped,
    Failed(Error),
}

impl From<Error> for Left {
    fn from(error: Error) -> Left {
        match error {
            Error::Scene { .. } | Error::Setting { .. } | Error::Memory { .. } => Left::Refused(error),
            _ => Left::Failed(error),
        }
    }
}

impl Run<'_> {
    fn all(&mut self) -> Result<Outcome> {
        let Grid { models, against, .. } = self.grid;
        let apart = against.filter(|against| !models.contains(against));
        let groups: Vec<Vec<Vec<Variant>>> = models.iter().map(|&model| self.grid.groups(model)).collect();
        let samples = groups.iter().flatten().flatten().map(|variant| u64::from(variant.samples)).sum::<u64>();
        let halves = 2 * u64::from(self.grid.half()) * (models.len() + usize::from(apart.is_some())) as u64;
        self.total = (samples + halves) * self.pixels;

        let mut outcome = Outcome { converged: vec![], rows: vec![], against: *against, finished: false };
        let mut first = None;
        // The one that all are measured against comes first.
        let mut order: Vec<Model> = against.iter().copied().collect();
        order.extend(models.iter().copied().filter(|model| Some(*model) != *against));
        for model in order {
            let groups = models.iter().position(|named| *named == model).map_or(&[][..], |index| &groups[index]);
            let left = match self.model(model, groups, &mut outcome) {
                Ok(()) => continue,
                Err(left) => left,
            };
            match left {
                Left::Refused(why) => {
                    outcome.rows.extend(groups.iter().flatten().map(|&variant| refused(variant, &why)));
                    if outcome.against == Some(model) {
                        outcome.against = None;
                    }
                    first.get_or_insert(why);
                }
                Left::Stopped => return Ok(outcome),
                Left::Failed(error) => return Err(error),
            }
        }
        match first {
            Some(why) if outcome.converged.is_empty() => Err(why),
            _ => Ok(Outcome { finished: true, ..outcome }),
        }
    }

    /// The converged image of a model, then its variants.
    fn model(&mut self, model: Model, groups: &[Vec<Variant>], outcome: &mut Outcome) -> std::result::Result<(), Left> {
        let mut converged = self.converged(model)?;
        let exposure = self.grid.exposure;
        let yardstick = outcome.yardstick().map(|yardstick| &yardstick.image);
        // The first is itself the one that the others are measured against.
        let yardstick = yardstick.or((outcome.against == Some(model)).then_some(&converged.image)).cloned();
        if let Some(yardstick) = &yardstick {
            converged.error = Some(Errors::between(&converged.image, yardstick, exposure)?);
        }
        let image = converged.image.clone();
        outcome.converged.push(converged);
        for group in groups {
            let mut rows = Vec::new();
            let result = self.group(group, &mut |variant, kept, file, was_there| {
                let total = yardstick.as_ref().map(|yardstick| Errors::between(&kept.image, yardstick, exposure));
                let sampling = Errors::between(&kept.image, &image, exposure)?;
                let measured =
                    Measured { times: kept.times, sampling, total: total.transpose()?, file, kept: was_there };
                rows.push(Row { variant, outcome: Ok(measured) });
                Ok(())
            });
            let done = rows.len();
            outcome.rows.append(&mut rows);
            match result {
                Err(Left::Refused(why)) => outcome.rows.extend(group[done..].iter().map(|&v| refused(v, &why))),
                other => other?,
            }
        }
        Ok(())
    }

    fn converged(&mut self, model: Model) -> std::result::Result<Converged, Left> {
        let half = self.grid.half();
        let variant = Variant {
            model,
            integrator: Integrator::Sample,
            projection: Projection::Mis,
            choices: DEFAULTS,
            directions: self.grid.most_directions(),
            samples: half,
        };
        let mut halves = Vec::new();
        let mut session = None;
        for number in 1..=2 {
            let seed = self.settings.seed.wrapping_add(number);
            let settings = Settings { seed, precision: Precision::Full, ..variant.settings(&self.settings) };
            let name = format!("converged/{model}-{number}");
            let key = self.store.key(&settings, half);
            let image = match self.store.find(&name, &key) {
                Some(kept) => {
                    self.found(&name, half)?;
                    kept.image
                }
                None => {
                    let session = match &mut session {
                        Some(session) => session,
                        none => none.insert(self.begin(settings)?),
                    };
                    let (mut image, times) = self.render(session, seed, &name, half, 1)?;
                    self.store.keep(&name, &key, &mut image, times).map_err(Left::Failed)?;
                    image
                }
            };
            halves.push(image);
        }
        let halves = halves.try_into().expect("two were made");
        Ok(Converged::of(model, halves, half.saturating_mul(2), self.grid.exposure)?)
    }

    /// Variants that differ in samples alone, by one renderer.
    fn group(
        &mut self,
        group: &[Variant],
        done: &mut dyn FnMut(Variant, Kept, std::path::PathBuf, bool) -> Result<()>,
    ) -> std::result::Result<(), Left> {
        let mut session = None;
        for variant in group {
            let settings = variant.settings(&self.settings);
            let name = format!("variants/{}", variant.name());
            let key = self.store.key(&settings, variant.samples);
            let (kept, was_there) = match self.store.find(&name, &key) {
                Some(kept) => {
                    self.found(&name, variant.samples)?;
                    (kept, true)
                }
                None => {
                    let session = match &mut session {
                        Some(session) => session,
                        none => none.insert(self.begin(settings)?),
                    };
                    let (mut image, times) =
                        self.render(session, self.settings.seed, &name, variant.samples, REPEATS)?;
                    self.store.keep(&name, &key, &mut image, times).map_err(Left::Failed)?;
                    (Kept { image, times }, false)
                }
            };
            done(*variant, kept, self.store.file(&name), was_there).map_err(Left::Failed)?;
        }
        Ok(())
    }

    /// Notes an image that needs no rendering.
    fn found(&mut self, name: &str, samples: u32) -> std::result::Result<(), Left> {
        self.done += u64::from(samples) * self.pixels;
        let progress = Progress { done: self.done, total: self.total, name, kept: true };
        if (self.watch)(progress).is_break() { Err(Left::Stopped) } else { Ok(()) }
    }

    /// A renderer that has rendered a sample, so that the driver has compiled what it compiles.
    fn begin(&self, settings: Settings) -> Result<Session> {
        let timeline = Timeline::new();
        let start = Instant::now();
        let settings = Settings { timeline: Some(timeline.clone()), ..settings };
        let mut renderer = Renderer::new(self.device, self.scene, &settings)?;
        renderer.render(1)?;
        renderer.image()?;
        let spans = timeline.spans();
        let prepare = spans.iter().filter(|span| span.name == "prepare").map(|span| span.end - span.begin).sum::<f64>();
        let prepare = prepare * 1e-9;
        Ok(Session { renderer, timeline, prepare, start_up: start.elapsed().as_secs_f64() - prepare })
    }

    /// The image of `samples` samples, and the median time of at most `repeats` renders.
    fn render(
        &mut self,
        session: &mut Session,
        seed: u32,
        name: &str,
        samples: u32,
        repeats: usize,
    ) -> std::result::Result<(Image, Times), Left> {
        let Session { renderer, timeline, prepare, start_up } = session;
        let total = self.total;
        let (before, watch) = (self.done, &mut self.watch);
        let mut times: Vec<(f64, Option<f64>)> = Vec::new();
        let image = loop {
            timeline.clear();
            let start = Instant::now();
            renderer.reseed(seed)?;
            let range: Range<u32> = 0..samples;
            let finished = renderer.render_range(range, &mut |progress| {
                watch(Progress { done: before + progress.done, total, name, kept: false })
            })?;
            if !finished {
                return Err(Left::Stopped);
            }
            let image = renderer.image()?;
            let seconds = start.elapsed().as_secs_f64();
            let kernels = timeline.kernels();
            let sum = kernels.iter().map(|kernel| kernel.total).sum::<f64>() * 1e-9;
            times.push((seconds, (!kernels.is_empty()).then_some(sum)));
            if times.len() >= repeats || times.iter().map(|(seconds, _)| seconds).sum::<f64>() >= LONG_ENOUGH {
                break image;
            }
        };
        self.done += u64::from(samples) * self.pixels;
        times.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (render, kernels) = times[times.len() / 2];
        Ok((image, Times { start_up: *start_up, prepare: *prepare, render, kernels }))
    }
}

struct Session {
    renderer: Renderer,
    timeline: Timeline,
    prepare: f64,
    start_up: f64,
}

fn refused(variant: Variant, why: &Error) -> Row {
    Row { variant, outcome: Err(why.to_string()) }
}
