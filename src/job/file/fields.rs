//! Typed reading of a job file's tree: each reader takes a value and says what it wants where it finds another.

use super::node::{Node, Value, Wrong};
use crate::job::numbers::FrameSet;
use crate::job::options::limits::{self, within};
use crate::job::words::{listed, nearest};
use crate::math::{DVec3, Vec3};
use serde_yaml::Spanned;
use std::ops::RangeInclusive;

pub(super) type Read<T> = Result<T, Wrong>;

/// A map of which all keys are known.
pub(super) struct Fields<'a> {
    node: &'a Node,
    entries: &'a [(Spanned<String>, Node)],
}

impl<'a> Fields<'a> {
    /// The map in a node; a key that is in none of the lists is an error at that key.
    pub(super) fn of(node: &'a Node, known: &[&[&str]]) -> Read<Self> {
        let entries = entries(node)?;
        let known = known.concat();
        match entries.iter().find(|(key, _)| !known.contains(&key.value.as_str())) {
            None => Ok(Self { node, entries }),
            Some((key, _)) => {
                let hint = nearest(&key.value, known.iter().copied());
                let known = listed(known.iter().copied());
                Err(Wrong::at(key, format!("unknown key `{}`{hint}; allowed: {known}", key.value)))
            }
        }
    }

    /// The value of a key, if the key is there.
    pub(super) fn node(&self, key: &str) -> Option<&'a Node> {
        self.entries.iter().find(|(k, _)| k.value == key).map(|(_, node)| node)
    }

    /// The value of a key as it is read; an error names the key.
    pub(super) fn get<T>(&self, key: &str, read: impl FnOnce(&Node) -> Read<T>) -> Read<Option<T>> {
        self.node(key).map(|node| read(node).map_err(|wrong| about(key, wrong))).transpose()
    }

    /// The value of a key that must be there.
    pub(super) fn need<T>(&self, key: &str, read: impl FnOnce(&Node) -> Read<T>) -> Read<T> {
        self.get(key, read)?.ok_or_else(|| Wrong::at(self.node, format!("`{key}` is missing")))
    }
}

/// Names the key that an error is about, with those around it: `camera.eye`.
pub(super) fn about(key: &str, wrong: Wrong) -> Wrong {
    let key = wrong.key.map_or_else(|| key.to_string(), |inner| format!("{key}.{inner}"));
    Wrong { key: Some(key), ..wrong }
}

/// What is told of a value of another kind than what is wanted.
pub(super) fn unexpected(node: &Node, wanted: &str) -> Wrong {
    let remedy = match node.value {
        Value::Number(_) | Value::Long(_) | Value::Bool(_) if wanted.starts_with("text") => {
            "; put it into quotes"
        }
        _ => "",
    };
    Wrong::at(node, format!("expected {wanted}, found {}{remedy}", node.value))
}

/// The entries of a map with any keys.
pub(super) fn entries(node: &Node) -> Read<&[(Spanned<String>, Node)]> {
    match &node.value {
        Value::Map(entries) => Ok(entries),
        _ => Err(unexpected(node, "a map")),
    }
}

/// The elements of a list.
pub(super) fn elements(node: &Node) -> Read<&[Node]> {
    match &node.value {
        Value::List(list) => Ok(list),
        _ => Err(unexpected(node, "a list")),
    }
}

/// A list, each element read.
pub(super) fn list<T>(read: impl Fn(&Node) -> Read<T>) -> impl Fn(&Node) -> Read<Vec<T>> {
    move |node| elements(node)?.iter().map(&read).collect()
}

/// A number within a range.
pub(super) fn number(range: RangeInclusive<f64>) -> impl Fn(&Node) -> Read<f64> {
    move |node| match node.value.number() {
        Some(x) => within(x, &range).map_err(|e| Wrong::at(node, e)),
        None => Err(unexpected(node, &format!("a number {}", limits::told(&range)))),
    }
}

/// A whole number within a range.
pub(super) fn whole(range: RangeInclusive<f64>) -> impl Fn(&Node) -> Read<f64> {
    move |node| match node.value.number() {
        Some(x) if x.fract() == 0.0 => within(x, &range).map_err(|e| Wrong::at(node, e)),
        _ => Err(unexpected(node, &format!("a whole number {}", limits::told(&range)))),
    }
}

/// A whole number of 64 bits, as numbers of frames are: none is rounded.
pub(super) fn integer(node: &Node) -> Read<i64> {
    // the first f64 beyond them
    const END: f64 = 9_223_372_036_854_775_808.0;
    match node.value {
        Value::Long(x) => Ok(x),
        Value::Number(x) if x.fract() == 0.0 && (-END..END).contains(&x) => Ok(x as i64),
        _ => Err(unexpected(node, &format!("a whole number from {} to {}", i64::MIN, i64::MAX))),
    }
}

/// `true` or `false`.
pub(super) fn truth(node: &Node) -> Read<bool> {
    match node.value {
        Value::Bool(x) => Ok(x),
        _ => Err(unexpected(node, "true or false")),
    }
}

/// Text that is not empty.
pub(super) fn text(node: &Node) -> Read<String> {
    match &node.value {
        Value::Text(text) if !text.is_empty() => Ok(text.clone()),
        _ => Err(unexpected(node, "text")),
    }
}

/// Text with a meaning.
pub(super) fn parsed<T>(parse: impl Fn(&str) -> Result<T, String>) -> impl Fn(&Node) -> Read<T> {
    move |node| parse(&text(node)?).map_err(|e| Wrong::at(node, e))
}

/// Frame numbers: `1-48`, or a single one.
pub(super) fn frames(node: &Node) -> Read<FrameSet> {
    match node.value {
        Value::Text(_) => parsed(str::parse)(node),
        _ => integer(node)
            .map(|n| FrameSet::from_numbers(&[n]))
            .map_err(|_| unexpected(node, "frame numbers, as 1-48, 1-48x2 or 5,7,9-12")),
    }
}

/// Three numbers.
pub(super) fn vector(node: &Node) -> Read<DVec3> {
    let number = number(limits::NUMBER);
    match &node.value {
        Value::List(list) if list.len() == 3 => {
            Ok(DVec3::new(number(&list[0])?, number(&list[1])?, number(&list[2])?))
        }
        _ => Err(unexpected(node, "three numbers, as [0, 1, 0]")),
    }
}

/// Three numbers that are a way to go.
pub(super) fn direction(node: &Node) -> Read<DVec3> {
    match vector(node)? {
        DVec3::ZERO => Err(Wrong::at(node, "a direction must not be [0, 0, 0]")),
        v => Ok(v),
    }
}

/// Three numbers, or one that stands for all three.
pub(super) fn triple(node: &Node) -> Read<DVec3> {
    match node.value {
        Value::Number(_) | Value::Long(_) => number(limits::NUMBER)(node).map(DVec3::splat),
        _ => vector(node),
    }
}

/// Linear RGB, not negative; one number stands for all channels.
pub(super) fn color(node: &Node) -> Read<Vec3> {
    let color = triple(node)?;
    for x in color.to_array() {
        within(x, &limits::COLOR).map_err(|e| Wrong::at(node, e))?;
    }
    Ok(color.as_vec3())
}
