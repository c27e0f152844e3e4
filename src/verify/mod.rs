//! Tests of a driver: each function and each kernel on a device beside its twin, and small images.
//!
//! A test has fixed inputs, made in the program from hashes, and a bound that follows from the precision which Vulkan
//! promises. Shared functions come first ([`functions`], [`profiles`], [`surfaces`]: the kernel `functions` evaluates them
//! one by one), then kernels in the order of the pipeline ([`stages`]), then images ([`image`]): whatever is at fault, the
//! first test that fails names it.
//!
//! ```
//! # fn main() -> translucent::Result<()> {
//! use translucent::{Device, DeviceOptions, verify};
//!
//! let device = Device::open(&DeviceOptions::default())?;
//! let mut bench = verify::Bench::new(&device)?;
//! let test = verify::TESTS.iter().find(|test| test.name == "random.hash").expect("it is there");
//! let verdict = test.run(&mut verify::Context::new(&mut bench))?;
//! assert!(verdict.passed(), "{verdict}");
//! # Ok(())
//! # }
//! ```
//!
//! `translucent verify` runs them in googletest's words ([`protocol`]), so that deqp-runner's `gtest-runner` drives it:
//! `gtest-runner run --gtest translucent --output results --baseline fails.txt -- verify`. What a failing test gave to the
//! device, and what came of it, [`dump`] keeps for a driver's developer and [`replay`] runs again.

mod amber;
mod bench;
pub mod cases;
pub mod cloud;
pub mod dump;
mod expectations;
pub mod functions;
pub mod geometry;
pub mod image;
pub mod profiles;
pub mod protocol;
pub mod replay;
pub mod stages;
pub mod surfaces;
mod verdict;
mod world;

pub use bench::{Bench, Dispatch, FUNCTIONS, Loaded};
pub use cases::Case;
pub use expectations::Expectations;
pub use verdict::{Bound, Census, ROUNDING, Roundings, Verdict, Worst, roundings, ulp};
pub use world::World;

use crate::{error::Result, render::SPIRV};
use std::sync::{Arc, OnceLock};

/// What a test runs on.
pub struct Context<'a> {
    pub bench: &'a mut Bench,
    /// Of the inputs of functions, one in so many is tried.
    pub fraction: u32,
    exact: Option<bool>,
}

impl Context<'_> {
    /// All inputs.
    pub fn new(bench: &mut Bench) -> Context<'_> {
        Context { bench, fraction: 1, exact: None }
    }

    /// How many of `inputs` are tried.
    fn share(&self, inputs: u32) -> u32 {
        (inputs / self.fraction.max(1)).max(64)
    }

    /// A verdict that compares bits, or by `otherwise` where the device's arithmetic is not that of IEEE 754.
    fn exact(&mut self, otherwise: Roundings) -> Result<Verdict> {
        let exact = match self.exact {
            Some(known) => known,
            None => functions::is_exact(self)?,
        };
        self.exact = Some(exact);
        if exact {
            return Ok(Verdict::new(Bound::Exact));
        }
        let mut verdict = Verdict::new(Bound::Relative(otherwise));
        verdict.notes.push("the device fuses operations or rounds quotients and roots coarsely: no bits".into());
        Ok(verdict)
    }
}

/// One test.
#[derive(Clone, Copy, Debug)]
pub struct Test {
    /// `suite.case`, as googletest has it.
    pub name: &'static str,
    /// Stems of the kernels of the bench that it runs; none of a whole image, which a renderer makes with its own.
    pub kernels: &'static [&'static str],
    run: fn(&mut Context) -> Result<Verdict>,
}

impl Test {
    /// Runs it.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`], [`crate::Error::Memory`] if a step of it fails.
    pub fn run(&self, context: &mut Context) -> Result<Verdict> {
        context.bench.unrepeatable.clear();
        let mut verdict = (self.run)(context)?;
        for stem in &context.bench.unrepeatable {
            verdict.problems.push(format!("kernel `{stem}` leaves other bytes when it runs again"));
        }
        Ok(verdict)
    }
}

macro_rules! tests {
    ($($name:literal [$($kernel:literal),*] $run:expr;)*) => {
        /// Every test, in the order in which the first failure names the culprit.
        pub const TESTS: &[Test] = &[$(Test { name: $name, kernels: &[$($kernel),*], run: $run },)*];
    };
}

