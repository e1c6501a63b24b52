//! Other memories behind the trait [`Memory`](acm_memory::Memory), to compare with. All share the perception-facing
//! machinery of `acm-memory` (identities, relations, beliefs, retrieval) and differ in what they keep.
//!
//! | method | keeps |
//! |---|---|
//! | `acm` | everything: [`acm_memory::AcmMemory`] |
//! | `paper-identity` | everything, with the paper's identity rule |
//! | `reactive` | the last frame, what the hand feels, the last action, how far the instruction is done |
//! | `first-frame` | the same and the places of the run's first frame |

mod first_frame;
mod last_frame;
mod method;
mod reactive;
#[cfg(test)]
mod tests;

pub use first_frame::FirstFrame;
pub use method::{METHODS, MethodError, UnknownMethod, by_name};
pub use reactive::Reactive;
