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

/// A line in one piece: others may write to the same place.
pub(super) fn out(line: Arguments) {
    let _ = std::io::stdout().write_all(format!("{line}\n").as_bytes());
}

pub(super) fn err(line: Arguments) {
    let line = format!("{line}\n");
    let styles = [("error:", "\x1b[1;31m"), ("warning:", "\x1b[1;33m")];
    let colored = |(label, style): &(&str, &str)| {
        line.strip_prefix(label).map(|rest| format!("{style}{label}\x1b[0m{rest}"))
    };
    let has_colors = anstream::stderr().current_choice() != ColorChoice::Never;
    let colored = if has_colors { styles.iter().find_map(colored) } else { None };
    let _ = std::io::stderr().write_all(colored.as_ref().unwrap_or(&line).as_bytes());
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
