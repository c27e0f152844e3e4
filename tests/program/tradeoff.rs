//! `tradeoff`: the files that it leaves, what it says of each variant, and that it does not do work twice.

use crate::Folder;
use std::{collections::HashMap, fs, path::Path, time::SystemTime};

/// Names and times of writing of all images and notes.
fn written(folder: &Path) -> Vec<(String, SystemTime)> {
    let mut found = Vec::new();
    for kind in ["variants", "converged"] {
        for entry in fs::read_dir(folder.join(kind)).expect("it is there") {
            let entry = entry.expect("readable");
            let name = format!("{kind}/{}", entry.file_name().to_string_lossy());
            found.push((name, entry.metadata().and_then(|about| about.modified()).expect("known")));
        }
    }
    found.sort();
    found
}

/// Rows of a CSV whose last column may hold commas, by the names of columns.
fn rows(text: &str) -> Vec<HashMap<&str, &str>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    lines.map(|line| names.iter().copied().zip(line.splitn(names.len(), ',')).collect()).collect()
}

/// What stands between `begin` and `end`, each time.
fn between<'a>(text: &'a str, begin: &'a str, end: &'a str) -> impl Iterator<Item = &'a str> {
    text.split(begin).skip(1).map(move |rest| rest.split(end).next().unwrap_or_default())
}

