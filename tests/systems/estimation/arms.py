"""A robot of which everything is wrong, what camera and encoders say of it, and who hears that."""

import numpy as np

from robots.description.model import load_robot
from robots.pose import pose_error
from systems.controller_model import ControllerModel
from systems.estimation.tip_estimator import TipEstimator
from systems.estimation.tip_estimator_config import TipEstimatorConfig
from systems.estimation.tip_model import Pair, Spread, TipModel, moved

PERIOD = 1e-2  # s, between two pairs
CAMERA = np.repeat([1.75e-4, 5e-5], 3)  # rad and m, standard deviations of one sample


def tip_model(payload: float = 7.0, **changes) -> TipModel:
    model = ControllerModel(load_robot("irb1200"), payload, PERIOD, elasticity="structure")
    return TipModel(model, Spread(**changes))


def true_unknowns(model: TipModel, seed: int, share: float = 0.5) -> np.ndarray:
    """Unknowns that are off by up to a share of their spreads."""
    rng = np.random.default_rng(seed)
    return model.mean + share * model.sigma * rng.uniform(-1.0, 1.0, model.size)


class MovingArm:
    """Joints on sine waves, seen at a multiple of the period."""

    def __init__(self, model: TipModel, x: np.ndarray, seed: int = 0) -> None:
        self.model, self.x = model, x
        self._constants = model.constants(x)
        rng = np.random.default_rng(seed)
        self._noise = np.random.default_rng(seed + 1)
        self._centre = np.array([0.5, 0.2, -0.1, 0.3, 0.8, 0.2])
        self._speed, self._phase = rng.uniform(0.6, 2.5, 6), rng.uniform(0.0, 6.0, 6)

    def joints(self, time: float, size: float) -> np.ndarray:
        """Positions, velocities and accelerations, (3, 6)."""
        u = self._speed * time + self._phase
        return np.array(
            [
                self._centre + size * np.sin(u),
                size * self._speed * np.cos(u),
                -size * self._speed**2 * np.sin(u),
            ]
        )

    def pair(self, time: float, size: float = 0.6, noise: float = 1.0) -> Pair:
        theta, v, a = self.joints(time, size)
        model, x, still = self.model, self.x, np.zeros((1, 6))
        arm = model.forward(self._constants, x, theta[None])[1]
        loads = model.loads.at(arm.frames, theta[None], v[None], a[None])
        twist = arm.columns[:, :, :6] @ v
        teeth = -np.sign(model.total_load(x, loads[0])[:6])
        states = np.concatenate((np.zeros(12), teeth))
        shapes = model.gear_shapes(theta, states)
        rest = (v[None], a[None]), twist, None if shapes is None else shapes[None]
        found = model.predict_anew(self._constants, x, (theta[None], still), *rest)
        for _ in range(3):  # until the loads are those of the arm that yields
            found = model.predict_anew(self._constants, x, (theta[None], found.gears), *rest)
        X_WE = moved(found.X_WE, (noise * CAMERA * self._noise.normal(size=6))[None])[0]
        return Pair(theta, loads[0], np.concatenate((v, a)), twist[0], X_WE, states=states)


class Session:
    """An estimator with its memory, fed by an arm."""

    def __init__(self, seed: int, **config) -> None:
        self.model = tip_model()
        self.arm = MovingArm(self.model, true_unknowns(self.model, seed), seed)
        self.estimator = TipEstimator(self.model, TipEstimatorConfig(**{"test_after": 100, **config}))
        self.memory = self.estimator.layout.view(np.zeros(self.estimator.layout.size))
        self.estimator.start(self.memory)
        self.time, self.events = 0.0, []

    def learn(self, duration: float, size: float = 0.6, change=None, noise: float = 1.0) -> None:
        for _ in range(round(duration / PERIOD)):
            self.time += PERIOD
            pair = self.arm.pair(self.time, size, noise)
            event = self.estimator.add(self.memory, change(pair) if change else pair)
            self.events += [event] if event else []
            self.estimator.work(self.memory)

    def error(self, seen: bool = False) -> float:
        """The largest error of the tip in m: at 40 new configurations, or at those of the last second."""
        errors = []
        times = np.linspace(self.time - 1.0, self.time, 20) if seen else np.linspace(20.0, 60.0, 40)
        for time in times:
            pair = self.arm.pair(time, noise=0.0)
            errors.append(pose_error(pair.X_WE, self.estimator.predict(self.memory, pair).X_WE[0])[3:])
        return float(np.linalg.norm(errors, axis=1).max())

    def squares(self, times: np.ndarray) -> np.ndarray:
        """The squares of the tip's errors in units of what they are said to be, (n,)."""
        found = []
        for time in times:
            pair = self.arm.pair(time, noise=0.0)
            error = pose_error(pair.X_WE, self.estimator.predict(self.memory, pair).X_WE[0])
            found.append(error @ np.linalg.solve(self.estimator.tip_covariance(self.memory, pair), error))
        return np.array(found)
