//! The actor runtime: envelopes, pure cores in supervised shells, a frame bus and a journal.
//!
//! It knows no robot. Message bodies are whatever the crate above says, as long as they have a kind and can be
//! written down as bytes.
//!
//! | module | holds |
//! |---|---|
//! | [`envelope`] | what every message carries beside its body |
//! | [`core`] | the trait of an actor's pure logic, and its outbox |
//! | [`system`] | shells on ractor: sequencing, write-ahead journal, supervision and restart |
//! | [`journal`] | where delivered messages are written before they are handled |
//! | [`trace`] | all of a run in one MCAP file: written, and read back |
//! | [`frame_bus`] | frames handed over by number instead of by copy, within a process and between processes |

pub mod core;
pub mod envelope;
pub mod frame_bus;
pub mod journal;
pub mod system;
pub mod trace;