tests! {
    "arithmetic.add_multiply" ["functions"] functions::add_multiply;
    "arithmetic.divide" ["functions"] functions::divide;
    "arithmetic.root" ["functions"] functions::root;
    "arithmetic.dot" ["functions"] functions::dot;
    "random.hash" ["functions"] functions::hash;
    "random.scramble" ["functions"] functions::scramble;
    "random.sobol" ["functions"] functions::sobol;
    "random.key" ["functions"] functions::key;
    "random.point" ["functions"] functions::point;
    "math.exp" ["functions"] functions::exp;
    "math.log" ["functions"] functions::log;
    "math.log1p" ["functions"] functions::log1p;
    "math.one_minus_exp_over" ["functions"] functions::one_minus_exp_over;
    "math.cos_sin" ["functions"] functions::cos_sin;
    "math.atan2" ["functions"] functions::atan2;
    "math.basis" ["functions"] functions::basis;
    "boundary.fresnel" ["functions"] surfaces::fresnel;
    "boundary.crossing" ["functions"] surfaces::crossing;
    "boundary.ggx" ["functions"] surfaces::ggx;
    "boundary.half_vector" ["functions"] surfaces::half_vector;
    "phase.refracted" ["functions"] surfaces::refracted;
    "phase.value" ["functions"] surfaces::phase;
    "phase.draw" ["functions"] surfaces::draw_phase;
    "texture.lookup" ["functions"] surfaces::texture;
    "light.delta" ["functions"] surfaces::delta_light;
    "light.environment" ["functions"] surfaces::environment;
    "light.environment_density" ["functions"] surfaces::environment_density;
    "light.draw_environment" ["functions"] surfaces::draw_environment;
    "light.draw_cosine" ["functions"] surfaces::draw_cosine;
    "light.draw_emitter" ["functions"] surfaces::draw_emitter;
    "light.emitter_density" ["functions"] surfaces::emitter_density;
    "profile.standard" ["functions"] profiles::standard;
    "profile.better" ["functions"] profiles::better;
    "profile.burley" ["functions"] profiles::burley;
    "profile.directional" ["functions"] profiles::directional;
    "profile.table" ["functions"] profiles::table;
    "profile.lambert" ["functions"] profiles::lambert;
    "profile.mixture" ["functions"] profiles::mixture;
    "projection.fractions" ["functions"] geometry::fractions;
    "projection.seen" ["functions"] geometry::seen;
    "projection.density" ["functions"] geometry::density;
    "traversal.nearest" ["functions"] geometry::nearest;
    "traversal.any" ["functions"] geometry::any;
    "traversal.all" ["functions"] geometry::all;
    "sums.add" ["functions"] geometry::add;
    "kernel.begin" ["begin"] stages::begin;
    "kernel.count" ["count"] stages::count;
    "kernel.irradiance" ["irradiance"] cloud::irradiance;
    "kernel.cluster" ["cluster"] cloud::cluster;
    "kernel.primary" ["primary"] |context| stages::each(context, stages::primary);
    "kernel.sample" ["sample"] |context| stages::each(context, stages::sample);
    "kernel.reproject" ["reproject"] |context| stages::each(context, stages::reproject);
    "kernel.accumulate" ["accumulate"] |context| stages::each(context, stages::accumulate);
    "kernel.reuse" ["reuse"] |context| stages::each(context, stages::reuse);
    "kernel.gather" ["gather"] cloud::gather;
    "kernel.single" ["single"] |context| stages::each(context, stages::single);
    "kernel.reflect" ["reflect"] |context| stages::each(context, stages::reflect);
    "kernel.resolve" ["resolve"] stages::resolve;
    "image.mis" [] image::mis;
    "image.camera" [] image::camera;
    "image.normal" [] image::normal;
}

/// The cases with their twins' stages, made once: the twins search every triangle.
fn staged() -> Result<Arc<Vec<stages::Staged>>> {
    static MADE: OnceLock<Arc<Vec<stages::Staged>>> = OnceLock::new();
    if let Some(made) = MADE.get() {
        return Ok(made.clone());
    }
    let cases = cases::cases()?.into_iter().enumerate();
    let made = Arc::new(cases.map(|(i, case)| stages::Staged::new(case, stages::SAMPLES[i % 2])).collect());
    Ok(MADE.get_or_init(|| made).clone())
}

/// Hex SHA-256 over the SPIR-V of all kernels and of [`FUNCTIONS`].
pub fn spirv_hash() -> String {
    use sha2::{Digest, Sha256};
    let mut hash = Sha256::new();
    for (stem, spirv) in SPIRV.iter().chain([&("functions", FUNCTIONS)]) {
        hash.update(stem.as_bytes());
        hash.update(spirv);
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Which compiler made the SPIR-V of the kernels: number and version of the tool, as Khronos lists them.
pub fn compiler() -> String {
    generator(FUNCTIONS)
}

/// Number and version of the tool that made a module, as the Khronos registry of generators lists them.
fn generator(spirv: &[u8]) -> String {
    let word = spirv.get(8..12).map_or(0, |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    let tool = match word >> 16 {
        8 => "glslang",
        13 => "shaderc over glslang",
        _ => "generator",
    };
    format!("{tool} ({}.{})", word >> 16, word & 0xffff)
}
