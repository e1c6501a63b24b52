//! The network: a mini-PointNet makes a token of each group of points, attention layers relate the tokens, their average
//! is what is known of the cloud, and a three-layer ReLU perceptron for each template reads its parameters from it.
//!
//! Layer norm and softmax are written out: candle's fused ones have no backward pass and cut the gradient without an
//! error. A test asserts that every weight gets one.

use crate::{
    cloud::{CONTEXT, Groups, Normal},
    config::{FolderError, HeadSpec, Shape},
    weights::{Builder, Source, Start, Weights},
};
use candle_core::{D, DType, Device, Result, Tensor, Var};
use std::path::Path;

/// Logarithms of standard deviations are kept between these.
pub(crate) const LOG_DEVIATION: (f64, f64) = (-6.0, 2.0);
/// What is added to a variance before it divides.
pub(crate) const EPSILON: f64 = 1e-5;

/// Clouds side by side.
#[derive(Debug, Clone)]
pub struct Batch {
    /// Middles of groups, [clouds, groups, 3].
    pub middles: Tensor,
    /// Points about their group's middle, [clouds, groups, group_size, 3].
    pub points: Tensor,
    /// [`Normal::context`], [clouds, 3].
    pub context: Tensor,
}

impl Batch {
    /// Puts clouds together that were cut by `shape`.
    pub fn new(clouds: &[(Groups, [f32; CONTEXT])], shape: &Shape) -> Result<Batch> {
        let count = clouds.len();
        let flat = |of: fn(&Groups) -> &[f32]| clouds.iter().flat_map(|(groups, _)| of(groups)).copied().collect();
        let middles: Vec<f32> = flat(|groups| &groups.middles);
        let points: Vec<f32> = flat(|groups| &groups.points);
        let context: Vec<f32> = clouds.iter().flat_map(|(_, context)| *context).collect();
        Ok(Batch {
            middles: Tensor::from_vec(middles, (count, shape.groups, 3), &Device::Cpu)?,
            points: Tensor::from_vec(points, (count, shape.groups, shape.group_size, 3), &Device::Cpu)?,
            context: Tensor::from_vec(context, (count, CONTEXT), &Device::Cpu)?,
        })
    }
    /// A batch of one.
    pub fn of_one(groups: Groups, normal: &Normal, shape: &Shape) -> Result<Batch> {
        Batch::new(&[(groups, normal.context)], shape)
    }
}

/// What a head gives for some clouds, [clouds, outputs] each.
#[derive(Debug, Clone)]
pub struct Answer {
    /// Means.
    pub mean: Tensor,
    /// Natural logarithms of standard deviations.
    pub log_deviation: Tensor,
}

/// The network with its weights.
#[derive(Debug, Clone)]
pub struct Net {
    shape: Shape,
    encoder: Encoder,
    heads: Vec<Head>,
    weights: Weights,
}

impl Net {
    /// One whose weights are drawn from a seed.
    pub fn drawn(shape: Shape, heads: &[HeadSpec], seed: u64) -> Result<Net> {
        Net::new(shape, heads, &mut Source::drawn(seed))
    }

    /// One whose weights are a file's.
    pub fn read(shape: Shape, heads: &[HeadSpec], path: &Path) -> std::result::Result<Net, FolderError> {
        let mut source = Source::read(path)?;
        let net = Net::new(shape, heads, &mut source).map_err(|e| FolderError::format(path, e))?;
        let left = match &source {
            Source::Read(tensors) => tensors.keys().min().cloned(),
            Source::Drawn(_) => None,
        };
        match left {
            Some(name) => Err(FolderError::format(path, format!("tensor `{name}` belongs to no layer of this shape"))),
            None => Ok(net),
        }
    }

    fn new(shape: Shape, heads: &[HeadSpec], source: &mut Source) -> Result<Net> {
        let mut weights = Weights::default();
        let mut at = Builder::new(source, &mut weights);
        let encoder = Encoder::new(&shape, &mut at.at("encoder"))?;
        let heads = heads
            .iter()
            .map(|head| Head::new(shape.width, head.outputs(), &mut at.at("head").at(&head.template)))
            .collect::<Result<_>>()?;
        Ok(Net { shape, encoder, heads, weights })
    }

