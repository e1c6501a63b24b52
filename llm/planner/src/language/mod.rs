//! From an instruction to a [`Task`].
//!
//! Words are cut (`token`), phrases and clauses are read by forms from the lexicon with bounded backtracking,
//! the longest reading first (`reader`, `noun`, `phrase`, `modifier`, `place`, `condition`, `clause`, `sentence`), and
//! references are joined (`interpret`). `syntax` is what is between the two.

mod clause;
mod condition;
mod error;
mod interpret;
mod modifier;
mod noun;
mod phrase;
mod place;
mod reader;
mod role;
mod rules;
mod sentence;
mod spelling;
mod syntax;
mod token;

pub use error::ParseError;
pub(crate) use interpret::{nouns_of, settle_subtasks};
pub(crate) use role::{CONTAINS, COVERING, Role, SUPPORTIVE};
pub use sentence::MAX_CLAUSES;
pub use token::{MAX_BYTES, MAX_TOKENS};

use crate::{lexicon::Lexicon, task::Task};
use acm_concept::template::TemplateLibrary;
use reader::{Expected, Reader};
use std::collections::BTreeSet;
use syntax::Sentence;
use token::Token;

/// Reads an instruction with the nouns and functions of a library; where it has no reading, with its typing errors put
/// right.
pub(crate) fn parse(lexicon: &Lexicon, library: &TemplateLibrary, text: &str) -> Result<Task, ParseError> {
    let read = |tokens: &[Token]| {
        let sentences = sentences(lexicon, library, text, tokens)?;
        interpret::interpret(lexicon, library, text, &sentences)
    };
    let tokens = token::tokenize(text)?;
    read(&tokens).or_else(|error| {
        let Some((tokens, corrections)) = spelling::corrected(lexicon, library, text, &tokens) else {
            return Err(error);
        };
        // What is wrong with the text as it was written is what the reader of the error can look up.
        read(&tokens).map_or(Err(error), |task| Ok(Task { corrections, ..task }))
    })
}

/// The names of the rules that the reading of an instruction rests on.
pub(crate) fn rules(lexicon: &Lexicon, library: &TemplateLibrary, text: &str) -> Result<BTreeSet<String>, ParseError> {
    Ok(rules::rules(lexicon, &sentences(lexicon, library, text, &token::tokenize(text)?)?))
}

fn sentences(
    lexicon: &Lexicon,
    library: &TemplateLibrary,
    text: &str,
    tokens: &[Token],
) -> Result<Vec<Sentence>, ParseError> {
    let tokens = without_ignored(lexicon, library, tokens);
    if tokens.iter().all(|token| token.stop) {
        return Err(ParseError::Empty);
    }
    let reader = Reader::new(lexicon, library, &tokens);
    let sentences = reader.sentences().ok_or_else(|| report(&reader, text))?;
    if sentences.len() > MAX_CLAUSES {
        return Err(ParseError::TooLong { unit: "clauses", length: sentences.len(), limit: MAX_CLAUSES });
    }
    Ok(sentences)
}

/// Drops words that say nothing here ("please", "carefully").
fn without_ignored(lexicon: &Lexicon, library: &TemplateLibrary, tokens: &[Token]) -> Vec<Token> {
    let kept = {
        let reader = Reader::new(lexicon, library, tokens);
        let mut kept = Vec::with_capacity(tokens.len());
        let mut at = 0;
        while at < tokens.len() {
            match reader.longest(at, &lexicon.words.ignored) {
                Some(end) => at = end,
                None => {
                    kept.push(at);
                    at += 1;
                }
            }
        }
        kept
    };
    let mut keep = kept.into_iter().peekable();
    let chosen = |(at, _): &(usize, &Token)| keep.next_if_eq(at).is_some();
    tokens.iter().enumerate().filter(chosen).map(|(_, token)| token.clone()).collect()
}

/// The farthest failure as an error.
fn report(reader: &Reader<'_>, text: &str) -> ParseError {
    let failure = reader.failure().unwrap_or(reader::Failure { at: 0, expected: Expected::Verb });
    let at = failure.at.min(reader.tokens.len().saturating_sub(1));
    // The span goes on over the unknown words that follow: "the coffee machine".
    let unknown = |place: usize| reader.word(place).is_some_and(|word| !reader.lexicon.known_words.contains(word));
    let mut end = at + 1;
    while failure.expected == Expected::Noun && unknown(end) && reader.noun(end).is_none() {
        end += 1;
    }
    let span = reader.span(at, end);
    let words = span.of(text).to_owned();
    if reader.exhausted() {
        let reason = "the sentence has too many readings: use shorter clauses".to_owned();
        return ParseError::Unreadable { text: words, span, reason };
    }
    match failure.expected {
        Expected::Noun => {
            let mut known = reader.nouns.iter().copied().collect::<Vec<_>>().join(", ");
            let lower = words.to_lowercase();
            let near = reader.nouns.iter().map(|noun| (strsim::damerau_levenshtein(&lower, noun), noun)).min();
            if let Some((_, noun)) = near.filter(|(distance, _)| *distance <= 1 + lower.chars().count() / 4) {
                known.push_str(&format!("; did you mean `{noun}`?"));
            }
            ParseError::UnknownNoun { text: words, span, known }
        }
        Expected::Verb => {
            let mut verbs: Vec<&str> = reader.lexicon.frames.iter().map(|frame| frame.name.as_str()).collect();
            verbs.dedup();
            let reason = format!("no known kind of request begins here; I know: {}", verbs.join(", "));
            ParseError::Unreadable { text: words, span, reason }
        }
        Expected::Other(what) if failure.at >= reader.tokens.len() => {
            ParseError::Unreadable { text: words, span, reason: format!("it ends where I expected {what}") }
        }
        Expected::Other(what) => ParseError::Unreadable { text: words, span, reason: format!("I expected {what}") },
    }
}
