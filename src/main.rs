//! The command line. It uses nothing but the library's public interface.

mod program;

use clap::{Parser, Subcommand};
use program::{
    bench::Bench, inspect::Inspect, measure::Measure, merge::Merge, render::Render, tables, tradeoff::Tradeoff,
    verify::Verify,
};
use std::process::ExitCode;

/// Renders translucent matter (marble, skin, milk, wax) in glTF scenes with Vulkan compute.
#[derive(Parser)]
#[command(
    version,
    after_help = "Exit status: 0 done, 1 failed, 2 wrong usage or input, 3 interrupted with a usable \
                                 partial image written."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render a glTF scene to an EXR image.
    Render(Box<Render>),
    /// Say what a scene requires: matter, models, lights, kernels, buffers, and why.
    Inspect(Box<Inspect>),
    /// Measure on scenes with a known answer, and plot both.
    Measure(Box<Measure>),
    /// Time fixed work again and again, kernel by kernel, or say whether two such runs differ beyond noise.
    Bench(Box<Bench>),
    /// Render a scene in many ways, and show time against error: CSV, plots and a page.
    Tradeoff(Box<Tradeoff>),
    /// Put the parts of a larger render together, weighted by samples.
    Merge(Merge),
    /// Test a driver: every kernel and function against its twin.
    Verify(Box<Verify>),
    /// List every named material with its coefficients, mean free path and colour.
    Presets,
    /// List every Vulkan device with what it lacks.
    Devices,
}

fn main() -> ExitCode {
    program::log::start();
    let result = match Cli::parse().command {
        Command::Render(render) => render.run(),
        Command::Inspect(inspect) => inspect.run(),
        Command::Measure(measure) => measure.run(),
        Command::Bench(bench) => bench.run(),
        Command::Tradeoff(tradeoff) => tradeoff.run(),
        Command::Merge(merge) => merge.run(),
        Command::Verify(verify) => verify.run(),
        Command::Presets => tables::presets(),
        Command::Devices => tables::devices(),
    };
    result.unwrap_or_else(|failure| {
        eprintln!("error: {}", failure.message);
        failure.code
    })
}
