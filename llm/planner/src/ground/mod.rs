//! References of a task grounded in memory.

pub(crate) mod geometry;
