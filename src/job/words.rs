//! Words that stand for choices, and the nearest one to a word that is none of them.

/// What a word stands for; else which words there are and which is nearest.
pub fn one_of<T: Copy>(table: &[(&str, T)], word: &str) -> Result<T, String> {
    table.iter().find(|(w, _)| *w == word).map(|(_, meaning)| *meaning).ok_or_else(|| {
        let words = || table.iter().map(|(w, _)| *w);
        format!("`{word}` is none of {}{}", listed(words()), nearest(word, words()))
    })
}

/// Words between commas.
pub(super) fn listed<'a>(words: impl Iterator<Item = &'a str>) -> String {
    words.collect::<Vec<_>>().join(", ")
}

/// ` (did you mean …?)`, or nothing where no known word is near.
pub(super) fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> String {
    match known.map(|k| (strsim::osa_distance(word, k), k)).min() {
        Some((distance, k)) if distance <= 1 + word.chars().count() / 3 => format!(" (did you mean `{k}`?)"),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_word_is_told_where_one_is_near() {
        let table = [("box", 1), ("triangle", 2)];
        assert_eq!(one_of(&table, "triangle"), Ok(2));
        assert_eq!(
            one_of(&table, "bx"),
            Err("`bx` is none of box, triangle (did you mean `box`?)".to_string())
        );
        assert_eq!(one_of(&table, "gauss"), Err("`gauss` is none of box, triangle".to_string()));
        // a swap of neighbours is one step
        assert_eq!(nearest("szie", ["eye", "size"].into_iter()), " (did you mean `size`?)");
    }
}
