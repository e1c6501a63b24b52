//! A camera that has stopped: its pictures repeat, bit for bit, while time goes on.

use acm_concept::{camera::RgbdFrame, object::Percepts, time::Time};
use std::collections::BTreeMap;

/// A surface smoother than this was not measured by a sensor with noise: of such pictures two may be equal. Metres.
const NOISELESS_M: f64 = 1e-4;

/// What is kept of the last picture of every camera.
#[derive(Debug, Clone, Default)]
pub struct LastPictures {
    by_camera: BTreeMap<String, (blake3::Hash, Time)>,
}

impl LastPictures {
    /// Takes a picture in, and says whether it is the camera's last one again although time has passed. `percepts` are
    /// those of the picture: without noise in the surface it shows, nothing is said.
    pub fn repeats(&mut self, frame: &RgbdFrame, percepts: &Percepts) -> bool {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&frame.color);
        hasher.update(bytemuck::cast_slice(&frame.depth));
        let picture = (hasher.finalize(), frame.header.time);
        let last = self.by_camera.insert(frame.header.camera.clone(), picture);
        let noisy = percepts.support.is_some_and(|support| support.residual_m > NOISELESS_M);
        noisy && last.is_some_and(|(hash, time)| hash == picture.0 && time < picture.1)
    }
}
