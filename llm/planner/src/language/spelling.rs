//! Typing errors: a word that nobody knows is read as the one known word that it nearly is.
//!
//! Only where the text has no reading as it stands; and what was read for what is kept with the task.

use super::token::Token;
use crate::{lexicon::Lexicon, task::Correction};
use acm_concept::template::TemplateLibrary;
use std::collections::BTreeSet;

/// Letters from which on a word may have one letter wrong; shorter ones are too often other words.
const ONE_WRONG: usize = 5;
/// Letters from which on it may have two.
const TWO_WRONG: usize = 8;

/// The tokens with typing errors put right, and which; `None` if there are none.
pub(super) fn corrected(
    lexicon: &Lexicon,
    library: &TemplateLibrary,
    text: &str,
    tokens: &[Token],
) -> Option<(Vec<Token>, Vec<Correction>)> {
    let nouns = library.iter().flat_map(|template| &template.synopsis.nouns).map(|noun| noun.noun.as_str());
    let named: BTreeSet<&str> =
        nouns.chain(lexicon.everyday_words_of(library)).flat_map(str::split_whitespace).collect();
    let known = |word: &str| lexicon.knows(word) || stems(word).any(|stem| named.contains(stem) || lexicon.knows(stem));
    let (mut tokens, mut corrections) = (tokens.to_vec(), Vec::new());
    for token in tokens.iter_mut().filter(|token| !token.stop && !known(&token.text)) {
        let words = named.iter().copied().chain(lexicon.every_word());
        let Some(read) = nearest(&token.text, words) else { continue };
        corrections.push(Correction { text: token.span.of(text).to_owned(), span: token.span, read: read.clone() });
        token.text = read;
    }
    let doubled =
        |at: &usize| matches!(tokens.get(*at..=*at + 1), Some([one, two]) if !one.stop && one.text == two.text);
    for at in (0..tokens.len()).rev().filter(doubled).collect::<Vec<_>>() {
        let second = tokens.remove(at + 1);
        let span = tokens.get(at).map_or(second.span, |first| first.span.join(second.span));
        corrections.push(Correction { text: span.of(text).to_owned(), span, read: second.text });
    }
    (!corrections.is_empty()).then_some((tokens, corrections))
}

/// A word and what it may be the plural of.
fn stems(word: &str) -> impl Iterator<Item = &str> {
    [Some(word), word.strip_suffix('s'), word.strip_suffix("es")].into_iter().flatten()
}

/// The known word that is fewer letters away than every other; begun alike, unless the first two letters are swapped.
fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    let length = word.chars().count();
    let reach = match length {
        TWO_WRONG.. => 2,
        ONE_WRONG.. => 1,
        _ => 0,
    };
    if word.chars().any(|letter| !letter.is_alphabetic()) {
        return None;
    }
    let near = |known: &str| {
        let letters = |word: &str| {
            let mut letters: Vec<char> = word.chars().collect();
            letters.sort_unstable();
            letters
        };
        let distance = strsim::osa_distance(word, known);
        let swapped = distance == 1 && length > 3 && letters(word) == letters(known);
        let alike =
            word.chars().next() == known.chars().next() && distance <= reach && known.chars().count() >= ONE_WRONG - 1;
        (swapped || alike).then_some(distance)
    };
    let mut best: Option<(usize, BTreeSet<String>)> = None;
    let mut consider = |candidate: &str| {
        let Some(distance) = near(candidate) else { return };
        match &mut best {
            Some((least, _)) if distance > *least => {}
            Some((least, words)) if distance == *least => _ = words.insert(candidate.to_owned()),
            _ => best = Some((distance, BTreeSet::from([candidate.to_owned()]))),
        }
    };
    for one in known {
        // A word is taken for a plural where it ends like one.
        match word.ends_with('s') && !one.ends_with('s') {
            true => consider(&format!("{one}s")),
            false => consider(one),
        }
    }
    let (_, words) = best?;
    <[String; 1]>::try_from(words.into_iter().collect::<Vec<_>>()).ok().map(|[word]| word)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics fails, which is what it shall do")]
    use super::*;

    const KNOWN: [&str; 6] = ["cube", "table", "potato", "refrigerator", "shelf", "spoon"];

    fn read(word: &str) -> Option<String> {
        nearest(word, KNOWN.into_iter())
    }

    #[test]
    fn a_letter_too_many_too_few_wrong_or_swapped_is_put_right() {
        for (wrong, right) in [
            ("cbue", "cube"),
            ("tabel", "table"),
            ("tabble", "table"),
            ("potatoe", "potato"),
            ("refridgeratr", "refrigerator"),
            ("spoonss", "spoons"),
        ] {
            assert_eq!(read(wrong).as_deref(), Some(right), "{wrong}");
        }
    }

    #[test]
    fn what_may_be_another_word_is_left_alone() {
        // Too short, another beginning, too far away, a number, and as near to two.
        for word in ["cubs", "stable", "tripod", "tab1e", "x"] {
            assert_eq!(read(word), None, "{word}");
        }
        assert_eq!(nearest("tible", ["table", "title"].into_iter()), None);
    }
}
