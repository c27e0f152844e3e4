//! What is known of a driver, in the files of deqp-runner: which tests fail, may fail, or must not run.

use super::protocol::Status;
use crate::error::{Error, Result};
use regex_lite::Regex;
use std::path::Path;

/// Expectations of one driver.
#[derive(Clone, Debug, Default)]
pub struct Expectations {
    /// Tests that end so.
    fails: Vec<(String, Status)>,
    flakes: Vec<Regex>,
    skips: Vec<Regex>,
}

impl Expectations {
    /// Adds a baseline: lines such as `kernel.sample,Fail`, with a test's name and Fail, Crash or Timeout.
    ///
    /// # Errors
    /// [`Error::File`] for a file that cannot be read, [`Error::Scene`] that names the line.
    pub fn add_baseline(&mut self, file: &Path) -> Result<()> {
        for (number, line) in lines(file)? {
            let known = line.split_once(',').and_then(|(name, status)| {
                let of = [Status::Fail, Status::Crash, Status::Timeout];
                let status = of.into_iter().find(|known| known.name() == status.trim())?;
                Some((name.trim().to_string(), status))
            });
            let problem = || Error::scene(file, number, "is not a test's name, a comma and Fail, Crash or Timeout");
            self.fails.push(known.ok_or_else(problem)?);
        }
        Ok(())
    }

    /// Adds regular expressions of tests whose failure says nothing; each may match any part of a name.
    ///
    /// # Errors
    /// As [`Expectations::add_baseline`].
    pub fn add_flakes(&mut self, file: &Path) -> Result<()> {
        self.flakes.extend(expressions(file)?);
        Ok(())
    }

    /// Adds regular expressions of tests that must not run; each may match any part of a name.
    ///
    /// # Errors
    /// As [`Expectations::add_baseline`].
    pub fn add_skips(&mut self, file: &Path) -> Result<()> {
        self.skips.extend(expressions(file)?);
        Ok(())
    }

    /// Whether a test must not run.
    pub fn skips(&self, name: &str) -> bool {
        self.skips.iter().any(|skip| skip.is_match(name))
    }

    /// What the end of a test means.
    pub fn judge(&self, name: &str, status: Status) -> Status {
        let fails = matches!(status, Status::Fail | Status::Crash | Status::Timeout);
        match self.fails.iter().find(|(known, _)| known == name) {
            Some((_, known)) if *known == status => Status::ExpectedFail,
            Some(_) if status == Status::Pass => Status::UnexpectedImprovement,
            _ if fails && self.flakes.iter().any(|flake| flake.is_match(name)) => Status::KnownFlake,
            _ => status,
        }
    }
}

/// Lines that say something, and where they stand.
fn lines(file: &Path) -> Result<Vec<(String, String)>> {
    let text = std::fs::read_to_string(file).map_err(|error| Error::file(file, error))?;
    let numbered = text.lines().enumerate().map(|(i, line)| (format!("line {}", i + 1), line.trim().to_string()));
    Ok(numbered.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).collect())
}

fn expressions(file: &Path) -> Result<Vec<Regex>> {
    let compile = |(number, line): (String, String)| {
        Regex::new(&line).map_err(|error| Error::scene(file, number, error.to_string()))
    };
    lines(file)?.into_iter().map(compile).collect()
}
