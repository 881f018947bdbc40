//! INPUT to sequences of files: folders, patterns, files (CONTRACT 2).

use super::JobError;
use super::animation::{self, Moment};
use super::names::{Name, group};
use super::pattern::Pattern;
use crate::format::{self, ClipChoice};
use crate::warning::Warnings;
use std::fs;
use std::path::{Path, PathBuf};

/// A file that is one frame of a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameFile {
    /// Its number in the file name, if it has one.
    pub number: Option<i64>,
    /// Where it is.
    pub path: PathBuf,
    /// Its name without extension.
    pub stem: String,
    /// What of a glTF file it shows; None: the file is an OBJ.
    pub moment: Option<Moment>,
}

/// Files that are frames of one sequence, ordered by number.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Files {
    /// The folder's name, where they are all that is taken of it; else what their names have in common.
    pub(super) name: String,
    pub(super) files: Vec<FrameFile>,
}

/// How folders are taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taking<'a> {
    /// All files of an INPUT are one sequence, in natural order, numbered from 1.
    pub(super) one_sequence: bool,
    /// Gaps are errors.
    pub(super) strict: bool,
    /// Frames a second of glTF files.
    pub(super) fps: f64,
    /// The clips of theirs that play.
    pub(super) clip: &'a ClipChoice,
}

/// Finds the sequences of an INPUT.
pub(super) fn discover(
    input: &Path,
    taking: Taking<'_>,
    warnings: &mut Warnings,
) -> Result<Vec<Files>, JobError> {
    let found = if input.is_dir() {
        let files = list(input, &|name| is_obj(Path::new(name)))?;
        if files.is_empty() {
            let animations = list(input, &|name| format::is_gltf(Path::new(name)))?;
            if animations.is_empty() {
                return Err(JobError::NoFrames(input.to_path_buf()));
            }
            return animations.iter().map(|file| animation::frames(file, taking, warnings)).collect();
        }
        files
    } else if input.exists() {
        if format::is_gltf(input) {
            return Ok(vec![animation::frames(input, taking, warnings)?]);
        }
        if !is_obj(input) {
            let input = input.to_path_buf();
            let is_job = super::resolve::is_job_file(&input);
            return Err(if is_job { JobError::JobInJob(input) } else { JobError::NotAnInput(input) });
        }
        vec![input.to_path_buf()]
    } else if let Some(pattern) = pattern_of(input) {
        let folder = input.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let matching = |is_wanted: fn(&Path) -> bool| {
            list(folder, &|name| is_wanted(Path::new(name)) && pattern.matches(name.as_encoded_bytes()))
        };
        let files = matching(is_obj)?;
        if files.is_empty() {
            let animations = matching(format::is_gltf)?;
            if animations.is_empty() {
                return Err(JobError::NoMatch(input.to_path_buf()));
            }
            return animations.iter().map(|file| animation::frames(file, taking, warnings)).collect();
        }
        files
    } else {
        return Err(JobError::Absent(input.to_path_buf()));
    };
    let names: Vec<Name> = found.iter().map(|f| Name::of(stem_bytes(f))).collect();
    let sequences = if taking.one_sequence {
        vec![in_natural_order(&found, &names, input_name(input))]
    } else {
        let groups = group(&names);
        let is_whole_folder = groups.len() == 1 && input.is_dir();
        let named = |text: String| {
            let is_name = !is_whole_folder && text.chars().any(char::is_alphabetic);
            if is_name { text } else { input_name(input) }
        };
        groups
            .into_iter()
            .map(|g| Files {
                files: g.members.iter().map(|&(number, i)| frame_file(number, &found[i])).collect(),
                name: named(g.text),
            })
            .collect()
    };
    for sequence in &sequences {
        check_numbers(sequence, input, taking.strict, warnings)?;
    }
    Ok(sequences)
}

fn in_natural_order(found: &[PathBuf], names: &[Name], name: String) -> Files {
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by(|&a, &b| names[a].natural_order(&names[b]).then_with(|| found[a].cmp(&found[b])));
    let files = (1..).zip(order).map(|(number, i)| frame_file(Some(number), &found[i])).collect();
    Files { name, files }
}

fn frame_file(number: Option<i64>, path: &Path) -> FrameFile {
    FrameFile {
        number,
        path: path.to_path_buf(),
        stem: String::from_utf8_lossy(stem_bytes(path)).into_owned(),
        moment: None,
    }
}

