//! `render --profile`: the trace as a viewer reads it, and the table of kernels beside it.

use crate::Folder;
use serde_json::Value;
use std::{collections::BTreeMap, fs};
use translucent::{Device, DeviceOptions};

/// Samples of all eight batches and one more.
const RENDER: &str = "render SPOT --resolution 24x24 --samples 9 --environment constant:1,1,1 -o a.exr";

/// Begin and end (us) with name and arguments.
type Spans = Vec<(f64, f64, String, Value)>;

/// The events of one track, in the file's order.
fn track(trace: &Value, wanted: &str) -> Spans {
    let events = trace["traceEvents"].as_array().expect("a list of events");
    let named = |event: &&Value| event["ph"] == "M" && event["args"]["name"] == wanted;
    let thread = &events.iter().find(named).expect("every track has a name")["tid"];
    let spans = events.iter().filter(|event| event["ph"] == "X" && event["tid"] == *thread);
    spans
        .map(|event| {
            let [begin, length] = ["ts", "dur"].map(|time| event[time].as_f64().expect("a time"));
            assert!(begin >= 0.0 && length >= 0.0 && event["pid"] == 1, "{event}");
            let name = event["name"].as_str().expect("a name").to_string();
            (begin, begin + length, name, event["args"].clone())
        })
        .collect()
}

/// What rounding to f64 may cost, in microseconds.
const ROUNDING: f64 = 1e-6;

#[test]
fn the_trace_opens_is_nested_and_names_what_ran() {
    let folder = Folder::new("profile");
    let said = folder.done(&format!("{RENDER} --profile a.json --profile a.csv"));
    let text = fs::read_to_string(folder.join("a.json")).expect("it was written");
    let trace: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(folder.files(), ["a.csv", "a.exr", "a.json"]);
    for event in trace["traceEvents"].as_array().expect("a list of events") {
        assert!(["X", "M", "C"].iter().any(|kind| event["ph"] == *kind), "{event}");
    }
    let made = &trace["otherData"];
    assert!(made["spirvHash"].as_str().expect("a hash").len() == 64 && made["deviationUs"].is_number(), "{made}");

    // The host's spans are nested: each ends before what is around it does.
    let host = track(&trace, "host");
    let mut open: Vec<(f64, &str)> = vec![];
    let mut around: BTreeMap<&str, Option<&str>> = BTreeMap::new();
    for (begin, end, name, _) in &host {
        while open.last().is_some_and(|(end, _)| end <= begin) {
            open.pop();
        }
        assert!(open.last().is_none_or(|(outer, _)| *end <= outer + ROUNDING), "{name} in {open:?}");
        around.insert(name, open.last().map(|(_, name)| *name));
        open.push((*end, name));
    }
    for (name, within) in [
        ("load", None),
        ("bvh", Some("load")),
        ("device", None),
        ("prepare", None),
        ("pipelines", None),
        ("upload", None),
        ("render", None),
        ("first dispatch", Some("render")),
        ("submission", Some("render")),
        ("image", None),
        ("resolve", Some("image")),
        ("download", Some("image")),
        ("write", None),
    ] {
        assert_eq!(around.get(name), Some(&within), "{name}");
    }

    let device = track(&trace, "device");
    if !Device::open(&DeviceOptions::default()).expect("a device").has_timestamps() {
        assert!(device.is_empty() && said.contains("no timestamps"));
        return;
    }
    assert!(device.windows(2).all(|pair| pair[0].1 <= pair[1].0 + ROUNDING), "dispatches follow one another");
    let submissions = || host.iter().filter(|(_, _, _, about)| about.is_object());
    for (begin, end, name, _) in &device {
        let inside = |(from, to, _, _): &&(f64, f64, _, _)| from - ROUNDING <= *begin && *end <= to + ROUNDING;
        assert_eq!(submissions().filter(inside).count(), 1, "{name} is in one submission");
    }
    let mut counts: BTreeMap<&str, (u64, f64)> = BTreeMap::new();
    for (begin, end, name, _) in &device {
        let (count, total) = counts.entry(name).or_default();
        (*count, *total) = (*count + 1, *total + end - begin);
    }
    // `primary`: the first stratum of each batch, and the pixels' centres.
    // `count`: once in each submission.
    let expected = [
        ("accumulate", 9),
        ("count", 2),
        ("primary", 9),
        ("reflect", 9),
        ("reproject", 9),
        ("resolve", 1),
        ("reuse", 9),
        ("sample", 9),
    ];
    assert_eq!(counts.iter().map(|(name, (count, _))| (*name, *count)).collect::<Vec<_>>(), expected);
    let samples = device.iter().filter(|span| span.2 == "sample");
    let indices: Vec<_> = samples.map(|span| span.3["sampleBegin"].as_u64()).collect();
    assert_eq!(indices, (0..9).map(Some).collect::<Vec<_>>());

    // The CSV and the table say the same.
    let csv = fs::read_to_string(folder.join("a.csv")).expect("it was written");
    let mut lines = csv.lines();
    let columns = "kernel,count,total_ms,mean_ms,min_ms,max_ms,share,device,driver,spirv_hash";
    assert_eq!(lines.next(), Some(columns));
    let mut shares = 0.0;
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), counts.len());
    for row in &rows {
        let (count, total) = counts[row[0]];
        let number = |column: usize| row[column].parse::<f64>().expect("a number");
        assert_eq!(number(1), count as f64);
        assert!((number(2) - total * 1e-3).abs() <= 1e-9 * number(2), "{row:?}");
        assert!((number(3) * number(1) - number(2)).abs() <= 1e-9 * number(2), "{row:?}");
        assert!(number(4) <= number(3) * (1.0 + 1e-9) && number(3) <= number(5) * (1.0 + 1e-9), "{row:?}");
        shares += number(6);
        let line = said.lines().find(|line| line.starts_with(row[0])).expect("every kernel is in the table");
        let launches = line.split_whitespace().nth(1).and_then(|cell| cell.parse().ok());
        assert_eq!(launches, Some(count), "{line}");
    }
    assert!((shares - 1.0).abs() < 1e-9, "{shares}");
}

#[test]
fn a_render_of_more_dispatches_than_one_query_pool_holds_is_timed_whole() {
    let folder = Folder::new("many");
    // 32 samples go in one submission, each with 50 portions of rays for two kernels: 3,200 dispatches, and a pool has
    // 1,024.
    folder.done(
        "render SPOT --resolution 1x1 --samples 33 --directions 200 --environment constant:1,1,1 --profile a.csv",
    );
    let csv = fs::read_to_string(folder.join("a.csv")).expect("it was written");
    let count = |kernel: &str| {
        let row = csv.lines().find(|line| line.starts_with(&format!("{kernel},")));
        row.map(|row| row.split(',').nth(1).and_then(|cell| cell.parse::<u64>().ok()).expect("a count"))
    };
    if let Some(samples) = count("sample") {
        assert_eq!(samples, 33);
        let portions = count("accumulate").expect("it ran");
        assert!(portions == 33 * 50, "{portions}");
    }
}
