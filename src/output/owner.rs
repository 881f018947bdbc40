//! Names of files that tell which process they belong to: `HOST.PID.N` between a prefix and a suffix.

use crate::clock;
use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Age at which a file is taken for a dead run's, wherever that ran.
const AGE_MAX_NS: u128 = 24 * 3_600 * 1_000_000_000;

/// A new name of this process, never given before by it.
pub fn own_name(prefix: &str, suffix: &str) -> String {
    static NAMES: AtomicU64 = AtomicU64::new(0);
    let n = NAMES.fetch_add(1, Ordering::Relaxed);
    let host = this_host().unwrap_or("unknown");
    format!("{prefix}{host}.{}.{n}{suffix}", std::process::id())
}

/// Whether a file has such a name, and its process is dead (known on this host alone) or it is older than a day.
pub(super) fn is_dead(path: &Path, prefix: &str, suffix: &str) -> bool {
    let name = path.file_name().and_then(|n| n.to_str());
    let Some((host, pid)) = name.and_then(|name| owner(name, prefix, suffix)) else { return false };
    is_gone_from(host, pid) || is_old(path)
}

/// Whether the process of a name that [`own_name`] made without prefix and suffix has ended; known on this host alone.
pub fn is_gone(name: &str) -> bool {
    owner(name, "", "").is_some_and(|(host, pid)| is_gone_from(host, pid))
}

fn is_gone_from(host: &str, pid: u32) -> bool {
    this_host() == Some(host) && !is_running(pid)
}

/// A process that has ended and for whose exit status nobody has asked runs no more (proc(5): its state is Z).
fn is_running(pid: u32) -> bool {
    let Ok(stat) = std::fs::read_to_string(format!("/proc/{pid}/stat")) else { return false };
    let state = stat.rsplit(')').next().and_then(|rest| rest.trim_start().chars().next());
    !matches!(state, Some('Z' | 'X'))
}

fn owner<'a>(name: &'a str, prefix: &str, suffix: &str) -> Option<(&'a str, u32)> {
    let mut words = name.strip_prefix(prefix)?.strip_suffix(suffix)?.split('.');
    let (host, pid) = (words.next()?, words.next()?.parse().ok()?);
    words.next()?.parse::<u64>().ok()?;
    words.next().is_none().then_some((host, pid))
}

fn is_old(path: &Path) -> bool {
    let modified = path.symlink_metadata().and_then(|m| m.modified());
    let since_epoch = modified.ok().and_then(|m| m.duration_since(std::time::UNIX_EPOCH).ok());
    since_epoch.is_some_and(|t| clock::unix_ns().saturating_sub(t.as_nanos()) > AGE_MAX_NS)
}

/// The name of what shares process numbers with this process: the host and, since containers of one host number their
/// processes anew, the namespace. None where the system does not say.
fn this_host() -> Option<&'static str> {
    static HOST: LazyLock<Option<String>> = LazyLock::new(|| {
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").ok()?;
        let namespace = std::fs::read_link("/proc/self/ns/pid").ok()?;
        let digits = namespace.to_str()?.chars().filter(char::is_ascii_digit);
        let plain = host.trim().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' });
        Some(plain.chain(['-']).chain(digits).collect())
    });
    HOST.as_deref()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::time::{Duration, SystemTime};

    /// A name of a process of this host that has ended.
    pub(crate) fn dead_name(prefix: &str, suffix: &str) -> String {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        own_name(prefix, suffix).replace(&format!(".{}.", std::process::id()), &format!(".{}.", child.id()))
    }

    pub(crate) fn make_old(path: &Path) {
        let days = Duration::from_hours(48);
        std::fs::File::options()
            .write(true)
            .open(path)
            .unwrap()
            .set_modified(SystemTime::now() - days)
            .unwrap();
    }

    #[test]
    fn names_tell_their_process() {
        let (one, two) = (own_name(".a-", ".tmp"), own_name(".a-", ".tmp"));
        assert_ne!(one, two);
        assert_eq!(owner(&one, ".a-", ".tmp").unwrap().1, std::process::id());
        for foreign in
            [".a-h.1.tmp", ".a-h.x.1.tmp", ".a-h.1.1.1.tmp", ".a-h.1.x.tmp", ".b-h.1.1.tmp", ".a-h.1.1"]
        {
            assert_eq!(owner(foreign, ".a-", ".tmp"), None, "{foreign}");
        }
    }

    #[test]
    fn the_dead_and_the_old() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, "").unwrap();
            path
        };
        let dead = |path: &Path| is_dead(path, "", ".log");
        let (ours, elsewhere) = (file(&own_name("", ".log")), file("elsewhere.1.0.log"));
        assert!(!dead(&ours) && !dead(&elsewhere));
        if this_host().is_some() {
            assert!(dead(&file(&dead_name("", ".log"))));
        }
        make_old(&elsewhere);
        assert!(dead(&elsewhere));
        let foreign = file("notes.log");
        make_old(&foreign);
        assert!(!dead(&foreign));
    }
}
