"""What the self-calibrating law learns of motors: how far off their plan they are, and why."""

import math
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.controller_model import ControllerModel
from systems.estimation import kernels
from systems.estimation.drives.dead_time import CommandDelay
from systems.estimation.drives.drive_model import LATE, REGRESSORS, DriveCommand, DriveModel
from systems.estimation.drives.encoder_steps import EncoderSteps
from systems.estimation.drives.gain_search import TORQUES
from systems.estimation.drives.motor_feedback import MotorFeedback
from systems.estimation.gears.gear_errors import NUM_MODELS, NUM_STATES
from systems.estimation.kernels.arrays import Ring
from systems.estimation.memory import History, Layout
from systems.samples import JointSample
from systems.servo.self_calibrating.config import SelfCalibratingConfig

_FIRST_LEARNT = 0.4  # s after the start: before that the robot is led onto its plan
_UPSET = 3e-4  # rad, a following error that no drive makes on its own: load or dead time have changed
_UPSET_PAUSE = 0.3  # s without learning after it, so that the drives come to rest
_LONGEST_PAUSE = 0.6  # s, after which what is left has to be learnt
_CALM_AGAIN = 1.0  # s after an upset before there can be another one
_MOST_GAINS = 2  # times that the probe begins anew because drives have other gains
_SHARE_OF_DELAY = 0.3  # of 1 / T with a delay T, by which motors are brought back to their plan at most
_DIFFERENCE = 8e-3  # s, between positions from which it is known how motors moved

# A row of the plan: motors, loads, links, tip, unrest, regressors and correction of the drive model, torques
# of its search for gains, by how much the command is ahead of the plan, states of the gears and what their
# models differ by.
PLAN = Layout(
    theta=(6,),
    velocity=(6,),
    acceleration=(6,),
    loads=(5, 18),
    motion=(12,),
    twist=(6,),
    unrest=(1,),
    regressors=REGRESSORS,
    beside=(6,),
    torques=(len(TORQUES), 6),
    ahead=(6,),
    states=(NUM_STATES,),
    others=(NUM_MODELS, NUM_JOINTS),
)


