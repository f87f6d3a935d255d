"""People as boxes in single images, from a detection network of the user's: NanoDet or tiny YOLO v3.

Networks are run by OpenCV. NanoDet says for each place of three grids how likely each of 80 kinds of things
is, and how far the four sides of its box are, as distributions over 11 distances. YOLO (Probst 2024, A.9) has
a box for each place and each of three anchors: where it is, how likely it holds anything, and what. For both
the first kind is a person. Boxes that mostly show the known robot do not count: it looks like one.
"""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

_KINDS, _PERSON = 80, 0
_DISTANCES = 11  # of NanoDet, in steps of its grid
_NANODET_MEAN = np.array([103.53, 116.28, 123.675])  # of blue, green and red
_NANODET_SIGMA = np.array([57.375, 57.12, 58.395])
_GRAY = 128.0 / 255.0  # of what YOLO sees beside an image
_COARSEST = 32  # px, the coarsest grid of NanoDet: sides of its input are multiples of it
_SCORE = {".onnx": 0.35, ".cfg": 0.25}
_OVERLAP = 0.5  # intersection over union from which two boxes are one person


class PersonNetwork:
    """A network that is ready to run."""

    def __init__(self, file: str | Path) -> None:
        """Loads it.

        Args:
            file: NAME.onnx of a NanoDet (`make detector`), or NAME.cfg of a YOLO with NAME.weights beside it.

        Raises:
            ValueError: if it cannot be read, or is no such network.
        """
        self._file, self._is_yolo = Path(file), Path(file).suffix == ".cfg"
        if self._file.suffix not in _SCORE:
            raise ValueError(f"network {file}: must be .onnx of a NanoDet or .cfg of a YOLO")
        for each in (self._file, *([self._file.with_suffix(".weights")] if self._is_yolo else [])):
            if not each.is_file():
                raise ValueError(f"network {file}: there is no file {each}")
        self.size, self._is_cut = 416, False
        try:
            if self._is_yolo:
                self._check_weights()
                self._net = cv2.dnn.readNetFromDarknet(str(file), str(self._file.with_suffix(".weights")))
            else:
                self._net = cv2.dnn.readNetFromONNX(str(file))
            self._outputs = self._net.getUnconnectedOutLayersNames()
            self._decoded(*self._forward(np.zeros((self.size, self.size, 3), np.uint8)))
            self._is_cut = self._takes_less()
        except cv2.error as error:
            said = str(error).strip().splitlines()[-1]
            raise ValueError(f"network {file}: OpenCV cannot run it: {said}") from error

    def people(self, image: np.ndarray, robot: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Boxes of people.

        Args:
            image: (h, w, 3) of uint8, blue first.
            robot: (h, w), nonzero where the known robot is; a box half of which is its does not count.

        Returns:
            Left, upper, right and lower edge in px, (n, 4), and how sure the network is, (n,).
        """
        height, width = image.shape[:2]
        scale = self.size / max(height, width)
        small = cv2.resize(image, (round(width * scale), round(height * scale)), interpolation=cv2.INTER_AREA)
        boxes, scores = self._decoded(*self._forward(small))
        boxes = np.clip(boxes / scale, 0.0, [width, height, width, height])
        kept = _apart(boxes, scores, _SCORE[self._file.suffix])
        boxes, scores = boxes[kept], scores[kept]
        if robot is not None:
            free = np.array([covered(robot, box) < 0.5 for box in boxes], bool)
            boxes, scores = boxes[free], scores[free]
        return boxes, scores

    def _takes_less(self) -> bool:
        """Whether it takes images that are not square, of which nothing has to be computed beside them."""
        if self._is_yolo:
            return False
        self._is_cut = True
        try:
            self._decoded(*self._forward(np.zeros((self.size // 2, self.size, 3), np.uint8)))
        except (cv2.error, ValueError):  # its grids are fixed
            return False
        return True

    def _forward(self, small: np.ndarray) -> tuple[list[np.ndarray], tuple[int, int]]:
        """What the network says of an image at the upper left of its input; height and width of that, px."""
        height, width = small.shape[:2]
        size = (self.size, self.size)
        if self._is_cut:
            size = (-(-height // _COARSEST) * _COARSEST, -(-width // _COARSEST) * _COARSEST)
        if self._is_yolo:
            whole = np.full((self.size, self.size, 3), _GRAY, np.float32)
            whole[:height, :width] = small[..., ::-1] / np.float32(255.0)
        else:
            whole = np.zeros((*size, 3), np.float32)
            whole[:height, :width] = small
            whole = (whole - _NANODET_MEAN.astype(np.float32)) / _NANODET_SIGMA.astype(np.float32)
        self._net.setInput(np.ascontiguousarray(whole.transpose(2, 0, 1)[None]))
        return list(self._net.forward(self._outputs)), size

    def _decoded(self, outputs: list[np.ndarray], size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        if self._is_yolo:  # OpenCV's own layers have turned them into boxes, in shares of the image
            rows = np.concatenate(outputs)
            middle, half = self.size * rows[:, :2], 0.5 * self.size * rows[:, 2:4]
            return np.concatenate([middle - half, middle + half], 1), rows[:, 5 + _PERSON]
        return nanodet_boxes(outputs, size)

    def _check_weights(self) -> None:
        """Refuses weights that are not as many as the cfg needs, which OpenCV would read past their end."""
        needed, self.size = darknet_weights(self._file)
        data = self._file.with_suffix(".weights").read_bytes()
        major, minor = np.frombuffer(data[:8].ljust(8, b"\0"), np.int32)
        header = 20 if major * 10 + minor >= 2 else 16
        has = (len(data) - header) // 4
        if has != needed:
            raise ValueError(
                f"network {self._file}: it needs {needed} weights, "
                f"{self._file.with_suffix('.weights')} has {has}"
            )


def nanodet_boxes(outputs: Sequence[np.ndarray], size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Boxes (n, 4) in px of an input of a height and width, and scores (n,) of people, for all places.

    Raises:
        ValueError: if the arrays are not those of a NanoDet.
    """
    of_grid: dict[int, dict[int, np.ndarray]] = {}
    for each in outputs:
        of_grid.setdefault(each.shape[-2], {})[each.shape[-1]] = each.reshape(each.shape[-2:])
    boxes, scores = [], []
    for places, arrays in of_grid.items():
        step = max(1, round((size[0] * size[1] / places) ** 0.5))
        columns = size[1] // step
        if (size[0] // step) * columns != places or set(arrays) != {_KINDS, 4 * _DISTANCES}:
            shapes = ", ".join(str(each.shape) for each in outputs)
            raise ValueError(f"network: outputs of the shapes {shapes} are not those of a NanoDet")
        parts = arrays[4 * _DISTANCES].reshape(places, 4, _DISTANCES)
        weights = np.exp(parts - parts.max(axis=2, keepdims=True))
        sides = step * (weights @ np.arange(_DISTANCES)) / weights.sum(axis=2)
        row, column = np.divmod(np.arange(places), columns)
        middle = step * (np.stack([column, row], 1) + 0.5)
        boxes.append(np.concatenate([middle - sides[:, :2], middle + sides[:, 2:]], 1))
        scores.append(arrays[_KINDS][:, _PERSON])
    return np.concatenate(boxes), np.concatenate(scores)


def darknet_weights(cfg: str | Path) -> tuple[int, int]:
    """How many weights the convolutions of a cfg need, and the side of its square input in px.

    Raises:
        ValueError: if a layer is of a kind that a tiny YOLO v3 does not have, or the input is not square.
    """
    sections: list[dict[str, str]] = []
    for line in Path(cfg).read_text(encoding="utf-8", errors="replace").splitlines():
        text = line.split("#")[0].strip()
        if text.startswith("["):
            sections.append({"kind": text.strip("[]")})
        elif text and sections and "=" in text:
            name, value = text.split("=", 1)
            sections[-1][name.strip()] = value.strip()
    if not sections or sections[0]["kind"] not in ("net", "network"):
        raise ValueError(f"network {cfg}: a cfg begins with [net]")
    net, layers = sections[0], sections[1:]
    width, height = net.get("width"), net.get("height")
    if width is None or width != height:
        raise ValueError(f"network {cfg}: the input must be square, is {width} x {height}")
    channels, needed = [int(net.get("channels", 3))], 0
    for number, layer in enumerate(layers):
        before = channels[-1]
        if layer["kind"] == "convolutional":
            filters, size = int(layer.get("filters", 1)), int(layer.get("size", 1))
            scales = 4 if int(layer.get("batch_normalize", 0)) else 1  # mean, variance, scale and bias
            needed += filters * (before * size**2 + scales)
            before = filters
        elif layer["kind"] == "route":
            taken = [int(each) for each in layer["layers"].split(",")]
            before = sum(channels[1 + (each if each >= 0 else number + each)] for each in taken)
        elif layer["kind"] not in ("maxpool", "upsample", "yolo"):
            raise ValueError(f"network {cfg}: a tiny YOLO has no layer [{layer['kind']}]")
        channels.append(before)
    return needed, int(width)


def covered(mask: np.ndarray, box: np.ndarray) -> float:
    """The share of a box (left, upper, right, lower in px) in which a mask is not zero."""
    left, upper, right, lower = np.rint(box).astype(int)
    inside = mask[upper : max(lower, upper + 1), left : max(right, left + 1)]
    return float(np.count_nonzero(inside)) / max(1, inside.size)


def _apart(boxes: np.ndarray, scores: np.ndarray, least: float) -> np.ndarray:
    """Indices of the boxes that remain where those of one person are one."""
    likely = np.flatnonzero(scores >= least)
    sizes = np.concatenate([boxes[likely, :2], boxes[likely, 2:] - boxes[likely, :2]], 1)
    kept = cv2.dnn.NMSBoxes(sizes.tolist(), scores[likely].tolist(), least, _OVERLAP)
    return likely[np.ravel(np.asarray(kept, int))]
