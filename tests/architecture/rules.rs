//! The rules, as functions of a house and a file's text.

use std::fmt;
use std::path::Path;

use crate::source::{self, Kind, Name};

/// What a house allows.
pub(crate) struct House {
    /// From the top; a room uses those after it.
    pub(crate) rooms: &'static [&'static str],
    /// Modules that every room uses and that use only one another.
    pub(crate) ground: &'static [&'static str],
    pub(crate) one_place: &'static [OnePlace],
    /// Files in which a comment proves each `unsafe`.
    pub(crate) unsafe_files: &'static [&'static str],
    /// Test suites that are library code, so that other crates can run them: their `unwrap`s are assertions.
    pub(crate) suites: &'static [&'static str],
    pub(crate) longest_file: usize,
}

/// Names that stand in certain places only. A name is `a::b` (that path and all below it; `*` at an end of a
/// segment stands for anything), `a!` (a macro) or `.a` (a method). Test code is free of it.
pub(crate) struct OnePlace {
    pub(crate) rule: &'static str,
    pub(crate) names: &'static [&'static str],
    pub(crate) places: Places,
}

/// Folders and files below `src/`, without extension.
#[derive(Clone, Copy)]
pub(crate) enum Places {
    Only(&'static [&'static str]),
    AllBut(&'static [&'static str]),
}

/// A rule broken.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Breach {
    pub(crate) file: String,
    pub(crate) line: usize,
    pub(crate) rule: String,
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.file, self.line, self.rule)
    }
}

/// A file of the house: its path from the package's root with `/`, and its text.
pub(crate) struct File<'a> {
    pub(crate) path: &'a str,
    pub(crate) text: &'a str,
}