class MotorLearning:
    """Holds encoders against the plan, in a part of the law's memory."""

    def __init__(
        self,
        model: ControllerModel,
        config: SelfCalibratingConfig,
        has_play: bool,
        delay: CommandDelay,
        length: int,
        on_upset: Callable[[SimpleNamespace], None],
    ) -> None:
        """Builds the parts. Raises what they raise.

        Args:
            model: what is believed.
            config: of the law.
            has_play: whether gears may have gaps.
            delay: the dead time as it is known.
            length: how many instants are remembered.
            on_upset: is given the law's memory when motors do what no drive does on its own.
        """
        self._period, self._delay, self._on_upset = model.period, delay, on_upset
        self._held_to_plan = config.drives.held_to_plan
        self._half = max(1, round(_DIFFERENCE / model.period))
        of_drives = config.drives, config.drive
        self.drives = DriveModel(model, *of_drives, has_play)
        self.feedback = MotorFeedback(*of_drives, self.drives.is_fed_back, model.period)
        self.plan, self.encoders = History(PLAN.size, length), History(2 * NUM_JOINTS, length)
        self.steps = EncoderSteps()
        search = {"search": self.drives.search.layout, "looks": (1,), "taken": (1,)}  # and gains taken
        self.arrays = {
            "drives": self.drives.layout,
            "feedback": self.feedback.layout,
            "gains": Layout(**search) if self.drives.finds_gains else Layout(),
            "shown_at": (1,),  # the planned instant at which a probe that does not wait has shown gains
            "learn_from": (1,),  # s, the planned instant from which on motors show what their drives are
            "plan": self.plan.layout,
            "encoders": self.encoders.layout,
            "steps": self.steps.layout,  # of the encoders
            "passed": PLAN,  # room for the plan of an instant that has passed
            "first": (1,),  # the first planned instant
            "off": (2 * self._half + 1, 6),  # rad, by which motors were behind the plan at the last instants
            "compared": (1,),  # how many planned instants encoders have been compared at
            "upset_at": (1,),
            "paused_until": (1,),
        }

    def start(self, memory: SimpleNamespace) -> None:
        """Writes what is known before the first sample."""
        self.drives.start(memory.drives)
        self.steps.start(memory.steps)
        memory.off[:] = np.nan
        memory.upset_at[0] = memory.paused_until[0] = memory.learn_from[0] = -np.inf

    def rehearse(self, memory: SimpleNamespace, position: np.ndarray) -> None:
        """Runs what ticks run, on scratch memory, with joints at some position in rad, (6,)."""
        self.steps.hear(memory.steps, position)
        for time in (0.0, 1.0):
            self.encoders.append(memory.encoders, time, np.concatenate((position, np.zeros(NUM_JOINTS))))
            self.plan.append(memory.plan, time, memory.passed.all)
        self._hold_against(memory, memory.passed.all, 0.5)
        self._differ(memory)

    def _hold_against(self, memory: SimpleNamespace, planned: np.ndarray, instant: float) -> None:
        """Adds by how much motors were behind a plan at an instant."""
        encoders = memory.encoders
        ring = Ring(encoders.count, encoders.times, encoders.rows)
        kernels.history.compare(ring, planned, instant, memory.off)

    def _differ(self, memory: SimpleNamespace) -> None:
        """Works out how motors moved otherwise than planned at the instant that has just passed."""
        parts, span = memory.drives.deviation, self._half * self._period
        kernels.history.otherwise(memory.off, self._half, span, parts.faster, parts.accelerated)

    def compare(self, memory: SimpleNamespace) -> None:
        """Learns from where the motors were at planned instants that have passed."""
        plan, count, off = memory.plan, int(memory.plan.count[0]), memory.off
        encoders = memory.encoders
        newest = encoders.times[(int(encoders.count[0]) - 1) % self.encoders.length]
        for k in range(max(int(memory.compared[0]), count - self.plan.length + self._half), count):
            instant = plan.times[k % self.plan.length]
            if instant > newest + 1e-9:
                break
            memory.compared[0] = k + 1
            self._hold_against(memory, plan.rows[k % self.plan.length], instant)
            if k >= self._half:  # how motors moved at an instant is known when the next ones have passed
                then = (k - self._half) % self.plan.length
                memory.passed.all[:] = plan.rows[then]
                self._learn_instant(memory, plan.times[then], off[self._half])

    def _learn_instant(self, memory: SimpleNamespace, instant: float, off: np.ndarray) -> None:
        """Learns from the instant that has just passed, at which motors were so far behind, rad, (6,)."""
        asks_for_gains = self._asks_for_gains(memory)
        self._differ(memory)
        self.drives.deviate(memory.drives, memory.passed.velocity)
        if asks_for_gains:
            needed = memory.passed.torques + self.drives.needed_beyond(memory.drives)
            self.drives.search.follow(memory.gains.search, needed)
        if not self.is_on_plan(memory, instant) or np.isnan(off[0]):
            memory.drives.deviation.all[:] = 0.0  # that motors were elsewhere then was no friction's doing
            return
        actual = memory.passed.theta - off
        if asks_for_gains:
            self._look_for_gains(memory, instant, actual)
        if instant > memory.learn_from[0]:
            self._learn_drives(memory, instant, actual)

    def is_on_plan(self, memory: SimpleNamespace, instant: float) -> bool:
        """Whether motors are on their plan at an instant but for what drives leave."""
        has_begun = instant >= memory.first[0] + _FIRST_LEARNT
        return bool(has_begun) and self._delay.is_settled(memory.delay, instant)

    def feed_back(self, memory: SimpleNamespace, command: DriveCommand, instant: float) -> DriveCommand:
        """A command for an instant with what encoders say of motors now."""
        off = memory.off[-1] if self.is_on_plan(memory, instant) else np.zeros(NUM_JOINTS)
        of_motors = off, self.steps.sigma(memory.steps), self.drives.shares_fed_back(memory.drives)
        return self.feedback.add(memory.feedback, command, *of_motors, float(memory.delay.delay[0]))

    def to_plan(self, memory: SimpleNamespace, joints: JointSample) -> np.ndarray:
        """What brings motors back to their plan that follow speeds alone, rad/s, (6,): nothing else does."""
        if not memory.first[0] <= joints.time:
            return np.zeros(NUM_JOINTS)
        planned = self.plan.at(memory.plan, joints.time)
        if planned is None:
            return np.zeros(NUM_JOINTS)
        gain = min(self._held_to_plan, _SHARE_OF_DELAY / max(float(memory.delay.delay[0]), self._period))
        return np.nan_to_num(gain * (planned[:NUM_JOINTS] - joints.position))  # none where they are not known

    def _look_for_gains(self, memory: SimpleNamespace, instant: float, actual: np.ndarray) -> None:
        """Holds the instant that has just passed against drives with other gains; after a probe, decides."""
        row, gains, search = memory.passed, memory.gains, self.drives.search
        smoothed, rate = row.regressors[LATE]
        search.add(gains.search, np.array([row.velocity + rate, smoothed]), row.theta + row.ahead - actual)
        if instant < memory.shown_at[0] + memory.waited[0]:
            return
        gains.looks[0] += 1.0
        found = search.find(gains.search, *memory.drives.gains.factors)
        if found and gains.looks[0] <= _MOST_GAINS:
            self.drives.prepare_gains(memory.drives, found)

    def take_gains(self, memory: SimpleNamespace, instant: float) -> float:
        """Goes on with the gains that were found, and learns from an instant on; as `DriveModel`."""
        memory.gains.search.all[:], memory.gains.taken[0] = 0.0, memory.gains.looks[0]
        memory.learn_from[0] = instant
        return self.drives.take_gains(memory.drives)

    def _asks_for_gains(self, memory: SimpleNamespace) -> bool:
        if not (self.drives.finds_gains and math.isfinite(memory.shown_at[0])):  # or no probe shows them
            return False
        return bool(memory.gains.looks[0] == memory.gains.taken[0])

    def _learn_drives(self, memory: SimpleNamespace, instant: float, actual: np.ndarray) -> None:
        """Learns from the instant that has just passed."""
        drives, row = memory.drives, memory.passed
        motion = row.theta, row.velocity, row.acceleration
        planned_then = motion, row.regressors, row.beside
        is_watched, is_paused = instant > memory.heard.path_start[0], np.isfinite(memory.paused_until[0])
        most = -1.0 if is_paused else _UPSET if is_watched else np.inf
        left = self.drives.look_back(drives, *planned_then, actual, most)
        if left <= most:
            return
        if left > _UPSET and is_watched:
            if instant > memory.upset_at[0] + _CALM_AGAIN:
                memory.upset_at[0] = instant
                self._on_upset(memory)
            until = min(instant + _UPSET_PAUSE, memory.upset_at[0] + _LONGEST_PAUSE)
            if until > instant:  # or what is believed would be opened again at every instant
                memory.paused_until[0] = until
        if instant <= memory.paused_until[0]:
            return
        if np.isfinite(memory.paused_until[0]):
            memory.paused_until[0] = -np.inf
            self.drives.widen(drives)
        self.drives.look_back(drives, *planned_then, actual)
