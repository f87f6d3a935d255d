"""Graph models of TensorFlow.js as ONNX: the operations that a NanoDet has, one by one.

TensorFlow keeps images with their channels last, ONNX before height and width. Values are therefore kept as
views: a value of ONNX and the order in which its axes are read, so that transpositions are made only where a
value is needed in another order than the one it has.
"""

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper, shape_inference

_TYPES = {"float32": np.float32, "int32": np.int64, "bool": np.bool_}
_OPSET = 13
Axes = tuple[int, ...]
_LAST = (0, 2, 3, 1)  # how TensorFlow reads the axes of an image of ONNX
_SAME = {"Add": "Add", "AddV2": "Add", "Sigmoid": "Sigmoid", "Identity": "Identity", "LeakyRelu": "LeakyRelu"}


def read_weights(file: Path, model: dict[str, Any]) -> dict[str, np.ndarray]:
    """The arrays of a model by name.

    Raises:
        OSError: if a file of weights cannot be read.
        ValueError: if it is too short or has numbers of an unknown kind.
    """
    found: dict[str, np.ndarray] = {}
    for group in model["weightsManifest"]:
        data, at = b"".join((file.parent / name).read_bytes() for name in group["paths"]), 0
        for entry in group["weights"]:
            kind, kept = entry["dtype"], entry.get("quantization", entry)["dtype"]
            if kind not in _TYPES or kept not in (kind, "float16"):
                raise ValueError(f"{file}: weights of the kind {kind}, kept as {kept}, are not known")
            size = int(np.prod(entry["shape"]))
            values = np.frombuffer(data, kept, size, at).reshape(entry["shape"])
            at += values.nbytes
            found[entry["name"]] = values.astype(_TYPES[kind])
    return found


def to_onnx(file: Path) -> onnx.ModelProto:
    """Converts ``model.json`` with the weights beside it.

    Raises:
        OSError: if a file cannot be read.
        ValueError: if there is an operation that is not known.
    """
    model = json.loads(file.read_text(encoding="utf-8"))
    return _Conversion(file, model).model()


