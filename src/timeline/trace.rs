//! Chrome's trace format: "Trace Event Format", N. Duca, D. Sinclair, 2016; complete events (X), metadata (M) and
//! counters (C), times in microseconds.

use super::{Span, Track};
use serde_json::{Value, json};

/// The one process that a trace has.
const PROCESS: u32 = 1;

pub(super) fn json(spans: &[Span], deviation: f64, about: &Value) -> Value {
    let mut events = vec![metadata("process_name", 0, "translucent")];
    for (track, name) in [(Track::Host, "host"), (Track::Device, "device")] {
        events.push(metadata("thread_name", thread(track), name));
    }
    // By begin, the longer first, so that a reader meets what encloses before what is enclosed.
    let mut sorted: Vec<&Span> = spans.iter().collect();
    sorted.sort_by(|a, b| a.begin.total_cmp(&b.begin).then(b.end.total_cmp(&a.end)));
    let mut done = 0;
    for span in &sorted {
        let mut event = json!({
            "ph": "X", "pid": PROCESS, "tid": thread(span.track), "name": span.name, "cat": category(span.track),
            "ts": microseconds(span.begin), "dur": microseconds(span.end - span.begin),
        });
        if let Some(work) = &span.work {
            event["args"] = json!({
                "band": work.band, "pixels": work.pixels,
                "sampleBegin": work.samples.start, "sampleEnd": work.samples.end,
            });
        }
        events.push(event);
        if let (Track::Host, Some(work)) = (span.track, &span.work) {
            done += u64::from(work.pixels) * work.samples.len() as u64;
            events.push(json!({
                "ph": "C", "pid": PROCESS, "tid": thread(span.track), "name": "pixel samples",
                "ts": microseconds(span.end), "args": { "done": done },
            }));
        }
    }
    let mut about = about.clone();
    if about.is_object() {
        about["deviationUs"] = microseconds(deviation).into();
    }
    json!({ "traceEvents": events, "displayTimeUnit": "ms", "otherData": about })
}

fn metadata(kind: &str, thread: u32, name: &str) -> Value {
    json!({ "ph": "M", "pid": PROCESS, "tid": thread, "name": kind, "args": { "name": name } })
}

fn thread(track: Track) -> u32 {
    match track {
        Track::Host => 1,
        Track::Device => 2,
    }
}

fn category(track: Track) -> &'static str {
    match track {
        Track::Host => "host",
        Track::Device => "kernel",
    }
}

fn microseconds(nanoseconds: f64) -> f64 {
    nanoseconds / 1e3
}
