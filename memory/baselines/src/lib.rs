//! Other memories behind the trait [`Memory`](acm_memory::Memory), to compare with. All share the perception-facing
//! machinery of `acm-memory` (identities, relations, beliefs, retrieval) and differ in what they keep.
//!
//! | method | keeps |
//! |---|---|
//! | `acm` | everything: [`acm_memory::AcmMemory`] |
//! | `paper-identity` | everything, with the paper's identity rule |
//! | `reactive` | the last frame, the last deed |
//! | `first-frame` | the last frame and the run's first one; what was dealt with in the present subtask |
//! | `window`, `window-2` | the last eight or two frames and the deeds since the first of them |
//! | `action-log` | the last frame and all own deeds, with what they tell of places |
//! | `keyframe` | a short window, and key frames: nominated ones, clustered by their number |
//! | `embedding` | the last frame and a bank of frames, of which those are read that look most like the present one; what was dealt with |
//! | `text-summary` | everything, as far as short sentences can say it |
//! | `semantic` | each thing's looks and last known place; what was dealt with |
//! | `full-history` | all frames, perceived again once it is known what is asked for, and all deeds |
//! | `shuffled` | everything, but each thing has another one's past |
//!
//! What the hand feels and how far the instruction is done is the same for all of them. But for the first two and the last
//! one, what a method does not keep is dropped after every call ([`Pruned`]), so that nothing later can rest on it.

mod first_frame;
mod full_history;
mod keeping;
mod method;
mod prune;
mod pruned;
mod shuffled;
mod sights;
#[cfg(test)]
mod tests;
mod words;

pub use full_history::{FullHistory, Perceive};
pub use method::{METHODS, MethodError, UnknownMethod, by_name};
pub use pruned::Pruned;
pub use shuffled::Shuffled;
