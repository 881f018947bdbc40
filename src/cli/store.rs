//! Where the store on disk is.

use crate::store::{DEFAULT_LIMIT_BYTES, Store, is_own_checkout};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// `--cache DIR`, else `RENTIX_CACHE`, else `cache/` of a checkout in which the program is run, else the user's cache
/// folder. None where there is no such folder.
pub(super) fn store(cache: Option<&Path>) -> Option<Arc<Store>> {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let root = cache
        .map(Path::to_path_buf)
        .or_else(|| set("RENTIX_CACHE"))
        .or_else(|| is_own_checkout().then(|| PathBuf::from("cache")))
        .or_else(|| {
            Some(
                set("XDG_CACHE_HOME")
                    .filter(|p| p.is_absolute())
                    .or_else(|| Some(set("HOME")?.join(".cache")))?
                    .join("rentix"),
            )
        })?;
    Some(Arc::new(Store::new(&root, DEFAULT_LIMIT_BYTES)))
}
