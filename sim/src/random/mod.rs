//! Seeded randomness as data: streams, named draws and rejection.

mod draws;
mod numpy;
mod stream;

pub use draws::DrawError;
pub(crate) use draws::{DrawKind, DrawSpec, Draws, MAX_COUNT, Scope, count, element};
pub(crate) use stream::{Stream, StreamKind};
