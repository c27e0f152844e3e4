//! Compiles kernels with a fault in their sources, and finds the test that names it.

use super::table::Mutant;
use shaderc::{CompileOptions, Compiler, EnvVersion, ResolvedInclude, ShaderKind, SpirvVersion, TargetEnv};
use std::{collections::HashMap, fs};
use translucent::{
    shared::glsl,
    verify::{Bench, Context, TESTS},
};

/// Every kernel, and what its source includes, directly or not.
pub struct Plantation {
    sources: HashMap<String, String>,
    sound: HashMap<&'static str, Vec<u8>>,
}

impl Plantation {
    pub fn new() -> Plantation {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/glsl");
        let files = fs::read_dir(folder).expect("the folder is there").map(|entry| entry.expect("readable").path());
        let mut sources: HashMap<String, String> = files
            .map(|path| {
                let name = path.file_name().expect("a file").to_string_lossy().into_owned();
                (name, fs::read_to_string(&path).expect("readable"))
            })
            .collect();
        sources.insert("shared.glsl".into(), glsl());
        Plantation { sources, sound: HashMap::new() }
    }

    fn includes(&self, file: &str, wanted: &str) -> bool {
        let included = self.sources[file].lines().filter_map(|line| line.strip_prefix("#include \""));
        file == wanted || included.map(|name| name.trim_end_matches('"')).any(|name| self.includes(name, wanted))
    }

    /// SPIR-V without names and lines, so that only code makes a difference.
    fn compile(sources: &HashMap<String, String>, stem: &str) -> Vec<u8> {
        let compiler = Compiler::new().expect("shaderc starts");
        let mut options = CompileOptions::new().expect("shaderc starts");
        options.set_target_env(TargetEnv::Vulkan, EnvVersion::Vulkan1_3 as u32);
        options.set_target_spirv(SpirvVersion::V1_6);
        options.set_include_callback(|name, _, _, _| {
            let content = sources.get(name).cloned().ok_or_else(|| format!("no {name}"))?;
            Ok(ResolvedInclude { resolved_name: name.into(), content })
        });
        let source = &sources[&format!("{stem}.comp")];
        let compiled = compiler.compile_into_spirv(source, ShaderKind::Compute, stem, "main", Some(&options));
        compiled.unwrap_or_else(|error| panic!("{stem}: {error}")).as_binary_u8().to_vec()
    }

    pub fn has_place(&self, mutant: &Mutant) -> bool {
        self.sources[mutant.file].contains(mutant.text)
    }

    /// The first test that fails where a fault is planted, with its verdict; none if all pass.
    pub fn first_failure(&mut self, bench: &mut Bench, mutant: &Mutant) -> Option<(&'static str, String)> {
        let Mutant { file, text, with, .. } = mutant;
        assert!(self.has_place(mutant), "glsl/{file} has no longer: {text}");
        let source = &self.sources[*file];
        let mut planted = self.sources.clone();
        planted.insert(file.to_string(), source.replacen(text, with, 1));
        // Whether each kernel has other bytes now; compiled when the first test of it comes.
        let mut changed: HashMap<&'static str, bool> = HashMap::new();
        let mut failure = None;
        for test in TESTS {
            for &stem in test.kernels {
                if !changed.contains_key(stem) {
                    changed.insert(stem, self.plant(bench, &planted, stem, file));
                }
            }
            // Identical bytes cannot fail otherwise than before.
            if !test.kernels.iter().any(|stem| changed[stem]) {
                continue;
            }
            let mut context = Context::new(bench);
            context.fraction = 8;
            let verdict = test.run(&mut context).expect("the device runs it");
            if !verdict.passed() {
                failure = Some((test.name, verdict.to_string()));
                break;
            }
        }
        assert!(changed.values().any(|changed| *changed), "glsl/{file}: {text}: changes no kernel");
        changed.iter().filter(|(_, changed)| **changed).for_each(|(stem, _)| bench.restore(stem));
        failure
    }

    /// Gives the bench a kernel with the planted sources, if they make a difference to it.
    fn plant(&mut self, bench: &mut Bench, planted: &HashMap<String, String>, stem: &'static str, file: &str) -> bool {
        if !self.includes(&format!("{stem}.comp"), file) {
            return false;
        }
        let spirv = Plantation::compile(planted, stem);
        let sound = self.sound.entry(stem).or_insert_with(|| Plantation::compile(&self.sources, stem));
        let differs = spirv != *sound;
        if differs {
            bench.replace(stem, spirv);
        }
        differs
    }

    /// Fails unless the fault is named.
    pub fn check(&mut self, bench: &mut Bench, mutant: &Mutant) -> Result<(), String> {
        let Mutant { file, text, named, kind, .. } = mutant;
        let what = format!("glsl/{file}, {kind}, {}", text.lines().next().unwrap_or_default().trim());
        match self.first_failure(bench, mutant) {
            Some((first, verdict)) if first == *named => {
                println!("{what}: {first}: {verdict}");
                Ok(())
            }
            Some((first, verdict)) => Err(format!("{what}: {first} fails first, not {named}: {verdict}")),
            None => Err(format!("{what}: every test passes")),
        }
    }
}
