//! Nine primitives and the manipulation functions built from them, as pure controllers.
