//! Files that tell by a mark in them that this program made them.

use crate::format::open_plain;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// So much of a file's beginning and end is looked at: formats have comments with what is said of the whole.
const LOOK_BYTES: u64 = 1 << 20;

/// Whether a mark stands near a file's beginning or end; in what cannot be read none does.
pub fn has_mark(path: &Path, mark: &str) -> bool {
    let Ok(Some((mut file, length))) = open_plain(path) else { return false };
    [0, length.saturating_sub(LOOK_BYTES)].into_iter().any(|from| {
        let mut part = Vec::new();
        file.seek(SeekFrom::Start(from)).is_ok()
            && file.by_ref().take(LOOK_BYTES).read_to_end(&mut part).is_ok()
            && part.windows(mark.len()).any(|w| w == mark.as_bytes())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_found_at_both_ends_and_nowhere_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("film");
        assert!(!has_mark(&file, "mark"));
        let far = vec![b'.'; 3 << 20];
        for (text, is_found) in [
            ([b"mark", &*far].concat(), true),
            ([&*far, b"mark"].concat(), true),
            ([&*far, b"mark", &*far].concat(), false),
            (b"mar".to_vec(), false),
        ] {
            std::fs::write(&file, text).unwrap();
            assert_eq!(has_mark(&file, "mark"), is_found);
        }
    }
}
