"""A law that knows little of the robot: it repeats a path and corrects laps by the errors of the last."""

import math

import numpy as np

from robots.pose import pose_error
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.reference.paths import CartesianPath
from systems.servo.law import LawInput, LawOutput, ServoLaw, integrate_twist
from systems.servo.law_config import LawConfig

_JOINTS = slice(0, 18)  # of the last tick
_PLACE = 18  # of the last command among those of all laps, not a number before the path
_CORRECTION = slice(19, 25)  # rad and m, rotation first
_EXPOSED = 25  # place of the last exposure, not a number before there is one
_ERROR = slice(26, 32)  # that was seen then
_HEAD = 32
_LONGEST_LAP = 20.0  # s
_LEARNING = 0.8  # share of the last lap's error that is corrected
_SMOOTHING = 0.012  # s, standard deviation of the window over an error
_REACH = 3.0  # such deviations on both sides
_FARTHEST = 0.1  # s between two exposures, between which an error is known


class IterativeLearning(ServoLaw):
    """Commands the path displaced by u; u of lap k + 1 is u + 0.8 e of lap k, smoothed along the lap.

    The smoothing is without lag, because the last lap is known on both sides of an instant. Before the path
    and after it the error at rest is integrated with the gains; the first lap goes with what that has found.
    Errors and corrections have their places along the lap by the time on the path: when a pose was exposed,
    and when a command is believed to act. Places are about a tick apart, and a lap is a whole number of them.

    Between two exposures an error changes evenly.

    The memory holds the joints of the last tick, its place, the correction in force, the last exposure, and,
    of every place of a lap, the correction that was commanded and the one that has been learnt.
    """

    title = "Iterative learning"
    colour = "#9d174d"
    awaits_joints = False

    def __init__(self, model: ControllerModel, config: LawConfig, guard: GuardConfig) -> None:
        """Checks the configuration. Raises ValueError as `ServoLaw`."""
        self._longest = round(_LONGEST_LAP / model.period)
        self.memory_size = _HEAD + 12 * self._longest
        super().__init__(model, config, guard)
        reach = max(1, round(_REACH * _SMOOTHING / model.period))
        self._offsets = np.arange(-reach, reach + 1)
        self._start, self._lap, self._laps, self._width = 0.0, 1, 1, model.period

    def check_path(self, path: CartesianPath) -> None:
        """Takes over where laps are.

        Raises:
            ValueError: if a lap takes longer than the law can remember.
        """
        length = (path.dwell_start - path.path_start) / len(path.lap_starts)
        if length > _LONGEST_LAP:
            raise ValueError(f"iterative learning: a lap may take {_LONGEST_LAP:g} s, got {length:.4g} s")
        self._start, self._laps = path.path_start, len(path.lap_starts)
        self._lap = max(1, round(length / self.period))
        self._width = length / self._lap  # s, from place to place

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """At the measured positions, at rest, nothing learnt."""
        memory = np.concatenate([moment.position, np.zeros(self.memory_size - 6)])
        memory[[_PLACE, _EXPOSED]] = math.nan
        return memory

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """The joints for the displaced pose."""
        commanded, learnt = memory[_HEAD:].reshape(2, self._longest, 6)[:, : self._lap]
        correction, last = memory[_CORRECTION].copy(), self._lap * self._laps
        now, exposed = self._place(moment.acts_at), self._place(moment.exposed_at)
        error = None if moment.measured is None else pose_error(*moment.measured)
        if error is not None:
            self._learn(memory, exposed, error)
        rate, is_on_path = np.zeros(6), 0 <= _nearest(now) < last
        if is_on_path:
            wanted = correction
            if _nearest(now) >= self._lap:
                wanted = self._smoothed(learnt, now)
            rate = (wanted - correction) / self.period
            # Seldom two places are passed in a tick.
            before = memory[_PLACE] if math.isfinite(memory[_PLACE]) else now - 1.0
            passed = np.arange(min(_nearest(before) + 1, _nearest(now)), _nearest(now) + 1)
            commanded[passed % self._lap] = wanted
            if error is not None and 0.0 < (now - exposed) * self._width < _FARTHEST:
                # Until the next exposure, or places behind a robot would seem to be without an error.
                since = np.arange(max(_nearest(exposed) + 1, 0), _nearest(now) + 1)
                learnt[since % self._lap] = commanded[since % self._lap] + _LEARNING * error
        elif error is not None and (_nearest(now) < 0 or _nearest(exposed) >= last):
            rate = self.within_limits(self.gains * error, correction)
        correction = correction + self.period * rate
        X = integrate_twist(moment.X_WD, correction)
        joints = self.joints_at(X, moment.V_WD + rate, memory[_JOINTS])
        memory[_JOINTS], memory[_CORRECTION] = joints, correction
        memory[_PLACE] = now if is_on_path else math.nan
        return LawOutput(joints[:6], joints[6:12], correction, memory)

    def _learn(self, memory: np.ndarray, exposed: float, error: np.ndarray) -> None:
        """Takes an error that was seen at a place, and what it was since the exposure before."""
        before = memory[_EXPOSED]
        if exposed == before:
            return
        commanded, learnt = memory[_HEAD:].reshape(2, self._longest, 6)[:, : self._lap]
        places, errors = np.array([_nearest(exposed)]), error[None]
        if 0.0 < (exposed - before) * self._width < _FARTHEST:
            places = np.arange(_nearest(before) + 1, _nearest(exposed) + 1)
            share = np.clip((places - before) / (exposed - before), 0.0, 1.0)[:, None]
            errors = memory[_ERROR] + share * (error - memory[_ERROR])
        of_path = (places >= 0) & (places < self._lap * self._laps)
        at = places[of_path] % self._lap
        learnt[at] = commanded[at] + _LEARNING * errors[of_path]
        memory[_EXPOSED], memory[_ERROR] = exposed, error

    def _place(self, path_time: float) -> float:
        """Where along all laps a time on the path in s is, in places."""
        return (path_time - self._start) / self._width

    def _smoothed(self, learnt: np.ndarray, place: float) -> np.ndarray:
        """What has been learnt about a place, between two of them too."""
        middle = _nearest(place)
        window = np.exp(-0.5 * ((self._offsets + middle - place) * self._width / _SMOOTHING) ** 2)
        return window / window.sum() @ learnt[(middle + self._offsets) % self._lap]


def _nearest(place: float) -> int:
    """The place next to one that may lie between two."""
    return math.floor(place + 0.5 + 1e-6)  # as rounded, a half does not go to and fro
