//! From the names in an OBJ to materials: libraries are found and read, the job's statements laid over, and the
//! textures that they name loaded.

use super::error::FormatError;
use super::lookup::Lookup;
use super::material::{FoundMap, material};
use super::mtl::{self, Given};
use super::obj::LineOf;
use super::text::{self, Tally, Text, is_blank, shown, shown_statement};
use super::texture::{TextureCache, TextureUse};
use super::{MaterialOverride, ReadOptions};
use crate::scene::{Material, Part};
use crate::warning::{Warning, Warnings};
use std::collections::{BTreeSet, HashMap, HashSet};
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

/// What is said of a material and where.
#[derive(Clone, Default)]
struct Entry {
    /// In an MTL.
    given: Given,
    /// That MTL; None where only the job speaks of the material.
    file: Option<PathBuf>,
    /// In the job.
    changes: Given,
    /// The job file; None where it does not speak of the material.
    job: Option<PathBuf>,
}

/// Reads what an OBJ refers to.
pub(super) struct Loader<'a> {
    options: &'a ReadOptions,
    obj: &'a Path,
    entries: HashMap<Vec<u8>, Entry>,
    lookup: Lookup,
    incomplete: bool,
    /// Every file that was read or whose content is known, in order.
    pub inputs: Vec<PathBuf>,
    seen: HashSet<PathBuf>,
    /// Bytes that were read.
    pub bytes_read: u64,
    /// What was named and cannot be had, each as a sentence.
    pub missing: Vec<String>,
    /// Names that overrides speak of and that are not wanted.
    pub unmet_overrides: Vec<Vec<u8>>,
}

impl<'a> Loader<'a> {
    pub(super) fn new(obj: &'a Path, options: &'a ReadOptions) -> Self {
        Self {
            options,
            obj,
            entries: HashMap::new(),
            lookup: Lookup::within(options.within.clone()),
            incomplete: false,
            inputs: Vec::new(),
            seen: HashSet::new(),
            bytes_read: 0,
            missing: Vec::new(),
            unmet_overrides: Vec::new(),
        }
    }

