//! Envelopes, supervision, effects, the frame bus and the journal: actors that know no robot.