fn stem_bytes(path: &Path) -> &[u8] {
    path.file_stem().unwrap_or_default().as_encoded_bytes()
}

/// The pattern in the last part of a path, if there is one.
fn pattern_of(path: &Path) -> Option<Pattern> {
    let pattern = Pattern::new(path.file_name()?.as_encoded_bytes());
    pattern.has_signs().then_some(pattern)
}

/// The name of an INPUT: a file's stem, the name of the folder that it is or that a pattern stands in.
pub(super) fn input_name(input: &Path) -> String {
    if input.is_file() {
        return String::from_utf8_lossy(stem_bytes(input)).into_owned();
    }
    let folder = if input.is_dir() { Some(input) } else { input.parent() };
    let real = folder
        .map(|f| if f.as_os_str().is_empty() { Path::new(".") } else { f })
        .and_then(|f| f.canonicalize().ok());
    let name = real.as_deref().and_then(Path::file_name).map(|n| n.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "sequence".to_string())
}

fn is_obj(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"))
}

/// The plain files of a folder (links to files too) whose names are wanted, hidden ones left out, sorted by name.
fn list(folder: &Path, wanted: &dyn Fn(&std::ffi::OsStr) -> bool) -> Result<Vec<PathBuf>, JobError> {
    let unreadable = |cause| JobError::Unreadable { path: folder.to_path_buf(), cause };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let name = entry.file_name();
        let is_hidden = name.as_encoded_bytes().first() == Some(&b'.');
        if !is_hidden && wanted(&name) && !entry.path().is_dir() {
            files.push(entry.path());
        }
    }
    files.sort();
    Ok(files)
}

/// Two files of one number are an error, gaps a warning; with strict an error.
fn check_numbers(
    sequence: &Files,
    input: &Path,
    strict: bool,
    warnings: &mut Warnings,
) -> Result<(), JobError> {
    let numbers: Vec<i64> = sequence.files.iter().filter_map(|f| f.number).collect();
    if let Some(i) = numbers.windows(2).position(|w| w[0] == w[1]) {
        let [first, second] = [&sequence.files[i], &sequence.files[i + 1]];
        let remedy = if first.stem == second.stem {
            "rename one, or use --one-sequence with {frame} in the name (--name)"
        } else {
            "remove one, or use --one-sequence"
        };
        let (first, second) = (first.path.clone(), second.path.clone());
        return Err(JobError::TwoOfANumber { number: numbers[i], first, second, remedy });
    }
    // a simulation that writes every tenth step has no gaps; two numbers are not enough to tell
    let numbers: Vec<i128> = numbers.into_iter().map(i128::from).collect();
    let step = numbers.windows(2).fold(0, |step, w| gcd(step, w[1] - w[0]));
    let step = if numbers.len() > 2 { step } else { 1 };
    let gaps: Vec<String> = numbers
        .windows(2)
        .filter(|w| w[1] - w[0] > step)
        .map(|w| match (w[0] + step, w[1] - step) {
            (a, b) if a == b => a.to_string(),
            (a, b) => format!("{a}-{b}"),
        })
        .collect();
    if gaps.is_empty() {
        return Ok(());
    }
    let shown = gaps.iter().take(8).cloned().collect::<Vec<_>>().join(", ");
    let more = if gaps.len() > 8 { format!(" and {} more gaps", gaps.len() - 8) } else { String::new() };
    let text = format!("frames {shown}{more} of sequence {} are missing", sequence.name);
    if strict {
        return Err(JobError::Gaps { input: input.to_path_buf(), text });
    }
    warnings.add(Some(input), None, text);
    Ok(())
}

