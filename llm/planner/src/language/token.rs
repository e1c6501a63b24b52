//! An instruction cut into words and stops.

use super::ParseError;
use crate::task::Span;

/// Longest instruction that is read, bytes.
pub const MAX_BYTES: usize = 4000;
/// Most words and stops of an instruction.
pub const MAX_TOKENS: usize = 300;

/// A word in lower case, or a stop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Token {
    pub text: String,
    pub span: Span,
    /// Whether it is punctuation that ends a clause.
    pub stop: bool,
}

/// Cuts a text. `'s` and `'ve` become words of their own, so that genitives and contractions need no entries.
pub(super) fn tokenize(text: &str) -> Result<Vec<Token>, ParseError> {
    if text.len() > MAX_BYTES {
        return Err(ParseError::TooLong { unit: "bytes", length: text.len(), limit: MAX_BYTES });
    }
    let mut tokens: Vec<Token> = Vec::new();
    let mut word: Option<(usize, String)> = None;
    for (at, character) in text.char_indices() {
        let character = if matches!(character, '\u{2019}' | '\u{2018}') { '\'' } else { character };
        if character.is_alphanumeric() || character == '\'' || character == '-' {
            let (_, letters) = word.get_or_insert_with(|| (at, String::new()));
            letters.extend(character.to_lowercase());
            continue;
        }
        finish(&mut tokens, word.take(), at);
        if matches!(character, ',' | ';' | '.' | ':' | '!' | '?' | '\u{2013}' | '\u{2014}' | '(' | ')' | '\n') {
            let end = at + character.len_utf8();
            tokens.push(Token { text: character.to_string(), span: Span { start: at, end }, stop: true });
        }
    }
    finish(&mut tokens, word.take(), text.len());
    if tokens.len() > MAX_TOKENS {
        return Err(ParseError::TooLong { unit: "words", length: tokens.len(), limit: MAX_TOKENS });
    }
    Ok(tokens)
}

fn finish(tokens: &mut Vec<Token>, word: Option<(usize, String)>, end: usize) {
    let Some((start, letters)) = word else { return };
    let span = Span { start, end };
    let trimmed = letters.trim_matches('\'');
    if trimmed.chars().all(|c| c == '-') {
        // A dash between spaces separates clauses; stray quotes say nothing.
        if !trimmed.is_empty() {
            tokens.push(Token { text: "-".into(), span, stop: true });
        }
        return;
    }
    let trimmed = trimmed.trim_matches('-');
    let (stem, tail) = match (trimmed.strip_suffix("'s"), trimmed.strip_suffix("'ve")) {
        (Some(stem), _) if stem != "let" => (stem, Some("'s")),
        (_, Some(stem)) => (stem, Some("have")),
        _ => (trimmed, None),
    };
    tokens.push(Token { text: stem.into(), span, stop: false });
    tokens.extend(tail.map(|tail| Token { text: tail.into(), span, stop: false }));
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics fails, which is what it shall do")]
    use super::*;

    fn words(text: &str) -> Vec<String> {
        tokenize(text).unwrap().into_iter().map(|token| token.text).collect()
    }

    #[test]
    fn contractions_genitives_and_dashes_are_cut() {
        assert_eq!(words("Once you\u{2019}ve pressed it"), ["once", "you", "have", "pressed", "it"]);
        assert_eq!(words("the cube's left-hand mat - done"), ["the", "cube", "'s", "left-hand", "mat", "-", "done"]);
        assert_eq!(words("let's 'go'"), ["let's", "go"]);
    }

    #[test]
    fn spans_point_into_the_text_even_after_wide_characters() {
        let text = "\u{201c}Öffne\u{201d}, BRING it";
        let tokens = tokenize(text).unwrap();
        let bring = tokens.iter().find(|token| token.text == "bring").unwrap();
        assert_eq!(bring.span.of(text), "BRING");
    }
}
