//! Problems in the Behavior Domain Definition Language and its dialect of tabletop tasks: objects with their types,
//! what holds at first, and the goal. Benches of planner and memory read the outside data with it.
//!
//! | module | holds |
//! |---|---|
//! | [`archive`] | the archives that the files come in |

pub mod archive;

use acm_planner::classical::sexpr::{Expression, ExpressionError};
use std::collections::BTreeMap;

/// The sections of a problem, by their names without the colon.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    sections: BTreeMap<String, Vec<Expression>>,
}

impl Problem {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// The text is no `(define (problem NAME) (:section ...) ...)`.
    pub fn parse(text: &str) -> Result<Problem, ExpressionError> {
        let read = Expression::parse(text)?;
        let defined = read.first().ok_or(ExpressionError::Empty)?;
        let (head, rest) = defined.expect_headed("(define ...)")?;
        if head != "define" {
            return Err(defined.error(format!("(define ...) is expected, not `({head} ...)`")));
        }
        let mut sections = BTreeMap::new();
        for section in rest {
            let (name, content) = section.expect_headed("a section such as (:init ...)")?;
            let name = name.trim_start_matches(':').to_string();
            if sections.insert(name, content.to_vec()).is_some() {
                return Err(section.error("this section stands there twice"));
            }
        }
        Ok(Problem { sections })
    }
    /// The objects of a section written `a b - kind c - kind`: names and types, in order.
    ///
    /// # Errors
    /// A list stands among the names, or the last of them have no type.
    pub fn typed(&self, section: &str) -> Result<Vec<(&str, &str)>, ExpressionError> {
        let (mut typed, mut untyped) = (Vec::new(), Vec::new());
        let mut items = self.section(section).iter();
        while let Some(item) = items.next() {
            match item.expect_word("the name of an object")? {
                "-" => {
                    let kind = items.next().ok_or_else(|| item.error("a type is expected after `-`"))?;
                    let kind = kind.expect_word("a type")?;
                    typed.extend(untyped.drain(..).map(|name| (name, kind)));
                }
                name => untyped.push(name),
            }
        }
        match (untyped.first(), self.section(section).last()) {
            (Some(name), Some(last)) => Err(last.error(format!("`{name}` has no type: `{name} - type` is expected"))),
            _ => Ok(typed),
        }
    }
    /// What stands in a section; empty if there is none.
    pub fn section(&self, name: &str) -> &[Expression] {
        self.sections.get(name).map_or(&[], Vec::as_slice)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    #[test]
    fn sections_and_typed_names_are_read() {
        let text = "(define (problem p) (:objects a.n.01_1 a.n.01_2 - a.n.01 b - c) (:goal (and (open ?b))))";
        let problem = Problem::parse(text).unwrap();
        assert_eq!(problem.typed("objects").unwrap(), [("a.n.01_1", "a.n.01"), ("a.n.01_2", "a.n.01"), ("b", "c")]);
        assert_eq!(problem.section("goal")[0].to_string(), "(and (open ?b))");
        assert_eq!(problem.section("init"), []);
    }

    #[test]
    fn what_is_no_problem_is_said() {
        let error = |text: &str| Problem::parse(text).unwrap_err().to_string();
        assert!(error("(problem p)").contains("(define ...) is expected, not `(problem ...)`"));
        assert!(error("(define (:init) (:init))").contains("twice"));
        let untyped = Problem::parse("(define (:objects a - b c))").unwrap();
        assert!(untyped.typed("objects").unwrap_err().to_string().contains("`c` has no type"));
        let unnamed = Problem::parse("(define (:objects a -))").unwrap();
        assert!(unnamed.typed("objects").unwrap_err().to_string().contains("a type is expected"));
    }
}
