//! Headless RGB-D renderer and depth-sensor model.
