//! Renders that end when the image is good enough, or the time is up: how much each pixel still needs, and who gets it.
//!
//! # Allocation
//! A pixel with n samples, whose part of E^2 is e, has s = n e at one sample. The fewest samples in all for a sum of s / n
//! are n in proportion to sqrt(s) (J. Neyman, J. R. Stat. Soc. 97 (1934)). A pixel's own e has seven degrees of freedom;
//! by that alone the lucky ones would stop early. So s is the mean over a square of pixels, the allocation t is the largest
//! of the means nearby and of the pixel's own s, n = sqrt(t) sum(s / sqrt(t)) / E^2, and every pixel gets at least
//! [`FLOOR`] of the mean. What is left is a bias of second order: pixels that happen to look quiet with all around them
//! get fewer samples.
//!
//! The estimate of the whole has the means too: E^2 = sum of s / n. A pixel that was lucky, and therefore has few samples,
//! would stand there with its own small s for ever; its neighbours had no luck with it.

use super::{
    PASS, Progress, Renderer, SUBMISSION,
    bands::{Band, Film, unpack},
    error,
};
use crate::{
    error::{Error, Result},
    gpu::upload,
    image::FLOOR_OF_MEAN,
    settings::Integrator,
    shared::{ACTIVE_HEADER, BATCHES, IRRADIANCE_CACHED, REPROJECT_SCREEN, Slot, Sums},
    timeline,
};
use glam::Vec3;
use rayon::prelude::*;
use std::{ops::ControlFlow, time::Instant};

/// Side of the square of pixels whose mean stands for one (pixels). With 5 in place of 7, 48 renders of the demo at 32x32 for
/// an error of .08 state .062 and have .076, by glints that few samples hit; with 7 they have .071, for a third more samples.
const MEAN: usize = 7;

/// Side of the square of such means of which the largest counts (pixels).
const LARGEST: usize = 3;

/// Least samples of a pixel, in parts of the mean.
const FLOOR: f64 = 1.0 / 8.0;

/// Plans aim at this part of the error, so that a second one is seldom needed.
const AIM: f64 = 0.97;

/// Most by which a plan multiplies the samples of a pixel: the next one knows more.
const GROWTH: u32 = 4;

/// When [`Renderer::render_until`] ends: with the first of these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// Samples of each pixel, at least 1.
    pub samples: u32,
    /// Estimated error of the image, sqrt(relMSE), above 0. Each pixel gets 32 samples, then as many as it needs.
    pub error: Option<f64>,
    /// No submission is made that would end later, as far as the one before tells; but each pixel has a sample.
    pub deadline: Option<Instant>,
}

/// What ended a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    Samples,
    Error,
    Time,
    /// The caller's `progress`.
    Caller,
}

/// How a render ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    pub stop: Stop,
    /// The estimated error, sqrt(relMSE), where one was asked for and each pixel has a sample of each batch.
    pub error: Option<f64>,
}

/// How long a pixel sample takes, and until when there is time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    deadline: Option<Instant>,
    /// Seconds of a pixel sample in the last submission.
    each: f64,
}

impl Pace {
    pub fn note(&mut self, start: Instant, pixel_samples: u64) {
        self.each = start.elapsed().as_secs_f64() / pixel_samples.max(1) as f64;
    }

    /// How many samples of `pixels` pixels the next submission takes; none where the time is up.
    pub fn samples(&self, pixels: u32) -> Option<u32> {
        let most = (SUBMISSION / u64::from(pixels.max(1))).clamp(1, u64::from(PASS)) as u32;
        let Some(deadline) = self.deadline else { return Some(most) };
        let left = deadline.saturating_duration_since(Instant::now()).as_secs_f64();
        let fit = left / (self.each * f64::from(pixels)).max(1e-12);
        if left > 0.0 && fit >= 1.0 { Some(most.min(fit as u32)) } else { None }
    }
}

/// What there is of an image, pixel by pixel in the order of the bands.
struct Estimate {
    /// Samples.
    samples: Vec<u32>,
    /// The part of the squared error that each pixel has at one sample.
    own: Vec<f64>,
    /// Means of those over squares.
    means: Vec<f64>,
    error: f64,
}

