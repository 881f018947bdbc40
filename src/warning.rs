//! What is wrong but does not stop a frame; collected as values, told once per cause and file.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// One warning: a cause in a file, with its count.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file, where there is one.
    pub file: Option<PathBuf>,
    /// The first line concerned, from 1.
    pub line: Option<u32>,
    /// What is wrong and what is done about it.
    pub text: String,
    /// How often it was met.
    pub count: u64,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}:", file.display())?;
            if let Some(line) = self.line {
                write!(f, "{line}:")?;
            }
            f.write_str(" ")?;
        }
        f.write_str(&self.text)?;
        if self.count > 1 { write!(f, " ({} times)", self.count) } else { Ok(()) }
    }
}

/// Warnings by file and cause; adding one again counts it.
#[derive(Clone, Debug, Default)]
pub struct Warnings {
    by_cause: BTreeMap<(Option<PathBuf>, String), (Option<u32>, u64)>,
}

impl Warnings {
    /// Adds a warning; the same text in the same file is counted.
    pub fn add(&mut self, file: Option<&Path>, line: Option<u32>, text: impl Into<String>) {
        self.add_times(file, line, text, 1);
    }

    /// Adds a warning that was met several times.
    pub fn add_times(&mut self, file: Option<&Path>, line: Option<u32>, text: impl Into<String>, count: u64) {
        let entry = self.by_cause.entry((file.map(Path::to_path_buf), text.into())).or_insert((line, 0));
        entry.1 += count;
    }

    /// Takes over all warnings of another collection; returns those that are new here.
    pub fn merge(&mut self, other: &Self) -> Vec<Warning> {
        let mut new = Vec::new();
        for w in other.list() {
            let key = (w.file.clone(), w.text.clone());
            if let Some(e) = self.by_cause.get_mut(&key) {
                e.1 += w.count;
            } else {
                self.by_cause.insert(key, (w.line, w.count));
                new.push(w);
            }
        }
        new
    }

    /// Those that do not read as the sentence, which is told another way.
    #[must_use]
    pub fn without(&self, sentence: &str) -> Self {
        let mut others = self.clone();
        others.by_cause.retain(|(file, text), (line, _)| {
            Warning { file: file.clone(), line: *line, text: text.clone(), count: 1 }.to_string() != sentence
        });
        others
    }

    /// All warnings, ordered by file and text.
    pub fn list(&self) -> Vec<Warning> {
        self.by_cause
            .iter()
            .map(|((file, text), &(line, count))| Warning {
                file: file.clone(),
                line,
                text: text.clone(),
                count,
            })
            .collect()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.by_cause.is_empty()
    }
}
