"""What the cameras record of the markers on the level of images: pixels in windows about the body.

A camera reads only the window in which the body is expected, as Probst (2024) section 8.1 plans. Each marker
is a lit ellipse in it (`systems.vision.rendering`); what hides the centre of a sphere hides all of it. The
noise is a stream that the numbers from outside are the key of: to bring tens of thousands of numbers for each
exposure through a port would cost more than everything else.
"""

from dataclasses import dataclass

import numpy as np

from robots.kinematics.arm_capsules import Capsules
from systems.vision.camera_model import Cameras
from systems.vision.depth_of_field import DepthOfField
from systems.vision.marker_body import DetectionBody
from systems.vision.rendering import Picture, Sensor, draw
from systems.vision.sphere_images import Ellipses, sphere_images
from systems.vision.tracking.pose_refinement import linearize, moved
from systems.vision.visibility import occluded

CLEAR_OF_NOISE = 6.0  # sigma; one dark pixel in a thousand million is further from the background

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
    f_number: float = 0.0  # of the aperture; 0: equally sharp at all distances
    focus_distance: float = 5.0  # m, at which the lenses are focused; assumed
    pixel_pitch_um: float = 5.5  # assumed


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
        expected, _ = linearize(self._cameras, self._body.p_E, X_WE)
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
        blur = self._blur(p_W)[camera, marker]
        lights = Ellipses(spheres.center[camera, marker], spheres.shape[camera, marker])
        if self._config.reflections > 0.0:
            count, lights = self._with_reflections(lights, windows, rng)
            camera = np.concatenate([camera, np.repeat(np.arange(len(windows)), count)])
            way = np.concatenate([way, np.zeros((count.sum(), 2))])
            blur = np.concatenate([blur, np.full(count.sum(), self._config.blur_sigma)])
        sensor = Sensor(
            self._config.brightness * self._config.exposure,
            self._config.background,
            self._config.noise_sigma,
            blur,
        )
        return draw(camera, lights, way, windows, sensor, rng)

    def _blur(self, p_W: np.ndarray) -> np.ndarray:
        """Standard deviations of the edges of the markers in px, (n, m): of the lens, and out of focus."""
        distance = self._cameras.depth(p_W)
        sharp = np.full(distance.shape, self._config.blur_sigma)
        if not self._config.f_number:
            return sharp
        pitch = 1e-6 * self._config.pixel_pitch_um
        apart = [
            DepthOfField(f * pitch, self._config.f_number, self._config.focus_distance, pitch)
            for f in self._cameras.focal.mean(1)
        ]
        return np.hypot(sharp, [lens.blur_sigma_px(d) for lens, d in zip(apart, distance, strict=True)])

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


def _check(config: ImageConfig, threshold: float) -> None:
    for name in ("exposure", "brightness", "blur_sigma", "focus_distance", "pixel_pitch_um"):
        if not 0.0 < getattr(config, name) < np.inf:
            raise ValueError(f"images: {name} must be positive, got {getattr(config, name)}")
    for name in ("background", "noise_sigma", "reflections", "margin", "f_number"):
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
