"""YOLO networks with random weights: structure as published, values of no meaning."""

from pathlib import Path

import numpy as np

from systems.vision.people.person_networks import darknet_weights

ANCHORS = [(10, 14), (23, 27), (37, 58), (81, 82), (135, 169), (344, 319)]
NET = "[net]\nwidth=416\nheight=416\nchannels=3\n"
YOLO = (
    "[yolo]\nmask={mask}\nanchors=" + ",".join(f"{w},{h}" for w, h in ANCHORS) + "\nclasses=80\nnum=6\n"
    "jitter=.3\nignore_thresh=.7\ntruth_thresh=1\nrandom=1\n"
)


def conv(filters: int, size: int = 3) -> str:
    return (
        f"[convolutional]\nbatch_normalize=1\nfilters={filters}\nsize={size}\nstride=1\npad=1\n"
        "activation=leaky\n"
    )


def pool(stride: int = 2) -> str:
    return f"[maxpool]\nsize=2\nstride={stride}\n"


HEAD = "[convolutional]\nsize=1\nstride=1\npad=1\nfilters=255\nactivation=linear\n"


def tiny_yolo() -> str:
    """Table A.9: thirteen convolutions, two outputs."""
    parts = [NET]
    for filters in (16, 32, 64, 128, 256):
        parts += [conv(filters), pool()]
    parts += [conv(512), pool(1), conv(1024), conv(256, 1), conv(512), HEAD, YOLO.format(mask="3,4,5")]
    parts += ["[route]\nlayers = -4\n", conv(128, 1), "[upsample]\nstride=2\n", "[route]\nlayers = -1, 8\n"]
    return "".join([*parts, conv(256), HEAD, YOLO.format(mask="0,1,2")])


def small_yolo() -> str:
    """One output, which costs a hundredth."""
    layers = [conv(4), pool(), conv(4), pool(), conv(4), pool(), conv(4), pool(), conv(8), pool()]
    return "".join([NET, *layers, HEAD, YOLO.format(mask="3,4,5")])


def write(folder: Path, cfg: str, missing: int = 0) -> Path:
    """The cfg with random weights beside it, of a size that keeps values from layer to layer near one."""
    file = folder / "net.cfg"
    file.write_text(cfg)
    count, _ = darknet_weights(file)
    weights = np.random.default_rng(3).uniform(0.02, 0.2, count - missing).astype(np.float32)
    header = np.array([0, 2, 0], np.int32).tobytes() + np.int64(0).tobytes()
    file.with_suffix(".weights").write_bytes(header + weights.tobytes())
    return file
