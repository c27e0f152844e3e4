//! The program when the machine fails it: Vulkan, the disk, memory. A clear message, the right exit status, and a whole
//! file or none.
#![cfg(target_os = "linux")]

use crate::{Folder, stderr};
use std::{
    fs,
    path::PathBuf,
    process::{Command, Output},
    sync::OnceLock,
};

/// The folder of a Vulkan loader that fails on demand, and the system's loader.
fn loader() -> &'static (PathBuf, String) {
    static LOADER: OnceLock<(PathBuf, String)> = OnceLock::new();
    LOADER.get_or_init(|| {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("loader");
        fs::create_dir_all(&folder).expect("the build's temporary folder is writable");
        let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/program/loader.c");
        let built = Command::new("cc")
            .args(["-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", source, "-ldl", "-o"])
            .arg(folder.join("libvulkan.so.1"))
            .status();
        assert!(built.expect("a C compiler").success());
        let real = Command::new("cc").arg("-print-file-name=libvulkan.so.1").output().expect("a C compiler");
        (folder, String::from_utf8(real.stdout).expect("a path").trim().into())
    })
}

fn faulty(folder: &Folder, words: &str, fault: &str) -> Output {
    let (ours, real) = loader();
    let mut command = folder.command(words);
    command.env("LD_LIBRARY_PATH", ours).env("LOADER", real).env("FAULT", fault);
    command.output().expect("the program starts")
}

const SMALL: &str = "render SPOT --resolution 16x16 --samples 8 -o out.exr --png out.png";

#[test]
fn a_lost_device_is_replaced_once() {
    let folder = Folder::new("lost");
    let undisturbed = faulty(&folder, SMALL, "none 0 0 once");
    assert_eq!(undisturbed.status.code(), Some(0), "{}", stderr(&undisturbed));
    let files = || ["out.exr", "out.png"].map(|name| fs::read(folder.join(name)).expect("it was written"));
    let expected = files();
    for name in ["out.exr", "out.png"] {
        fs::remove_file(folder.join(name)).expect("it was written");
    }
    let output = faulty(&folder, SMALL, "vkWaitForFences 3 -4 once");
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("lost") && said.contains("going on with a new device"), "{said}");
    assert!(files() == expected, "other files");
}

#[test]
fn faults_end_with_1_and_a_message_that_names_the_step_and_leave_nothing() {
    let folder = Folder::new("faults");
    for (fault, step) in [
        ("vkCreateInstance 1 -1 once", "create the instance"),
        ("vkCreateDevice 1 -3 once", "create the device"),
        ("vkCreateComputePipelines 3 -2 once", "compile kernel"),
        ("vkCreateBuffer 5 -1 once", "create buffer"),
        ("vkAllocateMemory 1 -2 always", "create buffer"),
        ("vkQueueSubmit2 2 -2 once", "submit the recording"),
        ("vkWaitForFences 2 -4 always", "wait for the recording"),
    ] {
        let output = faulty(&folder, SMALL, fault);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{fault}: {said}");
        assert!(said.contains("error: ") && said.contains(step), "{fault}: {said}");
        assert!(!said.contains("panicked"), "{fault}: {said}");
        assert_eq!(folder.files(), [""; 0], "{fault}");
    }
}

/// The program, run by a shell after `before`.
fn limited(folder: &Folder, before: &str, words: &str) -> Output {
    let command = folder.command(words);
    let mut shell = Command::new("sh");
    shell.current_dir(command.get_current_dir().expect("it has one"));
    shell.args(["-c", &format!("{before}; exec \"$@\""), "sh"]).arg(command.get_program()).args(command.get_args());
    shell.output().expect("a shell")
}

#[test]
fn a_disk_without_room_leaves_the_old_file() {
    let folder = Folder::new("disk");
    // Blocks of 512 bytes; the signal that would end the program is ignored, as a full disk has none.
    let before = "trap '' XFSZ; ulimit -f 8";
    for old in [false, true] {
        if old {
            fs::write(folder.join("out.exr"), b"old").expect("writable");
        }
        let output = limited(&folder, before, "render SPOT --resolution 64x64 --samples 1 -o out.exr");
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("error: out.exr: ") && !said.contains("panicked"), "{said}");
        assert_eq!(folder.files(), if old { vec!["out.exr"] } else { vec![] });
    }
    assert_eq!(fs::read(folder.join("out.exr")).expect("it is there"), b"old");
    // Where no file can be made it is said before the work.
    let output = folder.run("render SPOT --resolution 64x64 --samples 1 -o /proc/out.exr");
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("/proc/out.exr"), "{}", stderr(&output));
}

#[test]
fn memory_that_is_not_there_is_refused_before_the_work() {
    let folder = Folder::new("memory");
    let render = |kib: u32, size: &str| {
        let words = format!("render SPOT --resolution {size} --samples 1 --quiet -o out.exr");
        let output = limited(&folder, &format!("ulimit -v {kib}"), &words);
        (output.status.code(), stderr(&output))
    };
    // From less than the program itself takes to more than the render does: refused in words, until it works.
    let mut works = false;
    for kib in [100_000, 400_000, 700_000, 1_000_000, 1_250_000, 16_000_000] {
        let (code, said) = render(kib, "16x16");
        match code {
            Some(0) => works = true,
            // The system's own loader refuses programs that do not fit.
            Some(127) => assert!(said.contains("cannot") && !works, "{kib}: {said}"),
            _ => assert!(code == Some(1) && said.contains("error: ") && !works, "{kib}: {code:?} {said}"),
        }
    }
    assert!(works);
    // What is needed for what, what is left, and what makes it less.
    let (code, said) = render(4_000_000, "8192x8192");
    assert_eq!(code, Some(1), "{said}");
    for part in ["are needed (image 5100.3 MB", "are left by", "ulimit -v", "lower the resolution or crop"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert_eq!(folder.files(), ["out.exr"]);
}
