//! What the library says while it works goes to stderr.

use log::{Level, LevelFilter, Log, Metadata, Record};

struct Stderr;

impl Log for Stderr {
    fn enabled(&self, about: &Metadata) -> bool {
        about.target().starts_with("translucent")
    }

    fn log(&self, record: &Record) {
        if self.enabled(record.metadata()) {
            let prefix = if record.level() <= Level::Warn { "warning: " } else { "" };
            eprintln!("{prefix}{}", record.args());
        }
    }

    fn flush(&self) {}
}

/// From now on notes and warnings are printed.
pub fn start() {
    if log::set_logger(&Stderr).is_ok() {
        log::set_max_level(LevelFilter::Info);
    }
}

/// From now on nothing is.
pub fn quiet() {
    log::set_max_level(LevelFilter::Off);
}
