//! The kernels' texts are valid in every way in which frames use them, and bind what the host binds. No GPU is needed.

use naga::back::PipelineConstants;
use naga::back::pipeline_constants::process_overrides;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Expression, Literal, Module, ShaderStage, StorageAccess};
use rayon::prelude::*;
use rentix::device::gpu::records::NODES_IN_GROUP;
use rentix::device::gpu::shaders::{
    self, Access, FARS, FILM_WORDS, FLAGS, GROUP, REFIT_BINDINGS, TRACE_BINDINGS,
};
use std::collections::BTreeSet;
use std::path::Path;

/// The largest of the stacks for which there are kernels: as it stands in the text.
const MOST_FAR: u32 = FARS[FARS.len() - 1];

/// Each kernel's text, by the name of its file.
fn kernels() -> [(&'static str, String); 3] {
    [("trace", shaders::trace(MOST_FAR)), ("center", shaders::center(MOST_FAR)), ("refit", shaders::refit())]
}

/// A text as naga reads it; it needs nothing that not every adapter has.
fn valid(name: &str, text: &str) -> (Module, ModuleInfo) {
    let module = naga::front::wgsl::parse_str(text)
        .unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string_with_path(text, name)));
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string_with_path(text, name)));
    (module, info)
}

#[test]
fn kernels_are_valid_as_they_stand() {
    for (name, text) in kernels() {
        let (module, _) = valid(name, &text);
        let entries: Vec<_> = module.entry_points.iter().map(|e| (e.stage, &*e.name)).collect();
        let wanted = match name {
            "refit" => vec!["refit_level", "refit_top"],
            name => vec![name],
        };
        let wanted: Vec<_> = wanted.into_iter().map(|entry| (ShaderStage::Compute, entry)).collect();
        assert_eq!(entries, wanted, "{name}");
    }
}

#[test]
fn kernels_have_the_stacks_that_they_are_made_for() {
    for far in FARS {
        for (name, text) in [("trace", shaders::trace(far)), ("center", shaders::center(far))] {
            let (module, _) = valid(name, &text);
            let (_, constant) = module
                .constants
                .iter()
                .find(|(_, c)| c.name.as_deref() == Some("FAR"))
                .unwrap_or_else(|| panic!("{name}: FAR is not there"));
            let value = &module.global_expressions[constant.init];
            let is_set = matches!(value, Expression::Literal(Literal::U32(value)) if *value == far);
            assert!(is_set, "{name}: {value:?}, not {far}");
        }
    }
}

/// The constants of one kind of frame; bits say which flags are set.
fn constants(bits: usize, film_words: u32) -> PipelineConstants {
    let mut constants = PipelineConstants::default();
    for (k, flag) in FLAGS.into_iter().enumerate() {
        constants.insert(flag.to_string(), f64::from(u8::from(bits >> k & 1 != 0)));
    }
    constants.insert(FILM_WORDS.to_string(), f64::from(film_words));
    constants
}

/// What the constants of a kernel are set to, kind by kind of frame; a kernel that fits trees has its threads: those of a
/// workgroup that every adapter has, and of the largest that is asked for.
fn kinds(kernel: &str) -> Vec<PipelineConstants> {
    if kernel == "refit" {
        let with = |threads: u32| PipelineConstants::from_iter([(GROUP.to_string(), f64::from(threads))]);
        return [8 * NODES_IN_GROUP, 256, 512].map(with).to_vec();
    }
    let words = |bits| [1, 3, 4].map(|film_words| constants(bits, film_words));
    (0..1 << FLAGS.len()).flat_map(words).collect()
}

#[test]
fn kernels_are_valid_for_every_kind_of_frame() {
    for (name, text) in kernels() {
        let (module, info) = valid(name, &text);
        for entry in &module.entry_points {
            let fault = |constants: &PipelineConstants| {
                // validates what it makes, and that no constant is left open
                let made = process_overrides(&module, &info, Some((entry.stage, &entry.name)), constants);
                made.err().map(|e| format!("{} with {constants:?}: {e}", entry.name))
            };
            let faults: Vec<String> = kinds(name).par_iter().filter_map(fault).collect();
            assert!(faults.is_empty(), "{} kinds, the first is {}", faults.len(), faults[0]);
        }
    }
}

#[test]
fn both_sides_know_the_same_constants() {
    for (name, text) in kernels() {
        let (module, _) = valid(name, &text);
        let there: BTreeSet<&str> = module.overrides.iter().filter_map(|(_, o)| o.name.as_deref()).collect();
        assert_eq!(there.len(), module.overrides.len(), "{name}: a constant has no name of its own");
        assert!(
            module.overrides.iter().all(|(_, o)| o.id.is_none()),
            "{name}: a constant is known by number"
        );
        let here: BTreeSet<&str> = match name {
            "refit" => BTreeSet::from([GROUP]),
            _ => FLAGS.into_iter().chain([FILM_WORDS]).collect(),
        };
        assert_eq!(there, here, "{name}");
    }
}

#[test]
fn kernels_bind_what_the_host_binds() {
    for (name, text) in kernels() {
        let (module, _) = valid(name, &text);
        let wanted: &[Access] = if name == "refit" { &REFIT_BINDINGS } else { &TRACE_BINDINGS };
        let mut found = vec![None; wanted.len()];
        for (_, variable) in module.global_variables.iter() {
            let Some(binding) = variable.binding else { continue };
            let called = variable.name.as_deref().unwrap_or("?");
            assert_eq!(binding.group, 0, "{name}: {called}");
            let place = found.get_mut(binding.binding as usize);
            let place = place.unwrap_or_else(|| panic!("{name}: {called}: binding {}", binding.binding));
            let access = match variable.space {
                AddressSpace::Storage { access } if access == StorageAccess::LOAD => Access::Read,
                AddressSpace::Storage { .. } => Access::Write,
                space => panic!("{name}: {called} is in {space:?}"),
            };
            assert_eq!(place.replace(access), None, "{name}: {called} shares its binding");
        }
        let wanted: Vec<_> = wanted.iter().copied().map(Some).collect();
        assert_eq!(found, wanted, "{name}");
    }
}

#[test]
fn every_file_is_part_of_a_kernel() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let kernels = kernels();
    let mut files = 0;
    for folder in [folder.join("parts"), folder] {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                assert!(path.ends_with("parts"), "{} is read by nobody", path.display());
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let is_used = kernels.iter().any(|(_, kernel)| kernel.contains(&text));
            assert!(is_used, "{} is part of no kernel", path.display());
            files += 1;
        }
    }
    assert!(files > kernels.len(), "{files} files");
}