    /// The encoder's shape.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }
    /// All weights by name.
    pub fn weights(&self) -> &Weights {
        &self.weights
    }

    /// What is known of each cloud, [clouds, width + 3].
    pub fn features(&self, batch: &Batch) -> Result<Tensor> {
        Tensor::cat(&[&self.encoder.pooled(batch)?, &batch.context], 1)
    }

    /// What a head, by its place, says of features.
    pub fn answer(&self, head: usize, features: &Tensor) -> Result<Answer> {
        let Some(head) = self.heads.get(head) else { candle_core::bail!("there is no head {head}") };
        head.forward(features)
    }

    /// Lets the heads begin at the mean and the standard deviation of what they are to give.
    pub fn begin_heads_at(&self, statistics: &[(Vec<f32>, Vec<f32>)]) -> Result<()> {
        for (head, (means, deviations)) in self.heads.iter().zip(statistics) {
            let logs = deviations.iter().map(|deviation| deviation.max(1e-3).ln());
            let bias: Vec<f32> = means.iter().copied().chain(logs).collect();
            head.last.bias.set(&Tensor::from_vec(bias, head.last.bias.dims(), &Device::Cpu)?)?;
        }
        Ok(())
    }
}

#[derive(Debug, Clone)]
struct Linear {
    weight: Var,
    bias: Var,
}

impl Linear {
    /// `gain` 1 keeps the variance; before a ReLU it is the square root of 2.
    fn new(inputs: usize, outputs: usize, gain: f64, at: &mut Builder) -> Result<Linear> {
        let spread = Start::Spread(gain / (inputs as f64).sqrt());
        let weight = at.tensor("weight", &[inputs, outputs], spread)?;
        Ok(Linear { weight, bias: at.tensor("bias", &[outputs], Start::Constant(0.0))? })
    }

    /// Over the last dimension.
    fn forward(&self, x: &Tensor) -> Result<Tensor> {
        let product = multiply(x, &self.weight)?;
        &product + rows_of(&self.bias, product.dims())?
    }
}

/// A row as often as there are rows in a tensor of these dimensions, as a product of matrices. Broadcasting gives the
/// same, but the sums of its backward pass take candle several times as long as everything else.
fn rows_of(row: &Tensor, dims: &[usize]) -> Result<Tensor> {
    let width = row.elem_count();
    let count = dims.iter().product::<usize>() / width.max(1);
    let ones = Tensor::ones((count, 1), DType::F32, &Device::Cpu)?;
    ones.matmul(&row.reshape((1, width))?)?.reshape(dims)
}

/// The last dimension times a matrix: as one product of two matrices, which is the fastest.
fn multiply(x: &Tensor, weight: &Var) -> Result<Tensor> {
    let (inputs, outputs) = weight.dims2()?;
    let mut dims = x.dims().to_vec();
    dims.pop();
    let flat = x.reshape((dims.iter().product::<usize>(), inputs))?.matmul(weight)?;
    dims.push(outputs);
    flat.reshape(dims)
}

#[derive(Debug, Clone)]
struct LayerNorm {
    scale: Var,
    shift: Var,
}

impl LayerNorm {
    fn new(width: usize, at: &mut Builder) -> Result<LayerNorm> {
        let scale = at.tensor("scale", &[width], Start::Constant(1.0))?;
        Ok(LayerNorm { scale, shift: at.tensor("shift", &[width], Start::Constant(0.0))? })
    }

    fn forward(&self, x: &Tensor) -> Result<Tensor> {
        let centred = x.broadcast_sub(&x.mean_keepdim(D::Minus1)?)?;
        let deviation = (centred.sqr()?.mean_keepdim(D::Minus1)? + EPSILON)?.sqrt()?;
        let normal = centred.broadcast_div(&deviation)?;
        (normal * rows_of(&self.scale, x.dims())?)? + rows_of(&self.shift, x.dims())?
    }
}

