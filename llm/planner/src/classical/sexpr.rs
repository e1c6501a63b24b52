//! Bracketed text, as PDDL and its relatives are written in: `(and (open ?door) (not (on ?cup ?table)))`.

use std::fmt;
use thiserror::Error;

/// Longest text, bytes.
pub const MAX_BYTES: usize = 1024 * 1024;
/// Deepest nesting of brackets.
pub const MAX_DEPTH: usize = 64;

/// A word or a list, with the line that it begins on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Expression {
    /// Line of the text, from 1.
    pub line: usize,
    /// What stands there.
    pub content: Content,
}

/// What an expression is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Content {
    /// A word: anything without space, bracket and semicolon.
    Word(String),
    /// What stands between two brackets.
    List(Vec<Expression>),
}

/// A text that is no expression, or that is too large for one.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ExpressionError {
    /// More text than is read.
    #[error("the text has {bytes} bytes; at most {MAX_BYTES} are read")]
    TooLong {
        /// Its length.
        bytes: usize,
    },
    /// More brackets within each other than are read.
    #[error("line {line}: brackets are nested deeper than {MAX_DEPTH}")]
    TooDeep {
        /// Where.
        line: usize,
    },
    /// A bracket that nothing opened.
    #[error("line {line}: `)` without `(`")]
    Unopened {
        /// Where.
        line: usize,
    },
    /// A bracket that nothing closes.
    #[error("line {line}: `(` is never closed")]
    Unclosed {
        /// Where it was opened.
        line: usize,
    },
    /// Nothing at all.
    #[error("the text holds no expression")]
    Empty,
    /// The form of a part is not what is expected there.
    #[error("line {line}: {problem}")]
    Form {
        /// Where.
        line: usize,
        /// What is expected and what stands there.
        problem: String,
    },
}

impl Expression {
    /// Reads a text: all expressions in it, in order. What follows `;` on a line is a comment. Closing brackets
    /// after the last expression are let pass, since published files have them.
    ///
    /// # Errors
    /// The text is too long or too deep, holds nothing, or has a bracket without its fellow.
    ///
    /// ```
    /// # use acm_planner::classical::sexpr::Expression;
    /// let read = Expression::parse("(open ?door) ; the fridge's").unwrap();
    /// assert_eq!(read[0].to_string(), "(open ?door)");
    /// ```
    pub fn parse(text: &str) -> Result<Vec<Expression>, ExpressionError> {
        if text.len() > MAX_BYTES {
            return Err(ExpressionError::TooLong { bytes: text.len() });
        }
        let mut read = Vec::new();
        let mut open: Vec<(usize, Vec<Expression>)> = Vec::new();
        for (number, line) in (1..).zip(text.lines()) {
            for token in Tokens(line) {
                let done = match token {
                    "(" if open.len() == MAX_DEPTH => return Err(ExpressionError::TooDeep { line: number }),
                    "(" => {
                        open.push((number, Vec::new()));
                        continue;
                    }
                    ")" => match open.pop() {
                        Some((line, items)) => Expression { line, content: Content::List(items) },
                        None if read.is_empty() => return Err(ExpressionError::Unopened { line: number }),
                        None => continue,
                    },
                    word => Expression { line: number, content: Content::Word(word.into()) },
                };
                open.last_mut().map_or(&mut read, |(_, items)| items).push(done);
            }
        }
        match open.first() {
            Some((line, _)) => Err(ExpressionError::Unclosed { line: *line }),
            None if read.is_empty() => Err(ExpressionError::Empty),
            None => Ok(read),
        }
    }
    /// The word that stands here.
    pub fn word(&self) -> Option<&str> {
        match &self.content {
            Content::Word(word) => Some(word),
            Content::List(_) => None,
        }
    }
    /// The list that stands here.
    pub fn list(&self) -> Option<&[Expression]> {
        match &self.content {
            Content::List(items) => Some(items),
            Content::Word(_) => None,
        }
    }
    /// The first word of the list that stands here, and what follows it.
    pub fn headed(&self) -> Option<(&str, &[Expression])> {
        let (head, rest) = self.list()?.split_first()?;
        Some((head.word()?, rest))
    }
    /// The word, or an error that says what is expected.
    ///
    /// # Errors
    /// A list stands here.
    pub fn expect_word(&self, expected: &str) -> Result<&str, ExpressionError> {
        self.word().ok_or_else(|| self.error(format!("{expected} is expected, not a list")))
    }
    /// The list's first word and the rest, or an error that says what is expected.
    ///
    /// # Errors
    /// A word stands here, or the list does not begin with one.
    pub fn expect_headed(&self, expected: &str) -> Result<(&str, &[Expression]), ExpressionError> {
        self.headed().ok_or_else(|| self.error(format!("{expected} is expected, not `{self:.60}`")))
    }
    /// An error about this expression.
    pub fn error(&self, problem: impl Into<String>) -> ExpressionError {
        ExpressionError::Form { line: self.line, problem: problem.into() }
    }
}

impl fmt::Display for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match &self.content {
            Content::Word(word) => word.clone(),
            Content::List(items) => {
                let items: Vec<String> = items.iter().map(Expression::to_string).collect();
                format!("({})", items.join(" "))
            }
        };
        f.pad(&text)
    }
}

/// Brackets and words of a line, without its comment.
struct Tokens<'t>(&'t str);

impl<'t> Iterator for Tokens<'t> {
    type Item = &'t str;
    fn next(&mut self) -> Option<&'t str> {
        let rest = self.0.trim_start();
        let end = match rest.chars().next()? {
            ';' => return None,
            '(' | ')' => 1,
            _ => rest.find(|c: char| c.is_whitespace() || "();".contains(c)).unwrap_or(rest.len()),
        };
        let (token, rest) = rest.split_at(end);
        self.0 = rest;
        Some(token)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    #[test]
    fn lists_words_and_comments_are_told_apart() {
        let text = "(define (problem p) ; one (\n  (:init (on a b)))\n";
        let read = Expression::parse(text).unwrap();
        assert_eq!(read.len(), 1);
        assert_eq!(read[0].to_string(), "(define (problem p) (:init (on a b)))");
        let (head, rest) = read[0].headed().unwrap();
        assert_eq!((head, rest[1].line), ("define", 2));
    }

    #[test]
    fn what_cannot_be_read_is_located() {
        let read = |text: &str| Expression::parse(text).unwrap_err();
        assert_eq!(read(") a"), ExpressionError::Unopened { line: 1 });
        assert_eq!(read("(a\n(b)"), ExpressionError::Unclosed { line: 1 });
        assert_eq!(read(" ; nothing"), ExpressionError::Empty);
        assert_eq!(read(&"(".repeat(MAX_DEPTH + 1)), ExpressionError::TooDeep { line: 1 });
        assert_eq!(read(&" ".repeat(MAX_BYTES + 1)), ExpressionError::TooLong { bytes: MAX_BYTES + 1 });
        assert!(Expression::parse(&format!("{}{}", "(".repeat(MAX_DEPTH), ")".repeat(MAX_DEPTH))).is_ok());
    }
}
