//! Names of pictures: `{stem}`, `{name}`, `{frame}`, `{frame:04}`.

/// What a template is filled with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fill<'a> {
    pub(super) stem: &'a str,
    pub(super) name: &'a str,
    pub(super) frame: Option<i64>,
}

/// Whether a template can be filled where a frame has a number.
pub(super) fn check(template: &str) -> Result<(), String> {
    fill(template, Fill { stem: "stem", name: "name", frame: Some(0) }).map(drop)
}

/// Fills a template; an error says which placeholder is wrong.
pub(super) fn fill(template: &str, with: Fill<'_>) -> Result<String, String> {
    let mut out = String::new();
    let mut rest = template;
    while let Some(open) = rest.find('{') {
        out.push_str(&rest[..open]);
        let close = rest[open..].find('}').ok_or_else(|| format!("name `{template}`: a {{ is not closed"))?;
        out.push_str(
            &placeholder(&rest[open + 1..open + close], with)
                .map_err(|e| format!("name `{template}`: {e}"))?,
        );
        rest = &rest[open + close + 1..];
    }
    out.push_str(rest);
    if out.is_empty() || out.split(['/', '\\']).any(|part| part.is_empty() || part == "." || part == "..") {
        return Err(format!("name `{template}` gives `{out}`, which is no name of a picture"));
    }
    Ok(out)
}

fn placeholder(word: &str, with: Fill<'_>) -> Result<String, String> {
    let (word, width) = match word.split_once(':') {
        None => (word, 0),
        Some((word, width)) => {
            let digits = width.strip_prefix('0').unwrap_or(width).parse::<usize>().ok().filter(|w| *w <= 32);
            (word, digits.ok_or_else(|| format!("`{width}` is not a number of digits, as in {{frame:04}}"))?)
        }
    };
    match word {
        "stem" => Ok(with.stem.to_string()),
        "name" => Ok(with.name.to_string()),
        "frame" => with
            .frame
            .map(|f| number(f, width))
            .ok_or_else(|| format!("{} has no frame number; use {{stem}}", with.stem)),
        _ => Err(format!("there is no {{{word}}}; there are {{stem}}, {{name}}, {{frame}}, {{frame:04}}")),
    }
}

/// The sign stands before the zeros.
fn number(frame: i64, width: usize) -> String {
    let sign = if frame < 0 { "-" } else { "" };
    format!("{sign}{:0width$}", frame.unsigned_abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placeholders() {
        let with = Fill { stem: "walk_7", name: "walk", frame: Some(7) };
        let filled = |t: &str| fill(t, with).unwrap();
        assert_eq!(filled("{stem}-hd"), "walk_7-hd");
        assert_eq!(filled("{name}_{frame:04}.{frame}"), "walk_0007.7");
        assert_eq!(fill("{frame:03}", Fill { frame: Some(-5), ..with }).unwrap(), "-005");
        for bad in ["{frme}", "{frame", "{frame:x}", "../{stem}", "", "a//b"] {
            assert!(fill(bad, with).is_err() && check(bad).is_err(), "{bad}");
        }
        assert!(fill("{frame}", Fill { frame: None, ..with }).is_err() && check("{frame}").is_ok());
    }
}