/// Softmax over the last dimension.
fn softmax(x: &Tensor) -> Result<Tensor> {
    // The largest is taken off against overflow alone: it cancels out, and so does its gradient.
    let powers = x.broadcast_sub(&x.max_keepdim(D::Minus1)?.detach())?.exp()?;
    powers.broadcast_div(&powers.sum_keepdim(D::Minus1)?)
}

#[derive(Debug, Clone)]
struct Encoder {
    tokeniser: Tokeniser,
    place: [Linear; 2],
    layers: Vec<Layer>,
    norm: LayerNorm,
}

impl Encoder {
    fn new(shape: &Shape, at: &mut Builder) -> Result<Encoder> {
        let hidden = shape.token_width;
        Ok(Encoder {
            tokeniser: Tokeniser::new(shape, &mut at.at("token"))?,
            place: [
                Linear::new(3, hidden, 2f64.sqrt(), &mut at.at("place.0"))?,
                Linear::new(hidden, shape.width, 1.0, &mut at.at("place.1"))?,
            ],
            layers: (0..shape.layers)
                .map(|index| Layer::new(shape, &mut at.at("layer").at(index)))
                .collect::<Result<_>>()?,
            norm: LayerNorm::new(shape.width, &mut at.at("norm"))?,
        })
    }

    /// [clouds, width].
    fn pooled(&self, batch: &Batch) -> Result<Tensor> {
        let [first, second] = &self.place;
        let place = second.forward(&first.forward(&batch.middles)?.relu()?)?;
        let mut tokens = self.tokeniser.forward(&batch.points)?;
        for layer in &self.layers {
            // Where a token is, is told anew to every layer, as Point-BERT does.
            tokens = layer.forward(&(tokens + &place)?)?;
        }
        self.norm.forward(&tokens)?.mean(1)
    }
}

/// Mini-PointNet: each point of a group, then what is largest among them, then each point beside that, and again.
#[derive(Debug, Clone)]
struct Tokeniser {
    first: Linear,
    second: Linear,
    own: Linear,
    common: Linear,
    last: Linear,
}

impl Tokeniser {
    fn new(shape: &Shape, at: &mut Builder) -> Result<Tokeniser> {
        let width = shape.token_width;
        Ok(Tokeniser {
            // Points of a group are near to its middle: without a gain all tokens would begin alike.
            first: Linear::new(3, width, 8.0, &mut at.at("first"))?,
            second: Linear::new(width, 2 * width, 1.0, &mut at.at("second"))?,
            // One layer over a point's features and the group's, side by side.
            own: Linear::new(2 * width, 4 * width, 1.0, &mut at.at("own"))?,
            common: Linear::new(2 * width, 4 * width, 1.0, &mut at.at("common"))?,
            last: Linear::new(4 * width, shape.width, 1.0, &mut at.at("last"))?,
        })
    }

    /// [clouds, groups, width] of [clouds, groups, group_size, 3].
    fn forward(&self, points: &Tensor) -> Result<Tensor> {
        let (clouds, groups, size, _) = points.dims4()?;
        // The points of a group one after the other outside, so that halves of them lie together.
        let points = points.permute((2, 0, 1, 3))?.contiguous()?;
        let each = self.second.forward(&self.first.forward(&points)?.relu()?)?;
        let common = self.common.forward(&largest(&each)?)?;
        let (inner, width) = (clouds * groups, common.dim(D::Minus1)?);
        let common = rows_of(&common.flatten_all()?, &[size, inner * width])?.reshape((size, clouds, groups, width))?;
        let each = (self.own.forward(&each)? + common)?.relu()?;
        largest(&self.last.forward(&each)?)
    }
}

