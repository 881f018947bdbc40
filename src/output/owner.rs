//! Names of files that tell which process they belong to: `HOST.PID.START.N` between a prefix and a suffix. START, when the
//! process began, tells it from a later one of the same number; it is left out where the system does not say.

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
    format!("{prefix}{}.{n}{suffix}", *PROCESS)
}

/// The first words of all names of this process.
static PROCESS: LazyLock<String> = LazyLock::new(|| {
    let (host, pid) = (this_host().unwrap_or("unknown"), std::process::id());
    process(pid).map_or_else(|| format!("{host}.{pid}"), |(_, start)| format!("{host}.{pid}.{start}"))
});

/// Whether a file has such a name, and its process is dead (known on this host alone) or it is older than a day.
pub(super) fn is_dead(path: &Path, prefix: &str, suffix: &str) -> bool {
    let name = path.file_name().and_then(|n| n.to_str());
    let Some(owner) = name.and_then(|name| owner(name, prefix, suffix)) else { return false };
    owner.is_gone() || is_old(path)
}

/// Whether the process of a name that [`own_name`] made without prefix and suffix has ended; known on this host alone.
pub fn is_gone(name: &str) -> bool {
    owner(name, "", "").is_some_and(|owner| owner.is_gone())
}

/// What a name tells of its process.
#[derive(Debug, PartialEq)]
struct Owner<'a> {
    host: &'a str,
    pid: u32,
    start: Option<u64>,
}

impl Owner<'_> {
    fn is_gone(&self) -> bool {
        this_host() == Some(self.host)
            && match process(self.pid) {
                // one that has ended and for whose exit status nobody has asked runs no more
                Some(('Z' | 'X', _)) | None => true,
                Some((_, start)) => self.start.is_some_and(|began| began != start),
            }
    }
}

/// The state of a process and when it began, in ticks since the machine did: the 3rd and the 22nd field of proc(5)'s stat. The
/// second is in brackets and may hold anything.
fn process(pid: u32) -> Option<(char, u64)> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let mut fields = stat.rsplit(')').next()?.split_ascii_whitespace();
    let state = fields.next()?.chars().next()?;
    Some((state, fields.nth(18)?.parse().ok()?))
}

fn owner<'a>(name: &'a str, prefix: &str, suffix: &str) -> Option<Owner<'a>> {
    let words: Vec<&str> = name.strip_prefix(prefix)?.strip_suffix(suffix)?.split('.').collect();
    let (host, pid, start, n) = match words[..] {
        [host, pid, n] => (host, pid, None, n),
        [host, pid, start, n] => (host, pid, Some(start.parse().ok()?), n),
        _ => return None,
    };
    n.parse::<u64>().ok()?;
    Some(Owner { host, pid: pid.parse().ok()?, start })
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
        assert_eq!(owner(&one, ".a-", ".tmp").unwrap().pid, std::process::id());
        let without_start = Owner { host: "h", pid: 7, start: None };
        assert_eq!(owner(".a-h.7.0.tmp", ".a-", ".tmp"), Some(without_start));
        for foreign in [
            ".a-h.1.tmp",
            ".a-h.x.1.tmp",
            ".a-h.1.1.1.1.tmp",
            ".a-h.1.x.1.tmp",
            ".a-h.1.x.tmp",
            ".b-h.1.1.tmp",
            ".a-h.1.1",
        ] {
            assert_eq!(owner(foreign, ".a-", ".tmp"), None, "{foreign}");
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_later_process_of_the_same_number_is_another_one() {
        let own = own_name("", "");
        assert!(!is_gone(&own));
        let start = process(std::process::id()).unwrap().1;
        let earlier = own.replace(&format!(".{start}."), &format!(".{}.", start - 1));
        assert!(earlier != own && is_gone(&earlier), "{earlier}");
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
