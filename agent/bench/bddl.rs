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
    /// What stands in a section; empty if there is none.
    pub fn section(&self, name: &str) -> &[Expression] {
        self.sections.get(name).map_or(&[], Vec::as_slice)
    }
}
