//! Shaders of the tests, compiled when the test runs.

use stillray::shaders::{Binding, Shader};

/// Compiles `tests/shaders/FILE` with the build script's settings and these macros defined. Threads come in groups of 64.
pub fn compile(file: &str, macros: &[&str], bindings: Vec<Binding>) -> &'static Shader {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = std::fs::read_to_string(root.join("tests/shaders").join(file)).expect("the probe is there");
    let mut options = shaderc::CompileOptions::new().expect("shaderc starts");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_optimization_level(shaderc::OptimizationLevel::Performance);
    options.set_warnings_as_errors();
    for name in macros {
        options.add_macro_definition(name, Some("1"));
    }
    options.set_include_callback(move |name, _, _, _| {
        let path = root.join("glsl/include").join(name);
        let content = std::fs::read_to_string(&path).map_err(|e| e.to_string())?;
        Ok(shaderc::ResolvedInclude { resolved_name: path.display().to_string(), content })
    });
    let compiler = shaderc::Compiler::new().expect("shaderc starts");
    let module = compiler.compile_into_spirv(&source, shaderc::ShaderKind::Compute, file, "main", Some(&options));
    let spirv = module.unwrap_or_else(|e| panic!("{e}")).as_binary().to_vec();
    Box::leak(Box::new(Shader {
        name: "probe",
        spirv: bytemuck::cast_slice(spirv.leak()),
        local_size: [64, 1, 1],
        push_size: 0,
        bindings: bindings.leak(),
    }))
}
