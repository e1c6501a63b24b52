//! The network's graph as ONNX, for other runtimes.
//!
//! Inputs are those of [`Batch`](crate::net::Batch) by name: `middles` [clouds, groups, 3], `points`
//! [clouds, groups, group_size, 3], `context` [clouds, 3]. Outputs are `TEMPLATE.mean` and `TEMPLATE.log_deviation`,
//! [clouds, outputs], for each template, in the order of [`HeadSpec`](crate::config::HeadSpec). Operator set 20.

mod proto;

use crate::{
    cloud::CONTEXT,
    config::{FolderError, HeadSpec},
    estimator::Estimator,
    net::{EPSILON, LOG_DEVIATION},
};
use candle_core::Result;
use prost::Message;
use proto::{
    Attribute, Dimension, Extent, FLOAT, Graph, INT64, Model, Node, OperatorSet, TensorData, TensorShape, TensorType,
    ValueInfo, ValueType,
};
use std::path::Path;

/// `Gelu` came with this set.
const OPERATOR_SET: i64 = 20;
/// The format's version of that set.
const IR_VERSION: i64 = 9;
/// The open number of clouds.
const CLOUDS: &str = "clouds";

/// Writes an estimator's graph and weights into one file.
///
/// # Errors
/// The file cannot be written.
pub fn write(estimator: &Estimator, path: &Path) -> std::result::Result<(), FolderError> {
    let model = model(estimator).map_err(|e| FolderError::format(path, e))?;
    std::fs::write(path, model.encode_to_vec()).map_err(|source| FolderError::file(path, source))
}

fn model(estimator: &Estimator) -> Result<Model> {
    let shape = estimator.net().shape();
    let (groups, size) = (shape.groups as i64, shape.group_size as i64);
    let mut drawing = Drawing::default();
    for (name, var) in estimator.net().weights().all() {
        let numbers = var.flatten_all()?.to_vec1::<f32>()?;
        let dims = var.dims().iter().map(|n| *n as i64).collect();
        let raw_data = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        drawing.graph.initializer.push(TensorData { dims, data_type: FLOAT, name: name.into(), raw_data });
    }
    drawing.graph.input = vec![
        floats("middles", &[groups, 3]),
        floats("points", &[groups, size, 3]),
        floats("context", &[CONTEXT as i64]),
    ];
    let features = drawing.encoder(shape.layers, shape.heads as i64, groups, shape.width as i64);
    for head in &estimator.description().heads {
        drawing.head(head, &features);
    }
    Ok(Model {
        ir_version: IR_VERSION,
        producer_name: "acm".into(),
        doc_string: "Point-Transformer estimator of template parameters; see docs/learned.md".into(),
        graph: Some(Graph { name: "estimator".into(), ..drawing.graph }),
        opset_import: vec![OperatorSet { domain: String::new(), version: OPERATOR_SET }],
    })
}

