//! The typed messages, the five actors and the episode loop.
