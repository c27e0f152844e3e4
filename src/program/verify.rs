//! `verify`: every kernel and function against its twin, in the words of googletest.

use super::{Failure, print};
use std::{
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};
use translucent::{
    Device, DeviceOptions,
    image::{check_writable, write_whole},
    verify::{Bench, Expectations, compiler, protocol, replay, spirv_hash},
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
    /// Write every dispatch of a test that fails to a folder of its own: SPIR-V, buffers before and after, constants,
    /// device, and a script for Amber.
    #[arg(long, value_name = "DIR")]
    dump: Option<PathBuf>,
    /// With --dump, also those of tests that pass.
    #[arg(long, requires = "dump")]
    dump_all: bool,
    /// Run one dumped dispatch again and compare, bit for bit; no tests. The folder is trusted: its SPIR-V and buffers
    /// go to the driver as they are.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["list", "filter", "fraction", "repeat", "timeout", "baseline",
        "flakes", "skips", "junit", "csv", "dump"])]
    replay: Option<PathBuf>,
}

impl Verify {
    pub fn run(self) -> Result<ExitCode, Failure> {
        if let Some(folder) = &self.replay {
            return self.replay(folder);
        }
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
        if let Some(folder) = &self.dump {
            fs::create_dir_all(folder).map_err(|error| Failure::input(format!("{}: {error}", folder.display())))?;
        }
        let device = self.open()?;
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
            dump: self.dump.clone(),
            dump_all: self.dump_all,
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

    fn open(&self) -> translucent::Result<Device> {
        Device::open(&DeviceOptions { device: self.device.clone(), ..DeviceOptions::default() })
    }

    /// Exit status 0 where the device gives the bits that were recorded, else 1.
    fn replay(&self, folder: &Path) -> Result<ExitCode, Failure> {
        let dispatch = replay::read(folder).map_err(Failure::while_reading)?;
        let device = self.open()?;
        let found = Bench::new(&device)?.replay(&dispatch)?;
        let differences = replay::compare(&found, &dispatch.after);
        let equal = differences.iter().all(|difference| difference.census.total() == 0);
        let info = device.info();
        let mut text = format!("kernel `{}` on {}, {}\n", dispatch.stem, info.name, info.driver);
        differences.iter().for_each(|difference| text.push_str(&format!("{difference}\n")));
        text.push_str(if equal { "as recorded\n" } else { "not as recorded\n" });
        print(&text)?;
        Ok(ExitCode::from(u8::from(!equal)))
    }

    fn expectations(&self) -> translucent::Result<Expectations> {
        let mut expectations = Expectations::default();
        self.baseline.iter().try_for_each(|file| expectations.add_baseline(file))?;
        self.flakes.iter().try_for_each(|file| expectations.add_flakes(file))?;
        self.skips.iter().try_for_each(|file| expectations.add_skips(file))?;
        Ok(expectations)
    }
}