fn gcd(a: i128, b: i128) -> i128 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TAKING: Taking = Taking { one_sequence: false, strict: false, fps: 24.0, clip: &ClipChoice::Auto };

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let t = tempfile::tempdir().unwrap();
        for name in names {
            fs::write(t.path().join(name), "").unwrap();
        }
        t
    }

    fn numbers(input: &Path, taking: Taking) -> Vec<Vec<Option<i64>>> {
        let found = discover(input, taking, &mut Warnings::default()).unwrap();
        found.iter().map(|s| s.files.iter().map(|f| f.number).collect()).collect()
    }

    #[test]
    fn folders_and_patterns() {
        let t = folder(&["w_1.obj", "w_2.OBJ", "w_10.obj", ".w_3.obj", "notes.txt", "x.mtl"]);
        let all = vec![vec![Some(1), Some(2), Some(10)]];
        assert_eq!(numbers(t.path(), TAKING), all);
        assert_eq!(numbers(&t.path().join("*.obj"), TAKING), [[Some(1), Some(10)]]);
        assert_eq!(numbers(&t.path().join("w_##.obj"), TAKING), [[Some(10)]]);
        assert_eq!(numbers(&t.path().join("w_%d.obj"), TAKING), [[Some(1), Some(10)]]);
        assert_eq!(numbers(&t.path().join("w_%02d.obj"), TAKING), [[Some(10)]]);
        let one = Taking { one_sequence: true, ..TAKING };
        assert_eq!(numbers(t.path(), one), [[Some(1), Some(2), Some(3)]]);
        let Err(JobError::NoMatch(_)) = discover(&t.path().join("y_#.obj"), TAKING, &mut Warnings::default())
        else {
            panic!("a pattern that matches nothing")
        };
    }

    #[test]
    fn gaps_are_told_and_doubles_refused() {
        let t = folder(&["w_1.obj", "w_2.obj", "w_4.obj", "w_9.obj"]);
        let mut warnings = Warnings::default();
        discover(t.path(), TAKING, &mut warnings).unwrap();
        assert!(warnings.list()[0].text.contains("frames 3, 5-8 "), "{:?}", warnings.list());
        let strict = Taking { strict: true, ..TAKING };
        assert!(matches!(discover(t.path(), strict, &mut warnings), Err(JobError::Gaps { .. })));
        assert!(matches!(
            discover(folder(&["w_1.obj", "w_3.obj"]).path(), strict, &mut warnings),
            Err(JobError::Gaps { .. })
        ));
        // numbers as far apart as may be
        let t2 = folder(&["w_-9223372036854775808.obj", "w_0.obj", "w_9223372036854775807.obj"]);
        assert!(discover(t2.path(), TAKING, &mut Warnings::default()).is_ok());
        let every_tenth = folder(&["w_10.obj", "w_20.obj", "w_30.obj"]);
        assert!(discover(every_tenth.path(), strict, &mut warnings).is_ok());
        let t = folder(&["w_7.obj", "w_0007.obj", "w_8.obj"]);
        let error = discover(t.path(), TAKING, &mut warnings).unwrap_err().to_string();
        assert!(error.contains("w_7.obj") && error.contains("w_0007.obj"), "{error}");
        assert!(error.ends_with("remove one, or use --one-sequence"), "{error}");
        let t = folder(&["w_1.obj", "w_1.OBJ"]);
        let error = discover(t.path(), TAKING, &mut warnings).unwrap_err().to_string();
        assert!(error.contains("w_1.obj") && error.contains("w_1.OBJ"), "{error}");
        assert!(error.contains("--one-sequence with {frame} in the name"), "{error}");
    }

    #[test]
    fn sequences_have_names() {
        let names = |input: &Path| -> Vec<String> {
            let found = discover(input, TAKING, &mut Warnings::default()).unwrap();
            found.into_iter().map(|s| s.name).collect()
        };
        let t = folder(&[]);
        let in_folder = |name: &str, files: &[&str]| {
            let folder = t.path().join(name);
            fs::create_dir(&folder).unwrap();
            for file in files {
                fs::write(folder.join(file), "").unwrap();
            }
            folder
        };
        assert_eq!(names(&in_folder("cloth", &["frame_1.obj", "frame_2.obj"])), ["cloth"]);
        assert_eq!(names(&in_folder("sim", &["0000_00.obj", "0001_00.obj"])), ["sim"]);
        let two = in_folder("two", &["a_01_1.obj", "a_01_2.obj", "a_02_1.obj", "b7.obj", "1.obj"]);
        assert_eq!(names(&two), ["two", "a_01", "a_02", "b7"]);
        assert_eq!(names(&two.join("a_02_#.obj")), ["a_02_1"]);
        assert_eq!(names(&two.join("a_01_#.obj")), ["a_01"]);
        assert_eq!(names(&two.join("1.obj")), ["1"]);
    }

    #[test]
    fn what_is_no_input_is_named() {
        let t = folder(&["a.txt"]);
        let error = |p: &Path| discover(p, TAKING, &mut Warnings::default()).unwrap_err().to_string();
        assert!(error(t.path()).contains("no .obj"), "{}", error(t.path()));
        assert!(error(&t.path().join("a.txt")).contains("a.txt"));
        assert!(error(&t.path().join("absent")).contains("absent"));
    }
}
