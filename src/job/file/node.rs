//! YAML as a tree in which every key and value knows its line and column.

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_yaml::Spanned;
use std::fmt;

/// A value and where it stands.
pub(super) type Node = Spanned<Value>;

/// What YAML has. Maps keep their order; no key stands twice.
#[derive(Debug)]
pub(super) enum Value {
    Null,
    Bool(bool),
    Number(f64),
    /// A whole number that f64 may not hold.
    Long(i64),
    Text(String),
    List(Vec<Node>),
    Map(Vec<(Spanned<String>, Node)>),
}

impl Value {
    /// The number nearest to a number.
    pub(super) fn number(&self) -> Option<f64> {
        match *self {
            Self::Number(x) => Some(x),
            Self::Long(x) => Some(x as f64),
            _ => None,
        }
    }
}

/// What is wrong, and where: line and column from 1.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Wrong {
    pub(super) line: u64,
    pub(super) column: u64,
    /// The key that it is about, if it is about one, behind those around it: `camera.eye`.
    pub(super) key: Option<String>,
    pub(super) text: String,
}

impl Wrong {
    /// Something wrong with a value or a key.
    pub(super) fn at<T>(node: &Spanned<T>, text: impl Into<String>) -> Self {
        let place = node.referenced;
        Self { line: place.line(), column: place.column(), key: None, text: text.into() }
    }
}

/// Where a value stands, as it follows a file's name: `:LINE:COLUMN`.
pub(super) fn place_of(node: &Node) -> String {
    format!(":{}:{}", node.referenced.line(), node.referenced.column())
}

impl fmt::Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(key) = &self.key {
            write!(f, "{key}: ")?;
        }
        f.write_str(&self.text)
    }
}

/// Reads one YAML 1.2 document. How deep it nests and what aliases make of it are bounded by the library.
pub(super) fn parse(text: &str) -> Result<Node, Wrong> {
    // `up: y` is the letter; a number that is not finite is out of every range
    let options = serde_yaml::options! {
        strict_booleans: true,
        non_finite_float_policy: serde_yaml::NonFiniteFloatPolicy::PassThrough,
        with_snippet: false,
    };
    serde_yaml::from_str_with_options(text, options).map_err(|error| {
        let (line, column) = error.location().map_or((1, 1), |l| (l.line(), l.column()));
        let cause = match &error {
            serde_yaml::Error::AliasError { error, .. } => error,
            error => error,
        };
        let text = match cause {
            serde_yaml::Error::DuplicateMappingKey { key, .. } => {
                format!("duplicate key `{}`; remove one", key.as_deref().unwrap_or_default())
            }
            serde_yaml::Error::Budget { .. } => {
                "is too much for a job file with all that its aliases stand for".to_string()
            }
            serde_yaml::Error::MultipleDocuments { .. } => {
                "multiple YAML documents, parted by `---`; a job file is one: remove the others".to_string()
            }
            cause if let Some((line, column)) = indenting_tab(text, line, &cause.to_string()) => {
                let text = "a tab indents this line; in YAML only blanks do".to_string();
                return Wrong { line, column, key: None, text };
            }
            // the place stands in front already
            cause => cause.to_string().split(" at line ").next().unwrap_or_default().to_string(),
        };
        Wrong { line, column, key: None, text }
    })
}

/// Where a tab stands among the blanks before the line of an error; where the library speaks of a tab, before that line or
/// a later one: it may name the value before it.
fn indenting_tab(text: &str, line: u64, told: &str) -> Option<(u64, u64)> {
    let is_meant = |number: u64| number == line || (number > line && told.contains("found a tab"));
    let tab = |line: &str| line.find(|c| c != ' ').filter(|&at| line[at..].starts_with('\t'));
    let mut lines = (1..).zip(text.lines()).filter(|(number, _)| is_meant(*number));
    lines.find_map(|(number, line)| tab(line).map(|at| (number, at as u64 + 1)))
}

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(AnyValue)
    }
}

struct AnyValue;

/// All whole numbers up to this are f64.
const EXACT: u64 = 1 << 53;

impl<'de> Visitor<'de> for AnyValue {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, x: bool) -> Result<Value, E> {
        Ok(Value::Bool(x))
    }

    fn visit_i64<E>(self, x: i64) -> Result<Value, E> {
        Ok(if x.unsigned_abs() <= EXACT { Value::Number(x as f64) } else { Value::Long(x) })
    }

    fn visit_u64<E>(self, x: u64) -> Result<Value, E> {
        let is_exact = x <= EXACT;
        Ok(i64::try_from(x).ok().filter(|_| !is_exact).map_or(Value::Number(x as f64), Value::Long))
    }

    fn visit_f64<E>(self, x: f64) -> Result<Value, E> {
        Ok(Value::Number(x))
    }

    fn visit_str<E>(self, x: &str) -> Result<Value, E> {
        Ok(Value::Text(x.to_string()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut list = Vec::new();
        while let Some(node) = access.next_element()? {
            list.push(node);
        }
        Ok(Value::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let mut map = Vec::new();
        while let Some(entry) = access.next_entry()? {
            map.push(entry);
        }
        Ok(Value::Map(map))
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Null => f.write_str("nothing"),
            Self::Bool(x) => write!(f, "{x}"),
            Self::Number(x) => write!(f, "the number {x}"),
            Self::Long(x) => write!(f, "the number {x}"),
            Self::Text(x) => write!(f, "the text `{x}`"),
            Self::List(list) => write!(f, "a list of {}", list.len()),
            Self::Map(_) => f.write_str("a map"),
        }
    }
}