    /// The materials of those names, as the files behind `mtllib`, the options' file and the job give them.
    pub(super) fn library<'n>(
        &mut self,
        libraries: &[&[u8]],
        names: impl Iterator<Item = &'n [u8]>,
        textures: &TextureCache,
        line_of: LineOf<'_>,
        warnings: &mut Warnings,
    ) -> Result<Library, FormatError> {
        let names: HashSet<&[u8]> = names.collect();
        let is_wanted = |name: &[u8]| names.contains(name);
        let spoken_of = self.options.material_overrides.iter().map(|change| &change.name);
        self.unmet_overrides = spoken_of.filter(|name| !is_wanted(name)).cloned().collect();
        self.read_libraries(libraries, line_of, &is_wanted, warnings);
        if let Some(file) = &self.options.materials_file {
            let materials = self.read_library(file, &is_wanted, warnings)?;
            self.entries.extend(materials);
        }
        for change in &self.options.material_overrides {
            let entry = self.entries.entry(change.name.clone()).or_default();
            entry.change(change, warnings)?;
        }
        let mut entries: Vec<(Vec<u8>, Entry)> =
            self.entries.drain().filter(|(name, _)| names.contains(&name[..])).collect();
        entries.sort_by(|(a, _), (b, _)| a.cmp(b));
        let mut maps: Vec<Vec<FoundMap>> = entries.iter_mut().map(|(_, entry)| self.maps(entry)).collect();
        self.load_textures(&mut maps, textures, warnings)?;
        let srgb = self.options.mtl_srgb;
        let materials = entries.into_iter().zip(maps).map(|((name, entry), maps)| {
            let said_in = entry.job.as_deref().or(entry.file.as_deref()).unwrap_or(self.obj);
            let material = material(entry.given, entry.changes, maps, srgb, &mut |text| {
                warnings.add(Some(said_in), None, text);
            });
            (name, Part::new(material))
        });
        Ok(Library { materials: materials.collect(), incomplete: self.incomplete })
    }

    /// Reads the files behind `mtllib`. Of materials with one name in several files that of the first stands, as the
    /// format says.
    fn read_libraries(
        &mut self,
        statements: &[&[u8]],
        line_of: LineOf<'_>,
        is_wanted: &dyn Fn(&[u8]) -> bool,
        warnings: &mut Warnings,
    ) {
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
                if let Err(text) = self.read_named(&name, is_wanted, warnings) {
                    self.misses(self.obj, line_of(b"mtllib", statement), text, warnings);
                    self.incomplete = true;
                }
            }
        }
    }

    /// Tells what a file names that cannot be had.
    fn misses(&mut self, file: &Path, line: Option<u32>, text: String, warnings: &mut Warnings) {
        warnings.add(Some(file), line, text.clone());
        self.missing.push(Warning { file: Some(file.to_path_buf()), line, text, count: 1 }.to_string());
    }

    /// What stands behind one `mtllib` is one name with blanks if there is such a file, else several.
    fn library_names(&mut self, statement: &[u8]) -> Vec<Vec<u8>> {
        let whole = [statement.to_vec(), unescaped(statement)];
        let mut found =
            whole.into_iter().filter(|name| self.lookup.find(name, &[folder(self.obj)]).is_some());
        found
            .next()
            .map_or_else(|| split_escaped(statement).take(MAX_LIBRARIES + 1).collect(), |name| vec![name])
    }

    /// Reads one library; else what to say.
    fn read_named(
        &mut self,
        name: &[u8],
        is_wanted: &dyn Fn(&[u8]) -> bool,
        warnings: &mut Warnings,
    ) -> Result<(), String> {
        let Some(path) = self.lookup.find(name, &[folder(self.obj)]) else {
            let name = shown(name);
            return Err(format!("material library `{name}` is not found; its materials are the default"));
        };
        let materials = self
            .read_library(&path, is_wanted, warnings)
            .map_err(|error| format!("material library {error}"))?;
        for (name, entry) in materials {
            self.entries.entry(name).or_insert(entry);
        }
        Ok(())
    }

    fn read_library(
        &mut self,
        path: &Path,
        is_wanted: &dyn Fn(&[u8]) -> bool,
        warnings: &mut Warnings,
    ) -> Result<HashMap<Vec<u8>, Entry>, FormatError> {
        let bytes = text::read(path)?;
        let text = Text::new(&bytes, path)?;
        let parsed = mtl::parse(&text, is_wanted);
        self.note_input(path, bytes.len() as u64);
        let mut warn = |tally: Tally, what: String| {
            if tally.count > 0 {
                warnings.add_times(Some(path), Some(text.line_at(tally.first)), what, tally.count);
            }
        };
        for (skipped, what) in [
            (&parsed.unknown, "unknown statements are skipped"),
            (&parsed.malformed, "statements whose value is not understood are skipped"),
        ] {
            warn(skipped.tally, format!("{what}, the first is `{}`", shown_statement(&skipped.word)));
        }
        warn(parsed.idle.tally, idle_text(&parsed.idle.words));
        let entry = |given| Entry { given, file: Some(path.to_path_buf()), ..Entry::default() };
        Ok(parsed.materials.into_iter().map(|(name, given)| (name, entry(given))).collect())
    }

    /// The files behind `mtllib` statements and the options' file, and the maps of all their materials.
    pub(super) fn named_files(mut self, libraries: &[&[u8]]) -> Vec<PathBuf> {
        let mut unheard = Warnings::default();
        self.read_libraries(libraries, &|_, _| None, &|_| true, &mut unheard);
        if let Some(file) = &self.options.materials_file {
            let materials = self.read_library(file, &|_| true, &mut unheard).unwrap_or_default();
            self.entries.extend(materials);
        }
        for change in &self.options.material_overrides {
            // what is wrong with one is told when the frame is read
            let _ = self.entries.entry(change.name.clone()).or_default().change(change, &mut unheard);
        }
        let mut entries: Vec<Entry> = self.entries.drain().map(|(_, entry)| entry).collect();
        let maps = entries.iter_mut().flat_map(|entry| self.maps(entry)).collect::<Vec<_>>();
        self.inputs.into_iter().chain(maps.into_iter().filter_map(|map| map.path)).collect()
    }

    fn note_input(&mut self, path: &Path, bytes: u64) {
        self.bytes_read += bytes;
        if self.seen.insert(path.to_path_buf()) {
            self.inputs.push(path.to_path_buf());
        }
    }

    /// Takes the maps out of what is said of a material and looks for their files: relative to where it is said, then
    /// to the OBJ.
    fn maps(&mut self, entry: &mut Entry) -> Vec<FoundMap> {
        let mut found = Vec::new();
        for (given, file) in [(&mut entry.given, &entry.file), (&mut entry.changes, &entry.job)] {
            let said_in = file.as_deref().unwrap_or(self.obj);
            for (slot, statement) in std::mem::take(&mut given.maps) {
                let path = self.lookup.find(&statement.file, &[folder(said_in), folder(self.obj)]);
                let said_in = said_in.to_path_buf();
                found.retain(|map: &FoundMap| !slot.replaces(map.slot));
                found.push(FoundMap { slot, statement, said_in, path, texture: None });
            }
        }
        found
    }

    /// Loads the textures of all maps, each once.
    fn load_textures(
        &mut self,
        maps: &mut [Vec<FoundMap>],
        cache: &TextureCache,
        warnings: &mut Warnings,
    ) -> Result<(), FormatError> {
        let wanted: BTreeSet<(PathBuf, TextureUse)> = maps
            .iter()
            .flatten()
            .filter_map(|map| Some((map.path.clone()?, map.slot.texture_use())))
            .collect();
        let wanted: Vec<_> = wanted.into_iter().collect();
        let loaded = cache.load(self.obj, &wanted)?;
        for ((path, _), loaded) in wanted.iter().zip(&loaded) {
            if loaded.texture.is_ok() {
                self.note_input(path, loaded.bytes_read);
            }
        }
        let loaded: HashMap<_, _> = wanted.into_iter().zip(loaded).collect();
        for map in maps.iter_mut().flatten() {
            let texture = match &map.path {
                None => Err(format!("`{}` is not found", shown(&map.statement.file))),
                Some(path) => match loaded.get(&(path.clone(), map.slot.texture_use())).map(|l| &l.texture) {
                    Some(Ok(texture)) => Ok(texture.clone()),
                    Some(Err(why)) => Err(why.clone()),
                    None => continue,
                },
            };
            match texture {
                Ok(texture) => map.texture = Some(texture),
                Err(why) => {
                    let text = format!("{} {why}; the constant is used", map.slot.word());
                    self.misses(&map.said_in, None, text, warnings);
                }
            }
        }
        Ok(())
    }
}

