//! Tests run one after another, told in googletest's words; and their results as JUnit and CSV.

use super::{Bench, Context, Dispatch, Expectations, TESTS, Test, Verdict, dump};
use crate::{error::Result, gpu::Device};
use std::{
    fmt::Write,
    path::PathBuf,
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

/// How a test ended, in the words of deqp-runner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Pass,
    Fail,
    /// It could not be carried out: a step of it returned an error.
    Crash,
    Timeout,
    Skip,
    /// It failed as the baseline says.
    ExpectedFail,
    /// It passed although the baseline says that it fails.
    UnexpectedImprovement,
    /// It failed, and is known to do so now and then.
    KnownFlake,
    /// Not reached: a test before it did not end.
    Missing,
}

impl Status {
    /// As result files have it.
    pub fn name(self) -> &'static str {
        match self {
            Status::Pass => "Pass",
            Status::Fail => "Fail",
            Status::Crash => "Crash",
            Status::Timeout => "Timeout",
            Status::Skip => "Skip",
            Status::ExpectedFail => "ExpectedFail",
            Status::UnexpectedImprovement => "UnexpectedImprovement",
            Status::KnownFlake => "KnownFlake",
            Status::Missing => "Missing",
        }
    }

    /// Whether the run as a whole may succeed.
    pub fn is_success(self) -> bool {
        matches!(self, Status::Pass | Status::Skip | Status::ExpectedFail | Status::KnownFlake)
    }
}

/// What became of a test.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub name: &'static str,
    pub status: Status,
    /// None where it did not come to one.
    pub verdict: Option<Verdict>,
    /// The verdict in one line, or why there is none.
    pub message: String,
    pub seconds: f64,
}

/// How tests run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Of the inputs of functions, one in so many is tried.
    pub fraction: u32,
    /// How often each dispatch runs; it must leave the same bytes.
    pub repeat: u32,
    /// Most time of one test. One that takes longer is the last: what hangs in a driver cannot be ended.
    pub timeout: Duration,
    pub expectations: Expectations,
    /// SPIR-V in place of what the build made, by stem.
    pub modules: Vec<(&'static str, Vec<u8>)>,
    /// The folder in which [`dump::write`] keeps the dispatches of tests that fail.
    pub dump: Option<PathBuf>,
    /// It also keeps those of tests that pass.
    pub dump_all: bool,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            fraction: 1,
            repeat: 1,
            timeout: Duration::from_secs(60),
            expectations: Expectations::default(),
            modules: vec![],
            dump: None,
            dump_all: false,
        }
    }
}

/// The tests that a googletest filter names: patterns with `*` and `?` between colons, after a minus those that are left
/// out.
pub fn select(filter: &str) -> Vec<&'static Test> {
    let (wanted, unwanted) = filter.split_once('-').unwrap_or((filter, ""));
    let wanted = if wanted.is_empty() { "*" } else { wanted };
    let any =
        |patterns: &str, name: &str| patterns.split(':').any(|pattern| matches(pattern.as_bytes(), name.as_bytes()));
    TESTS.iter().filter(|test| any(wanted, test.name) && !any(unwanted, test.name)).collect()
}

/// Whether a pattern with `*` and `?` is a name's.
fn matches(pattern: &[u8], name: &[u8]) -> bool {
    match (pattern, name) {
        ([], []) => true,
        ([b'*', rest @ ..], _) => matches(rest, name) || !name.is_empty() && matches(pattern, &name[1..]),
        ([b'?', rest @ ..], [_, after @ ..]) => matches(rest, after),
        ([letter, rest @ ..], [first, after @ ..]) => letter == first && matches(rest, after),
        _ => false,
    }
}

fn split(test: &Test) -> (&'static str, &'static str) {
    test.name.split_once('.').unwrap_or((test.name, ""))
}

