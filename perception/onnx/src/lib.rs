//! Networks in ONNX files behind the tool traits of perception, run by ONNX Runtime.
//!
//! A model is a file with a documented tensor interface (docs/perception-tools.md): a *segmenter* takes an image with
//! depth and gives a score for each pixel and thing, a *parameter estimator* of one template takes a cloud of points and
//! gives values with standard deviations. Without the feature `runtime` the crate is empty but for the tests of what goes in
//! and comes out; with it the runtime is loaded from the path in `ORT_DYLIB_PATH`, and what it answers is checked like any
//! tool's answer.
//!
//! | module | holds |
//! |---|---|
//! | `tensors` | frames and masks as tensors, and tensors as answers |
//! | `model` | a file and the runtime that computes it |
//! | `tools` | the two tools |

#[cfg(any(test, feature = "runtime"))]
mod tensors;

#[cfg(feature = "runtime")]
mod model;
#[cfg(feature = "runtime")]
mod tools;

#[cfg(feature = "runtime")]
pub use model::OpenError;
#[cfg(feature = "runtime")]
pub use tensors::{CLOUD_POINTS, IMAGE_CHANNELS};
#[cfg(feature = "runtime")]
pub use tools::{OnnxParamEstimator, OnnxSegmenter};
