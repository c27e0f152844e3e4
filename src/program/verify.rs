//! `verify`: every kernel and function against its twin, in the words of googletest.

use super::{Failure, print};
use std::{path::PathBuf, process::ExitCode, time::Duration};
use translucent::{
    Device, DeviceOptions,
    image::{check_writable, write_whole},
    verify::{Expectations, compiler, protocol, spirv_hash},
};

#[derive(clap::Args)]
pub struct Verify {
    /// List the tests and run none.
    #[arg(long = "gtest_list_tests")]
    list: bool,
    /// Tests to run: patterns with * and ?, separated by colons; after a minus those that are left out.
    #[arg(long = "gtest_filter", value_name = "PATTERN", default_value = "*", allow_hyphen_values = true)]
    filter: String,
    /// Vulkan device by index, part of the name, or UUID (see `devices`); without it the best.
    #[arg(long, value_name = "INDEX|NAME|UUID")]
    device: Option<String>,
    /// Try one in N of the inputs of each function.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    fraction: u32,
    /// Run each dispatch N times and compare what it leaves: other bytes are a race.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Most seconds of one test; one that takes longer fails and ends the run.
    #[arg(long, value_name = "S", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..))]
    timeout: u64,
    /// Tests that are known to fail: lines such as `kernel.sample,Fail`.
    #[arg(long, value_name = "FILE")]
    baseline: Vec<PathBuf>,
    /// Tests that may fail: a regular expression a line.
    #[arg(long, value_name = "FILE")]
    flakes: Vec<PathBuf>,
    /// Tests that must not run: a regular expression a line.
    #[arg(long, value_name = "FILE")]
    skips: Vec<PathBuf>,
    /// Write the results as JUnit's XML.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write the results as a table.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

impl Verify {
    pub fn run(self) -> Result<ExitCode, Failure> {
        let tests = protocol::select(&self.filter);
        if self.list {
            print(&protocol::list(&tests))?;
            return Ok(ExitCode::SUCCESS);
        }
        if tests.is_empty() {
            return Err(Failure::input(format!("--gtest_filter: no test is called {}", self.filter)));
        }
        let expectations = self.expectations().map_err(Failure::while_reading)?;
        for file in self.junit.iter().chain(&self.csv) {
            check_writable(file)?;
        }
        let device = Device::open(&DeviceOptions { device: self.device.clone(), ..DeviceOptions::default() })?;
        let info = device.info();
        let properties = [
            ("device", info.name.clone()),
            ("driver", info.driver.clone()),
            ("version", env!("CARGO_PKG_VERSION").to_string()),
            ("spirvHash", spirv_hash()),
            ("compiler", compiler()),
        ];
        // Not on stdout, which whoever drives googletest reads.
        properties.iter().for_each(|(name, value)| eprintln!("{name}: {value}"));
        let options = protocol::Options {
            fraction: self.fraction,
            repeat: self.repeat,
            timeout: Duration::from_secs(self.timeout),
            expectations,
            modules: vec![],
        };
        let mut unwritten = None;
        let outcomes = protocol::run(&device, &tests, &options, &mut |line| {
            unwritten = unwritten.take().or(print(&format!("{line}\n")).err());
        })?;
        if let Some(failure) = unwritten {
            return Err(failure);
        }
        if let Some(file) = &self.junit {
            write_whole(file, protocol::junit(&outcomes, &properties).as_bytes())?;
        }
        if let Some(file) = &self.csv {
            write_whole(file, protocol::csv(&outcomes).as_bytes())?;
        }
        let good = outcomes.iter().all(|outcome| outcome.status.is_success());
        Ok(ExitCode::from(u8::from(!good)))
    }

    fn expectations(&self) -> translucent::Result<Expectations> {
        let mut expectations = Expectations::default();
        self.baseline.iter().try_for_each(|file| expectations.add_baseline(file))?;
        self.flakes.iter().try_for_each(|file| expectations.add_flakes(file))?;
        self.skips.iter().try_for_each(|file| expectations.add_skips(file))?;
        Ok(expectations)
    }
}
