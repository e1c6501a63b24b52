//! Means-ends search over the skills that memory offers.