fn idle_text(words: &BTreeSet<&'static str>) -> String {
    let words: Vec<&str> = words.iter().copied().collect();
    format!("without effect on the picture: {}", words.join(", "))
}

impl Entry {
    fn change(&mut self, change: &MaterialOverride, warnings: &mut Warnings) -> Result<(), FormatError> {
        self.job = Some(change.said_in.clone());
        for (word, value) in &change.words {
            let set = self.changes.set(word.as_bytes(), value.as_bytes());
            let idle = set.map_err(|_| FormatError::BadOverride {
                name: shown(&change.name),
                word: word.clone(),
                value: value.clone(),
            })?;
            if !idle.is_empty() {
                warnings.add(Some(&change.said_in), None, idle_text(&idle.into_iter().collect()));
            }
        }
        Ok(())
    }
}

fn folder(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

/// Names between blanks; `\ ` is a blank within a name.
fn split_escaped(statement: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    let mut escapes = false;
    let words = statement.split(move |&byte| {
        let parts = is_blank(byte) && !escapes;
        escapes = byte == b'\\';
        parts
    });
    words.filter(|word| !word.is_empty()).map(unescaped)
}

fn unescaped(name: &[u8]) -> Vec<u8> {
    let escapes = |i: usize| name[i] == b'\\' && name.get(i + 1).copied().is_some_and(is_blank);
    (0..name.len()).filter(|&i| !escapes(i)).map(|i| name[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_libraries() {
        let names = |statement: &str| -> Vec<String> {
            split_escaped(statement.as_bytes()).map(|n| String::from_utf8(n).unwrap()).collect()
        };
        assert_eq!(names("a.mtl b\\ c.mtl  d.mtl"), ["a.mtl", "b c.mtl", "d.mtl"]);
        assert_eq!(names(r"maps\a.mtl"), [r"maps\a.mtl"]);
        assert!(names("").is_empty());
    }
}
