"""Writes tiny models, weights set by hand, into a folder: two sound ones and some that are broken."""
import sys
from pathlib import Path

import onnx
from onnx import TensorProto, helper, numpy_helper
import numpy as np

out = Path(sys.argv[1])


def constant(name, values):
    return numpy_helper.from_array(np.array(values, dtype=np.float32), name)


def write(name, nodes, inputs, outputs, constants, metadata=None):
    graph = helper.make_graph(nodes, name, inputs, outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    model.model_version = 3
    helper.set_model_props(model, metadata or {})
    onnx.checker.check_model(model)
    onnx.save(model, out / f"{name}.onnx")


def tensor(name, shape):
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)


def segmenter(name, rows, bias, after=None, size=("h", "w")):
    """A score for red things and one for blue things: a 1x1 convolution over r, g, b, depth and a sigmoid."""
    last = "scores" if after is None else "sure"
    nodes = [
        helper.make_node("Conv", ["image", "weights", "bias"], ["logits"]),
        helper.make_node("Sigmoid", ["logits"], [last]),
    ] + (after or [])
    weights = np.array(rows, dtype=np.float32).reshape(len(rows), 4, 1, 1)
    constants = [constant("weights", weights), constant("bias", bias), constant("zero", 0.0)]
    write(name, nodes, [tensor("image", [1, 4, *size])], [tensor("scores", ["b", "k", "y", "x"])], constants)


RED_BLUE = [[60, -60, 0, 0], [-60, 0, 60, 0]]
segmenter("segmenter", RED_BLUE, [-12, -12])
segmenter("nothing", RED_BLUE, [-900, -900])
divide = helper.make_node("Div", ["zero", "zero"], ["nan"])
segmenter("nan", RED_BLUE, [-12, -12], [divide, helper.make_node("Add", ["sure", "nan"], ["scores"])])
turn = helper.make_node("Transpose", ["sure"], ["scores"], perm=[0, 1, 3, 2])
segmenter("transposed", RED_BLUE, [-12, -12], [turn])
segmenter("fixed", RED_BLUE, [-12, -12], size=(32, 32))


def estimator(name, metadata, sigmas=(0.01, 0.01, 0.01)):
    """A block's sizes as a linear map of the extents of its points."""
    nodes = [
        helper.make_node("ReduceMax", ["cloud"], ["high"], axes=[1], keepdims=0),
        helper.make_node("ReduceMin", ["cloud"], ["low"], axes=[1], keepdims=0),
        helper.make_node("Sub", ["high", "low"], ["extents"]),
        helper.make_node("MatMul", ["extents", "weights"], ["values"]),
        helper.make_node("Identity", ["spread"], ["sigmas"]),
    ]
    constants = [constant("weights", np.diag([0.9, 0.7, 1.0])), constant("spread", [sigmas])]
    outputs = [tensor("values", ["b", "p"]), tensor("sigmas", ["b", "q"])]
    write(name, nodes, [tensor("cloud", [1, 512, 3])], outputs, constants, metadata)


estimator("block", {"template": "block"})
estimator("nameless", {})
estimator("short", {"template": "block"}, (0.01,))
(out / "garbage.onnx").write_bytes(b"\x00\x01 no model")
(out / "truncated.onnx").write_bytes((out / "segmenter.onnx").read_bytes()[:120])