/// An input or output of as many rows as there are clouds.
fn floats(name: &str, dims: &[i64]) -> ValueInfo {
    let extents = std::iter::once(Extent::Open(CLOUDS.into())).chain(dims.iter().map(|n| Extent::Fixed(*n)));
    let shape = TensorShape { dim: extents.map(|value| Dimension { value: Some(value) }).collect() };
    let tensor_type = Some(TensorType { elem_type: FLOAT, shape: Some(shape) });
    ValueInfo { name: name.into(), r#type: Some(ValueType { tensor_type }) }
}

fn integer(name: &str, i: i64) -> Attribute {
    Attribute { name: name.into(), i, kind: 2, ..Attribute::default() }
}

/// A graph that is being drawn; the methods mirror `net`, and values are known by the names of their nodes.
#[derive(Default)]
struct Drawing {
    graph: Graph,
}

impl Drawing {
    /// Adds a node and gives the name of its result.
    fn node(&mut self, op_type: &str, input: &[&str], attribute: Vec<Attribute>) -> String {
        let name = format!("{}.{}", op_type.to_lowercase(), self.graph.node.len());
        self.graph.node.push(Node {
            input: input.iter().map(|name| name.to_string()).collect(),
            output: vec![name.clone()],
            name: name.clone(),
            op_type: op_type.into(),
            attribute,
        });
        name
    }
    /// A constant vector of whole numbers.
    fn integers(&mut self, numbers: &[i64]) -> String {
        let name = format!("constant.{}", self.graph.initializer.len());
        let raw_data = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let dims = vec![numbers.len() as i64];
        self.graph.initializer.push(TensorData { dims, data_type: INT64, name: name.clone(), raw_data });
        name
    }
    /// A constant number.
    fn number(&mut self, number: f64) -> String {
        let name = format!("constant.{}", self.graph.initializer.len());
        let raw_data = (number as f32).to_le_bytes().to_vec();
        self.graph.initializer.push(TensorData { dims: Vec::new(), data_type: FLOAT, name: name.clone(), raw_data });
        name
    }

    fn add(&mut self, a: &str, b: &str) -> String {
        self.node("Add", &[a, b], Vec::new())
    }
    fn relu(&mut self, x: &str) -> String {
        self.node("Relu", &[x], Vec::new())
    }
    fn product(&mut self, a: &str, b: &str) -> String {
        self.node("MatMul", &[a, b], Vec::new())
    }
    fn linear(&mut self, x: &str, path: &str) -> String {
        let product = self.product(x, &format!("{path}.weight"));
        self.add(&product, &format!("{path}.bias"))
    }
    fn norm(&mut self, x: &str, path: &str) -> String {
        let epsilon = Attribute { name: "epsilon".into(), f: EPSILON as f32, kind: 1, ..Attribute::default() };
        let inputs = [x, &format!("{path}.scale"), &format!("{path}.shift")];
        self.node("LayerNormalization", &inputs, vec![integer("axis", -1), epsilon])
    }
    fn over(&mut self, reduction: &str, x: &str, axis: i64, keep: bool) -> String {
        let axes = self.integers(&[axis]);
        self.node(reduction, &[x, &axes], vec![integer("keepdims", i64::from(keep))])
    }
    fn reshape(&mut self, x: &str, dims: &[i64]) -> String {
        let dims = self.integers(dims);
        self.node("Reshape", &[x, &dims], Vec::new())
    }
    fn transpose(&mut self, x: &str, order: [i64; 4]) -> String {
        let order = Attribute { name: "perm".into(), ints: order.to_vec(), kind: 7, ..Attribute::default() };
        self.node("Transpose", &[x], vec![order])
    }

    fn encoder(&mut self, layers: usize, heads: i64, groups: i64, width: i64) -> String {
        let place = self.linear("middles", "encoder.place.0");
        let place = self.relu(&place);
        let place = self.linear(&place, "encoder.place.1");
        let mut tokens = self.tokens();
        for layer in 0..layers {
            let path = format!("encoder.layer.{layer}");
            let placed = self.add(&tokens, &place);
            let before = self.norm(&placed, &format!("{path}.norm.0"));
            let attended = self.attention(&before, &path, [groups, heads, width / heads.max(1)]);
            let between = self.add(&placed, &attended);
            let normal = self.norm(&between, &format!("{path}.norm.1"));
            let hidden = self.linear(&normal, &format!("{path}.perceptron.0"));
            let approximate =
                Attribute { name: "approximate".into(), s: b"tanh".to_vec(), kind: 3, ..Attribute::default() };
            let hidden = self.node("Gelu", &[&hidden], vec![approximate]);
            let more = self.linear(&hidden, &format!("{path}.perceptron.1"));
            tokens = self.add(&between, &more);
        }
        let normal = self.norm(&tokens, "encoder.norm");
        let pooled = self.over("ReduceMean", &normal, 1, false);
        self.node("Concat", &[&pooled, "context"], vec![integer("axis", 1)])
    }

    fn tokens(&mut self) -> String {
        let first = self.linear("points", "encoder.token.first");
        let first = self.relu(&first);
        let each = self.linear(&first, "encoder.token.second");
        let largest = self.over("ReduceMax", &each, 2, true);
        let common = self.linear(&largest, "encoder.token.common");
        let own = self.linear(&each, "encoder.token.own");
        let both = self.add(&own, &common);
        let both = self.relu(&both);
        let last = self.linear(&both, "encoder.token.last");
        self.over("ReduceMax", &last, 2, false)
    }

    fn attention(&mut self, tokens: &str, path: &str, [groups, heads, per_head]: [i64; 3]) -> String {
        let query = self.linear(tokens, &format!("{path}.query"));
        let key = self.product(tokens, &format!("{path}.key.weight"));
        let value = self.linear(tokens, &format!("{path}.value"));
        // In a shape 0 stands for what there was.
        let split = [0, groups, heads, per_head];
        let [query, key, value] = [query, key, value].map(|x| self.reshape(&x, &split));
        let query = self.transpose(&query, [0, 2, 1, 3]);
        let key = self.transpose(&key, [0, 2, 3, 1]);
        let value = self.transpose(&value, [0, 2, 1, 3]);
        let scale = self.number((per_head as f64).powf(-0.5));
        let query = self.node("Mul", &[&query, &scale], Vec::new());
        let alike = self.product(&query, &key);
        let shares = self.node("Softmax", &[&alike], vec![integer("axis", -1)]);
        let mixed = self.product(&shares, &value);
        let mixed = self.transpose(&mixed, [0, 2, 1, 3]);
        let mixed = self.reshape(&mixed, &[0, groups, heads * per_head]);
        self.linear(&mixed, &format!("{path}.out"))
    }

    fn head(&mut self, head: &HeadSpec, features: &str) {
        let path = format!("head.{}", head.template);
        let mut hidden = features.to_string();
        for layer in 0..2 {
            hidden = self.linear(&hidden, &format!("{path}.{layer}"));
            hidden = self.relu(&hidden);
        }
        let both = self.linear(&hidden, &format!("{path}.2"));
        let outputs = head.outputs() as i64;
        let [least, most] = [LOG_DEVIATION.0, LOG_DEVIATION.1].map(|bound| self.number(bound));
        let mean = self.columns(&both, 0, outputs);
        let log = self.columns(&both, outputs, 2 * outputs);
        let log = self.node("Clip", &[&log, &least, &most], Vec::new());
        for (value, name) in [(mean, "mean"), (log, "log_deviation")] {
            let name = format!("{}.{name}", head.template);
            self.graph.node.push(Node {
                input: vec![value],
                output: vec![name.clone()],
                name: name.clone(),
                op_type: "Identity".into(),
                attribute: Vec::new(),
            });
            self.graph.output.push(floats(&name, &[outputs]));
        }
    }

    fn columns(&mut self, x: &str, from: i64, to: i64) -> String {
        let [from, to, axis] = [from, to, 1].map(|number| self.integers(&[number]));
        self.node("Slice", &[x, &from, &to, &axis], Vec::new())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;
    use crate::{
        cloud::group,
        config::{Description, Origin, SCHEMA, Shape},
        net::{Batch, Net},
    };
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::{collections::BTreeSet, process::Command};

    fn estimator() -> Estimator {
        let head = |template: &str, parameters: &[&str], fold| HeadSpec {
            template: template.into(),
            parameters: parameters.iter().map(|name| name.to_string()).collect(),
            fold,
        };
        let heads = vec![head("brick", &["length", "width", "height"], 2), head("tube", &["radius"], 0)];
        let net = Net::drawn(Shape::TINY, &heads, 3).unwrap();
        let description = Description { schema: SCHEMA.into(), shape: Shape::TINY, origin: Origin::default(), heads };
        Estimator::new(description, net)
    }

    #[test]
    fn every_value_is_made_before_it_is_used_and_every_weight_is_used() {
        let estimator = estimator();
        let graph = model(&estimator).unwrap().graph.unwrap();
        let mut known: BTreeSet<&str> = graph.initializer.iter().map(|tensor| tensor.name.as_str()).collect();
        assert_eq!(known.len(), graph.initializer.len());
        known.extend(graph.input.iter().map(|input| input.name.as_str()));
        let mut used = BTreeSet::new();
        for node in &graph.node {
            for input in &node.input {
                assert!(known.contains(input.as_str()), "{} takes {input}, which is not made yet", node.name);
                used.insert(input.as_str());
            }
            assert!(node.output.iter().all(|output| known.insert(output)), "{} is made twice", node.name);
        }
        assert!(graph.output.iter().all(|output| known.contains(output.name.as_str())));
        let unused: Vec<&str> =
            estimator.net().weights().all().map(|(name, _)| name).filter(|name| !used.contains(name)).collect();
        assert_eq!(unused, Vec::<&str>::new());
    }

    /// Another runtime gives the same answers. Skipped where Python has no onnxruntime.
    #[test]
    fn another_runtime_agrees() {
        let has = Command::new("python3").args(["-c", "import onnxruntime, numpy"]).output();
        if !has.is_ok_and(|output| output.status.success()) {
            eprintln!("skipped: python3 has no onnxruntime");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let estimator = estimator();
        write(&estimator, &folder.path().join("net.onnx")).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let clouds: Vec<_> = (0..3)
            .map(|_| {
                let points: Vec<[f32; 3]> = (0..700).map(|_| [(); 3].map(|()| rng.random_range(-0.5..0.5))).collect();
                let context = [(); 3].map(|()| rng.random_range(-1.0..1.0));
                (group(&points, &Shape::TINY, &mut rng).unwrap(), context)
            })
            .collect();
        let batch = Batch::new(&clouds, &Shape::TINY).unwrap();
        let features = estimator.net().features(&batch).unwrap();
        let mut tensors = vec![
            ("middles".to_string(), batch.middles.clone()),
            ("points".into(), batch.points.clone()),
            ("context".into(), batch.context.clone()),
        ];
        for (place, head) in estimator.description().heads.iter().enumerate() {
            let answer = estimator.net().answer(place, &features).unwrap();
            tensors.push((format!("{}.mean", head.template), answer.mean));
            tensors.push((format!("{}.log_deviation", head.template), answer.log_deviation));
        }
        for (name, tensor) in &tensors {
            tensor.write_npy(folder.path().join(format!("{name}.npy"))).unwrap();
        }
        let script = "import numpy, onnxruntime, os\n\
                      load = lambda name: numpy.load(name + '.npy')\n\
                      session = onnxruntime.InferenceSession('net.onnx', providers=['CPUExecutionProvider'])\n\
                      names = [output.name for output in session.get_outputs()]\n\
                      assert len(names) == 4, names\n\
                      found = session.run(names, {i.name: load(i.name) for i in session.get_inputs()})\n\
                      for name, value in zip(names, found):\n\
                      \x20   off = abs(value - load(name)).max()\n\
                      \x20   assert value.shape == load(name).shape and off < 1e-4, (name, off)\n";
        let ran = Command::new("python3").args(["-c", script]).current_dir(folder.path()).output().unwrap();
        assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    }
}
