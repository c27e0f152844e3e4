//! `verify --dump` and `--replay`.

use crate::{Folder, amber, stderr, verify::faulty};
use std::{fs, path::Path, process::Output};
use translucent::{
    Device, DeviceOptions,
    shared::Slot,
    verify::{Bench, protocol},
};

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn words(file: &Path) -> Vec<u32> {
    let bytes = fs::read(file).expect("the file is there");
    assert_eq!(bytes.len() % 4, 0);
    bytes.chunks(4).map(|word| u32::from_le_bytes(word.try_into().expect("four"))).collect()
}

fn json(file: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(file).expect("the file is there")).expect("JSON")
}

#[test]
fn what_fails_is_dumped_and_replayed() {
    let folder = Folder::new("dump");
    let device = Device::open(&DeviceOptions::default()).expect("a Vulkan device");
    let spirv = faulty(&Bench::new(&device).expect("bench"));
    let options = protocol::Options {
        fraction: 16,
        modules: vec![("functions", spirv.clone())],
        dump: Some(folder.join("dump")),
        ..protocol::Options::default()
    };
    let tests = protocol::select("random.hash:random.scramble");
    protocol::run(&device, &tests, &options, &mut |_| {}).expect("it runs");
    let names: Vec<_> = fs::read_dir(folder.join("dump")).expect("it was made").flatten().collect();
    assert_eq!(names.iter().map(|entry| entry.file_name()).collect::<Vec<_>>(), ["random.hash"]);

    let case = folder.join("dump/random.hash/000-functions");
    let about = json(&case.join("dispatch.json"));
    assert_eq!(about["stem"], "functions");
    assert_eq!(about["status"], "Fail");
    assert!(about["verdict"].as_str().expect("text").contains("bit for bit; worst "), "{about}");
    assert_eq!(json(&case.join("device.json"))["name"], device.info().name.as_str());
    the_script_says_the_same(&case, &spirv);

    let replay = || folder.run("verify --replay dump/random.hash/000-functions");
    let output = replay();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stdout(&output).ends_with("\nas recorded\n"), "{}", stdout(&output));

    // Another value recorded: a number that is none, in the fourth word.
    let after = case.join("batch_sums.after.bin");
    let recorded = fs::read(&after).expect("it is there");
    let mut other = recorded.clone();
    other[12..16].copy_from_slice(&f32::NAN.to_bits().to_le_bytes());
    fs::write(&after, &other).expect("writable");
    let output = replay();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let text = stdout(&output);
    let line = text.lines().find(|line| line.starts_with("batch_sums: ")).expect("it is named");
    assert!(line.contains("different 1 (NaN 1, infinity 0, denormal 0, finite 0; first 3)"), "{line}");
    assert_eq!(text.matches("different 0").count(), about["slots"].as_array().expect("slots").len() - 1, "{text}");
    fs::write(&after, &recorded).expect("writable");

    // What cannot be read is named.
    for (name, content) in [
        ("batch_sums.after.bin", recorded[4..].to_vec()),
        ("kernel.spv", spirv[..spirv.len() - 4].to_vec()),
        ("push_constants.bin", vec![0; 3]),
        ("specialization.json", b"[]".to_vec()),
        ("dispatch.json", b"{".to_vec()),
    ] {
        let file = case.join(name);
        let kept = fs::read(&file).expect("it is there");
        fs::write(&file, content).expect("writable");
        let output = replay();
        assert_eq!(output.status.code(), Some(2), "{name}: {}", stderr(&output));
        assert!(stderr(&output).contains(name), "{name}: {}", stderr(&output));
        fs::write(&file, kept).expect("writable");
    }
    let output = folder.run("verify --replay nowhere");
    assert!(output.status.code() == Some(2) && stderr(&output).contains("nowhere"), "{}", stderr(&output));
}

/// The script of a dumped dispatch has what its other files have.
fn the_script_says_the_same(case: &Path, spirv: &[u8]) {
    let text = fs::read_to_string(case.join("case.amber")).expect("the script is there");
    let script = amber::parse(&text).unwrap_or_else(|problem| panic!("case.amber: {problem}"));
    assert_eq!(script.spirv, spirv);
    assert_eq!(script.spirv, fs::read(case.join("kernel.spv")).expect("it is there"));
    assert_eq!(script.spirv[..4], 0x0723_0203u32.to_le_bytes());
    assert_eq!(script.buffers[&script.push_constants], words(&case.join("push_constants.bin")));

    let about = json(&case.join("dispatch.json"));
    let slots = about["slots"].as_array().expect("slots");
    for slot in slots {
        let name = slot["name"].as_str().expect("a name");
        let binding = slot["binding"].as_u64().expect("a number") as u32;
        assert_eq!(script.bindings[&binding], name);
        assert_eq!(script.buffers[name], words(&case.join(format!("{name}.before.bin"))));
        assert_eq!(script.buffers[name].len() as u64 * 4, slot["bytes"].as_u64().expect("a number"));
    }
    // Also the slots that hold nothing, which the kernel may mention.
    assert!(script.bindings.len() > slots.len() && script.bindings.len() == Slot::ALL.len(), "{:?}", script.bindings);
    assert_eq!(script.expected, [("batch_sums".to_string(), "batch_sums_after".to_string())]);
    assert_eq!(script.buffers["batch_sums_after"], words(&case.join("batch_sums.after.bin")));

    let constants = json(&case.join("specialization.json"));
    let constant = |entry: &serde_json::Value| (entry["id"].as_u64(), entry["value"].as_u64());
    let constants = constants.as_array().expect("constants").iter().map(constant);
    let specialization = script.specialization.iter().map(|&(id, value)| (Some(id.into()), Some(value.into())));
    assert!(constants.eq(specialization), "{:?}", script.specialization);
    assert_eq!(about["groups"], serde_json::json!(script.groups));
    let pixel_count = script.buffers[&script.push_constants][1];
    assert_eq!(about["invocations"], pixel_count);
    assert_eq!(script.groups, [pixel_count.div_ceil(script.specialization[0].1), 1, 1]);
}

#[test]
fn all_can_be_dumped_and_stdout_is_googletest_s() {
    let folder = Folder::new("dump-all");
    let output = folder.done("verify --gtest_filter=math.exp --fraction 64 --dump all --dump-all");
    assert!(output.lines().all(|line| line.starts_with('[') || line.starts_with("Pass: ")), "{output}");
    // The test asks for nearness, so a script must not ask for bits.
    let text = fs::read_to_string(folder.join("all/math.exp/000-functions/case.amber")).expect("the script is there");
    let script = amber::parse(&text).unwrap_or_else(|problem| panic!("case.amber: {problem}"));
    assert!(script.expected.is_empty() && text.contains("# EXPECT batch_sums EQ_BUFFER batch_sums_after\n"), "{text}");
    folder.done("verify --replay all/math.exp/000-functions");

    // Only what fails is dumped otherwise.
    folder.done("verify --gtest_filter=math.exp --fraction 64 --dump none");
    assert_eq!(fs::read_dir(folder.join("none")).expect("it was made").count(), 0);
    for (words, problem) in [
        ("--dump-all", "--dump"),
        ("--replay all/math.exp/000-functions --dump all", "--dump"),
        ("--dump all/math.exp/000-functions/case.amber", "case.amber"),
    ] {
        let output = folder.run(&format!("verify {words}"));
        assert_eq!(output.status.code(), Some(2), "{words}: {}", stderr(&output));
        assert!(stderr(&output).contains(problem), "{words}: {}", stderr(&output));
    }
}
