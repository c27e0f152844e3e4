//! The grid of model errors against random walks.

use std::{f64::consts::PI, fmt::Write};
use translucent::{
    Model,
    model::errors::{ALBEDOS, INDICES, measure, of, walk},
};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/model/grid.rs");

/// Models whose errors are measured; the table's are with the table.
const MODELS: [Model; 4] = [Model::Standard, Model::Better, Model::Directional, Model::Burley];

/// What `src/model/grid.rs` holds, by `paths` paths an index.
fn grid(paths: u64) -> String {
    let walked: Vec<_> = INDICES.iter().zip(1..).map(|(ior, seed)| walk(*ior, paths, seed)).collect();
    let mut text = String::from(
        "//! Measured errors of the models; see [`errors`](super::errors). Written by a test.\n\n\
         use super::errors::{Error, Errors};\n\n\
         const fn e(total: f64, l1: f64) -> Error {\n    Error { total, l1 }\n}\n\n\
         #[rustfmt::skip]\npub(super) const GRID: &[(&str, Errors)] = &[\n",
    );
    for model in MODELS {
        if measure(model, ALBEDOS[0], INDICES[0], &walked[0][0]).is_none() {
            continue;
        }
        let _ = writeln!(text, "    (\"{model}\", [");
        for (ior, walked) in INDICES.iter().zip(&walked) {
            text.push_str("        [");
            for (albedo, walked) in ALBEDOS.iter().zip(walked) {
                let error = measure(model, *albedo, *ior, walked).expect("a model that is built");
                let _ = write!(text, "e({:.3}, {:.3}), ", error.total, error.l1);
            }
            text.push_str("],\n");
        }
        text.push_str("    ]),\n");
    }
    text + "];\n"
}

#[test]
fn model_errors_are_what_a_random_walk_shows() {
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(FILE, grid(60_000)).expect("the sources are writable");
        return;
    }
    let ior = 1.3;
    let walked = walk(ior, 20_000, 99);
    for (albedo, walked) in ALBEDOS.iter().zip(&walked) {
        for model in MODELS {
            let (Some(found), Some(said)) = (measure(model, *albedo, ior, walked), of(model, *albedo, ior)) else {
                continue;
            };
            let noise = walked.total.error / walked.total.mean;
            assert!(
                (found.total - said.total).abs() < 5.0 * noise * (1.0 + said.total) + 1e-3,
                "{model} {albedo}: {found:?} {said:?}"
            );
            // The noise of a ring adds to the light that seems to be in the wrong place, at most all of it.
            let rings = walked.rings.iter().zip(walked.radii.windows(2));
            let rings: f64 = rings.map(|(ring, r)| ring.error * PI * (r[1] * r[1] - r[0] * r[0])).sum();
            let allowed = 1.5 * rings / walked.total.mean + 5.0 * noise * (1.0 + said.l1) + 0.02;
            assert!((found.l1 - said.l1).abs() < allowed, "{model} {albedo}: {found:?} {said:?}");
            assert!(allowed < 0.5 + said.l1, "{model} {albedo}: the test has no force at {allowed}");
        }
    }
}

#[test]
fn model_errors_agree_with_published_ones() {
    // An independent Monte Carlo (6 and 20 million photons): total and L1 in percent, of marble and skin1 channels.
    let published = [
        (Model::Standard, 2.62 / 2.6241, 1.5, -1.0, 20.0),
        (Model::Standard, 0.74 / 0.772, 1.3, -1.0, 28.0),
        (Model::Standard, 0.88 / 1.05, 1.3, 7.0, 51.0),
        (Model::Standard, 1.01 / 1.49, 1.3, 14.0, 74.0),
        (Model::Standard, 2.62 / 2.6241, 1.0, 0.0, 27.0),
        (Model::Better, 2.62 / 2.6241, 1.5, -1.0, 16.0),
        (Model::Better, 0.88 / 1.05, 1.3, -24.0, 42.0),
        (Model::Better, 1.01 / 1.49, 1.3, -39.0, 54.0),
        (Model::Directional, 2.62 / 2.6241, 1.5, 22.0, 25.0),
        (Model::Directional, 0.88 / 1.05, 1.3, 83.0, 92.0),
    ];
    for (model, albedo, ior, total, l1) in published {
        let Some(error) = of(model, albedo, ior) else { continue };
        // Rounded to percents, and interpolated between the albedos of the grid, which errs by a twentieth where errors
        // are large.
        let near =
            |found: f64, published: f64, slack: f64| (100.0 * found - published).abs() < slack + 0.05 * published.abs();
        assert!(near(error.total, total, 2.0), "{model} {albedo} {ior}: {error:?}, not {total}");
        assert!(near(error.l1, l1, 4.0), "{model} {albedo} {ior}: {error:?}, not {l1}");
    }
    // The standard dipole at least is measured.
    assert!(of(Model::Standard, 0.9, 1.3).is_some());
    // Beyond the grid the nearest holds.
    assert_eq!(of(Model::Standard, 1.0, 1.3), of(Model::Standard, 0.9998, 1.3));
    assert_eq!(of(Model::Standard, 0.1, 3.0), of(Model::Standard, 0.5, 2.0));
}
