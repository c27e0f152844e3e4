//! Ctrl-C, or a polite `kill`: the first writes what there is, the second ends the program.
#![cfg(unix)]

use crate::{Folder, integer, stderr};
use std::{
    process::{Child, Command, Output, Stdio},
    thread::sleep,
    time::{Duration, Instant},
};

/// More samples than any machine renders during the test.
const ENDLESS: &str = "--samples 2000000000 -o out.exr --quiet";

fn start(folder: &Folder, words: &str) -> Child {
    let mut command = folder.command(words);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
    // Ctrl-C is handled from the start on; a while later it is loading or rendering.
    sleep(Duration::from_millis(1500));
    child
}

fn signal(name: &str, child: &Child) {
    let status = Command::new("sh").arg("-c").arg(format!("kill -{name} {}", child.id())).status();
    assert!(status.expect("there is a shell").success());
}

/// What it left when it ended, at most a minute later.
fn end(mut child: Child) -> Output {
    let start = Instant::now();
    while child.try_wait().expect("it is our child").is_none() {
        if start.elapsed() > Duration::from_secs(60) {
            child.kill().expect("it is our child");
            panic!("the program ignores Ctrl-C");
        }
        sleep(Duration::from_millis(20));
    }
    child.wait_with_output().expect("it has ended")
}

#[test]
fn the_first_writes_a_whole_image_of_the_samples_so_far() {
    let folder = Folder::new("interrupt");
    for name in ["INT", "TERM"] {
        let child = start(&folder, &format!("render SPOT --resolution 24x24 {ENDLESS}"));
        signal(name, &child);
        let output = end(child);
        assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
        assert_eq!(folder.files(), ["out.exr"]);
    }
    let image = folder.image("out.exr");
    let samples = integer(&image, "samples");
    assert!(samples >= 1);
    assert_eq!((integer(&image, "sampleBegin"), integer(&image, "sampleEnd")), (0, samples));
    assert!(image.channel("samples.Y").expect("contract").iter().all(|&n| n == samples as f32));

    // The same samples without an interruption are the same image.
    folder.done(&format!("render SPOT --resolution 24x24 --samples {samples} -o again.exr"));
    assert!(image == folder.image("again.exr"));
}

#[test]
fn the_second_ends_the_program_without_a_file() {
    let folder = Folder::new("abort");
    // A single sample of so many pixels takes software Vulkan seconds, and a GPU cannot finish either.
    let child = start(&folder, &format!("render SPOT --resolution 4096x4096 --directions 1000 {ENDLESS}"));
    signal("INT", &child);
    sleep(Duration::from_millis(200));
    signal("TERM", &child);
    let output = end(child);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert_eq!(folder.files(), [] as [&str; 0]);
}

/// While the first converged image is rendered there is nothing to show; a later run begins with it.
#[test]
fn a_tradeoff_without_results_leaves_nothing() {
    let folder = Folder::new("interrupt-tradeoff");
    let words = "tradeoff SPOT --resolution 24x24 --models standard --integrators sample --against none --samples 1";
    let child = start(&folder, &format!("{words} --reference-samples 60000000 --quiet -o out"));
    signal("INT", &child);
    let output = end(child);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert_eq!(folder.files(), [] as [&str; 0]);
}
