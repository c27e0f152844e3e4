//! `measure`: table on stdout, CSV and SVG.

use crate::{Folder, stderr};
use std::fs;

#[test]
fn measure_writes_a_table_a_csv_and_an_svg() {
    let folder = Folder::new("measure");
    let table = folder.done("measure edge --preset skin1 --effort 0.02 -o skin.v1");
    assert!(table.contains("Convex edge") && table.contains("skin1") && table.contains("CLOSED FORM"), "{table}");
    assert_eq!(folder.files(), ["skin.v1.csv", "skin.v1.svg"]);

    let csv = fs::read_to_string(folder.join("skin.v1.csv")).expect("written");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], "panel,series,x_label,x,y_label,measured,standard_error,closed_form,deviation");
    assert_eq!(lines.len(), 1 + 72);
    for line in &lines[1..] {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().expect("a number");
        let (measured, error, expected, deviation) = (number(5), number(6), number(7), number(8));
        assert!(((measured - expected) / error - deviation).abs() < 1e-9 && deviation.abs() < 5.0, "{line}");
    }

    let svg = fs::read_to_string(folder.join("skin.v1.svg")).expect("written");
    assert!(svg.starts_with("<svg width=\"880\"") && svg.trim_end().ends_with("</svg>"), "{}", &svg[..200]);
    for part in ["distance from the edge [mm]", "exitance over a plane", "closed form", "skin1"] {
        assert!(svg.contains(part), "{part}");
    }

    // A folder, coefficients, several models.
    folder.done("measure profile --sigma-s-prime 1 --sigma-a 0.1 --unit 1/cm --ior 1.4 --effort 0.1 -o .");
    assert!(folder.files().contains(&"profile.svg".into()));
    let text = folder.done("measure profile --albedo 0.8,0.5,0.3 --mean-free-path 1 --model standard,standard -o two");
    assert!(text.contains("standard: total 0.5"), "{text}");
}

#[test]
fn measure_refuses_what_it_cannot_measure() {
    let folder = Folder::new("measure-usage");
    for (words, expected) in [
        ("measure", "EXPERIMENT"),
        ("measure colour", "colour"),
        ("measure edge --preset granite", "granite"),
        ("measure edge --sigma-a 1", "--sigma-s-prime"),
        ("measure edge --preset marble --albedo 1", "--albedo"),
        ("measure edge --sigma-s-prime 1 --sigma-a x", "R,G,B"),
        ("measure edge --sigma-s-prime 0 --sigma-a 1", "scatter"),
        ("measure edge --sigma-s-prime 1 --sigma-a=-1", "sigma_a"),
        ("measure edge --sigma-s-prime 1 --sigma-a 1 --unit mile", "mile"),
        ("measure edge --effort 0", "--effort"),
        ("measure edge -o nowhere/edge", "nowhere"),
        ("measure edge --model fast", "fast"),
    ] {
        let output = folder.run(words);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{words}: {message}");
        assert!(message.contains(expected) && !message.contains("panicked"), "{words}: {message}");
        assert_eq!(folder.files(), [""; 0], "{words}");
    }
}
