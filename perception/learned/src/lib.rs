//! The paper's learned estimator of template parameters: a Point-Transformer encoder, average pooling and a three-layer
//! ReLU perceptron for each template (paper, section "Perception and Concept Grounding" of the appendix).
//!
//! It is a first guess for the geometric fit, never the last word, and is off by default; [docs/learned.md] says how it is
//! trained and what it was measured to be worth.
//!
//! | module | holds |
//! |---|---|
//! | [`config`] | the sizes, and the file beside the weights that says what they are |
//! | [`cloud`] | a thing's points, made independent of place, heading and size, and cut into groups |
//! | [`targets`] | parameters and pose as the numbers that are learned, and back |
//! | `net`, `weights` | the network and its weights (feature `candle`) |
//! | `samples`, `train` | labelled clouds in a folder; training (feature `candle`) |
//! | `estimator` | a cloud and a template in, an estimate with its uncertainty out (feature `candle`) |
//! | `tool` | the estimator behind perception's trait `ParamEstimator` (feature `candle`) |
//! | `onnx` | the same graph for other runtimes (feature `candle`) |
//!
//! [docs/learned.md]: https://github.com/acm-robotics/acm/blob/main/docs/learned.md

pub mod cloud;
pub mod config;
pub mod targets;

#[cfg(feature = "candle")]
pub mod estimator;
#[cfg(feature = "candle")]
pub mod net;
#[cfg(feature = "candle")]
pub mod onnx;
#[cfg(feature = "candle")]
pub mod samples;
#[cfg(feature = "candle")]
pub mod tool;
#[cfg(feature = "candle")]
pub mod train;
#[cfg(feature = "candle")]
pub mod weights;

#[cfg(all(test, feature = "candle"))]
mod tests;
