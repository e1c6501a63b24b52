//! Agent and world in different processes: equal journals, a host in another language, and what remains when one of
//! the two is killed.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a failed unwrap is the test's verdict

mod host;
mod hunted;
mod journal;
mod kills;
mod python;
mod stapler;
