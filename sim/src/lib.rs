//! The simulated world, its robots and mechanisms, scenario files, and the oracle that judges.
