//! Classical planning: operators as data, goals with quantifiers, heuristic search. Pure and deterministic.
//!
//! | module | holds |
//! |---|---|
//! | [`sexpr`] | the bracketed text that formulas are written in |

pub mod sexpr;
