//! Materials that a job speaks of: a name that no frame has changes nothing and is most likely misspelt.

use crate::format::MaterialOverride;
use crate::warning::Warnings;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// The names that the frames so far were read with.
#[derive(Debug, Default)]
pub(super) struct Spoken {
    names: Mutex<BTreeMap<Vec<u8>, Name>>,
}

#[derive(Debug)]
struct Name {
    said_in: PathBuf,
    /// Whether a frame has such a material.
    is_met: bool,
}

impl Spoken {
    /// Takes what a frame was read with; `is_unmet` tells whether none of its files has a name.
    pub(super) fn see(&self, overrides: &[MaterialOverride], is_unmet: impl Fn(&[u8]) -> bool) {
        if overrides.is_empty() {
            return;
        }
        let mut names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        for spoken in overrides {
            let new = || Name { said_in: spoken.said_in.clone(), is_met: false };
            let name = names.entry(spoken.name.clone()).or_insert_with(new);
            name.is_met |= !is_unmet(&spoken.name);
        }
    }

    /// A warning for each name that no frame has.
    pub(super) fn unmet(&self) -> Warnings {
        let mut warnings = Warnings::default();
        let names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        for (name, Name { said_in, .. }) in names.iter().filter(|(_, name)| !name.is_met) {
            let name = String::from_utf8_lossy(name).replace(char::is_control, "\u{fffd}");
            let text =
                format!("materials: no frame has a material `{name}`; what is said of it changes nothing");
            warnings.add(Some(said_in), None, text);
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_unmet_where_no_frame_has_it() {
        let spoken = Spoken::default();
        let overrides = ["a", "b"].map(|name| MaterialOverride {
            name: name.into(),
            words: Vec::new(),
            said_in: "j.yaml".into(),
        });
        assert!(spoken.unmet().is_empty());
        spoken.see(&overrides, |_| true);
        spoken.see(&overrides, |name| name == b"b");
        spoken.see(&overrides[..1], |_| true);
        let told = spoken.unmet().list();
        assert!(
            told.len() == 1
                && told[0].to_string().starts_with("j.yaml: materials: no frame has a material `b`")
        );
    }
}
