//! Compiles every `glsl/*.comp` with shaderc, reflects the SPIR-V, and emits `shaders.rs`: one module a shader (code,
//! local size, bindings, push constants) and the Rust twins of the structs and constants of `glsl/include/types.glsl`.
//!
//! Nothing that is emitted here is typed again anywhere, so Rust and GLSL cannot drift apart: a changed member changes
//! the Rust struct, and every use that no longer fits fails to compile. The emitted offsets are asserted as well, which
//! guards the padding that this file works out.
//!
//! A shader may ask for variants with lines of the form `// variant NAME: DEFINE DEFINE=VALUE`; it is then also
//! compiled as `<shader>_<NAME>` with these macros defined. A line `// models: LENS AREA` names what a scene may need of it:
//! every set of these is compiled, with the macros of the set defined, and a frame uses the one that its model
//! (`MODEL_LENS`, `MODEL_AREA` in types.glsl) asks for. What only some of them bind is optional in `Bindings`.
//!
//! Not every set, for sets double with each name: where types.glsl says `// MODEL_A brings B C`, A is modelled with B and C only;
//! and what a variant defines anyway is not a choice.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, process};

use spirq::prelude::*;
use spirq::ty::{AccessType, DescriptorType, ScalarType, StructType, Type};

fn main() {
    println!("cargo:rerun-if-changed=glsl");
    if let Err(message) = run() {
        // Cargo shows the standard error of a failing build script.
        eprintln!("\n{message}");
        process::exit(1);
    }
}

fn run() -> Result<()> {
    let folder = |name: &str| env::var(name).map(PathBuf::from).map_err(|e| format!("{name}: {e}"));
    let out = folder("OUT_DIR")?;
    let code = generate(&folder("CARGO_MANIFEST_DIR")?.join("glsl"), &out)?;
    write(&out.join("shaders.rs"), code.as_bytes())
}

type Result<T> = std::result::Result<T, String>;

fn generate(root: &Path, out: &Path) -> Result<String> {
    let compiler = Compiler::new(root)?;
    let mut code = String::from("// Emitted by build.rs. Do not edit.\n\n");
    let types_path = root.join("include/types.glsl");
    let types = read(&types_path)?;
    let structs = shared_structs(&compiler, &types)?;
    emit_constants(&mut code, &types)?;
    let brings = brings(&types)?;
    emit_brings(&mut code, &brings);
    for (name, ty) in &structs {
        emit_struct(&mut code, name, ty, &structs, "")?;
    }
    let mut names = Vec::new();
    for path in entry_shaders(root)? {
        let source = read(&path)?;
        let stem = path.file_stem().and_then(|s| s.to_str()).ok_or("shader names are Unicode")?.to_owned();
        for (suffix, defines) in variants(&source) {
            let name = if suffix.is_empty() { stem.clone() } else { format!("{stem}_{suffix}") };
            let family = Family::compile(&compiler, &source, &path, &name, &defines, &brings)?;
            family.emit(&mut code, out, &structs).map_err(|e| format!("{}: {e}", path.display()))?;
            names.extend((0..family.members.len()).map(|set| format!("&{name}::MEMBERS[{set}]")));
        }
    }
    writeln!(code, "/// Every shader of the crate.\npub static ALL: &[&Shader] = &[{}];", names.join(", ")).ok();
    Ok(code)
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(path, bytes).map_err(|e| format!("{}: {e}", path.display()))
}

