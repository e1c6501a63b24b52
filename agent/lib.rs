//! Composition of the ACM agent.
