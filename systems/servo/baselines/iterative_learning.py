"""A law that knows little of the robot: it repeats a path and corrects laps by the errors of the last."""

import numpy as np

from robots.pose import pose_error
from systems.controller_model import ControllerModel
from systems.guard.guard import GuardConfig
from systems.reference.paths import CartesianPath
from systems.servo.law import LawInput, LawOutput, ServoLaw, integrate_twist
from systems.servo.law_config import LawConfig

_JOINTS = slice(0, 18)  # of the last tick
_COUNT = 18  # ticks since the first one
_CORRECTION = slice(19, 25)  # rad and m, rotation first
_HEAD = 25
_LONGEST_LAP = 20.0  # s
_LEARNING = 0.8  # share of the last lap's error that is corrected
_SMOOTHING = 0.012  # s, standard deviation of the window over an error
_REACH = 3.0  # such deviations on both sides


class IterativeLearning(ServoLaw):
    """Commands the path displaced by u; u of lap k + 1 is u + 0.8 e of lap k, smoothed along the lap.

    The smoothing is without lag, because the last lap is known on both sides of an instant. Before the path
    and after it the error at rest is integrated with the gains; the first lap goes with what that has found.
    Path time is that at which a command is believed to act.

    The memory holds the joints of the last tick, the number of ticks, the correction in force, and, of every
    tick of a lap, the correction that was commanded and the one that has been learnt.
    """

    title = "Iterative learning"
    colour = "#9d174d"
    awaits_joints = False

    def __init__(self, model: ControllerModel, config: LawConfig, guard: GuardConfig) -> None:
        """Checks the configuration. Raises ValueError as `ServoLaw`."""
        self._longest = round(_LONGEST_LAP / model.period)
        self.memory_size = _HEAD + 12 * self._longest
        super().__init__(model, config, guard)
        self._ahead, self._ago = model.command_delay, model.camera_delay
        reach = max(1, round(_REACH * _SMOOTHING / model.period))
        self._offsets = np.arange(-reach, reach + 1)
        window = np.exp(-0.5 * (self._offsets * model.period / _SMOOTHING) ** 2)
        self._window = window / window.sum()
        self._start, self._lap, self._laps = 0.0, 1, 1

    def check_path(self, path: CartesianPath) -> None:
        """Takes over where laps are.

        Raises:
            ValueError: if a lap takes longer than the law can remember.
        """
        length = (path.dwell_start - path.path_start) / len(path.lap_starts)
        if length > _LONGEST_LAP:
            raise ValueError(f"iterative learning: a lap may take {_LONGEST_LAP:g} s, got {length:.4g} s")
        self._start, self._laps = path.path_start, len(path.lap_starts)
        self._lap = round(length / self.period)

    def initial_state(self, moment: LawInput) -> np.ndarray:
        """At the measured positions, at rest, nothing learnt."""
        return np.concatenate([moment.position, np.zeros(self.memory_size - 6)])

    def step(self, moment: LawInput, memory: np.ndarray) -> LawOutput:
        """The joints for the displaced pose."""
        commanded, learnt = memory[_HEAD:].reshape(2, self._longest, 6)[:, : self._lap]
        time = memory[_COUNT] * self.period
        correction = memory[_CORRECTION].copy()
        now, exposed = self._tick_of_path(time + self._ahead), self._tick_of_path(time - self._ago)
        last = self._lap * self._laps
        error = None if moment.measured is None else pose_error(*moment.measured)
        if error is not None and 0 <= exposed < last:
            place = exposed % self._lap
            learnt[place] = commanded[place] + _LEARNING * error
        rate = np.zeros(6)
        if 0 <= now < last:
            wanted = correction
            if now >= self._lap:
                places = (now + self._offsets) % self._lap
                wanted = self._window @ learnt[places]
            rate = (wanted - correction) / self.period
            commanded[now % self._lap] = wanted
        elif error is not None and (now < 0 or exposed >= last):
            rate = self.within_limits(self.gains * error, correction)
        correction = correction + self.period * rate
        X = integrate_twist(moment.X_WD, correction)
        joints = self.joints_at(X, moment.V_WD + rate, memory[_JOINTS])
        memory[_JOINTS], memory[_COUNT], memory[_CORRECTION] = joints, memory[_COUNT] + 1.0, correction
        return LawOutput(joints[:6], joints[6:12], correction, memory)

    def _tick_of_path(self, time: float) -> int:
        return round((time - self._start) / self.period)
