//! From the names in an OBJ to materials: libraries are found and read, overrides applied, what is left out filled
//! in, and the files that maps name hashed.

use super::error::FormatError;
use super::lookup::Lookup;
use super::mtl::{self, Given};
use super::text::{self, Text, is_blank, shown};
use super::{MaterialOverride, ReadOptions};
use crate::scene::{MapFile, Material, Part, PartHash, PartHasher};
use crate::warning::Warnings;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// An OBJ may name so many libraries; each costs a look at the disk.
const MAX_LIBRARIES: usize = 1024;

/// Materials by name.
#[derive(Clone, Debug, Default)]
pub struct Library {
    materials: HashMap<Vec<u8>, Part<Material>>,
    /// Whether a file that may define more was not found, which was told already.
    pub(super) incomplete: bool,
}

impl Library {
    /// The material of that name.
    pub fn get(&self, name: &[u8]) -> Option<&Part<Material>> {
        self.materials.get(name)
    }
}

impl FromIterator<(Vec<u8>, Part<Material>)> for Library {
    fn from_iter<I: IntoIterator<Item = (Vec<u8>, Part<Material>)>>(materials: I) -> Self {
        Self { materials: materials.into_iter().collect(), incomplete: false }
    }
}

/// What a material's statements say and where they stand.
#[derive(Clone, Default)]
struct Entry {
    given: Given,
    /// The MTL; None where only overrides speak of the material.
    file: Option<PathBuf>,
}

/// Reads what an OBJ refers to.
pub(super) struct Loader<'a> {
    options: &'a ReadOptions,
    obj: &'a Path,
    entries: HashMap<Vec<u8>, Entry>,
    lookup: Lookup,
    contents: HashMap<PathBuf, Option<PartHash>>,
    incomplete: bool,
    /// Every file that was read, in order.
    pub inputs: Vec<PathBuf>,
    /// Their bytes.
    pub bytes_read: u64,
    /// What was named and not found, each as a sentence.
    pub missing: Vec<String>,
}

impl<'a> Loader<'a> {
    pub(super) fn new(obj: &'a Path, options: &'a ReadOptions) -> Self {
        Self {
            options,
            obj,
            entries: HashMap::new(),
            lookup: Lookup::default(),
            contents: HashMap::new(),
            incomplete: false,
            inputs: Vec::new(),
            bytes_read: 0,
            missing: Vec::new(),
        }
    }

