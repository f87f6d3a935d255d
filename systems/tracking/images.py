"""What the cameras record of the markers on the level of images: pixels in windows about the body.

A marker is an evenly lit ellipse. Blur turns its edge into the integral of a Gauss curve across it, and
motion during the exposure shifts it; noise and eight bits are added pixel by pixel. What hides the centre of
a sphere hides all of it.

A camera reads only the window in which the body is expected, as Probst (2024) section 8.1 plans. What is dark
there stays as it is: its noise is not drawn, because none of it would reach the threshold (`ImageSource`
refuses a threshold where it could). The noise of the lit parts is a stream that the numbers from outside are
the key of: to bring tens of thousands of numbers for each exposure through a port would cost more than
everything else.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import ndtr

from systems.tracking.arm_capsules import Capsules
from systems.tracking.camera_model import Cameras
from systems.tracking.detection_body import DetectionBody
from systems.tracking.pose_refinement import moved
from systems.tracking.sphere_images import Ellipses, sphere_images
from systems.tracking.visibility import occluded

FULL_SCALE = 255  # of eight bits
CLEAR_OF_NOISE = 6.0  # sigma; one dark pixel in a thousand million is further from the background

_PIXEL_SIGMA2 = 1.0 / 12.0  # px^2, a pixel gathers the light of its square
_EDGE = 4.0  # sigma beyond the outline, where nothing is left to be seen
_STILL = 0.2  # px, a shorter way during the exposure widens no edge by more than half a percent
_MOST_NODES = 16  # along the way of a light
_REFLECTION_SIZES = 0.7, 12.0  # px, half axes of false lights


@dataclass
class ImageConfig:
    """How the cameras record light; read from a scenario file. Brightness is counted in full scales."""

    exposure: float = 4e-4  # s, the longest of Probst (2024), table A.8
    brightness: float = 2000.0  # of a marker, 1/s; assumed: 0.8 at 0.4 ms
    background: float = 0.05  # assumed
    noise_sigma: float = 0.01  # standard deviation of a pixel; assumed
    blur_sigma: float = 0.7  # px, of the lens; assumed
    reflections: float = 0.0  # false lights in a window on average
    margin: float = 16.0  # px, of a window beyond the markers that are expected in it


@dataclass(frozen=True)
class Picture:
    """A window of an image; empty if there is none."""

    pixels: np.ndarray  # 0 to 255, (h, w) of uint8
    corner: np.ndarray  # px, u and v of the first pixel in the whole image, (2,)


class ImageSource:
    """The pictures that n cameras take of a body with m markers."""

    noise_size = 2  # standard normal numbers for one exposure

    def __init__(
        self,
        cameras: Cameras,
        windows: np.ndarray,
        body: DetectionBody,
        config: ImageConfig,
        threshold: float = 0.4,
    ) -> None:
        """Checks the configuration.

        Args:
            cameras: n cameras.
            windows: the parts of their images that may be looked at, u0, v0, u1, v1 in px, (n, 4).
            body: what carries the markers.
            config: how light is recorded.
            threshold: above which a pixel will count as lit, in full scales.

        Raises:
            ValueError: if a number is out of its range, or noise would reach the threshold.
        """
        _check(config, threshold)
        self._cameras, self._body, self._config = cameras, body, config
        # Pixels count from 0, so that those before the right edge u1 end at u1 - 1.
        self._windows = np.concatenate([np.ceil(windows[:, :2]), np.ceil(windows[:, 2:]) - 1], 1).astype(int)

    def windows(self, X_WE: np.ndarray | None) -> np.ndarray:
        """The windows in which to look for the body, u0, v0, u1, v1, both ends included, (n, 4).

        ``X_WE`` (4, 4) is where it is expected; None for the whole windows of the cameras. A camera that is
        not expected to see the body has a window with u1 < u0.
        """
        if X_WE is None:
            return self._windows.copy()
        expected = self._cameras.project(self._body.p_E @ X_WE[:3, :3].T + X_WE[:3, 3])
        near = self._cameras.depth(X_WE[:3, 3])
        reach = self._config.margin + self._cameras.focal.max(1) * self._body.diameter / np.maximum(near, 0.1)
        # Without a marker in front of the camera there is nothing between the two corners.
        low = np.fmin.reduce(expected, axis=1, initial=1e6) - reach[:, None]
        high = np.fmax.reduce(expected, axis=1, initial=-1e6) + reach[:, None]
        low, high = np.floor(np.clip(low, -1e6, 1e6)), np.ceil(np.clip(high, -1e6, 1e6))
        return np.concatenate(
            [np.maximum(low, self._windows[:, :2]), np.minimum(high, self._windows[:, 2:])], 1
        ).astype(int)

    def expose(
        self,
        X_WE: np.ndarray,
        V_WE: np.ndarray,
        noise: np.ndarray,
        windows: np.ndarray,
        arm: Capsules | None = None,
    ) -> list[Picture]:
        """One exposure.

        Args:
            X_WE: the tool in the world amid the exposure, homogeneous matrix (4, 4).
            V_WE: its velocity, rotation first, in rad/s and m/s, shape (6,).
            noise: standard normal numbers, shape (2,); the same ones give the same pictures.
            windows: what is read of each image, as `windows` gives it.
            arm: what may stand in the way; None for nothing.

        Returns:
            One picture for each camera.
        """
        rng = np.random.Generator(np.random.Philox(key=np.ascontiguousarray(noise).view(np.uint64)))
        p_W = self._body.p_E @ X_WE[:3, :3].T + X_WE[:3, 3]
        spheres = sphere_images(self._cameras, p_W, 0.5 * self._body.diameter)
        shown = np.isfinite(spheres.center[..., 0])
        if arm is not None:
            shown &= ~occluded(self._cameras.p_WC, p_W, arm)
        camera, marker = np.nonzero(shown)
        way = self._way(X_WE, V_WE)[camera, marker]
        lights = Ellipses(spheres.center[camera, marker], spheres.shape[camera, marker])
        if self._config.reflections > 0.0:
            count, lights = self._with_reflections(lights, windows, rng)
            camera = np.concatenate([camera, np.repeat(np.arange(len(windows)), count)])
            way = np.concatenate([way, np.zeros((count.sum(), 2))])
        return self._draw(camera, lights, way, windows, rng)

    def _way(self, X_WE: np.ndarray, V_WE: np.ndarray) -> np.ndarray:
        """How far the images of the markers move during the exposure in px, (n, m, 2)."""
        motion = 0.5 * self._config.exposure * V_WE
        ends = [moved(X_WE, sign * motion) for sign in (1.0, -1.0)]
        after, before = (self._cameras.project(self._body.p_E @ X[:3, :3].T + X[:3, 3]) for X in ends)
        return after - before

    def _with_reflections(
        self, lights: Ellipses, windows: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, Ellipses]:
        """How many false lights each camera has, (n,), and the lights with these behind them."""
        count = rng.poisson(self._config.reflections, len(windows))
        count[np.any(windows[:, 2:] < windows[:, :2], axis=1)] = 0
        box = np.repeat(windows, count, axis=0)
        center = rng.uniform(box[:, :2], box[:, 2:] + 1.0)
        smallest, largest = np.log(_REFLECTION_SIZES)
        half = np.exp(rng.uniform(smallest, largest, (len(box), 2)))
        angle = rng.uniform(0.0, np.pi, len(box))
        c, s = np.cos(angle), np.sin(angle)
        turn = np.stack([c, -s, s, c], -1).reshape(-1, 2, 2)
        shape = turn * (half * half)[:, None] @ turn.swapaxes(1, 2)
        return count, Ellipses(np.concatenate([lights.center, center]), np.concatenate([lights.shape, shape]))

    def _draw(
        self,
        camera: np.ndarray,
        lights: Ellipses,
        way: np.ndarray,
        windows: np.ndarray,
        rng: np.random.Generator,
    ) -> list[Picture]:
        """The windows with k lights: their cameras (k,), outlines, and ways in px, (k, 2)."""
        config = self._config
        size = np.maximum(windows[:, 2:] - windows[:, :2] + 1, 0)
        begin = np.concatenate([[0], np.cumsum(np.prod(size, axis=1))])
        sigma = float(np.sqrt(config.blur_sigma**2 + _PIXEL_SIGMA2))
        reach = np.sqrt(np.diagonal(lights.shape, axis1=1, axis2=2)) + _EDGE * sigma + 0.5 * np.abs(way)
        light, place = _places(lights.center, reach, windows[camera])
        offset = (place - lights.center[light]).astype(np.float32)
        share = _lit_share(offset, np.linalg.inv(lights.shape), way, light, sigma)
        value = config.brightness * config.exposure * share + config.background
        value += config.noise_sigma * rng.standard_normal(len(value), dtype=np.float32)
        np.clip(np.rint(FULL_SCALE * value), 0, FULL_SCALE, out=value)
        memory = np.full(begin[-1], round(FULL_SCALE * config.background), np.uint8)
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
    offset: np.ndarray, S_inverse: np.ndarray, way: np.ndarray, light: np.ndarray, sigma: float
) -> np.ndarray:
    """How bright pixels are, 0 to 1, from their offsets (p, 2) in px from the centres of their lights.

    The distance from the outline is measured along the radius, and the edge is taken as straight. A straight
    edge about a circle of radius r would spread its light over pi (r^2 + sigma^2), so r is made smaller.
    """
    r2 = 1.0 / np.sqrt(np.linalg.det(S_inverse))
    S_inverse = S_inverse * (1.0 + sigma * sigma / r2)[:, None, None]
    a, b, c = (S_inverse[:, i, j].astype(np.float32)[light] for i, j in ((0, 0), (0, 1), (1, 1)))
    longest = float(np.abs(way).max(initial=0.0))
    nodes, weights = _quadrature(1 if longest < _STILL else 2 + int(longest / (2.0 * sigma)))
    share = np.zeros(len(offset), np.float32)
    for node, weight in zip(nodes, weights, strict=True):
        u, v = (offset - (0.5 * node * way).astype(np.float32)[light]).T
        radius = np.sqrt(u * u + v * v)
        relative = np.sqrt(a * u * u + 2.0 * b * u * v + c * v * v) + np.float32(1e-6)
        share += np.float32(0.5 * weight) * ndtr((radius / relative - radius) / np.float32(sigma))
    return share


@cache
def _quadrature(count: int) -> tuple[list[float], list[float]]:
    """Nodes in [-1, 1] and weights of Gauss and Legendre; so close that the blur fills what is between them."""
    nodes, weights = np.polynomial.legendre.leggauss(min(count, _MOST_NODES))
    return nodes.tolist(), weights.tolist()


def _check(config: ImageConfig, threshold: float) -> None:
    for name in ("exposure", "brightness", "blur_sigma"):
        if not 0.0 < getattr(config, name) < np.inf:
            raise ValueError(f"images: {name} must be positive, got {getattr(config, name)}")
    for name in ("background", "noise_sigma", "reflections", "margin"):
        if not 0.0 <= getattr(config, name) < np.inf:
            raise ValueError(f"images: {name} must not be negative, got {getattr(config, name)}")
    dark = config.background + CLEAR_OF_NOISE * config.noise_sigma
    if not dark < threshold < 1.0:
        raise ValueError(
            f"images: the threshold must be between {dark:g}, six sigma above the background, and 1, "
            f"got {threshold}"
        )
    if not config.background + config.brightness * config.exposure > threshold:
        raise ValueError(
            f"images: markers of brightness {config.brightness:g} 1/s stay below the threshold {threshold} "
            f"in {config.exposure:g} s"
        )