fn entry_shaders(root: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(root).map_err(|e| format!("{}: {e}", root.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|e| e.ok().map(|e| e.path())).collect();
    paths.retain(|p| p.extension().is_some_and(|e| e == "comp"));
    paths.sort();
    Ok(paths)
}

/// The variants that a shader asks for, the plain one (empty suffix) first.
fn variants(source: &str) -> Vec<(String, Vec<String>)> {
    let asked = source.lines().filter_map(|line| line.strip_prefix("// variant ")).filter_map(|v| v.split_once(':'));
    let named =
        asked.map(|(name, defines)| (name.trim().to_owned(), defines.split_whitespace().map(str::to_owned).collect()));
    std::iter::once((String::new(), Vec::new())).chain(named).collect()
}

/// What a scene may need of a shader: the names of its `// models:` line.
fn models(source: &str) -> Vec<String> {
    let lines = source.lines().filter_map(|line| line.strip_prefix("// models:"));
    lines.flat_map(str::split_whitespace).map(str::to_owned).collect()
}

/// What comes with what: the names of the lines `// MODEL_A brings B C`.
type Brings = BTreeMap<String, Vec<String>>;

fn brings(types: &str) -> Result<Brings> {
    let mut found = Brings::new();
    for line in types.lines().filter_map(|line| line.strip_prefix("// MODEL_")) {
        let Some((name, others)) = line.split_once(" brings ") else { continue };
        let others: Vec<String> = others.split_whitespace().map(str::to_owned).collect();
        let known = |name: &str| types.contains(&format!("const uint MODEL_{name} = "));
        if let Some(unknown) = others.iter().map(String::as_str).chain([name]).find(|name| !known(name)) {
            return Err(format!("types.glsl: 'MODEL_{name} brings ...': there is no MODEL_{unknown}"));
        }
        found.insert(name.to_owned(), others);
    }
    Ok(found)
}

fn emit_brings(code: &mut String, brings: &Brings) {
    let row = |(name, others): (&String, &Vec<String>)| {
        let others: Vec<String> = others.iter().map(|other| format!("MODEL_{other}")).collect();
        format!("(MODEL_{name}, {})", others.join(" | "))
    };
    let rows: Vec<String> = brings.iter().map(row).collect();
    writeln!(code, "/// `MODEL_` bits that are modelled with others only: those come with them.").ok();
    writeln!(code, "pub static MODEL_BRINGS: [(u32, u32); {}] = [{}];\n", rows.len(), rows.join(", ")).ok();
}

// --- Compiling ---

struct Compiler {
    shaderc: shaderc::Compiler,
    include: PathBuf,
}

/// A compiled shader: the code that ships, and the entry point reflected from an unoptimised twin that keeps its names.
struct Module {
    code: Vec<u32>,
    entry: spirq::entry_point::EntryPoint,
}

impl Compiler {
    fn new(root: &Path) -> Result<Self> {
        let shaderc = shaderc::Compiler::new().map_err(|e| format!("shaderc does not start: {e}"))?;
        Ok(Self { shaderc, include: root.join("include") })
    }

    fn compile(&self, source: &str, path: &Path, defines: &[String]) -> Result<Module> {
        let code = self.spirv(source, path, defines, shaderc::OptimizationLevel::Performance)?;
        let named = self.spirv(source, path, defines, shaderc::OptimizationLevel::Zero)?;
        let entries = ReflectConfig::new().spv(named).ref_all_rscs(true).reflect();
        let entry = entries.map_err(|e| format!("{}: reflection failed: {e}", path.display()))?;
        let entry = entry.into_iter().next().ok_or_else(|| format!("{}: no entry point", path.display()))?;
        Ok(Module { code, entry })
    }

    fn spirv(
        &self,
        source: &str,
        path: &Path,
        defines: &[String],
        level: shaderc::OptimizationLevel,
    ) -> Result<Vec<u32>> {
        let mut options = shaderc::CompileOptions::new().map_err(|e| format!("shaderc has no options: {e}"))?;
        options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
        options.set_warnings_as_errors();
        options.set_optimization_level(level);
        if level == shaderc::OptimizationLevel::Zero {
            options.set_generate_debug_info();
        }
        for define in defines {
            let (name, value) = define.split_once('=').unwrap_or((define, "1"));
            options.add_macro_definition(name, Some(value));
        }
        let include = self.include.clone();
        options.set_include_callback(move |name, _, _, _| {
            let path = include.join(name);
            let content = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
            Ok(shaderc::ResolvedInclude { resolved_name: path.display().to_string(), content })
        });
        let file = path.display().to_string();
        let result =
            self.shaderc.compile_into_spirv(source, shaderc::ShaderKind::Compute, &file, "main", Some(&options));
        Ok(result.map_err(|e| e.to_string())?.as_binary().to_vec())
    }
}

// --- Shared structs ---

/// Every struct of types.glsl, reflected through a probe shader that binds an array of each.
fn shared_structs(compiler: &Compiler, types: &str) -> Result<BTreeMap<String, StructType>> {
    let names = types.lines().filter_map(|l| l.strip_prefix("struct ")).filter_map(|l| l.split([' ', '{']).next());
    let names: Vec<&str> = names.collect();
    let mut probe = String::from("#version 460\n#extension GL_GOOGLE_include_directive : require\n");
    probe.push_str("#include \"types.glsl\"\nlayout(local_size_x = 1) in;\n");
    for (i, name) in names.iter().enumerate() {
        writeln!(probe, "layout(set = 0, binding = {i}, std430) buffer Probe{i} {{ {name} probe{i}[]; }};").ok();
    }
    probe.push_str("void main() {\n");
    for i in 0..names.len() {
        writeln!(probe, "    probe{i}[0] = probe{i}[1];").ok();
    }
    probe.push_str("}\n");
    let module = compiler.compile(&probe, Path::new("types.glsl (layout probe)"), &[])?;
    let mut found = BTreeMap::new();
    for var in &module.entry.vars {
        collect_structs(var.ty(), &mut found);
    }
    found.retain(|name, _| names.contains(&name.as_str()));
    for name in names {
        if !found.contains_key(name) {
            return Err(format!("types.glsl: struct {name} was not reflected"));
        }
    }
    Ok(found)
}

fn collect_structs(ty: &Type, found: &mut BTreeMap<String, StructType>) {
    match ty {
        Type::Struct(s) => {
            if let Some(name) = s.name() {
                found.insert(name.to_owned(), s.clone());
            }
            s.members.iter().for_each(|m| collect_structs(&m.ty, found));
        }
        Type::Array(a) => collect_structs(&a.element_ty, found),
        Type::DevicePointer(p) => collect_structs(&p.pointee_ty, found),
        _ => {}
    }
}

/// `const uint NAME = VALUE;` of types.glsl, for Rust.
fn emit_constants(code: &mut String, types: &str) -> Result<()> {
    for line in types.lines() {
        let Some(rest) = line.strip_prefix("const uint ") else { continue };
        let parts = rest.split_once('=').and_then(|(n, v)| Some((n.trim(), v.split_once(';')?.0.trim())));
        let (name, value) = parts.ok_or_else(|| format!("types.glsl: cannot read '{line}'"))?;
        let value = value.trim_end_matches('u');
        writeln!(code, "/// See `glsl/include/types.glsl`.\npub const {name}: u32 = {value};").ok();
    }
    Ok(())
}

/// Rust type, size and alignment of a reflected type, as `#[repr(C)]` Rust lays it out.
fn rust_type(ty: &Type, structs: &BTreeMap<String, StructType>) -> Result<(String, usize, usize)> {
    let scalar = |s: &ScalarType| match s {
        ScalarType::Integer { bits: 32, is_signed: false } => Ok("u32"),
        ScalarType::Integer { bits: 32, is_signed: true } => Ok("i32"),
        ScalarType::Float { bits: 32 } => Ok("f32"),
        other => Err(format!("no Rust twin for scalar {other:?}")),
    };
    match ty {
        Type::Scalar(s) => Ok((scalar(s)?.to_owned(), 4, 4)),
        Type::Vector(v) => Ok((format!("[{}; {}]", scalar(&v.scalar_ty)?, v.nscalar), 4 * v.nscalar as usize, 4)),
        Type::Array(a) => {
            let (element, size, align) = rust_type(&a.element_ty, structs)?;
            let count = a.nelement.ok_or("a runtime array has no Rust twin")? as usize;
            if a.stride != Some(size) {
                return Err(format!("array of {element}: stride {:?} is not its size {size}", a.stride));
            }
            Ok((format!("[{element}; {count}]"), size * count, align))
        }
        Type::Struct(s) => {
            let name = s.name().ok_or("a nested struct without a name")?;
            let size = struct_size(s, structs)?;
            Ok((format!("{}{name}", if structs.contains_key(name) { "" } else { "?" }), size, 4))
        }
        other => Err(format!("no Rust twin for {other:?}")),
    }
}

/// GLSL's alignment of a type under std430.
fn glsl_align(ty: &Type) -> usize {
    match ty {
        Type::Vector(v) => [4, 4, 8, 16, 16][v.nscalar as usize],
        Type::Array(a) => glsl_align(&a.element_ty),
        Type::Struct(s) => s.members.iter().map(|m| glsl_align(&m.ty)).max().unwrap_or(4),
        _ => 4,
    }
}

fn struct_size(s: &StructType, structs: &BTreeMap<String, StructType>) -> Result<usize> {
    let last = s.members.last().ok_or("an empty struct")?;
    let end = last.offset.ok_or("a member without an offset")? + rust_type(&last.ty, structs)?.1;
    let align = s.members.iter().map(|m| glsl_align(&m.ty)).max().unwrap_or(4);
    Ok(end.next_multiple_of(align))
}

fn emit_struct(
    code: &mut String,
    name: &str,
    s: &StructType,
    structs: &BTreeMap<String, StructType>,
    indent: &str,
) -> Result<()> {
    let mut fields = String::new();
    let mut asserts = String::new();
    let mut at = 0;
    let mut pads = 0;
    let mut pad = |fields: &mut String, bytes: usize| {
        if bytes > 0 {
            writeln!(fields, "{indent}    #[doc(hidden)]\n{indent}    pub _pad{pads}: [u32; {}],", bytes / 4).ok();
            pads += 1;
        }
    };
    for m in &s.members {
        let field = m.name.as_deref().ok_or("a member without a name")?;
        let offset = m.offset.ok_or("a member without an offset")?;
        let (ty, size, _) = rust_type(&m.ty, structs)?;
        pad(&mut fields, offset - at);
        writeln!(fields, "{indent}    /// See `glsl/`.\n{indent}    pub {field}: {ty},").ok();
        writeln!(asserts, "{indent}const _: () = assert!(std::mem::offset_of!({name}, {field}) == {offset});").ok();
        at = offset + size;
    }
    let size = struct_size(s, structs)?;
    pad(&mut fields, size - at);
    writeln!(code, "{indent}/// Twin of the GLSL struct of this name.").ok();
    writeln!(code, "{indent}#[repr(C)]").ok();
    writeln!(code, "{indent}#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]").ok();
    writeln!(code, "{indent}pub struct {name} {{\n{fields}{indent}}}\n{asserts}").ok();
    writeln!(code, "{indent}const _: () = assert!(std::mem::size_of::<{name}>() == {size});\n").ok();
    Ok(())
}

// --- Shader modules ---

/// A shader, compiled for the sets of what a scene may need of it.
struct Family {
    name: String,
    models: Vec<String>,
    /// In the order of their sets.
    members: Vec<Member>,
}

struct Member {
    name: String,
    /// Bit i: the i-th of the family's models.
    set: usize,
    module: Module,
}

/// Bindings by number: name, kind and access.
type Interface = BTreeMap<u32, (String, &'static str, &'static str)>;

impl Family {
    fn compile(
        compiler: &Compiler,
        source: &str,
        path: &Path,
        name: &str,
        defines: &[String],
        brings: &Brings,
    ) -> Result<Self> {
        let models: Vec<String> = models(source).into_iter().filter(|model| !defines.contains(model)).collect();
        let has = |set: usize, model: &str| models.iter().position(|m| m == model).is_none_or(|i| set >> i & 1 != 0);
        // Whether what comes with each of a set is in it too.
        let is_whole = |set: &usize| {
            let chosen = models.iter().enumerate().filter(|(i, _)| set >> i & 1 != 0).map(|(_, model)| model);
            chosen.filter_map(|model| brings.get(model)).flatten().all(|other| has(*set, other))
        };
        let member = |set: usize| {
            let chosen = models.iter().enumerate().filter(|(i, _)| set >> i & 1 != 0).map(|(_, model)| model);
            let all: Vec<String> = defines.iter().chain(chosen.clone()).cloned().collect();
            let name = chosen.fold(name.to_owned(), |name, model| format!("{name}_{}", model.to_lowercase()));
            Ok(Member { name, set, module: compiler.compile(source, path, &all)? })
        };
        let members = (0..1 << models.len()).filter(is_whole).map(member).collect::<Result<_>>()?;
        Ok(Self { name: name.to_owned(), models, members })
    }

    fn emit(&self, code: &mut String, out: &Path, structs: &BTreeMap<String, StructType>) -> Result<()> {
        let interfaces = self.members.iter().map(|m| interface(&m.module, structs)).collect::<Result<Vec<_>>>()?;
        let push = interfaces.first().and_then(|(_, push)| push.clone());
        let push_size = push.as_ref().map_or(Ok(0), |s| struct_size(s, structs))?;
        writeln!(code, "/// Shader `{}`.\npub mod {} {{\n    use super::*;\n", self.name, self.name).ok();
        writeln!(
            code,
            "    /// The shader for each set of models that there is.\n    pub static MEMBERS: [Shader; {}] = [",
            interfaces.len()
        )
        .ok();
        for (member, (bindings, _)) in self.members.iter().zip(&interfaces) {
            emit_member(code, out, member, bindings, push_size)?;
        }
        writeln!(code, "    ];\n").ok();
        writeln!(code, "    /// The one that models nothing.\n    pub static SHADER: &Shader = &MEMBERS[0];\n").ok();
        self.emit_choice(code);
        let bindings: Vec<&Interface> = interfaces.iter().map(|(bindings, _)| bindings).collect();
        emit_bindings(code, &bindings)?;
        if let Some(s) = push {
            emit_struct(code, "Push", &s, structs, "    ")?;
        }
        writeln!(code, "}}\n").ok();
        Ok(())
    }

    fn emit_choice(&self, code: &mut String) {
        let bits: Vec<String> = self.models.iter().map(|m| format!("MODEL_{m}")).collect();
        writeln!(code, "    /// The `MODEL_` bits that make a difference to it.").ok();
        writeln!(code, "    pub static MODELS: [u32; {}] = [{}];\n", bits.len(), bits.join(", ")).ok();
        let sets: Vec<String> = self.members.iter().map(|m| m.set.to_string()).collect();
        writeln!(code, "    static SETS: [usize; {}] = [{}];\n", sets.len(), sets.join(", ")).ok();
        writeln!(code, "    /// The one that models no more than the `MODEL_` bits that are set, and what they bring.")
            .ok();
        writeln!(code, "    pub fn modelling(model: u32) -> &'static Shader {{").ok();
        writeln!(code, "        &MEMBERS[member_of(model, &MODELS, &SETS)]\n    }}\n").ok();
    }
}

/// What a module binds, and its push constants.
fn interface(module: &Module, structs: &BTreeMap<String, StructType>) -> Result<(Interface, Option<StructType>)> {
    let mut bindings = Interface::new();
    let mut push = None;
    for var in &module.entry.vars {
        match var {
            Variable::Descriptor { name, desc_bind, desc_ty, ty, .. } => {
                if desc_bind.set() != 0 {
                    return Err("only descriptor set 0 is used".to_owned());
                }
                check_shared(ty, structs)?;
                let field = name.clone().filter(|n| !n.is_empty()).ok_or("a binding without an instance name")?;
                let (kind, access) = descriptor(desc_ty)?;
                if bindings.insert(desc_bind.bind(), (field.clone(), kind, access)).is_some() {
                    return Err(format!("binding {} is used twice ({field})", desc_bind.bind()));
                }
            }
            Variable::PushConstant { ty: Type::Struct(s), .. } => push = Some(s.clone()),
            _ => {}
        }
    }
    Ok((bindings, push))
}

fn emit_member(code: &mut String, out: &Path, member: &Member, bindings: &Interface, push_size: usize) -> Result<()> {
    let file = out.join(format!("{}.spv", member.name));
    let bytes: Vec<u8> = member.module.code.iter().flat_map(|word| word.to_ne_bytes()).collect();
    write(&file, &bytes)?;
    let list: Vec<String> = bindings
        .iter()
        .map(|(index, (field, kind, access))| {
            format!("Binding {{ name: \"{field}\", index: {index}, kind: Kind::{kind}, access: Access::{access} }}")
        })
        .collect();
    let [x, y, z] = local_size(&member.module)?;
    writeln!(code, "        Shader {{\n            name: \"{}\",", member.name).ok();
    writeln!(code, "            spirv: &Aligned(*include_bytes!(\"{}\")).0,", file.display()).ok();
    writeln!(code, "            local_size: [{x}, {y}, {z}], push_size: {push_size},").ok();
    writeln!(code, "            bindings: &[{}],\n        }},", list.join(", ")).ok();
    Ok(())
}

/// The bindings of all members: those that not all of them have are optional.
fn emit_bindings(code: &mut String, interfaces: &[&Interface]) -> Result<()> {
    let mut all = Interface::new();
    for (index, binding) in interfaces.iter().flat_map(|i| i.iter()) {
        let known = all.entry(*index).or_insert_with(|| binding.clone());
        if known.0 != binding.0 || known.1 != binding.1 {
            return Err(format!("binding {index} is {} here and {} there", known.0, binding.0));
        }
    }
    let always = |index: &u32| interfaces.iter().all(|i| i.contains_key(index));
    let mut fields = String::new();
    let mut values = String::new();
    let mut list = String::new();
    for (index, (name, kind, access)) in &all {
        let ty = if always(index) { "R" } else { "Option<R>" };
        let value = if always(index) { format!("Some(self.{name})") } else { format!("self.{name}") };
        writeln!(fields, "        /// {kind}, {access}.\n        pub {name}: {ty},").ok();
        writeln!(values, "                {index} => {value},").ok();
        writeln!(list, "self.{name}, ").ok();
    }
    writeln!(code, "    /// What the shader binds, by the names that it uses.\n    #[derive(Clone, Copy, Debug)]").ok();
    writeln!(code, "    pub struct Bindings<R> {{\n{fields}    }}\n").ok();
    writeln!(code, "    impl<R: Copy> Bindings<R> {{").ok();
    if interfaces.len() == 1 {
        writeln!(code, "        /// In the order of `SHADER.bindings`.").ok();
        writeln!(code, "        pub fn list(&self) -> Vec<R> {{\n            vec![{list}]\n        }}\n    }}\n").ok();
        return Ok(());
    }
    writeln!(code, "        /// What one of `MEMBERS` binds, in the order of its bindings.").ok();
    writeln!(code, "        pub fn of(&self, member: &Shader) -> Vec<R> {{").ok();
    writeln!(code, "            let at = |index| match index {{\n{values}                _ => None,\n            }};")
        .ok();
    writeln!(code, "            member.bindings.iter().filter_map(|b| at(b.index)).collect()\n        }}\n    }}\n")
        .ok();
    Ok(())
}

/// A shader that includes types.glsl sees the same structs as the probe did, or the build fails.
fn check_shared(ty: &Type, structs: &BTreeMap<String, StructType>) -> Result<()> {
    let mut found = BTreeMap::new();
    collect_structs(ty, &mut found);
    for (name, s) in found {
        let Some(shared) = structs.get(&name) else { continue };
        let layout = |s: &StructType| -> Vec<(Option<String>, Option<usize>)> {
            s.members.iter().map(|m| (m.name.clone(), m.offset)).collect()
        };
        if layout(shared) != layout(&s) {
            return Err(format!("struct {name} is laid out differently here: is its buffer std430?"));
        }
    }
    Ok(())
}

fn descriptor(ty: &DescriptorType) -> Result<(&'static str, &'static str)> {
    let access = |a: &AccessType| match a {
        AccessType::ReadOnly => "Read",
        AccessType::WriteOnly => "Write",
        AccessType::ReadWrite => "ReadWrite",
    };
    match ty {
        DescriptorType::StorageBuffer(a) => Ok(("StorageBuffer", access(a))),
        DescriptorType::StorageImage(a) => Ok(("StorageImage", access(a))),
        DescriptorType::CombinedImageSampler() => Ok(("SampledImage", "Read")),
        other => Err(format!("descriptor type {other:?} is not used in this project")),
    }
}

fn local_size(module: &Module) -> Result<[u32; 3]> {
    for mode in &module.entry.exec_modes {
        if mode.exec_mode == spirq::spirv::ExecutionMode::LocalSize {
            let size = |c: &spirq::constant::Constant| {
                if let spirq::constant::ConstantValue::U32(n) = c.value { Some(n) } else { None }
            };
            let n: Vec<u32> = mode.operands.iter().filter_map(size).collect();
            if let [x, y, z] = n[..] {
                return Ok([x, y, z]);
            }
        }
    }
    Err("no local size".to_owned())
}