/// The largest over the first dimension, half against half: many times faster than a reduction and its backward pass.
fn largest(x: &Tensor) -> Result<Tensor> {
    let mut left = x.clone();
    while left.dim(0)? > 1 {
        let count = left.dim(0)?;
        let half = count / 2;
        let both = left.narrow(0, 0, half)?.maximum(&left.narrow(0, half, half)?)?;
        // An odd one waits for the next round.
        left = if count % 2 == 0 { both } else { Tensor::cat(&[&both, &left.narrow(0, count - 1, 1)?], 0)? };
    }
    left.squeeze(0)
}

/// Attention and perceptron, each after a layer norm and beside what it is given.
#[derive(Debug, Clone)]
struct Layer {
    heads: usize,
    norms: [LayerNorm; 2],
    query: Linear,
    /// Without a bias: it would change no attention.
    key: Var,
    value: Linear,
    out: Linear,
    perceptron: [Linear; 2],
}

impl Layer {
    fn new(shape: &Shape, at: &mut Builder) -> Result<Layer> {
        let width = shape.width;
        let mut square = |name: &str, gain: f64| Linear::new(width, width, gain, &mut at.at(name));
        let (query, value, out) = (square("query", 1.0)?, square("value", 1.0)?, square("out", 0.5)?);
        let spread = Start::Spread((width as f64).powf(-0.5));
        Ok(Layer {
            heads: shape.heads,
            query,
            key: at.tensor("key.weight", &[width, width], spread)?,
            value,
            out,
            norms: [LayerNorm::new(width, &mut at.at("norm.0"))?, LayerNorm::new(width, &mut at.at("norm.1"))?],
            perceptron: [
                Linear::new(width, 4 * width, 1.0, &mut at.at("perceptron.0"))?,
                Linear::new(4 * width, width, 0.5, &mut at.at("perceptron.1"))?,
            ],
        })
    }

    fn forward(&self, tokens: &Tensor) -> Result<Tensor> {
        let [before, between] = &self.norms;
        let tokens = (tokens + self.attend(&before.forward(tokens)?)?)?;
        let [first, second] = &self.perceptron;
        let more = second.forward(&first.forward(&between.forward(&tokens)?)?.gelu()?)?;
        tokens + more
    }

    fn attend(&self, tokens: &Tensor) -> Result<Tensor> {
        let (clouds, groups, width) = tokens.dims3()?;
        let per_head = width / self.heads;
        let split = |x: Tensor| x.reshape((clouds, groups, self.heads, per_head))?.transpose(1, 2)?.contiguous();
        let query = (split(self.query.forward(tokens)?)? * (per_head as f64).powf(-0.5))?;
        let key = split(multiply(tokens, &self.key)?)?;
        let value = split(self.value.forward(tokens)?)?;
        let mixed = softmax(&query.matmul(&key.t()?.contiguous()?)?)?.matmul(&value)?;
        self.out.forward(&mixed.transpose(1, 2)?.contiguous()?.reshape((clouds, groups, width))?)
    }
}

/// Three layers with ReLU between.
#[derive(Debug, Clone)]
struct Head {
    outputs: usize,
    first: Linear,
    second: Linear,
    last: Linear,
}

impl Head {
    fn new(width: usize, outputs: usize, at: &mut Builder) -> Result<Head> {
        let relu = 2f64.sqrt();
        Ok(Head {
            outputs,
            first: Linear::new(width + CONTEXT, width, relu, &mut at.at(0))?,
            second: Linear::new(width, width, relu, &mut at.at(1))?,
            last: Linear::new(width, 2 * outputs, 0.1, &mut at.at(2))?,
        })
    }

    fn forward(&self, features: &Tensor) -> Result<Answer> {
        let hidden = self.second.forward(&self.first.forward(features)?.relu()?)?.relu()?;
        let both = self.last.forward(&hidden)?;
        let (least, most) = LOG_DEVIATION;
        Ok(Answer {
            mean: both.narrow(1, 0, self.outputs)?,
            log_deviation: both.narrow(1, self.outputs, self.outputs)?.clamp(least, most)?,
        })
    }
}
