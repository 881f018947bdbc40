//! What the program says. A reader that is gone or a full disk ends neither a run nor a daemon: what cannot be said is not.

use anstream::ColorChoice;
use std::fmt::Arguments;
use std::io::Write as _;

/// A line for programs, on stdout.
macro_rules! out {
    ($($line:tt)*) => { $crate::cli::say::out(format_args!($($line)*)) };
}

/// A line for people, on stderr.
macro_rules! err {
    ($($line:tt)*) => { $crate::cli::say::err(format_args!($($line)*)) };
}

/// When lines for people have colours: by what stands behind `--color`, else on terminals.
pub(super) fn color(words: impl IntoIterator<Item = std::ffi::OsString>) -> ColorChoice {
    let mut words = words.into_iter();
    let mut choice = ColorChoice::Auto;
    while let Some(word) = words.next() {
        let word = word.to_string_lossy();
        let when = match word.strip_prefix("--color") {
            Some("") => words.next().unwrap_or_default().to_string_lossy().into_owned(),
            Some(rest) => rest.trim_start_matches('=').to_string(),
            None => continue,
        };
        choice = match when.as_str() {
            "always" => ColorChoice::Always,
            "never" => ColorChoice::Never,
            _ => ColorChoice::Auto,
        };
    }
    choice
}

pub(super) fn out(line: Arguments) {
    let _ = writeln!(std::io::stdout().lock(), "{line}");
}

pub(super) fn err(line: Arguments) {
    let line = line.to_string();
    let mut stream = anstream::stderr().lock();
    let labels = [("error:", "\x1b[1;31m"), ("warning:", "\x1b[1;33m")];
    let _ = match labels.iter().find_map(|(label, style)| Some((label, style, line.strip_prefix(label)?))) {
        Some((label, style, rest)) => writeln!(stream, "{style}{label}\x1b[0m{rest}"),
        None => writeln!(stream, "{line}"),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_color_that_is_asked_for_counts() {
        let color = |line: &str| super::color(line.split(' ').map(Into::into));
        assert_eq!(color("rentix render walk"), ColorChoice::Auto);
        assert_eq!(color("rentix --color never render walk"), ColorChoice::Never);
        assert_eq!(color("rentix render --color=never --color always walk"), ColorChoice::Always);
        assert_eq!(color("rentix render walk --color"), ColorChoice::Auto);
    }
}