    /// The materials of those names, as the files behind `mtllib`, the options' file and overrides give them.
    pub(super) fn library<'n>(
        &mut self,
        libraries: &[&[u8]],
        names: impl Iterator<Item = &'n [u8]>,
        warnings: &mut Warnings,
    ) -> Result<Library, FormatError> {
        self.read_libraries(libraries, warnings);
        if let Some(file) = &self.options.materials_file {
            let materials = self.read_library(file, warnings)?;
            self.entries.extend(materials);
        }
        for change in &self.options.material_overrides {
            self.entries.entry(change.name.clone()).or_default().given.change(change)?;
        }
        let mut materials = HashMap::new();
        for name in names {
            if !materials.contains_key(name)
                && let Some(entry) = self.entries.get(name).cloned()
            {
                materials.insert(name.to_vec(), Part::new(self.material(entry, warnings)));
            }
        }
        Ok(Library { materials, incomplete: self.incomplete })
    }

    /// Reads the files behind `mtllib`. Of materials with one name in several files that of the first stands, as the
    /// format says.
    fn read_libraries(&mut self, statements: &[&[u8]], warnings: &mut Warnings) {
        let mut seen = HashSet::new();
        let mut named = 0;
        for statement in statements.iter().filter(|statement| seen.insert(**statement)) {
            for name in self.library_names(statement) {
                named += 1;
                if named > MAX_LIBRARIES {
                    let text = format!(
                        "more than {MAX_LIBRARIES} material libraries are named; the others are left out"
                    );
                    return warnings.add(Some(self.obj), None, text);
                }
                if let Err(text) = self.read_named(&name, warnings) {
                    self.missing.push(format!("{}: {text}", self.obj.display()));
                    warnings.add(Some(self.obj), None, text);
                    self.incomplete = true;
                }
            }
        }
    }

    /// What stands behind one `mtllib` is one name with blanks if there is such a file, else several.
    fn library_names(&mut self, statement: &[u8]) -> Vec<Vec<u8>> {
        let whole = [statement.to_vec(), unescaped(statement)];
        let mut found =
            whole.into_iter().filter(|name| self.lookup.find(name, &[folder(self.obj)]).is_some());
        found.next().map_or_else(|| split_escaped(statement), |name| vec![name])
    }

    /// Reads one library; else what to say.
    fn read_named(&mut self, name: &[u8], warnings: &mut Warnings) -> Result<(), String> {
        let Some(path) = self.lookup.find(name, &[folder(self.obj)]) else {
            let name = shown(name);
            return Err(format!("material library `{name}` is not found; its materials are the default"));
        };
        let materials =
            self.read_library(&path, warnings).map_err(|error| format!("material library {error}"))?;
        for (name, entry) in materials {
            self.entries.entry(name).or_insert(entry);
        }
        Ok(())
    }

    fn read_library(
        &mut self,
        path: &Path,
        warnings: &mut Warnings,
    ) -> Result<HashMap<Vec<u8>, Entry>, FormatError> {
        let bytes = text::read(path)?;
        let text = Text::new(&bytes, path)?;
        let parsed = mtl::parse(&text);
        self.note_input(path, bytes.len());
        for (skipped, what) in [
            (&parsed.unknown, "unknown statements are skipped"),
            (&parsed.malformed, "statements with a malformed value are skipped"),
        ] {
            if skipped.tally.count > 0 {
                let line = text.line_at(skipped.tally.first);
                let what = format!("{what}, the first is `{}`", shown(&skipped.word));
                warnings.add_times(Some(path), Some(line), what, skipped.tally.count);
            }
        }
        let entry = |given| Entry { given, file: Some(path.to_path_buf()) };
        Ok(parsed.materials.into_iter().map(|(name, given)| (name, entry(given))).collect())
    }

    /// The files behind `mtllib` statements and the options' file, and the maps of all their materials.
    pub(super) fn named_files(mut self, libraries: &[&[u8]]) -> Vec<PathBuf> {
        let mut unheard = Warnings::default();
        self.read_libraries(libraries, &mut unheard);
        if let Some(file) = &self.options.materials_file {
            let materials = self.read_library(file, &mut unheard).unwrap_or_default();
            self.entries.extend(materials);
        }
        let mut files = std::mem::take(&mut self.inputs);
        for entry in self.entries.values() {
            let said_in = entry.file.as_deref().unwrap_or(self.obj);
            let folders = [folder(said_in), folder(self.obj)];
            files.extend(entry.given.maps.iter().filter_map(|(_, name)| self.lookup.find(name, &folders)));
        }
        files
    }

    fn note_input(&mut self, path: &Path, bytes: usize) {
        self.bytes_read += bytes as u64;
        if !self.inputs.iter().any(|input| input == path) {
            self.inputs.push(path.to_path_buf());
        }
    }

    fn material(&mut self, Entry { mut given, file }: Entry, warnings: &mut Warnings) -> Material {
        let said_in = file.as_deref().unwrap_or(self.obj);
        if let (Some(d), Some(tr)) = (given.d, given.tr)
            && (d + tr - 1.0).abs() > 1e-3
        {
            warnings.add(Some(said_in), None, "d and Tr disagree; d is used");
        }
        let maps = std::mem::take(&mut given.maps);
        let maps = maps.into_iter().map(|(word, name)| self.map(word, &name, said_in, warnings)).collect();
        Material { maps, ..filled_in(&given, self.options.mtl_srgb) }
    }

    fn map(&mut self, word: &str, name: &[u8], said_in: &Path, warnings: &mut Warnings) -> MapFile {
        let path = self.lookup.find(name, &[folder(said_in), folder(self.obj)]);
        let content = path.as_deref().and_then(|path| self.content(path));
        if content.is_none() {
            let text = format!("{word} `{}` is not found; the constant is used", shown(name));
            self.missing.push(format!("{}: {text}", said_in.display()));
            warnings.add(Some(said_in), None, text);
        }
        MapFile { word: word.to_owned(), path: path.filter(|_| content.is_some()), content }
    }

    /// Hash of a file's bytes, taken once; None where it cannot be read.
    fn content(&mut self, path: &Path) -> Option<PartHash> {
        if let Some(&known) = self.contents.get(path) {
            return known;
        }
        let content = text::read(path).ok().map(|bytes| {
            self.note_input(path, bytes.len());
            let mut hasher = PartHasher::new("file");
            hasher.bytes(&bytes);
            hasher.finish()
        });
        self.contents.insert(path.to_path_buf(), content);
        content
    }
}