fn suites(tests: &[&'static Test]) -> usize {
    tests.chunk_by(|a, b| split(a).0 == split(b).0).count()
}

/// As `--gtest_list_tests` prints them.
pub fn list(tests: &[&'static Test]) -> String {
    let mut text = String::new();
    for suite in tests.chunk_by(|a, b| split(a).0 == split(b).0) {
        let _ = writeln!(text, "{}.", split(suite[0]).0);
        suite.iter().for_each(|test| text.push_str(&format!("  {}\n", split(test).1)));
    }
    text
}

/// Runs the tests on a device, each after the other, and tells `print` line by line.
///
/// # Errors
/// [`crate::Error::Vulkan`], [`crate::Error::Memory`] if nothing can run at all; [`crate::Error::File`],
/// [`crate::Error::Setting`] if a dump cannot be written.
pub fn run(
    device: &Device,
    tests: &[&'static Test],
    options: &Options,
    print: &mut dyn FnMut(&str),
) -> Result<Vec<Outcome>> {
    let skipped = |test: &Test| options.expectations.skips(test.name);
    let running: Vec<&'static Test> = tests.iter().copied().filter(|test| !skipped(test)).collect();
    let results = start(device, running, options)?;
    let begin = Instant::now();
    let mut outcomes: Vec<Outcome> = vec![];
    let mut hung = false;
    print(&format!("[==========] Running {} tests from {} test suites.", tests.len(), suites(tests)));
    for test in tests {
        let without = |status, message: &str| Outcome {
            name: test.name,
            status,
            verdict: None,
            message: message.into(),
            seconds: 0.0,
        };
        let start = Instant::now();
        let mut dispatches = None;
        let mut outcome = match () {
            () if hung => without(Status::Missing, "a test before did not end"),
            () => {
                print(&format!("[ RUN      ] {}", test.name));
                match skipped(test) {
                    true => without(Status::Skip, "left out by the expectations"),
                    false => match results.recv_timeout(options.timeout) {
                        Ok((outcome, ran)) => {
                            dispatches = ran;
                            outcome
                        }
                        Err(error) => {
                            hung = true;
                            match error {
                                mpsc::RecvTimeoutError::Timeout => without(Status::Timeout, "ran out of time"),
                                mpsc::RecvTimeoutError::Disconnected => without(Status::Crash, "panicked"),
                            }
                        }
                    },
                }
            }
        };
        outcome.seconds = start.elapsed().as_secs_f64();
        outcome.status = options.expectations.judge(test.name, outcome.status);
        if outcome.status != Status::Missing {
            // Brackets are the protocol's.
            let message = outcome.message.replace('[', "(").replace(']', ")");
            print(&format!("{}: {message}", outcome.status.name()));
            let word = match outcome.status {
                Status::Pass | Status::UnexpectedImprovement => "[       OK ]",
                Status::Skip => "[  SKIPPED ]",
                _ => "[  FAILED  ]",
            };
            print(&format!("{word} {} ({:.0} ms)", test.name, outcome.seconds * 1e3));
        }
        if let (Some(folder), Some(dispatches)) = (&options.dump, dispatches) {
            dump::write(folder, device, &outcome, &dispatches)?;
        }
        outcomes.push(outcome);
    }
    let time = begin.elapsed().as_secs_f64() * 1e3;
    print(&format!("[==========] {} tests from {} test suites ran. ({time:.0} ms total)", tests.len(), suites(tests)));
    let passed = outcomes.iter().filter(|outcome| outcome.status == Status::Pass).count();
    print(&format!("[  PASSED  ] {passed} tests."));
    summary(&outcomes).lines().for_each(print);
    Ok(outcomes)
}

/// What a reader looks for at the end: tests that did not end as expected.
fn summary(outcomes: &[Outcome]) -> String {
    let unexpected: Vec<&Outcome> = outcomes.iter().filter(|outcome| !outcome.status.is_success()).collect();
    let mut text = String::new();
    if !unexpected.is_empty() {
        let _ = writeln!(text, "Unexpected results:");
    }
    unexpected.iter().for_each(|outcome| text.push_str(&format!("  {},{}\n", outcome.name, outcome.status.name())));
    text
}

/// What a test came to, and its dispatches if they are to be kept.
type Ran = (Outcome, Option<Vec<Dispatch>>);

/// Starts the thread on which tests run; it ends after the last of them.
fn start(device: &Device, tests: Vec<&'static Test>, options: &Options) -> Result<mpsc::Receiver<Ran>> {
    let mut bench = Bench::new(device)?;
    bench.repeat = options.repeat;
    options.modules.iter().for_each(|(stem, spirv)| bench.replace(stem, spirv.clone()));
    let fraction = options.fraction;
    let (dump, dump_all) = (options.dump.is_some(), options.dump_all);
    // The next test starts when the last one's outcome was taken.
    let (send, receive) = mpsc::sync_channel(0);
    thread::spawn(move || {
        let mut context = Context { fraction, ..Context::new(&mut bench) };
        for test in tests {
            context.bench.record = dump.then(Vec::new);
            let result = test.run(&mut context);
            let (status, message) = match &result {
                Ok(verdict) if verdict.passed() => (Status::Pass, verdict.to_string()),
                Ok(verdict) => (Status::Fail, verdict.to_string()),
                Err(error) => (Status::Crash, error.to_string()),
            };
            let outcome = Outcome { name: test.name, status, verdict: result.ok(), message, seconds: 0.0 };
            let dispatches = context.bench.record.take().filter(|_| dump_all || status != Status::Pass);
            if send.send((outcome, dispatches)).is_err() {
                return;
            }
        }
    });
    Ok(receive)
}

/// Text within an XML attribute or element.
fn escaped(text: &str) -> String {
    text.chars()
        .map(|c| match c {
            '&' => "&amp;".into(),
            '<' => "&lt;".into(),
            '>' => "&gt;".into(),
            '"' => "&quot;".into(),
            c if c.is_control() => ' '.into(),
            c => String::from(c),
        })
        .collect()
}

/// The outcomes as JUnit's XML, with what `properties` name about the run.
pub fn junit(outcomes: &[Outcome], properties: &[(&str, String)]) -> String {
    let count = |of: fn(&Outcome) -> bool| outcomes.iter().filter(|outcome| of(outcome)).count();
    let failures = count(|outcome| !outcome.status.is_success());
    let skipped = count(|outcome| outcome.status == Status::Skip);
    let seconds: f64 = outcomes.iter().map(|outcome| outcome.seconds).sum();
    let counts = format!("tests=\"{}\" failures=\"{failures}\" errors=\"0\" skipped=\"{skipped}\"", outcomes.len());
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let _ = writeln!(text, "<testsuites name=\"translucent verify\" {counts} time=\"{seconds:.3}\">");
    let _ = writeln!(text, "  <testsuite name=\"verify\" {counts} time=\"{seconds:.3}\">\n    <properties>");
    for (name, value) in properties {
        let _ = writeln!(text, "      <property name=\"{name}\" value=\"{}\"/>", escaped(value));
    }
    text.push_str("    </properties>\n");
    for outcome in outcomes {
        let (suite, case) = outcome.name.split_once('.').unwrap_or((outcome.name, ""));
        let head = format!("<testcase classname=\"{suite}\" name=\"{case}\" time=\"{:.3}\">", outcome.seconds);
        let message = escaped(&outcome.message);
        let body = match outcome.status {
            Status::Skip => format!("<skipped message=\"{message}\"/>"),
            status if status.is_success() => format!("<system-out>{message}</system-out>"),
            status => format!("<failure type=\"{}\" message=\"{message}\"/>", status.name()),
        };
        let _ = writeln!(text, "    {head}{body}</testcase>");
    }
    text.push_str("  </testsuite>\n</testsuites>\n");
    text
}

/// Columns of [`csv`].
const COLUMNS: &str = "test,status,seconds,values,bound,worst_ulp,worst_relative,found,expected,input,wrong,nan,\
                       infinity,denormal,finite,first,message";

/// The outcomes as a table.
pub fn csv(outcomes: &[Outcome]) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\"").replace(['\n', '\r'], " "));
    let mut text = format!("{COLUMNS}\n");
    for outcome in outcomes {
        let _ = write!(text, "{},{},{:.3}", outcome.name, outcome.status.name(), outcome.seconds);
        match &outcome.verdict {
            None => text.push_str(&",".repeat(13)),
            Some(verdict) => {
                let _ = write!(text, ",{},{:e}", verdict.values, verdict.bound.relative());
                match &verdict.worst {
                    None => text.push_str(",,,,,"),
                    Some(worst) => {
                        let (ulp, relative, found, expected) = (worst.ulp, worst.relative, worst.found, worst.expected);
                        let _ = write!(text, ",{ulp:.3},{relative:e},{found:e},{expected:e},{}", quoted(&worst.input));
                    }
                }
                let census = &verdict.census;
                let first = census.first.map(|first| first.to_string()).unwrap_or_default();
                let classes = [census.total(), census.nan, census.infinity, census.denormal, census.finite];
                classes.iter().for_each(|class| text.push_str(&format!(",{class}")));
                let _ = write!(text, ",{first}");
            }
        }
        let _ = writeln!(text, ",{}", quoted(&outcome.message));
    }
    text
}