class _Conversion:
    """One model on its way."""

    def __init__(self, file: Path, model: dict[str, Any]) -> None:
        self._file = file
        self._operations = {node["name"]: node for node in model["modelTopology"]["node"]}
        self._known = read_weights(file, model)  # arrays by name, given or worked out
        self._initial: dict[str, np.ndarray] = {}
        self._nodes: list[onnx.NodeProto] = []
        self._inputs: list[onnx.ValueInfoProto] = []
        self._takers: dict[str, list[str]] = {}  # of a value: kinds of the operations that take it
        for node in self._operations.values():
            for each in node.get("input", []):
                self._takers.setdefault(_plain(each), []).append(node["op"])
        self._views: dict[str, dict[Axes, str]] = {}  # of a value: names in ONNX by the order of axes

    def model(self) -> onnx.ModelProto:
        for name in self._in_order():
            self._convert(name)
        self._merge_margins()
        outputs = [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, None)
            for name, node in self._operations.items()
            if node["op"] == "Identity"
        ]
        initial = [numpy_helper.from_array(np.ascontiguousarray(v), k) for k, v in self._initial.items()]
        graph = helper.make_graph(self._nodes, "graph", self._inputs, outputs, initial)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=8)
        model = shape_inference.infer_shapes(model)
        onnx.checker.check_model(model)
        return model

    def _merge_margins(self) -> None:
        """Margins of zero before a convolution that nobody else takes become its own."""
        takers: dict[str, list[onnx.NodeProto]] = {}
        for node in self._nodes:
            for each in node.input:
                takers.setdefault(each, []).append(node)
        for pad in [node for node in self._nodes if node.op_type == "Pad" and len(node.input) == 2]:
            after = takers[pad.output[0]]
            margins = self._initial[pad.input[1]].reshape(2, 4)
            own = [each for node in after for each in node.attribute if each.name == "pads"]
            if len(after) == 1 and after[0].op_type == "Conv" and own and not margins[:, :2].any():
                after[0].input[0] = pad.input[0]
                own[0].ints[:] = margins[:, 2:].reshape(-1).tolist()
                self._nodes.remove(pad)
                del self._initial[pad.input[1]]

    def _in_order(self) -> list[str]:
        """Names, each after those that it takes."""
        order: dict[str, None] = {}
        waiting = list(reversed(self._operations))
        while waiting:
            name = waiting[-1]
            left = [each for each in map(_plain, self._takes(name)) if each not in order]
            if left:
                waiting += left
            else:
                order[waiting.pop()] = None
        return list(order)

    def _takes(self, name: str) -> list[str]:
        return self._operations[name].get("input", [])

    def _convert(self, name: str) -> None:
        node = self._operations[name]
        kind, takes, attributes = node["op"], self._takes(name), node.get("attr", {})
        if kind == "Const":
            return
        if kind == "Placeholder":
            shape = [int(each["size"]) for each in attributes["shape"]["shape"]["dim"]]
            self._inputs.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, shape))
        elif all(_plain(each) in self._known for each in takes):
            self._known[name] = self._worked_out(kind, [self._known[_plain(each)] for each in takes])
        elif kind in ("Add", "AddV2") and self._is_bias(takes):
            self._nodes[-1].input.append(
                self._keep(f"{name}/bias", self._known[_plain(takes[1])].reshape(-1))
            )
            self._views[name] = self._views[_plain(takes[0])]
        elif kind in _SAME:
            alpha = {"alpha": float(attributes["alpha"]["f"])} if kind == "LeakyRelu" else {}
            if kind == "Identity":
                self._add(kind, [self._value(each) for each in takes], name)
            else:
                axes = self._axes(takes)
                self._give(_SAME[kind], name, [self._value(each, axes) for each in takes], axes, **alpha)
        else:
            maker = getattr(self, f"_make_{kind}", None)
            if maker is None:
                raise ValueError(f"{self._file}: the operation {kind} is not known")
            maker(name, takes, attributes)

    def _is_bias(self, takes: list[str]) -> bool:
        """Whether a sum adds a constant for each channel to the convolution made last."""
        before, constant = map(_plain, takes)
        last = self._nodes[-1]
        return (
            constant in self._known
            and last.op_type == "Conv"
            and list(last.output) == list(self._views.get(before, {}).values())
            and len(last.input) == 2
            and len(self._takers[before]) == 1
            and self._known[constant].size == self._initial[last.input[1]].shape[0]
            and self._known[constant].shape[-1] == self._known[constant].size
        )

    def _worked_out(self, kind: str, values: list[np.ndarray]) -> np.ndarray:
        """What an operation on constants gives."""
        if kind in ("Add", "AddV2"):
            return values[0] + values[1]
        if kind == "SparseToDense":
            places, shape, entries, rest = values
            dense = np.full(np.atleast_1d(shape), rest)
            if places.size:
                dense[tuple(np.atleast_2d(places.T))] = entries
            return dense
        raise ValueError(f"{self._file}: the operation {kind} on constants is not known")

    def _add(self, kind: str, takes: list[str], gives: str | list[str], **attributes: Any) -> None:
        made = helper.make_node(kind, takes, [gives] if isinstance(gives, str) else gives, **attributes)
        self._nodes.append(made)

    def _axes(self, names: list[str]) -> Axes:
        """The order of the axes of the first value that is not constant."""
        for each in names:
            if _plain(each) not in self._known:
                return next(iter(self._views.get(each, {(): each})))
        return ()

    def _value(self, name: str, axes: Axes = ()) -> str:
        """The name in ONNX of what gives a value when its axes are read in an order; () as it is.

        A constant is kept with the model.
        """
        plain = _plain(name)
        if plain in self._known:
            values = self._known[plain]
            if axes:
                values = values.reshape((1,) * (len(axes) - values.ndim) + values.shape)
                values = values.transpose(np.argsort(axes))
            return self._keep("/".join([plain, *map(str, axes)]), values)
        views = self._views.setdefault(name, {(): plain if name.endswith(":0") else name})
        if axes not in views:
            has, source = next(iter(views.items()))
            rank = range(len(axes or has))
            # Read backwards in the wanted order, a value read in the one it has.
            order = [(has or rank)[each] for each in np.argsort(axes or rank)]
            views[axes] = "/".join([name.removesuffix(":0"), *map(str, axes or "v")])
            self._add("Transpose", [source], views[axes], perm=order)
        return views[axes]

    def _give(self, kind: str, name: str, takes: list[str], axes: Axes = _LAST, **attributes: Any) -> None:
        """An operation whose result is read in an order."""
        self._views[name] = {axes: f"{name}/made"}
        self._add(kind, takes, f"{name}/made", **attributes)

    def _keep(self, name: str, values: Any) -> str:
        self._initial[name] = np.asarray(values)
        return name

    def _make_Pad(self, name: str, takes: list[str], attributes: dict[str, Any]) -> None:  # noqa: N802
        axes, margins = self._axes(takes), self._known[_plain(takes[1])]
        if axes:
            margins = margins[np.argsort(axes)]
        pads = self._keep(f"{name}/pads", margins.T.reshape(-1).astype(np.int64))
        rest = [self._keep(f"{name}/rest", np.float32(self._known[_plain(each)])) for each in takes[2:]]
        self._give("Pad", name, [self._value(takes[0], axes), pads, *rest], axes)

    _make_PadV2 = _make_Pad  # noqa: N815

    def _make_Transpose(self, name: str, takes: list[str], attributes: dict[str, Any]) -> None:  # noqa: N802
        order = [int(each) for each in self._known[_plain(takes[1])]]
        axes = self._axes(takes)
        read = tuple((axes or range(len(order)))[each] for each in order)
        self._views[name] = {() if read == tuple(range(len(order))) else read: self._value(takes[0], axes)}

    def _make_Conv2D(self, name: str, takes: list[str], attributes: dict[str, Any]) -> None:  # noqa: N802
        kernel = self._known[_plain(takes[1])].transpose(3, 2, 0, 1)
        padding = base64.b64decode(attributes["padding"]["s"]).decode()
        how: dict[str, Any] = {"pads": [0, 0, 0, 0]} if padding == "VALID" else {"auto_pad": "SAME_UPPER"}
        names = [self._value(takes[0], _LAST), self._keep(f"{name}/kernel", kernel)]
        self._give("Conv", name, names, strides=_numbers(attributes, "strides")[1:3], **how)

    def _make_MaxPool(self, name: str, takes: list[str], attributes: dict[str, Any]) -> None:  # noqa: N802
        size, steps = (_numbers(attributes, each)[1:3] for each in ("ksize", "strides"))
        self._give("MaxPool", name, [self._value(takes[0], _LAST)], kernel_shape=size, strides=steps)

    def _make_ConcatV2(self, name: str, takes: list[str], attributes: dict[str, Any]) -> None:  # noqa: N802
        axes, along = self._axes(takes), int(self._known[_plain(takes[-1])])
        names = [self._value(each, axes) for each in takes[:-1]]
        self._give("Concat", name, names, axes, axis=axes[along] if axes else along)

    def _make_ResizeBilinear(self, name: str, takes: list[str], attributes: dict[str, Any]) -> None:  # noqa: N802
        size = [int(each) for each in self._known[_plain(takes[1])]]
        image = self._value(takes[0], _LAST)
        before = self._shape(image)
        scales = np.array([1.0, 1.0, size[0] / before[2], size[1] / before[3]], np.float32)
        self._give(
            *("Resize", name, [image, "", self._keep(f"{name}/scales", scales)]),
            mode="linear",
            coordinate_transformation_mode="half_pixel",
        )

    def _make_SplitV(self, name: str, takes: list[str], attributes: dict[str, Any]) -> None:  # noqa: N802
        sizes = self._keep(f"{name}/sizes", self._known[_plain(takes[1])].astype(np.int64))
        axes, along = self._axes(takes), int(self._known[_plain(takes[2])])
        parts = [f"{name}/made{number}" for number in range(len(self._initial[sizes]))]
        for number, part in enumerate(parts):
            self._views[f"{name}:{number}" if number else name] = {axes: part}
        axis = axes[along] if axes else along
        self._add("Split", [self._value(takes[0], axes), sizes], parts, axis=axis)

    def _make_Reshape(self, name: str, takes: list[str], attributes: dict[str, Any]) -> None:  # noqa: N802
        shape = self._keep(f"{name}/shape", self._known[_plain(takes[1])].astype(np.int64))
        self._add("Reshape", [self._value(takes[0]), shape], name)

    def _shape(self, name: str) -> list[int]:
        """The shape of a value that has been made, by its name in ONNX."""
        initial = [numpy_helper.from_array(np.ascontiguousarray(v), k) for k, v in self._initial.items()]
        output = helper.make_tensor_value_info(name, TensorProto.FLOAT, None)
        graph = helper.make_graph(self._nodes, "graph", self._inputs, [output], initial)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=8)
        found = shape_inference.infer_shapes(model).graph.output[0].type.tensor_type.shape.dim
        return [each.dim_value for each in found]


def _plain(name: str) -> str:
    """The name of the operation that gives a value."""
    return name.lstrip("^").split(":")[0]


def _numbers(attributes: dict[str, Any], name: str) -> list[int]:
    return [int(each) for each in attributes[name]["list"]["i"]]
