"""A graph model of TensorFlow.js and its ONNX give the same numbers."""

import base64
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnx
import pytest
from onnx.reference import ReferenceEvaluator
from scipy.signal import correlate

from experiments.watch.graph_model import to_onnx

RNG = np.random.default_rng(0)
KERNEL, BIAS = RNG.normal(size=(3, 3, 2, 4)).astype(np.float32), RNG.normal(size=4).astype(np.float32)
CONSTANTS = {
    "last": np.array([0, 2, 3, 1], np.int32),
    "first": np.array([0, 3, 1, 2], np.int32),
    "margins": np.array([[0, 0], [1, 1], [1, 1], [0, 0]], np.int32),
    "kernel": KERNEL,
    "bias": BIAS,
    "axis": np.array(3, np.int32),
    "size": np.array([8, 8], np.int32),
    "shape": np.array([1, 64, 8], np.int32),
}


def node(name: str, kind: str, takes: tuple[str, ...] = (), **attributes: Any) -> dict[str, Any]:
    return {"name": name, "op": kind, "input": list(takes), "attr": attributes}


def numbers(*values: int) -> dict[str, Any]:
    return {"list": {"i": [str(each) for each in values]}}


NODES = [
    node("y", "Identity", ("reshaped",)),  # not in order
    *(node(name, "Const") for name in CONSTANTS),
    node("x", "Placeholder", shape={"shape": {"dim": [{"size": str(n)} for n in (1, 2, 8, 8)]}}),
    node("image", "Transpose", ("x", "last")),
    node("padded", "Pad", ("image", "margins")),
    node(
        *("conv", "Conv2D", ("padded", "kernel")),
        padding={"s": base64.b64encode(b"VALID").decode()},
        strides=numbers(1, 2, 2, 1),
    ),
    node("sum", "Add", ("conv", "bias")),
    node("there", "Transpose", ("sum", "first")),
    node("back", "Transpose", ("there", "last")),
    node("active", "LeakyRelu", ("back",), alpha={"f": 0.1}),
    node("double", "ConcatV2", ("active", "active", "axis")),
    node("large", "ResizeBilinear", ("double", "size")),
    node("bounded", "Sigmoid", ("large",)),
    node("reshaped", "Reshape", ("bounded", "shape")),
]


def written(folder: Path, nodes: list[dict[str, Any]]) -> Path:
    entries = [
        {"name": name, "shape": list(values.shape), "dtype": values.dtype.name}
        for name, values in CONSTANTS.items()
    ]
    model = {
        "modelTopology": {"node": nodes},
        "weightsManifest": [{"paths": ["model.bin"], "weights": entries}],
    }
    (folder / "model.bin").write_bytes(b"".join(each.tobytes() for each in CONSTANTS.values()))
    (folder / "model.json").write_text(json.dumps(model))
    return folder / "model.json"


def expected(x: np.ndarray) -> np.ndarray:
    padded = np.pad(x[0].transpose(1, 2, 0), ((1, 1), (1, 1), (0, 0)))
    conv = np.stack([correlate(padded, KERNEL[..., k], "valid")[..., 0] for k in range(4)], -1)[::2, ::2]
    active = np.where(conv + BIAS > 0.0, conv + BIAS, 0.1 * (conv + BIAS))
    large = cv2.resize(np.concatenate([active, active], -1), (8, 8), interpolation=cv2.INTER_LINEAR)
    return (1.0 / (1.0 + np.exp(-large))).reshape(1, 64, 8)


def test_it_gives_what_the_operations_say(tmp_path: Path):
    model = to_onnx(written(tmp_path, NODES))
    x = RNG.normal(size=(1, 2, 8, 8)).astype(np.float32)
    found = list(ReferenceEvaluator(model).run(["y"], {"x": x}))
    np.testing.assert_allclose(np.array(found[0]), expected(x), atol=1e-5)
    onnx.save(model, str(tmp_path / "model.onnx"))
    network = cv2.dnn.readNetFromONNX(str(tmp_path / "model.onnx"))
    network.setInput(x)
    np.testing.assert_allclose(network.forward("y"), expected(x), atol=1e-5)


def test_only_what_is_left_of_transpositions_is_made(tmp_path: Path):
    """Margins and bias become the convolution's own; one transposition before the values leave the image."""
    kinds = [each.op_type for each in to_onnx(written(tmp_path, NODES)).graph.node]
    assert sorted(kinds) == sorted(
        ["Conv", "LeakyRelu", "Concat", "Resize", "Sigmoid", "Transpose", "Reshape", "Identity"]
    )


def test_an_operation_that_is_not_known_is_named(tmp_path: Path):
    nodes = [*NODES, node("odd", "Fft", ("x",))]
    with pytest.raises(ValueError, match="Fft is not known"):
        to_onnx(written(tmp_path, nodes))
