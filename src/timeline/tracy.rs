//! Spans as Tracy shows them. Its protocol takes the host's zones only while they go on, so submissions, which are
//! noted when they have ended, show as their dispatches alone.

use super::{Span, Track};
use tracy_client::{Client, GpuContext, GpuContextType};

/// The client, and a context for the device; clones share it.
#[derive(Clone)]
pub(super) struct Stream {
    client: Client,
    /// None when the process has made 255 of them.
    device: Option<GpuContext>,
}

impl Stream {
    /// A device whose clock is at 0 now and counts nanoseconds, as timelines do.
    pub fn new() -> Stream {
        let client = Client::start();
        let device = client.clone().new_gpu_context(Some("translucent"), GpuContextType::Vulkan, 0, 1.0).ok();
        Stream { client, device }
    }

    /// A zone of this thread, which ends when it is dropped.
    pub fn zone(&self, name: &'static str) -> tracy_client::Span {
        self.client.clone().span_alloc(Some(name), "translucent", file!(), line!(), 0)
    }

    /// Sends a dispatch that has ended.
    pub fn note(&self, span: &Span) {
        let (Track::Device, Some(device)) = (span.track, &self.device) else { return };
        // It is full when a viewer is far behind; what it misses, the trace has.
        if let Ok(mut zone) = device.span_alloc(span.name, "translucent", file!(), line!()) {
            zone.end_zone();
            zone.upload_timestamp_start(span.begin as i64);
            zone.upload_timestamp_end(span.end as i64);
        }
    }
}
