//! From language and memory to goals and verified steps.
