//! Compiles every `glsl/*.comp` to SPIR-V with glslang (through shaderc), includes resolved, names kept,
//! and writes `shared.glsl` from `src/shared/mod.rs`.

use std::{env, fs, path::Path};

#[path = "src/shared/mod.rs"]
#[allow(dead_code)]
mod shared;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src/shared");
    println!("cargo::rerun-if-changed=glsl");
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let out = Path::new(&out);

    // The build always uses the fresh text; the copy in glsl/ is for readers, and a test keeps it fresh.
    let header = shared::glsl();
    fs::write(out.join("shared.glsl"), &header).expect("OUT_DIR is writable");

    let compiler = shaderc::Compiler::new().expect("shaderc starts");
    let mut options = shaderc::CompileOptions::new().expect("shaderc starts");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_target_spirv(shaderc::SpirvVersion::V1_6);
    options.set_generate_debug_info();
    options.set_optimization_level(shaderc::OptimizationLevel::Performance);
    options.set_warnings_as_errors();
    options.set_include_callback(|name, _, _, _| {
        let content = match name {
            "shared.glsl" => header.clone(),
            _ => fs::read_to_string(Path::new("glsl").join(name)).map_err(|e| format!("glsl/{name}: {e}"))?,
        };
        Ok(shaderc::ResolvedInclude { resolved_name: format!("glsl/{name}"), content })
    });

    let mut kernels: Vec<_> = fs::read_dir("glsl")
        .expect("the folder glsl exists")
        .map(|entry| entry.expect("glsl is readable").path())
        .filter(|path| path.extension().is_some_and(|e| e == "comp"))
        .collect();
    kernels.sort();
    let mut failed = false;
    for path in kernels {
        let source = fs::read_to_string(&path).expect("a kernel is readable");
        let stem = path.file_stem().expect("a kernel has a name").to_string_lossy().into_owned();
        let name = path.to_string_lossy().into_owned();
        match compiler.compile_into_spirv(&source, shaderc::ShaderKind::Compute, &name, "main", Some(&options)) {
            Ok(spirv) => fs::write(out.join(format!("{stem}.spv")), spirv.as_binary_u8()).expect("OUT_DIR is writable"),
            Err(error) => {
                failed = true;
                for line in error.to_string().lines() {
                    println!("cargo::error={line}");
                }
            }
        }
    }
    if failed {
        std::process::exit(1);
    }
}