impl Given {
    fn change(&mut self, change: &MaterialOverride) -> Result<(), FormatError> {
        for (word, value) in &change.words {
            self.set(word.as_bytes(), value.as_bytes()).map_err(|_| FormatError::BadOverride {
                name: shown(&change.name).into_owned(),
                word: word.clone(),
                value: value.clone(),
            })?;
        }
        Ok(())
    }
}

/// What the statements say, and the defaults of CONTRACT 5 for what they do not.
fn filled_in(given: &Given, srgb: bool) -> Material {
    let color = |color: Option<[f32; 3]>, absent: f32| {
        let given = color.map(|c| if srgb { c.map(linear_from_srgb) } else { c });
        given.unwrap_or([absent; 3])
    };
    let ks = color(given.ks, 0.0);
    let shiny = ks.iter().any(|&channel| channel > 0.0);
    Material {
        ka: color(given.ka, 0.0),
        kd: color(given.kd, 0.8),
        ks,
        ke: color(given.ke, 0.0),
        ns: given.ns.unwrap_or(if shiny { 10.0 } else { 1.0 }),
        d: given.d.or(given.tr.map(|tr| 1.0 - tr)).unwrap_or(1.0),
        illum: given.illum.unwrap_or(if shiny { 2 } else { 1 }),
        maps: Vec::new(),
        ..Material::default()
    }
}

/// IEC 61966-2-1. What is above 1 has no place on the curve and stays.
fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.04045 {
        x / 12.92
    } else if x < 1.0 {
        ((x + 0.055) / 1.055).powf(2.4)
    } else {
        x
    }
}

fn folder(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

/// Names between blanks; `\ ` is a blank within a name.
fn split_escaped(statement: &[u8]) -> Vec<Vec<u8>> {
    let borders =
        (0..statement.len()).filter(|&i| is_blank(statement[i]) && (i == 0 || statement[i - 1] != b'\\'));
    let mut names = Vec::new();
    let mut start = 0;
    for end in borders.chain([statement.len()]) {
        if start < end {
            names.push(unescaped(&statement[start..end]));
        }
        start = end + 1;
    }
    names
}

fn unescaped(name: &[u8]) -> Vec<u8> {
    let escapes = |i: usize| name[i] == b'\\' && name.get(i + 1).copied().is_some_and(is_blank);
    (0..name.len()).filter(|&i| !escapes(i)).map(|i| name[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_of_what_is_absent() {
        assert_eq!(filled_in(&Given::default(), false), Material::default());
        let shiny = filled_in(&Given { ks: Some([0.0, 0.5, 0.0]), ..Given::default() }, false);
        assert_eq!((shiny.ns, shiny.illum, shiny.kd), (10.0, 2, [0.8; 3]));
        let d = |d, tr| filled_in(&Given { d, tr, ..Given::default() }, false).d;
        assert_eq!([d(None, Some(0.75)), d(Some(0.75), Some(0.5)), d(Some(0.5), None)], [0.25, 0.75, 0.5]);
    }

    #[test]
    fn srgb_is_undone_for_colours_given() {
        // 0.5 in sRGB is 0.21404 in linear light; 17 is brighter than the curve goes
        let given = Given { kd: Some([0.5, 0.0, 1.0]), ke: Some([17.0; 3]), ..Given::default() };
        let material = filled_in(&given, true);
        assert!((material.kd[0] - 0.214_041_14).abs() < 1e-6);
        assert_eq!((material.kd[1], material.kd[2], material.ke), (0.0, 1.0, [17.0; 3]));
        assert_eq!(filled_in(&Given::default(), true).kd, [0.8; 3], "a default is linear");
    }

    #[test]
    fn names_of_libraries() {
        let names = |statement: &str| -> Vec<String> {
            split_escaped(statement.as_bytes()).into_iter().map(|n| String::from_utf8(n).unwrap()).collect()
        };
        assert_eq!(names("a.mtl b\\ c.mtl  d.mtl"), ["a.mtl", "b c.mtl", "d.mtl"]);
        assert_eq!(names(r"maps\a.mtl"), [r"maps\a.mtl"]);
        assert!(names("").is_empty());
    }
}
