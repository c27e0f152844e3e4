//! What `render --profile` writes and prints.

use super::{
    Failure,
    tables::{aligned, quoted, row},
};
use std::{fmt::Write, path::PathBuf};
use translucent::{Device, bench::about, image::write_whole, render::spirv_hash, timeline::Timeline};

/// Writes each file whole or not at all: a trace, or a table where the name ends in .csv.
pub fn write(timeline: &Timeline, device: &Device, files: &[PathBuf]) -> Result<(), Failure> {
    let about = about(device);
    for file in files {
        let table = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
        let text = if table { csv(timeline, device) } else { timeline.trace(&about) };
        write_whole(file, text.as_bytes())?;
    }
    Ok(())
}

/// One row for each kernel. Columns are only ever added, at the end.
fn csv(timeline: &Timeline, device: &Device) -> String {
    let mut text = String::from("kernel,count,total_ms,mean_ms,min_ms,max_ms,share,device,driver,spirv_hash\n");
    let info = device.info();
    let made = [&info.name, &info.driver, &spirv_hash()].map(|word| quoted(word)).join(",");
    for times in timeline.kernels() {
        let numbers = [times.total, times.mean(), times.min, times.max].map(|ns| (ns * 1e-6).to_string()).join(",");
        // Text that cannot be written to a string does not exist.
        let _ = writeln!(text, "{},{},{numbers},{},{made}", times.kernel, times.count, times.share);
    }
    text
}

/// For reading: what each kernel took, the most first, and what the host did meanwhile.
pub fn table(timeline: &Timeline) -> String {
    let mut kernels = timeline.kernels();
    if kernels.is_empty() {
        return "no kernel was timed: the device has no timestamps\n".into();
    }
    kernels.sort_by(|a, b| b.total.total_cmp(&a.total));
    let ms = |ns: f64| format!("{:.3}", ns * 1e-6);
    let mut rows = vec![row(["KERNEL", "LAUNCHES", "TOTAL [ms]", "SHARE", "MEAN [ms]", "MIN [ms]", "MAX [ms]"])];
    for times in &kernels {
        rows.push(row([
            times.kernel,
            &times.count.to_string(),
            &ms(times.total),
            &format!("{:.1} %", 100.0 * times.share),
            &ms(times.mean()),
            &ms(times.min),
            &ms(times.max),
        ]));
    }
    let total: f64 = kernels.iter().map(|times| times.total).sum();
    let launches: u64 = kernels.iter().map(|times| times.count).sum();
    rows.push(row(["all", &launches.to_string(), &ms(total), "", "", "", ""]));
    aligned(&rows)
}
