//! `verify`: googletest's words, expectations, result files, and a fault that it must see.

use crate::{Folder, stderr};
use std::fs;
use translucent::{
    Device, DeviceOptions,
    verify::{
        Bench, Expectations, TESTS,
        protocol::{self, Status},
    },
};

#[test]
fn tests_are_listed_as_googletest_does() {
    let folder = Folder::new("verify-list");
    let list = folder.done("verify --gtest_list_tests");
    let mut names = vec![];
    let mut suite = "";
    for line in list.lines() {
        match line.strip_prefix("  ") {
            Some(case) => names.push(format!("{suite}{case}")),
            None => suite = line,
        }
    }
    assert!(names.iter().eq(TESTS.iter().map(|test| test.name)), "{list}");
    let some = folder.done("verify --gtest_list_tests --gtest_filter=random.*:math.e??:-*.hash:random.s*");
    assert_eq!(some, "random.\n  key\n  point\nmath.\n  exp\n");
}

#[test]
fn results_are_told_and_written() {
    let folder = Folder::new("verify-results");
    let output =
        folder.done("verify --gtest_filter=random.*:math.exp --junit r.xml --csv r.csv --fraction 8 --repeat 2");
    for name in ["random.hash", "random.point", "math.exp"] {
        assert!(output.contains(&format!("[ RUN      ] {name}\n")), "{output}");
        assert!(output.contains(&format!("[       OK ] {name} (")), "{output}");
    }
    assert!(output.contains("[==========] Running 6 tests from 2 test suites.\n"), "{output}");
    assert!(output.contains("[  PASSED  ] 6 tests.\n") && !output.contains("FAILED"), "{output}");

    let csv = fs::read_to_string(folder.join("r.csv")).expect("the table is there");
    let rows: Vec<&str> = csv.lines().collect();
    let columns = rows[0].split(',').count();
    assert_eq!((rows.len(), columns), (7, 17));
    for row in &rows[1..] {
        // Commas within quotes do not count.
        let plain: String = row.split('"').step_by(2).collect();
        assert_eq!(plain.split(',').count(), columns, "{row}");
    }
    let junit = fs::read_to_string(folder.join("r.xml")).expect("the file is there");
    assert_well_formed(&junit);
    assert_eq!(junit.matches("<testcase ").count(), 6);
    assert!(junit.contains("failures=\"0\"") && junit.contains("<property name=\"spirvHash\""), "{junit}");
}

/// Every element is closed in order.
fn assert_well_formed(xml: &str) {
    let mut open: Vec<&str> = vec![];
    for tag in xml.split('<').skip(1) {
        let (tag, text) = tag.split_once('>').expect("a tag ends");
        assert!(!text.contains('>') && tag.matches('"').count() % 2 == 0, "{tag}");
        match (tag.strip_prefix('/'), tag.strip_suffix(['/', '?'])) {
            (Some(name), _) => assert_eq!(open.pop(), Some(name), "{tag}"),
            (None, Some(_)) => {}
            (None, None) => open.push(tag.split(' ').next().expect("a name")),
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn expectations_decide_what_a_run_means() {
    let folder = Folder::new("verify-expectations");
    fs::write(folder.join("skips.txt"), "# slow\nrandom\\.s.*\n").expect("writable");
    let output = folder.done("verify --gtest_filter=random.* --skips skips.txt --fraction 64");
    assert!(output.contains("[  SKIPPED ] random.scramble") && output.contains("[       OK ] random.hash"), "{output}");

    // What passes although it should fail is news.
    fs::write(folder.join("fails.txt"), "random.hash,Fail\n").expect("writable");
    let output = folder.run("verify --gtest_filter=random.hash --baseline fails.txt");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(String::from_utf8_lossy(&output.stdout).contains("random.hash,UnexpectedImprovement"));

    fs::write(folder.join("wrong.txt"), "\nrandom.hash Fail\n").expect("writable");
    for (words, problem) in [
        ("--baseline wrong.txt", "line 2"),
        ("--skips missing.txt", "missing.txt"),
        ("--gtest_filter=nothing.*", "nothing.*"),
        ("--fraction 0", "--fraction"),
        ("--csv no/r.csv", "no"),
    ] {
        let output = folder.run(&format!("verify {words}"));
        assert_eq!(output.status.code(), Some(2), "{words}: {}", stderr(&output));
        assert!(stderr(&output).contains(problem), "{words}: {}", stderr(&output));
    }
}

/// The SPIR-V of the shared functions with one constant of the hash changed.
pub fn faulty(bench: &Bench) -> Vec<u8> {
    let mut spirv = bench.module("functions").expect("it is built in").to_vec();
    let constant = 0x21f0_aaadu32.to_le_bytes();
    let place = spirv.windows(4).position(|word| word == constant).expect("the hash has it");
    spirv[place] ^= 2;
    spirv
}

#[test]
fn a_fault_is_named_counted_and_expected_if_known() {
    let device = Device::open(&DeviceOptions::default()).expect("a Vulkan device");
    let modules = vec![("functions", faulty(&Bench::new(&device).expect("bench")))];
    let tests = protocol::select("random.hash:random.scramble:random.key");
    let run = |expectations| {
        let options = protocol::Options { modules: modules.clone(), expectations, ..protocol::Options::default() };
        let mut lines = vec![];
        let outcomes = protocol::run(&device, &tests, &options, &mut |line| lines.push(line.to_string()));
        (outcomes.expect("it runs"), lines)
    };
    let statuses = |outcomes: &[protocol::Outcome]| outcomes.iter().map(|outcome| outcome.status).collect::<Vec<_>>();
    let (outcomes, lines) = run(Expectations::default());
    assert_eq!(statuses(&outcomes), [Status::Fail, Status::Pass, Status::Fail]);
    assert!(lines.iter().any(|line| line.starts_with("[  FAILED  ] random.hash (")), "{lines:?}");
    let census = outcomes[0].verdict.as_ref().expect("it was judged").census;
    assert!(census.first == Some(0) && census.finite > 16_000, "{census:?}");

    let folder = Folder::new("verify-known");
    fs::write(folder.join("fails.txt"), "random.hash,Fail\n").expect("writable");
    fs::write(folder.join("flakes.txt"), "random\\..*\n").expect("writable");
    let mut expectations = Expectations::default();
    expectations.add_baseline(&folder.join("fails.txt")).expect("valid");
    expectations.add_flakes(&folder.join("flakes.txt")).expect("valid");
    let (outcomes, _) = run(expectations);
    assert_eq!(statuses(&outcomes), [Status::ExpectedFail, Status::Pass, Status::KnownFlake]);
    assert!(outcomes.iter().all(|outcome| outcome.status.is_success()));
}

#[test]
fn expectations_that_ship_are_valid() {
    for driver in ["lavapipe", "swiftshader"] {
        let file = |kind: &str| format!("{}/tests/expectations/{driver}-{kind}.txt", env!("CARGO_MANIFEST_DIR"));
        let mut expectations = Expectations::default();
        expectations.add_baseline(file("fails").as_ref()).expect("valid");
        expectations.add_flakes(file("flakes").as_ref()).expect("valid");
        expectations.add_skips(file("skips").as_ref()).expect("valid");
    }
}