impl Renderer {
    /// Adds samples until the first of the goals is reached, and says which. The samples that there are count: it goes on
    /// after an interruption, or with a renderer that was resumed. With an error as goal all begin at sample 0, pixels
    /// get different numbers of samples ([`Renderer::samples`] are those that all have), and no other call adds samples
    /// after that until [`Renderer::reset`]. `progress` as in [`Renderer::render_range`].
    ///
    /// *Error.* relMSE is the mean over pixels and channels of (x - r)^2 / (r^2 + .01 m^2), r the converged image and m its
    /// mean. Its estimate is unbiased where noise is small, too large where noise is as large as the light. Pixels get
    /// samples by what their neighbourhood needs; a place that looks quiet in the first 32 samples, such as a glint that
    /// none of them hit, gets an eighth of the mean: a bias of second order that a fixed number of samples does not have.
    ///
    /// # Errors
    /// As [`Renderer::render_range`]; [`Error::Setting`] for a goal that is out of range, or an error as goal of a
    /// renderer that was made without [`Settings::estimate_error`](crate::Settings::estimate_error), records, looks points up
    /// in the G-buffer, computes on the host, or gathers from a cloud, whose error all samples share.
    pub fn render_until(
        &mut self,
        goal: &Goal,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Outcome> {
        if goal.samples == 0 {
            return Err(Error::setting("samples", "0 hold no sample"));
        }
        if let Some(error) = goal.error {
            let refusal = match () {
                _ if !(error.is_finite() && error > 0.0) => format!("{error} is not a finite number above 0"),
                _ if self.settings.integrator == Integrator::Cloud => {
                    "cannot be estimated where light is gathered from a cloud: all samples share it".into()
                }
                _ if self.prepared.features.irradiance == IRRADIANCE_CACHED => {
                    "cannot be estimated where irradiance is cached: all samples share it".into()
                }
                _ if self.settings.integrator.is_on_host() => {
                    format!("is no goal of the integrator {}: it works on all pixels", self.settings.integrator)
                }
                _ if self.prepared.features.reproject == REPROJECT_SCREEN => {
                    "is no goal of reproject screen: pixels look into the G-buffer of all, which is traced as a whole"
                        .into()
                }
                _ if self.settings.recording => "is no goal of a renderer that records".into(),
                _ if !self.settings.estimate_error => "needs `estimate_error` in the renderer's settings".into(),
                _ if self.begin.unwrap_or(0) != 0 => "needs all samples from the first on".into(),
                _ => String::new(),
            };
            if !refusal.is_empty() {
                return Err(Error::setting("error", refusal));
            }
        }
        self.pace.deadline = goal.deadline;
        let result = match goal.error {
            None => self.uniform(goal.samples, progress).map(|stop| Outcome { stop, error: None }),
            Some(error) => self.adaptive(goal.samples, error, progress),
        };
        self.pace.deadline = None;
        let asked = goal.error.is_some() || goal.deadline.is_some();
        self.outcome = result.as_ref().ok().copied().filter(|_| asked);
        result
    }

    /// The same number of samples for each pixel.
    fn uniform(&mut self, samples: u32, progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>) -> Result<Stop> {
        let mut called_off = false;
        let finished = self.render_rest(0..samples, &mut |state| {
            let flow = progress(state);
            called_off |= flow.is_break();
            flow
        })?;
        Ok(match () {
            _ if finished => Stop::Samples,
            _ if called_off => Stop::Caller,
            _ => Stop::Time,
        })
    }

    fn adaptive(
        &mut self,
        most: u32,
        goal: f64,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Outcome> {
        // A device was lost while the image was taken, and with it the sums of a band.
        if self.adaptive && self.bands.iter().any(|band| band.film == Film::Empty) {
            self.reset();
        }
        let mut stopped = None;
        if !self.adaptive && self.samples().end < PASS.min(most) {
            let stop = self.uniform(PASS.min(most), progress)?;
            if self.samples().end < BATCHES {
                return Ok(Outcome { stop, error: None });
            }
            stopped = Some(stop).filter(|stop| *stop != Stop::Samples);
        }
        loop {
            let estimate = self.estimate()?;
            let error = Some(estimate.error);
            let targets = self.targets(&estimate, goal, most);
            let done: u64 = estimate.samples.iter().map(|&n| u64::from(n)).sum();
            let mut state = Progress { done, total: targets.iter().map(|&n| u64::from(n)).sum(), error };
            let stop = match stopped {
                _ if estimate.error <= goal => Some(Stop::Error),
                Some(stop) => Some(stop),
                None => (state.done == state.total).then_some(Stop::Samples),
            };
            if let Some(stop) = stop {
                return Ok(Outcome { stop, error });
            }
            self.adaptive = true;
            stopped = self.fulfil(&estimate.samples, &targets, &mut state, progress)?;
        }
    }

    /// Adds the samples that each pixel lacks, from the pixels with the fewest on. Says why it did not.
    fn fulfil(
        &mut self,
        samples: &[u32],
        targets: &[u32],
        state: &mut Progress,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Option<Stop>> {
        let mut first = 0;
        for band in 0..self.bands.len() {
            let pixels = self.bands[band].pixels;
            let of_band = first..first + pixels as usize;
            first = of_band.end;
            let (mut samples, targets) = (samples[of_band.clone()].to_vec(), &targets[of_band]);
            loop {
                // Of the pixels that lack some, those with the fewest; until the next have as many, or their stratum ends.
                let lacking = || samples.iter().zip(targets).filter(|(n, target)| n < target);
                let Some(start) = lacking().map(|(n, _)| *n).min() else { break };
                let list: Vec<u32> =
                    (0..pixels).filter(|&i| samples[i as usize] == start && targets[i as usize] > start).collect();
                let ends = list.iter().map(|&i| targets[i as usize]);
                let end = next_stratum(start).min(ends.min().unwrap_or(start));
                self.make_resident(band)?;
                self.upload_list(&list)?;
                let mut next = start;
                while next < end {
                    let Some(count) = self.pace.samples(list.len() as u32) else { return Ok(Some(Stop::Time)) };
                    let portion = next..end.min(next.saturating_add(count));
                    let submitted = self.submit_samples(band, portion.clone(), Some(list.len() as u32));
                    submitted.inspect_err(|_| self.distrust(band))?;
                    self.keep_in_time()?;
                    state.done += list.len() as u64 * portion.len() as u64;
                    next = portion.end;
                    if progress(state).is_break() {
                        return Ok(Some(Stop::Caller));
                    }
                }
                list.iter().for_each(|&i| samples[i as usize] = end);
                self.bands[band].end = samples.iter().copied().min().unwrap_or(end);
            }
        }
        Ok(None)
    }

    /// Lists the pixels of the band on the device that get the next samples.
    fn upload_list(&mut self, list: &[u32]) -> Result<()> {
        let mut words = vec![0; ACTIVE_HEADER as usize];
        words.extend(list);
        self.strata.fill(None);
        upload(&self.device, self.buffer(Slot::Actives).expect("kernels work on lists"), bytemuck::cast_slice(&words))
    }

    fn estimate(&mut self) -> Result<Estimate> {
        let _span = timeline::begin(&self.settings.timeline, "estimate");
        self.keep()?;
        let band_sums = |band: &Band| -> Vec<Sums> { bytemuck::pod_collect_to_vec(&unpack(&band.sums[0])) };
        let sums: Vec<Vec<Sums>> = self.bands.iter().map(band_sums).collect();
        let values = 3.0 * sums.iter().map(Vec::len).sum::<usize>() as f64;
        let mean = sums.iter().flatten().map(|sums| error::light(sums).element_sum()).sum::<f64>() / values;
        let k = FLOOR_OF_MEAN * mean * mean;
        let (mut samples, mut own) = (vec![], vec![]);
        for (band, sums) in self.bands.iter().zip(&sums) {
            let batches: Vec<Vec3> = bytemuck::pod_collect_to_vec(&unpack(&band.sums[1]));
            samples.extend(sums.iter().map(|sums| sums.samples));
            // Without any light there is no error.
            let part = |(i, sums): (usize, &Sums)| match k > 0.0 {
                true => {
                    error::part(sums.samples, &error::batches(&batches, band.pixels as usize, i), k) / values
                        * f64::from(sums.samples)
                }
                false => 0.0,
            };
            own.par_extend(sums.par_iter().enumerate().map(part));
        }
        let means = over_squares(&own, self.prepared.view.crop_width as usize, MEAN, |values| {
            let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
            sum / count
        });
        let error = means.iter().zip(&samples).map(|(mean, &n)| mean / f64::from(n.max(1))).sum::<f64>().sqrt();
        Ok(Estimate { samples, own, means, error })
    }

    /// The samples that each pixel should have for the error `goal`, `most` at most.
    fn targets(&self, estimate: &Estimate, goal: f64, most: u32) -> Vec<u32> {
        let width = self.prepared.view.crop_width as usize;
        let Estimate { own, means, .. } = estimate;
        let largest = over_squares(means, width, LARGEST, |values| values.fold(0.0, f64::max));
        let roots: Vec<f64> = largest.iter().zip(own).map(|(near, own)| near.max(*own).sqrt()).collect();
        let shares = means.iter().zip(&roots).map(|(mean, root)| if *mean > 0.0 { mean / root } else { 0.0 });
        let scale = shares.sum::<f64>() / (goal * AIM).powi(2);
        let floor = FLOOR * scale * roots.iter().sum::<f64>() / roots.len() as f64;
        let target = |(root, &n): (&f64, &u32)| {
            let wanted = (root * scale).max(floor).ceil().min(f64::from(u32::MAX)) as u32;
            let wanted = wanted.min(n.saturating_mul(GROWTH)).min(most);
            if wanted > n { wanted.next_multiple_of(PASS).min(most) } else { n }
        };
        let targets: Vec<u32> = roots.iter().zip(&estimate.samples).map(target).collect();
        if targets != estimate.samples {
            return targets;
        }
        // The plan before was fulfilled, but luck was not with it.
        estimate.samples.iter().map(|&n| next_stratum(n).min(most)).collect()
    }
}

/// End of the samples that share their sub-pixel strata with sample `n`.
fn next_stratum(n: u32) -> u32 {
    (n / PASS + 1).saturating_mul(PASS)
}

/// What `of` makes of the values in the square about each pixel, as far as it is in the image; row by row, then column by
/// column.
fn over_squares(
    values: &[f64],
    width: usize,
    side: usize,
    of: impl Fn(&mut dyn Iterator<Item = f64>) -> f64,
) -> Vec<f64> {
    let height = values.len() / width;
    let reach = |at: usize, size: usize| at.saturating_sub(side / 2)..(at + side / 2 + 1).min(size);
    let along = |i: usize| of(&mut reach(i % width, width).map(|x| values[i / width * width + x]));
    let rows: Vec<f64> = (0..values.len()).map(along).collect();
    let across = |i: usize| of(&mut reach(i / width, height).map(|y| rows[y * width + i % width]));
    (0..values.len()).map(across).collect()
}
