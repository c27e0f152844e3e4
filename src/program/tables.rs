//! `presets` and `devices`: tables on stdout.

use super::{Failure, print};
use std::process::ExitCode;
use translucent::{
    Device,
    reference::profile::{Dipole, Radial},
    scene,
};

/// Every named material: coefficients as its table has them, mean free path 1/sigma_t' and the total diffuse
/// reflectance of a flat half space under the energy normalisation.
pub fn presets() -> Result<ExitCode, Failure> {
    let mut rows =
        vec![row(["NAME", "SIGMA_S' [1/mm]", "SIGMA_A [1/mm]", "G", "IOR", "MEAN FREE PATH [mm]", "REFLECTANCE"])];
    for preset in scene::presets() {
        let (scattering, absorption) = (preset.sigma_s_prime, preset.sigma_a);
        let path = 1.0 / (scattering + absorption);
        let total = [0, 1, 2].map(|i| Dipole::new(scattering[i], absorption[i], preset.ior).total());
        rows.push(row([
            preset.name,
            &triple(scattering.to_array()),
            &triple(absorption.to_array()),
            &triple(preset.g.to_array()),
            &format!("{}", preset.ior),
            &triple(path.to_array()),
            &total.map(|value| format!("{value:5.3}")).join(" "),
        ]));
    }
    print(&aligned(&rows))?;
    Ok(ExitCode::SUCCESS)
}

/// Every Vulkan device. That none can be used is an answer, not a failure; that there is no loader or driver is one.
pub fn devices() -> Result<ExitCode, Failure> {
    let mut rows = vec![row(["INDEX", "NAME", "KIND", "VULKAN", "DRIVER", "UUID", "LACKS"])];
    for info in Device::list()? {
        let lacks = if info.lacks.is_empty() { "nothing".into() } else { info.lacks.join(", ") };
        let (index, kind) = (info.index.to_string(), info.kind.to_string());
        rows.push(row([&index, &info.name, &kind, &info.api_version, &info.driver, &info.uuid, &lacks]));
    }
    print(&aligned(&rows))?;
    Ok(ExitCode::SUCCESS)
}

pub fn row<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(String::from).into()
}

/// Three numbers with the four digits that the tables have at most.
fn triple(values: [f64; 3]) -> String {
    values.map(|value| format!("{:>8}", significant(value))).join(" ")
}

/// Four significant digits, without an exponent: the smallest coefficient is some 1e-6.
pub fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let digits = (3 - value.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// Columns padded to their widest cell, two spaces apart.
pub fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let widths: Vec<usize> =
        (0..columns).map(|c| rows.iter().map(|row| row[c].chars().count()).max().unwrap_or(0)).collect();
    let mut text = String::new();
    for row in rows {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:width$}")).collect();
        text.push_str(cells.join("  ").trim_end());
        text.push('\n');
    }
    text
}

/// A field of CSV (RFC 4180).
pub fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.into() }
}
