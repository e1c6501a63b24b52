//! A cloud and a template in, an estimate with its uncertainty out.

use crate::{
    cloud::{Cloud, group},
    config::{Description, FolderError, WEIGHTS_FILE},
    net::{Batch, Net},
    targets::{self, Deviations, PartState},
};
use acm_concept::template::Template;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use thiserror::Error;

/// Trained weights, ready to be asked.
#[derive(Debug, Clone)]
pub struct Estimator {
    description: Description,
    net: Net,
}

/// Why there is no estimate.
#[derive(Debug, Error)]
pub enum EstimateError {
    /// No head was trained for the template, or its parameters are others now.
    #[error("template `{0}` is none that was learned, or has other parameters now; train again")]
    UnknownTemplate(String),
    /// Too little is seen, or a point is no number.
    #[error("the cloud has {points} points: too few to say anything, or some that are no numbers")]
    NoCloud {
        /// Points of the cloud.
        points: usize,
    },
    /// The tensors do not fit: a mistake of ours.
    #[error(transparent)]
    Tensor(#[from] candle_core::Error),
}

/// An estimate and how far it may be off.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimated {
    /// The mean, in the frame of the cloud.
    pub state: PartState,
    /// Standard deviations.
    pub deviations: Deviations,
}

impl Estimator {
    /// One from a network and what is to be said of it.
    pub fn new(description: Description, net: Net) -> Estimator {
        Estimator { description, net }
    }

    /// Reads a folder of weights.
    ///
    /// # Errors
    /// One line with the file and what is wrong with it.
    pub fn read(folder: &Path) -> Result<Estimator, FolderError> {
        let description = Description::read(folder)?;
        let net = Net::read(description.shape, &description.heads, &folder.join(WEIGHTS_FILE))?;
        Ok(Estimator { description, net })
    }

    /// Writes the weights and what they are into a folder, which is made.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), FolderError> {
        std::fs::create_dir_all(folder).map_err(|source| FolderError::file(folder, source))?;
        self.net.weights().write(&folder.join(WEIGHTS_FILE))?;
        self.description.write(folder)
    }

    /// What the weights are.
    pub fn description(&self) -> &Description {
        &self.description
    }
    /// The network.
    pub fn net(&self) -> &Net {
        &self.net
    }

    /// Estimates a part. The same cloud always gives the same answer.
    ///
    /// # Errors
    /// The template was not learned, or the cloud is too small.
    pub fn estimate(&self, cloud: &Cloud, template: &Template) -> Result<Estimated, EstimateError> {
        let spec = crate::config::HeadSpec::of(template);
        let head = self.description.heads.iter().position(|head| *head == spec);
        let head = head.ok_or_else(|| EstimateError::UnknownTemplate(template.name.clone()))?;
        let no_cloud = || EstimateError::NoCloud { points: cloud.points.len() };
        let normal = cloud.normal().ok_or_else(no_cloud)?;
        let shape = self.net.shape();
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let groups = group(&cloud.points_in(&normal), shape, &mut rng).ok_or_else(no_cloud)?;
        let features = self.net.features(&Batch::of_one(groups, &normal, shape)?)?;
        let answer = self.net.answer(head, &features)?;
        let row = |tensor: &candle_core::Tensor| tensor.flatten_all()?.to_vec1::<f32>();
        let (means, deviations) = (row(&answer.mean)?, row(&answer.log_deviation.exp()?)?);
        let (state, deviations) = targets::decode(template, &normal, &means, &deviations);
        Ok(Estimated { state, deviations })
    }
}
