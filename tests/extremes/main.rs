//! The extremes that a render survives: one row a case, and the table of them in the crate's documentation.
//!
//! `BLESS=1 cargo test --test extremes table` writes the table.

#[allow(dead_code)]
#[path = "../images/harness.rs"]
mod harness;
mod matter;
mod opaque_limit;
#[path = "../common/pool.rs"]
mod pool;
#[allow(dead_code)]
#[path = "../images/scenes.rs"]
mod scenes;
mod size;

use harness::{channel, render};

/// Case, what could go wrong, what holds, and the test that shows it: file and function.
const ROWS: &[(&str, &str, &str, &str)] = &[
    (
        "a million random sets of matter, surface, light and camera through every kernel",
        "NaN, infinity, negative light",
        "none; where f32 has an answer, within 1e-3 of the twin but for 3e-4 at most",
        "kernels/sweep.rs::a_million_sets_through_every_kernel",
    ),
    (
        "sigma_t' 1e-6 to 1e9 per radius, alpha' 0, 1e-6, .5, .999, 1 - 2^-24, 1, n .7, 1 - 1e-6, 1, 1 + 1e-6, 1.3, 3; all combinations",
        "0/0, overflow, negative light, wrong energy",
        "a ball in uniform light has its closed form, finite everywhere",
        "extremes/matter.rs::every_matter_has_its_radiance",
    ),
    (
        "the same under the table and what auto takes, n 1, 1.3, 1.5",
        "a table left or never entered, a choice without a model",
        "finite, no more light than came but for the table's known error",
        "extremes/matter.rs::tables_and_what_auto_takes_of_every_matter_are_finite",
    ),
    (
        "n = 1 -+ 1e-6",
        "fits give a Fresnel boundary that is not there",
        "the image is that of n = 1 to 1e-4",
        "extremes/matter.rs::index_matched_matter_is_continuous",
    ),
    (
        "mean free path -> 0",
        "probes below the resolution of positions",
        "dipole and table tend to the opaque limit, and it is Lambert's law; their difference in proportion to the path",
        "extremes/opaque_limit.rs::short_paths_tend_to_lambert",
    ),
    (
        "1e5 to 1e12 mean free paths per unit",
        "hits between f32 positions",
        "the golden radiance within 1e-3",
        "images/lights.rs::matter_of_any_density_has_its_radiance",
    ),
    (
        "e^(sigma r) e^(-sigma d)",
        "overflow times 0",
        "exponents are combined: exact totals with the rate of another channel, n .4 to 9",
        "images/lights.rs::uniform_light_leaves_matter_of_any_index",
    ),
    (
        "largest random number",
        "ln 0, infinite radius",
        "numbers stay below 1",
        "physics/random.rs::units_are_below_one",
    ),
    (
        "sigma_tr = 0 (spectralon)",
        "no exponential to draw from",
        "the heavy-tailed sampler inverts its distribution",
        "physics/profile.rs::sampler_inverts_its_distribution",
    ),
    (
        "alpha' = 1",
        "sigma_tr = 0, energy lost or made",
        "F + Lo = 1 within .2 %",
        "images/closed_forms.rs::white_furnace_closes",
    ),
    (
        "camera in the tangent plane, lamp in the surface, lamp in the eye, vanishing and cancelling normals, random winding",
        "0/0 in Jacobian and cosines",
        "finite, no sample left out",
        "images/lights.rs::unlikely_places_stay_finite",
    ),
    (
        "silhouettes up to .2 degrees",
        "infinite variance of the camera ray",
        "within 4 standard errors of the closed form, weights bounded",
        "kernels/sphere.rs::uniform_light_shows_a_flat_disk",
    ),
    (
        "far camera",
        "cancellation in c - x",
        "at 1e5 radii what an orthographic camera sees",
        "images/lights.rs::a_very_far_eye_sees_what_an_orthographic_one_does",
    ),
    (
        "scene 1e-3 to 1e3 times as large, moved by 1e5 units",
        "lost digits of positions",
        "the same image to 1e-4",
        "images/closed_forms.rs::lit_pixels_do_not_depend_on_size_or_place",
    ),
    (
        "grazing light, down to 1e-3 degrees",
        "0/0 in Fresnel",
        "the closed form to 1e-3",
        "extremes/matter.rs::grazing_light_enters_by_its_cosine",
    ),
    (
        "zero-area triangles",
        "normals that are not numbers",
        "dropped, counted, the rest as before",
        "scene/geometry.rs::zero_area_triangles_leave_no_trace",
    ),
    (
        "slivers of 1e-6 their length",
        "normals and barycentrics without digits",
        "the image is that of the whole faces",
        "extremes/size.rs::slivers_change_nothing",
    ),
    (
        "mirrored and non-uniformly scaled nodes",
        "normals turned inward",
        "normals and windings stay outward",
        "scene/geometry.rs::mirrored_nodes_stay_outward",
    ),
    ("a ball inside out", "no light enters", "the same image", "images/lights.rs::a_ball_inside_out_looks_the_same"),
    (
        "more triangles than a binding holds",
        "a driver's fault",
        "refused, with the number that fits",
        "extremes/size.rs::too_many_triangles_are_refused_by_number",
    ),
    (
        "triangles that span ten decades, or coincide by the thousand",
        "a tree without bound",
        "a tree within its stack",
        "scene/bvh.rs::sizes_that_span_many_decades",
    ),
    (
        "more hits than a probe keeps",
        "lost light",
        "kept uniformly, reweighted, unbiased",
        "physics/stages.rs::long_hit_lists_are_unbiased",
    ),
    (
        "radiance 1e25 and 1e30, lamps in surfaces",
        "infinities in sums",
        "counted and left out, sums stay finite",
        "images/edge_cases.rs::lamps_beyond_f32_are_named_or_left_out",
    ),
];

/// Of tests that `./x verify-drivers` runs, since they take minutes.
const BY_NAME: &str = "#[ignore = \"./x verify-drivers runs it\"]\n";

#[test]
fn table() {
    let mut text = String::from("| case | danger | what holds | test |\n| --- | --- | --- | --- |\n");
    for (case, danger, holds, test) in ROWS {
        let (file, function) = test.split_once("::").expect("file and function");
        let path = format!("{}/tests/{file}", env!("CARGO_MANIFEST_DIR"));
        let source = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let written = |attribute: &str| source.contains(&format!("#[test]\n{attribute}fn {function}()"));
        assert!(written("") || written(BY_NAME), "{test} is not a test");
        text += &format!("| {case} | {danger} | {holds} | `tests/{test}` |\n");
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/docs/extremes.md");
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(path, &text).expect("the table is written");
    }
    let written = std::fs::read_to_string(path).unwrap_or_default();
    assert_eq!(written, text, "BLESS=1 cargo test --test extremes table");
}
