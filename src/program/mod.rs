//! What each command does, and how it ends.

pub mod arguments;
pub mod bench;
pub mod inspect;
pub mod log;
pub mod measure;
mod memory;
pub mod merge;
pub mod plot;
pub mod profile;
pub mod render;
pub mod scene;
pub mod tables;
mod tev;
pub mod tradeoff;
pub mod verify;

use std::{
    fmt::Display,
    io::{self, Write},
    path::Path,
    process::ExitCode,
};
use translucent::Error;

/// Exit status of a command that was interrupted but wrote an image.
pub const INTERRUPTED: u8 = 3;

/// Why a command ends early, with its exit status.
pub struct Failure {
    pub message: String,
    pub code: ExitCode,
}

impl Failure {
    /// The user's words or files are at fault.
    pub fn input(message: impl Display) -> Failure {
        Failure { message: message.to_string(), code: ExitCode::from(2) }
    }

    /// An error while input is read: also a file that is not there is the user's to mend.
    pub fn while_reading(error: Error) -> Failure {
        if matches!(error, Error::File { .. }) { Failure::input(error) } else { error.into() }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Failure {
        let code = if error.is_input() { 2 } else { 1 };
        Failure { message: error.to_string(), code: ExitCode::from(code) }
    }
}

/// Refuses to write over a file that is read.
pub fn keep(input: &Path, output: &Path) -> Result<(), Failure> {
    match (input.canonicalize(), output.canonicalize()) {
        (Ok(read), Ok(written)) if read == written => {
            Err(Failure::input(format!("{}: is an input, and would be overwritten", output.display())))
        }
        _ => Ok(()),
    }
}

/// Writes results to stdout. A reader that has seen enough and closed the pipe is no failure.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure { message: format!("stdout: {error}"), code: ExitCode::from(1) })
        }
        _ => Ok(()),
    }
}
