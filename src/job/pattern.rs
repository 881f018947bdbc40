//! Patterns of names: `*` is any text, `?` any byte, `####` and `%04d` a number of at least that many digits, `%d` any
//! number.

/// A pattern, matched in time proportional to its length times that of the name.
#[derive(Clone, Debug)]
pub(super) struct Pattern(Vec<Piece>);

/// Which bytes, and how often.
#[derive(Clone, Copy, Debug)]
struct Piece {
    class: Class,
    times: Times,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    Byte(u8),
    Digit,
    Any,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Times {
    Once,
    AtMostOnce,
    Any,
}

impl Class {
    fn holds(self, byte: u8) -> bool {
        match self {
            Self::Byte(b) => b == byte,
            Self::Digit => byte.is_ascii_digit(),
            Self::Any => true,
        }
    }
}

/// Longer numbers are in no name that a file system takes.
const MAX_DIGITS: usize = 255;

impl Pattern {
    /// What a text matches; one without any of the signs matches itself.
    pub(super) fn new(text: &[u8]) -> Self {
        let mut pieces = Vec::new();
        let mut rest = text;
        while let Some((&first, behind)) = rest.split_first() {
            let mut add = |class, times| pieces.push(Piece { class, times });
            rest = behind;
            match first {
                b'*' => add(Class::Any, Times::Any),
                b'?' => add(Class::Any, Times::Once),
                b'#' => {
                    let more = behind.iter().take_while(|b| **b == b'#').count();
                    add_number(1 + more, &mut add);
                    rest = &behind[more..];
                }
                b'%' if percent_d(behind).is_some() => {
                    let (digits, length) = percent_d(behind).unwrap_or_default();
                    add_number(digits, &mut add);
                    rest = &behind[length..];
                }
                byte => add(Class::Byte(byte), Times::Once),
            }
        }
        Self(pieces)
    }

    /// Whether it has any of the signs.
    pub(super) fn has_signs(&self) -> bool {
        self.0.iter().any(|p| !matches!(p.class, Class::Byte(_)))
    }

    /// Whether it matches a whole name.
    pub(super) fn matches(&self, name: &[u8]) -> bool {
        // all places in the pattern that the bytes so far may have led to
        let mut at = vec![false; self.0.len() + 1];
        at[0] = true;
        self.pass_over(&mut at);
        for &byte in name {
            let mut next = vec![false; at.len()];
            for (i, piece) in self.0.iter().enumerate() {
                if at[i] && piece.class.holds(byte) {
                    next[if piece.times == Times::Any { i } else { i + 1 }] = true;
                }
            }
            self.pass_over(&mut next);
            at = next;
        }
        at[self.0.len()]
    }

    /// A piece that may be absent is passed over.
    fn pass_over(&self, at: &mut [bool]) {
        for (i, piece) in self.0.iter().enumerate() {
            at[i + 1] |= at[i] && piece.times != Times::Once;
        }
    }
}

fn add_number(digits: usize, add: &mut impl FnMut(Class, Times)) {
    add(Class::Byte(b'-'), Times::AtMostOnce);
    for _ in 0..digits {
        add(Class::Digit, Times::Once);
    }
    add(Class::Digit, Times::Any);
}

/// The digits that `%04d` asks for and its length, both without the percent sign.
fn percent_d(behind: &[u8]) -> Option<(usize, usize)> {
    let width = behind.iter().take_while(|b| b.is_ascii_digit()).count();
    let digits = behind[..width].iter().fold(0, |n, b| (n * 10 + usize::from(b - b'0')).min(MAX_DIGITS));
    (behind.get(width) == Some(&b'd')).then_some((digits.max(1), width + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matching(pattern: &str, names: &[&'static str]) -> Vec<&'static str> {
        let pattern = Pattern::new(pattern.as_bytes());
        names.iter().copied().filter(|n| pattern.matches(n.as_bytes())).collect()
    }

    #[test]
    fn signs() {
        let names = ["a_1", "a_12", "a_0012", "a_-3", "b_1", "a_", "a_1x"];
        assert_eq!(matching("a_#", &names), ["a_1", "a_12", "a_0012", "a_-3"]);
        assert_eq!(matching("a_##", &names), ["a_12", "a_0012"]);
        assert_eq!(matching("a_%04d", &names), ["a_0012"]);
        assert_eq!(matching("a_%d", &names), ["a_1", "a_12", "a_0012", "a_-3"]);
        assert_eq!(matching("?_1", &names), ["a_1", "b_1"]);
        assert_eq!(matching("*1*", &names), ["a_1", "a_12", "a_0012", "b_1", "a_1x"]);
        assert_eq!(matching("*", &names), names);
        assert_eq!(matching("a_1", &names), ["a_1"]);
        assert_eq!(matching("50%", &["50%"]), ["50%"]);
        assert!(Pattern::new(b"a*").has_signs() && !Pattern::new(b"a%x").has_signs());
    }

    #[test]
    fn many_stars_take_no_longer() {
        let pattern = Pattern::new("*a".repeat(100).as_bytes());
        assert!(!pattern.matches(("a".repeat(254) + "b").as_bytes()));
    }
}
