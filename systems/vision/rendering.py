"""Rendering of marker images: ellipses with blur, motion blur, noise and quantisation.

Blur turns an edge into the integral of a Gauss curve across it, motion during the exposure shifts it, noise
is added pixel by pixel. Only what is near a light is computed: elsewhere a pixel is as dark as the
background, without its noise, which must be too small to be taken for light.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import ndtr

from systems.vision.sphere_images import Ellipses

FULL_SCALE = 255  # of eight bits

_PIXEL_SIGMA2 = 1.0 / 12.0  # px^2, a pixel gathers the light of its square
_EDGE = 4.0  # sigma beyond the outline, where nothing is left to be seen
_STILL = 0.2  # px, a shorter way during the exposure widens no edge by more than half a percent
_MOST_NODES = 16  # along the way of a light


@dataclass(frozen=True)
class Picture:
    """A window of an image; empty if there is none."""

    pixels: np.ndarray  # 0 to 255, (h, w) of uint8
    corner: np.ndarray  # px, u and v of the first pixel in the whole image, (2,)


@dataclass(frozen=True)
class Sensor:
    """Conversion of light to pixel values; brightness is in units of full scale."""

    brightness: float  # of a light
    background: float
    noise_sigma: float  # standard deviation of a pixel
    blur_sigma: float | np.ndarray  # px, of the lens; one, or that of each light, (k,)


def draw(
    camera: np.ndarray,
    lights: Ellipses,
    way: np.ndarray,
    windows: np.ndarray,
    sensor: Sensor,
    rng: np.random.Generator,
) -> list[Picture]:
    """The windows of n cameras with k lights in them.

    Args:
        camera: which of the cameras each light is seen by, shape (k,).
        lights: their outlines amid the exposure, arrays over k.
        way: how far they move during the exposure in px, shape (k, 2).
        windows: first and last pixel, u0, v0, u1, v1, (n, 4); empty where u1 < u0 or v1 < v0.
        sensor: how light becomes numbers.
        rng: of the noise.
    """
    size = np.maximum(windows[:, 2:] - windows[:, :2] + 1, 0)
    begin = np.concatenate([[0], np.cumsum(np.prod(size, axis=1))])
    sigma = np.broadcast_to(np.sqrt(np.square(sensor.blur_sigma) + _PIXEL_SIGMA2), len(camera))
    half = np.sqrt(np.diagonal(lights.shape, axis1=1, axis2=2))
    reach = half + _EDGE * sigma[:, None] + 0.5 * np.abs(way)
    light, place = _places(lights.center, reach, windows[camera])
    offset = (place - lights.center[light]).astype(np.float32)
    share = _lit_share(offset, np.linalg.inv(lights.shape), way, light, sigma)
    value = sensor.brightness * share + sensor.background
    value += sensor.noise_sigma * rng.standard_normal(len(value), dtype=np.float32)
    np.clip(np.rint(FULL_SCALE * value), 0, FULL_SCALE, out=value)
    memory = np.full(begin[-1], round(FULL_SCALE * sensor.background), np.uint8)
    u, v = (place - windows[camera[light], :2]).T
    # Of two lights in one place the brighter one is seen.
    index = begin[camera[light]] + v * size[camera[light], 0] + u
    np.maximum.at(memory, index, value.astype(np.uint8))
    return [
        Picture(memory[begin[i] : begin[i + 1]].reshape(size[i, ::-1]), windows[i, :2])
        for i in range(len(windows))
    ]


def _places(center: np.ndarray, reach: np.ndarray, windows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pixels about k lights: the light of each, and u and v of each, (p,) and (p, 2).

    Center and reach are in px, (k, 2); a light has no pixels outside its window, (k, 4).
    """
    low = np.maximum(np.floor(center - reach).astype(int), windows[:, :2])
    high = np.minimum(np.ceil(center + reach).astype(int), windows[:, 2:])
    size = np.maximum(high - low + 1, 0)
    count = np.prod(size, axis=1)
    light = np.repeat(np.arange(len(center)), count)
    number = np.arange(len(light)) - np.repeat(np.cumsum(count) - count, count)
    v, u = np.divmod(number, size[light, 0])
    return light, low[light] + np.stack([u, v], -1)


def _lit_share(
    offset: np.ndarray, S_inverse: np.ndarray, way: np.ndarray, light: np.ndarray, sigma: np.ndarray
) -> np.ndarray:
    """How bright pixels are, 0 to 1, from their offsets (p, 2) in px from the centres of their lights.

    Edges are as wide as ``sigma`` of each light in px says, (k,). The distance from the outline is measured
    along the radius, and the edge is taken as straight. A straight edge about a circle of radius r would
    spread its light over pi (r^2 + sigma^2), so r is made smaller.
    """
    r2 = 1.0 / np.sqrt(np.linalg.det(S_inverse))
    S_inverse = S_inverse * (1.0 + sigma * sigma / r2)[:, None, None]
    a, b, c = (S_inverse[:, i, j].astype(np.float32)[light] for i, j in ((0, 0), (0, 1), (1, 1)))
    longest = float(np.abs(way).max(initial=0.0))
    nodes, weights = _quadrature(
        1 if longest < _STILL else 2 + int(longest / (2.0 * sigma.min(initial=np.inf)))
    )  # blur fills the gaps
    width = sigma.astype(np.float32)[light]
    share = np.zeros(len(offset), np.float32)
    for node, weight in zip(nodes, weights, strict=True):
        u, v = (offset - (0.5 * node * way).astype(np.float32)[light]).T
        radius = np.sqrt(u * u + v * v)
        relative = np.sqrt(a * u * u + 2.0 * b * u * v + c * v * v) + np.float32(1e-6)
        share += np.float32(0.5 * weight) * ndtr((radius / relative - radius) / width)
    return share


@cache
def _quadrature(count: int) -> tuple[list[float], list[float]]:
    """Nodes in [-1, 1] and weights of Gauss and Legendre."""
    nodes, weights = np.polynomial.legendre.leggauss(min(count, _MOST_NODES))
    return nodes.tolist(), weights.tolist()