#[test]
fn a_run_leaves_table_plots_and_page_and_is_gone_on_with() {
    let folder = Folder::new("tradeoff");
    let words = "tradeoff SPOT --resolution 24x24 --models standard,directional --integrators sample,cloud \
                 --projections mis --cloud-points 60 --reference-samples 8 --against standard --quiet -o out";
    let said = folder.done(&format!("{words} --samples 2"));
    assert!(said.contains("ON THE FRONT") && said.contains("report.html"), "{said}");
    let out = folder.join("out");
    let read = |name: &str| fs::read_to_string(out.join(name)).expect("written");

    let csv = read("tradeoff.csv");
    let header = "model,integrator,projection,reproject,irradiance,reuse,precision,directions,samples,seconds,\
                  prepare_seconds,render_seconds,kernel_seconds,start_up_seconds,sampling_error,sampling_flip,model_error,model_flip,\
                  total_error,total_flip,reference_error,reference_flip,front_sampling_error,front_sampling_flip,\
                  front_total_error,front_total_flip,status";
    assert_eq!(csv.lines().next(), Some(header));
    let first = rows(&csv);
    assert_eq!(first.len(), 4, "{csv}");
    for row in &first {
        let number = |name: &str| row[name].parse::<f64>().unwrap_or(f64::NAN);
        let refused = row["model"] == "directional" && row["integrator"] == "cloud";
        assert_eq!(row["status"].starts_with("\"refused: integrator cloud"), refused, "{row:?}");
        assert_eq!(row["status"] == "rendered", !refused, "{row:?}");
        // A standard dipole is as far from itself by both.
        assert_eq!(row["model_error"] == "0", row["model"] == "standard", "{row:?}");
        assert!(number("reference_error") > 0.0, "{row:?}");
        if !refused {
            assert!(number("sampling_error") > 0.0 && number("sampling_flip") > 0.0, "{row:?}");
            assert!(number("total_flip") > 0.0 && number("total_flip") < 1.0, "{row:?}");
            let parts = number("prepare_seconds") + number("render_seconds");
            assert!(number("render_seconds") > 0.0 && (number("seconds") - parts).abs() < 1e-9, "{row:?}");
        }
    }
    // Of everything, something is on the front; what is on it is the fastest or the best.
    for name in ["front_sampling_error", "front_total_error", "front_total_flip"] {
        assert!(first.iter().any(|row| row[name] == "1"), "{csv}");
    }

    for measure in ["relative", "flip"] {
        let svg = read(&format!("tradeoff-{measure}.svg"));
        assert!(svg.starts_with("<svg width=\"1240\"") && svg.contains("sample, mis"), "{}", &svg[..200]);
        let png = image::open(out.join(format!("tradeoff-{measure}.png"))).expect("a PNG").into_rgb8();
        assert_eq!(png.width(), 2480);
    }
    let page = read("report.html");
    assert!(!page.contains("http://") || page.matches("http://").count() == page.matches("http://www.w3.org/").count());
    let mut asked = between(&page, "src=\"", "\"").chain(between(&page, "href=\"", "\""));
    assert_eq!(asked.next(), None);
    let data =
        between(&page, "<script type=\"application/json\" id=\"data\">", "</script>").next().expect("it holds data");
    let data: serde_json::Value = serde_json::from_str(data).expect("JSON");
    assert_eq!(data["rows"].as_array().map(Vec::len), Some(3));
    for row in data["rows"].as_array().expect("a list") {
        assert!(row["image"].as_str().is_some_and(|image| image.starts_with("data:image/png;base64,")), "{row}");
    }

    // The same again renders nothing; with another number of samples only that.
    let before = written(&out);
    assert_eq!(before.len(), 2 * (3 + 4));
    let again = folder.done(&format!("{words} --samples 2"));
    assert!(again.contains("7 images were there"), "{again}");
    assert_eq!(written(&out), before);
    let csv_again = read("tradeoff.csv");
    let second = rows(&csv_again);
    assert!(second.iter().all(|row| row["status"] == "kept" || row["status"].starts_with("\"refused")), "{csv_again}");
    for (row, was) in second.iter().zip(&first) {
        for name in ["seconds", "sampling_error", "total_flip"] {
            let number = |row: &HashMap<&str, &str>| row[name].parse::<f64>().ok();
            match (number(row), number(was)) {
                // JSON is read to the last digit but one.
                (Some(a), Some(b)) => assert!((a - b).abs() <= 1e-12 * b, "{name}: {a}, not {b}"),
                (a, b) => assert_eq!(a, b, "{name}"),
            }
        }
    }
    folder.done(&format!("{words} --samples 1,2"));
    let after = written(&out);
    assert!(before.iter().all(|file| after.contains(file)));
    assert_eq!(after.len(), before.len() + 2 * 3);

    // The command that the page names gives the image that was measured.
    let row =
        data["rows"].as_array().and_then(|rows| rows.iter().find(|row| row["method"] == "cloud")).expect("a cloud");
    let command = row["command"].as_str().and_then(|text| text.strip_prefix("translucent ")).expect("a command");
    folder.done(&format!("{command} -o again.exr --quiet"));
    let [again, was] =
        [folder.image("again.exr"), folder.image("out/variants/standard-cloud-mis-trace-direct-auto-packed-1x2.exr")];
    assert_eq!(again.channel("G").expect("contract"), was.channel("G").expect("contract"));
}

#[test]
fn axes_that_change_nothing_are_left_at_their_defaults() {
    let folder = Folder::new("tradeoff-axes");
    folder.done(
        "tradeoff SPOT --resolution 8x8 --models burley,table --integrators sample,cloud --projections mis --samples 1 \
         --reference-samples 2 --against none --reuse 1,4 --precision packed,full --cloud-points 60 --quiet -o out",
    );
    let csv = fs::read_to_string(folder.join("out/tradeoff.csv")).expect("written");
    let rows = rows(&csv);
    let found: Vec<[&str; 4]> =
        rows.iter().map(|row| ["model", "integrator", "reuse", "precision"].map(|name| row[name])).collect();
    let expected = [
        ["burley", "sample", "1", "packed"],
        ["burley", "sample", "4", "packed"],
        ["burley", "cloud", "auto", "packed"],
        ["table", "sample", "1", "packed"],
        ["table", "sample", "1", "full"],
        ["table", "sample", "4", "packed"],
        ["table", "sample", "4", "full"],
        ["table", "cloud", "auto", "packed"],
        ["table", "cloud", "auto", "full"],
    ];
    assert_eq!(found, expected, "{csv}");
    assert!(rows.iter().all(|row| row["status"] == "rendered"), "{csv}");
}
