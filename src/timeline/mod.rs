//! What takes how long: spans of the host's and the device's work on one clock, summed up for each kernel, and as a
//! trace that Perfetto and `chrome://tracing` open.
//!
//! ```
//! # fn main() -> translucent::Result<()> {
//! use translucent::{Device, DeviceOptions, LoadOptions, Renderer, Scene, Settings, timeline::Timeline};
//!
//! let timeline = Timeline::new();
//! let device = Device::open(&DeviceOptions { profiling: true, ..DeviceOptions::default() })?;
//! let options = LoadOptions { timeline: Some(timeline.clone()), ..LoadOptions::default() };
//! let scene = Scene::load_with("assets/spot.glb", &options)?;
//! # let model = translucent::Model::Standard;
//! let settings = Settings { timeline: Some(timeline.clone()), ..Settings::default() };
//! # let settings = Settings { model, resolution: Some((8, 8)), ..settings };
//! let mut renderer = Renderer::new(&device, &scene, &settings)?;
//! renderer.render(16)?;
//! for times in timeline.kernels() {
//!     println!("{}: {} times, {} ms", times.kernel, times.count, times.total * 1e-6);
//! }
//! # let names: Vec<_> = timeline.kernels().iter().map(|times| times.kernel).collect();
//! # assert!(!device.has_timestamps() || names == renderer.kernels()[..names.len()], "{names:?}");
//! # let renders = timeline.spans().into_iter().filter(|span| span.name == "render").count();
//! # assert_eq!(renders, 1);
//! # Ok(())
//! # }
//! ```
//!
//! Without a timeline nothing is timed: no query pool is made and no timestamp written. With one, each dispatch writes
//! two timestamps. Dispatches follow one another anyway, each after a barrier, so they are not held up by them.
//!
//! With the cargo feature `tracy` every timeline is also sent to the profiler Tracy while it grows: the host's spans as
//! zones of their thread, dispatches as those of a device on the host's clock. [`Timeline::new`] starts its client,
//! which waits for a viewer of Tracy's on a port of its own.
//!
//! On a software driver a kernel's time is wall time of the processor's cores, and means something while they are idle.

mod kernels;
mod trace;
#[cfg(feature = "tracy")]
mod tracy;

pub use kernels::{Counted, KernelTimes};

use std::{
    fmt,
    ops::Range,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

/// Where a [`Span`] was spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Track {
    /// By the thread that calls this library.
    Host,
    /// By the device's queue.
    Device,
}

/// Something that took time: nanoseconds since the timeline began.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    pub track: Track,
    /// The kernel, or what the host did.
    pub name: &'static str,
    pub begin: f64,
    pub end: f64,
    /// What it worked on, for a dispatch or a submission.
    pub work: Option<Work>,
}

/// A part of a render.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Which band of rows.
    pub band: u32,
    /// Pixels of the band.
    pub pixels: u32,
    /// Which samples; empty where the work is for all of them.
    pub samples: Range<u32>,
}

/// Where spans are noted; clones share it, and it may be used from several threads. A span takes some 64 bytes of
/// memory, and a render has about six for each sample of each band.
#[derive(Clone)]
pub struct Timeline {
    epoch: Instant,
    noted: Arc<Mutex<Noted>>,
    #[cfg(feature = "tracy")]
    tracy: tracy::Stream,
}

#[derive(Default)]
struct Noted {
    spans: Vec<Span>,
    deviation: f64,
    counted: kernels::Sums,
}

impl Timeline {
    /// An empty one, whose time begins now.
    pub fn new() -> Timeline {
        Timeline {
            epoch: Instant::now(),
            noted: Arc::default(),
            // Its clock begins with the timeline's.
            #[cfg(feature = "tracy")]
            tracy: tracy::Stream::new(),
        }
    }

    /// Begins a span of the host's that ends when the value is dropped. Spans of one thread are nested.
    #[must_use = "it ends when it is dropped"]
    pub fn begin(&self, name: &'static str) -> Open {
        Open {
            timeline: self.clone(),
            name,
            begin: self.at(Instant::now()),
            #[cfg(feature = "tracy")]
            _zone: self.tracy.zone(name),
        }
    }

    /// Every span so far, in order of their ends.
    pub fn spans(&self) -> Vec<Span> {
        self.noted().spans.clone()
    }

    /// How far the device's spans may be from their places on the host's clock (ns), the largest so far. Their lengths
    /// are the device's own.
    pub fn deviation(&self) -> f64 {
        self.noted().deviation
    }

    /// Sums of the device's spans for each kernel, in the order in which they first ran.
    pub fn kernels(&self) -> Vec<KernelTimes> {
        kernels::sums(&self.noted().spans)
    }

    /// What the device counted, on average over a kernel's dispatches; nothing without
    /// [`DeviceOptions::counters`](crate::DeviceOptions::counters).
    pub fn counters(&self) -> Vec<Counted> {
        self.noted().counted.means()
    }

    /// The trace in Chrome's JSON format, in microseconds, with `about` as its `otherData`.
    pub fn trace(&self, about: &serde_json::Value) -> String {
        let noted = self.noted();
        trace::json(&noted.spans, noted.deviation, about).to_string()
    }

    /// Forgets every span. Those that are open are noted when they end.
    pub fn clear(&self) {
        *self.noted() = Noted::default();
    }

    /// A moment's nanoseconds since the timeline began.
    pub(crate) fn at(&self, moment: Instant) -> f64 {
        moment.saturating_duration_since(self.epoch).as_nanos() as f64
    }

    /// Notes spans whose places are known up to `deviation` (ns).
    pub(crate) fn note(&self, spans: impl IntoIterator<Item = Span>, deviation: f64) {
        let mut noted = self.noted();
        #[cfg(feature = "tracy")]
        let spans = spans.into_iter().inspect(|span| self.tracy.note(span));
        noted.spans.extend(spans);
        noted.deviation = noted.deviation.max(deviation);
    }

    /// Notes what was counted of a dispatch: name and unit of each counter, and its value.
    pub(crate) fn count<'a>(&self, kernel: &'static str, counters: impl Iterator<Item = (&'a str, &'static str, f64)>) {
        self.noted().counted.add(kernel, counters);
    }

    fn noted(&self) -> MutexGuard<'_, Noted> {
        self.noted.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Default for Timeline {
    fn default() -> Self {
        Timeline::new()
    }
}

impl fmt::Debug for Timeline {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Timeline({} spans)", self.noted().spans.len())
    }
}

/// Whether they are the same one.
impl PartialEq for Timeline {
    fn eq(&self, other: &Timeline) -> bool {
        Arc::ptr_eq(&self.noted, &other.noted)
    }
}

/// A span of the host's that goes on until this is dropped.
pub struct Open {
    timeline: Timeline,
    name: &'static str,
    begin: f64,
    #[cfg(feature = "tracy")]
    _zone: tracy_client::Span,
}

impl Drop for Open {
    fn drop(&mut self) {
        let Open { timeline, name, begin, .. } = self;
        let end = timeline.at(Instant::now());
        timeline.note([Span { track: Track::Host, name, begin: *begin, end, work: None }], 0.0);
    }
}

/// Begins a span where there is a timeline.
#[must_use = "it ends when it is dropped"]
pub fn begin(timeline: &Option<Timeline>, name: &'static str) -> Option<Open> {
    timeline.as_ref().map(|timeline| timeline.begin(name))
}
