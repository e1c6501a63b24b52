//! Other memories behind the trait Memory, to compare with.