/// Checks all files together: a module that one file declares under `#[cfg(test)]` is test code in its own file.
pub(crate) fn check(house: &House, files: &[File<'_>]) -> Vec<Breach> {
    let mut breaches = Vec::new();
    let mut sources = Vec::new();
    for file in files {
        breaches.extend(length(house, file));
        breaches.extend(unknown_room(house, file));
        if Path::new(file.path).extension().is_some_and(|e| e == "rs") {
            match source::read(file.text, &module_path(file.path)) {
                Ok(source) => sources.push((file, source)),
                Err(why) => breaches.push(breach(file, 1, why)),
            }
        }
    }
    let test_modules: Vec<Vec<String>> =
        sources.iter().flat_map(|(_, source)| source.test_modules.clone()).collect();
    for (file, source) in &sources {
        let all_test = test_modules.iter().any(|m| module_path(file.path).starts_with(m));
        for name in &source.names {
            breaches.extend(unfinished(file, name));
            breaches.extend(unproved_unsafe(house, file, name));
            let Some(place) = file.path.strip_prefix("src/").and_then(|p| p.strip_suffix(".rs")) else {
                continue;
            };
            breaches.extend(above(house, file, place, name));
            if !(name.test || all_test) {
                breaches.extend(out_of_place(house, file, place, name));
                breaches.extend(unproved_unwrap(house, file, name));
            }
        }
    }
    breaches.sort();
    breaches.dedup();
    breaches
}

fn breach(file: &File<'_>, line: usize, rule: impl Into<String>) -> Breach {
    Breach { file: file.path.to_owned(), line, rule: rule.into() }
}

/// `src/scene/camera.rs` is `crate::scene::camera`.
fn module_path(path: &str) -> Vec<String> {
    let place = path.strip_prefix("src/").unwrap_or(path).trim_end_matches(".rs");
    let mut module = vec!["crate".to_owned()];
    module.extend(place.split('/').filter(|s| !matches!(*s, "mod" | "lib" | "main")).map(str::to_owned));
    module
}

fn length(house: &House, file: &File<'_>) -> Option<Breach> {
    let lines = file.text.lines().count();
    let rule = || format!("{lines} lines: a file has at most {}; split it by concern", house.longest_file);
    (lines > house.longest_file).then(|| breach(file, lines, rule()))
}

fn unfinished(file: &File<'_>, name: &Name) -> Option<Breach> {
    let left = name.kind == Kind::Macro && matches!(name.path[0].as_str(), "todo" | "unimplemented" | "dbg");
    left.then(|| breach(file, name.line, format!("`{}!` is left behind", name.path[0])))
}

/// The room of a place; `main` belongs to the top.
fn room(place: &str) -> &str {
    if place == "main" { "cli" } else { place.split('/').next().unwrap_or(place) }
}

/// How far below the top a room lies.
fn level(house: &House, room: &str) -> Option<usize> {
    let rank = house.rooms.iter().position(|r| *r == room);
    rank.or_else(|| house.ground.contains(&room).then_some(house.rooms.len()))
}

fn unknown_room(house: &House, file: &File<'_>) -> Option<Breach> {
    let room = room(file.path.strip_prefix("src/")?.trim_end_matches(".rs"));
    let rule = || format!("`{room}` is no room of the table");
    (room != "lib" && level(house, room).is_none()).then(|| breach(file, 1, rule()))
}

/// A room uses rooms below it and the ground floor.
fn above(house: &House, file: &File<'_>, place: &str, name: &Name) -> Option<Breach> {
    if place == "lib" || !matches!(name.kind, Kind::Path | Kind::Import) {
        return None;
    }
    let own = room(place);
    let named = match name.path.first()?.as_str() {
        "crate" => name.path.get(1)?,
        "rentix" if place == "main" => name.path.get(1)?,
        _ => return None,
    };
    let rule = format!("`{own}` may not use `{named}`: a room uses rooms below it");
    (level(house, named)? < level(house, own)?).then(|| breach(file, name.line, rule))
}

fn out_of_place(house: &House, file: &File<'_>, place: &str, name: &Name) -> Vec<Breach> {
    let within = |places: &[&str]| {
        places
            .iter()
            .any(|p| place.strip_prefix(p).is_some_and(|rest| rest.is_empty() || rest.starts_with('/')))
    };
    let place_rules = house.one_place.iter().filter(|rule| match rule.places {
        Places::Only(places) => !within(places),
        Places::AllBut(places) => within(places),
    });
    let broken = place_rules.filter(|rule| rule.names.iter().any(|pattern| matches(pattern, name)));
    broken
        .map(|rule| breach(file, name.line, format!("{}; here is `{}`", rule.rule, name.path.join("::"))))
        .collect()
}

/// Whether a name is what a pattern of [`OnePlace`] says.
fn matches(pattern: &str, name: &Name) -> bool {
    if let Some(method) = pattern.strip_prefix('.') {
        return name.kind == Kind::Method && name.path[0] == method;
    }
    if let Some(called) = pattern.strip_suffix('!') {
        return name.kind == Kind::Macro && name.path[0] == called;
    }
    // A lone identifier is a variable or a field, never a crate.
    if name.kind == Kind::Macro
        || name.kind == Kind::Method
        || (name.kind == Kind::Path && name.path.len() < 2)
    {
        return false;
    }
    let wanted: Vec<&str> = pattern.split("::").collect();
    if let Some((last, path)) = name.path.split_last()
        && last == "*"
    {
        // `use a::*` brings whatever is below it.
        return wanted.iter().zip(path).all(|(w, s)| segment_matches(w, s));
    }
    wanted.len() <= name.path.len() && wanted.iter().zip(&name.path).all(|(w, s)| segment_matches(w, s))
}

fn segment_matches(wanted: &str, segment: &str) -> bool {
    match (wanted.strip_prefix('*'), wanted.strip_suffix('*')) {
        (Some(end), _) => segment.ends_with(end),
        (None, Some(start)) => segment.starts_with(start),
        (None, None) => wanted == segment,
    }
}

fn unproved_unsafe(house: &House, file: &File<'_>, name: &Name) -> Option<Breach> {
    if name.path != ["unsafe"] {
        return None;
    }
    if !house.unsafe_files.contains(&file.path) {
        return Some(breach(file, name.line, "`unsafe` in a file that is not listed for it"));
    }
    let proved = comment_at(file.text, name.line, |c| c.contains("SAFETY:") || c.contains("# Safety"));
    (!proved).then(|| breach(file, name.line, "`unsafe` without a `// SAFETY:` comment right above it"))
}

fn unproved_unwrap(house: &House, file: &File<'_>, name: &Name) -> Option<Breach> {
    let unwraps = !house.suites.contains(&file.path)
        && name.kind == Kind::Method
        && matches!(name.path[0].as_str(), "unwrap" | "expect");
    let rule = || format!("`.{}()` without a comment beside or right above it that proves it", name.path[0]);
    (unwraps && !comment_at(file.text, name.line, |_| true)).then(|| breach(file, name.line, rule()))
}

/// Whether a comment that is accepted stands on the line, or in the unbroken run of comments and attributes above
/// the line or above the beginning of the statement it continues.
fn comment_at(text: &str, line: usize, accept: impl Fn(&str) -> bool) -> bool {
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let comment = |l: &str| l.find("//").is_some_and(|at| accept(&l[at..]));
    if comment(lines[line - 1]) {
        return true;
    }
    let above = lines[..line - 1].iter().rev();
    let statement = above.skip_while(|l| {
        !l.starts_with("//") && !l.ends_with(';') && !l.ends_with(['{', '}']) && !l.is_empty()
    });
    statement.take_while(|l| l.starts_with("//") || l.starts_with("#[")).any(|l| comment(l))
}
