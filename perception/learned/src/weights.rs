//! Weights by name: drawn from a seed, or read from a file.

use crate::config::FolderError;
use candle_core::{DType, Device, Result, Tensor, Var};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use std::{
    collections::{BTreeMap, HashMap},
    path::Path,
};

/// The weights of a network by name, `encoder.layer.3.query.weight`, in the order of their names.
#[derive(Debug, Clone, Default)]
pub struct Weights(BTreeMap<String, Var>);

impl Weights {
    /// All weights.
    pub fn all(&self) -> impl Iterator<Item = (&str, &Var)> {
        self.0.iter().map(|(name, var)| (name.as_str(), var))
    }
    /// Numbers in all of them.
    pub fn count(&self) -> usize {
        self.0.values().map(|var| var.elem_count()).sum()
    }

    /// Writes them as safetensors: under another name first, so that a file that is there is a whole one.
    pub fn write(&self, path: &Path) -> std::result::Result<(), FolderError> {
        let unfinished = path.with_extension("unfinished");
        let tensors: HashMap<&str, Tensor> = self.all().map(|(name, var)| (name, var.as_tensor().clone())).collect();
        candle_core::safetensors::save(&tensors, &unfinished).map_err(|e| FolderError::format(&unfinished, e))?;
        std::fs::rename(&unfinished, path).map_err(|source| FolderError::file(path, source))
    }
}

/// Where the weights of a network come from while it is put together.
pub enum Source {
    /// Drawn anew.
    Drawn(Box<ChaCha8Rng>),
    /// Taken from a file's.
    Read(HashMap<String, Tensor>),
}

impl Source {
    /// Weights drawn from a seed: equal seeds give equal ones.
    pub fn drawn(seed: u64) -> Source {
        Source::Drawn(Box::new(ChaCha8Rng::seed_from_u64(seed)))
    }
    /// The weights of a file.
    pub fn read(path: &Path) -> std::result::Result<Source, FolderError> {
        // What the system says of a missing file is better than what the format's reader does.
        std::fs::metadata(path).map_err(|source| FolderError::file(path, source))?;
        let tensors = candle_core::safetensors::load(path, &Device::Cpu).map_err(|e| FolderError::format(path, e))?;
        Ok(Source::Read(tensors))
    }
}

/// How weights begin.
#[derive(Debug, Clone, Copy)]
pub enum Start {
    /// All equal.
    Constant(f64),
    /// Drawn about 0 with this standard deviation.
    Spread(f64),
}

/// Puts weights together, each under the path of its place in the network.
pub struct Builder<'a> {
    source: &'a mut Source,
    weights: &'a mut Weights,
    path: String,
}

impl<'a> Builder<'a> {
    /// At the root.
    pub fn new(source: &'a mut Source, weights: &'a mut Weights) -> Builder<'a> {
        Builder { source, weights, path: String::new() }
    }
    /// At a place below this one.
    pub fn at(&mut self, name: impl std::fmt::Display) -> Builder<'_> {
        Builder { path: self.name(&name.to_string()), source: self.source, weights: self.weights }
    }
    fn name(&self, name: &str) -> String {
        if self.path.is_empty() { name.to_string() } else { format!("{}.{name}", self.path) }
    }

    /// One tensor of weights.
    ///
    /// # Errors
    /// A file lacks it, or has it in another shape.
    pub fn tensor(&mut self, name: &str, shape: &[usize], start: Start) -> Result<Var> {
        let name = self.name(name);
        let tensor = match (&mut *self.source, start) {
            (Source::Read(tensors), _) => {
                let tensor = tensors
                    .remove(&name)
                    .ok_or_else(|| candle_core::Error::Msg(format!("there is no tensor `{name}`")))?;
                if tensor.dims() != shape || tensor.dtype() != DType::F32 {
                    candle_core::bail!(
                        "tensor `{name}` is {:?} of {:?}, but must be {shape:?} of F32",
                        tensor.dims(),
                        tensor.dtype()
                    );
                }
                tensor
            }
            (Source::Drawn(_), Start::Constant(value)) => Tensor::full(value as f32, shape, &Device::Cpu)?,
            (Source::Drawn(rng), Start::Spread(deviation)) => {
                let normal = Normal::new(0.0, deviation as f32).map_err(candle_core::Error::wrap)?;
                let count = shape.iter().product();
                let numbers: Vec<f32> = normal.sample_iter(rng).take(count).collect();
                Tensor::from_vec(numbers, shape, &Device::Cpu)?
            }
        };
        let var = Var::from_tensor(&tensor)?;
        self.weights.0.insert(name, var.clone());
        Ok(var)
    }
}
