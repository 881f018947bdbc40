//! Names of files in records: paths of any bytes as words of printable ASCII.

use std::ffi::OsString;
use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

/// The name of a path: its components joined by `/`; `%` and all bytes but printable ASCII as `%xx`.
pub(super) fn name_from_path(path: &Path) -> String {
    let mut name = String::new();
    for component in path.components().filter(|component| *component != Component::CurDir) {
        if !name.is_empty() {
            name.push('/');
        }
        for &byte in component.as_os_str().as_encoded_bytes() {
            if byte.is_ascii_graphic() && byte != b'%' {
                name.push(char::from(byte));
            } else {
                // writing to a String cannot fail
                let _ = write!(name, "%{byte:02x}");
            }
        }
    }
    name
}

/// The path of a name; None where no path has it.
pub(super) fn path_from_name(name: &str) -> Option<PathBuf> {
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        if byte == b'%' {
            let (digits, after) = rest.split_at_checked(2)?;
            bytes.push(u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?);
            rest = after;
        } else {
            bytes.push(byte);
        }
    }
    os_string(bytes).map(PathBuf::from)
}

#[cfg(unix)]
#[expect(clippy::unnecessary_wraps, reason = "not every system's paths may be any bytes")]
fn os_string(bytes: Vec<u8>) -> Option<OsString> {
    Some(std::os::unix::ffi::OsStringExt::from_vec(bytes))
}

#[cfg(not(unix))]
fn os_string(bytes: Vec<u8>) -> Option<OsString> {
    String::from_utf8(bytes).ok().map(OsString::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_path_comes_back() {
        for (path, name) in [
            ("wave_0001.png", "wave_0001.png"),
            ("a b/100%.png", "a%20b/100%25.png"),
            ("tab\tline\n.png", "tab%09line%0a.png"),
            ("grün.png", "gr%c3%bcn.png"),
            ("./a//b.png", "a/b.png"),
            ("../c.png", "../c.png"),
        ] {
            assert_eq!(name_from_path(Path::new(path)), name);
            assert_eq!(name_from_path(&path_from_name(name).unwrap()), name);
        }
        #[cfg(unix)]
        {
            let odd: OsString = std::os::unix::ffi::OsStringExt::from_vec(b"\xff\x01\xfe.png".to_vec());
            let name = name_from_path(Path::new(&odd));
            assert_eq!(name, "%ff%01%fe.png");
            assert_eq!(path_from_name(&name).unwrap().as_os_str(), odd);
        }
        assert_eq!(path_from_name("torn%f"), None);
        assert_eq!(path_from_name("no%zz"), None);
    }
}
