//! `rentix cache`.

use super::{EXIT_FAILED, Global, store::store};
use crate::store::{Removed, Stat};
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::process::ExitCode;

/// What `cache` takes.
#[derive(Args, Debug)]
pub(super) struct CacheArgs {
    /// What to do
    what: What,
    /// Where the store is [default: as in render]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum What {
    /// Tell what is in it
    Stat,
    /// Bring it within its limit, the longest unused first
    Gc,
    /// Remove everything
    Clear,
}

/// Tells what is in the store, or removes of it.
pub(super) fn cache(args: &CacheArgs, global: &Global) -> Result<ExitCode> {
    let Some(store) = store(args.cache.as_deref()) else {
        bail!("there is no place for a store; --cache or RENTIX_CACHE names one");
    };
    let removed = match args.what {
        What::Stat => Removed::default(),
        What::Gc => store.collect_garbage(),
        What::Clear => store.clear(),
    };
    let Stat { entries, bytes } = store.stat();
    let (root, limit_bytes) = (store.root().display(), store.limit_bytes());
    if global.json {
        let line = serde_json::json!({
            "folder": root.to_string(), "entries": entries, "bytes": bytes, "limit_bytes": limit_bytes,
            "removed": removed.gone,
        });
        out!("{line}");
    } else {
        if !matches!(args.what, What::Stat) {
            out!("{} entries removed, {} bytes", removed.gone.entries, removed.gone.bytes);
        }
        out!("{root}: {entries} entries, {bytes} bytes of {limit_bytes}");
    }
    let Some(why) = &removed.why else { return Ok(ExitCode::SUCCESS) };
    err!("error: {why}; {} files or folders stay (look who may write there)", removed.failed);
    Ok(ExitCode::from(EXIT_FAILED))
}
