//! Whether two runs of the same work differ beyond their noise.

use super::{
    MAX_REPEATS, Report, Series,
    statistics::{Estimate, ratio},
};
use crate::{Error, Result};
use serde_json::Value;

/// How two runs compare.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// With this probability at least, runs that do not differ are said not to (0 to 1).
    pub confidence: f64,
    /// Each kernel, and the host's times.
    pub differences: Vec<Difference>,
}

/// How a kernel, or what the host does, compares.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    pub name: String,
    /// Median times (ms); none where that run has no such kernel.
    pub medians: [Option<f64>; 2],
    /// Time of the second run over the first's; none where one of them lacks it.
    pub ratio: Option<Estimate>,
    /// By more than noise and the least that counts.
    pub differs: bool,
}

impl Comparison {
    /// Those that differ.
    pub fn differing(&self) -> impl Iterator<Item = &Difference> {
        self.differences.iter().filter(|difference| difference.differs)
    }
}

/// Compares each kernel's times and the host's by [`ratio`], every one at the confidence that makes all of them
/// together as sure as `confidence` (C. E. Bonferroni). One differs if its interval leaves out every ratio from 1 / (1
/// + `least`) to 1 + `least`, or if one run alone has it; `least` = 0 counts every difference.
///
/// # Errors
/// [`Error::Setting`] if the work is not the same, with what is not, or a series has too few repeats to tell anything,
/// or more than [`MAX_REPEATS`].
pub fn compare(a: &Report, b: &Report, confidence: f64, least: f64) -> Result<Comparison> {
    let mut unlike = Vec::new();
    differences("", &a.work, &b.work, &mut unlike);
    if !unlike.is_empty() {
        return Err(Error::setting("compare", format!("the work is not the same: {}", unlike.join("; "))));
    }
    let all = |report: &Report| -> Vec<Series> { report.kernels.iter().chain(&report.host).cloned().collect() };
    let (first, second) = (all(a), all(b));
    let find = |list: &[Series], name: &str| list.iter().find(|series| series.name == name).cloned();
    let only_second = second.iter().filter(|series| find(&first, &series.name).is_none());
    let names: Vec<&str> = first.iter().chain(only_second).map(|series| series.name.as_str()).collect();
    if let Some(long) = first.iter().chain(&second).find(|series| series.times.len() > MAX_REPEATS as usize) {
        let problem = format!("{}: more than {MAX_REPEATS} repeats are not compared", long.name);
        return Err(Error::setting("compare", problem));
    }
    let each = 1.0 - (1.0 - confidence) / names.len().max(1) as f64;
    let judge = |name: &str| {
        let pair = [find(&first, name), find(&second, name)];
        let medians = pair.each_ref().map(|series| Some(series.as_ref()?.median()?.value));
        let [Some(a), Some(b)] = pair else {
            return Ok(Difference { name: name.into(), medians, ratio: None, differs: true });
        };
        let too_few = || {
            let problem = format!(
                "{name}: {} and {} repeats cannot tell {} series apart at {}; have more repeats",
                a.times.len(),
                b.times.len(),
                names.len(),
                confidence
            );
            Error::setting("compare", problem)
        };
        let ratio = ratio(&a.times, &b.times, each).ok_or_else(too_few)?;
        let differs = ratio.low > 1.0 + least || ratio.high < 1.0 / (1.0 + least);
        Ok(Difference { name: name.into(), medians, ratio: Some(ratio), differs })
    };
    Ok(Comparison { confidence, differences: names.iter().map(|name| judge(name)).collect::<Result<_>>()? })
}

/// Where two JSON values differ: path and both values.
fn differences(path: &str, a: &Value, b: &Value, found: &mut Vec<String>) {
    match (a, b) {
        (Value::Object(first), Value::Object(second)) => {
            let names = first.keys().chain(second.keys().filter(|name| !first.contains_key(*name)));
            for name in names {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                differences(&path, &a[name], &b[name], found);
            }
        }
        _ if a == b => {}
        _ => found.push(format!("{path} is {a} in the first and {b} in the second")),
    }
}
