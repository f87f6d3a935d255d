"""What the self-calibrating law learns from encoders and camera, apart from what it commands."""

from types import SimpleNamespace

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.controller_model import ControllerModel
from systems.estimation import kernels
from systems.estimation.drives.dead_time import CommandDelay
from systems.estimation.drives.drive_model import COLUMNS, LATE, DriveCommand, DriveModel
from systems.estimation.drives.encoder_steps import EncoderSteps
from systems.estimation.drives.gain_search import TORQUES
from systems.estimation.drives.motor_feedback import MotorFeedback
from systems.estimation.events import (
    DEAD_TIME_CHANGED,
    GAINS_UNLIKE_BELIEF,
    IMPLAUSIBLE,
    LOAD_CHANGED,
    LOAD_UNLIKE_BELIEF,
    PROBE_REPEATED,
    Event,
    EventLog,
)
from systems.estimation.gear_errors import NUM_MODELS, NUM_STATES
from systems.estimation.kernels.arrays import Ring
from systems.estimation.memory import History, Layout
from systems.estimation.probing.probe import Probe
from systems.estimation.tip_estimator import TipEstimator
from systems.estimation.tip_model import Pair, TipModel
from systems.samples import JointSample, PoseSample
from systems.servo.self_calibrating_config import SelfCalibratingConfig

_REACH = 0.1  # s, how far back plans and encoders are remembered, beyond the delays
_FIRST_LEARNT = 0.4  # s after the start: before that the robot is led onto its plan
_UPSET = 3e-4  # rad, a following error that no drive makes on its own: load or dead time have changed
_UPSET_PAUSE = 0.3  # s without learning after it, so that the drives come to rest
_LONGEST_PAUSE = 0.6  # s, after which what is left has to be learnt
_CALM_AGAIN = 1.0  # s after an upset before there can be another one
_LOOKED_AT, _LEAST_CHANGE = 250, 0.3  # samples since an upset, until a mass (kg) is compared with that before
_MOST_GAINS = 2  # times that the probe begins anew because drives have other gains
_SETTLING = 0.2  # s that the drives take to come to rest after a dead time was corrected
_ASTRAY = 3e-3  # rad, by which motors may miss their plan before its loads are not those of the robot
UNREST = 0.5  # m/s^2, while the robot is led onto its plan, or the plan is not where motors are
_DIFFERENCE = 8e-3  # s, between positions from which it is known how motors moved
_LOOK_EVERY = 5  # ticks, between two searches for the dead time
_GIVE_UP = 1.6  # s after the start: what is believed of the dead time has to do

# A row of the plan: motors, loads, links, tip, unrest, columns and correction of the drive model, torques of
# its search for gains, by how much the command is ahead of the plan, states of the gears and what their
# models differ by.
PLAN = Layout(
    theta=(6,),
    velocity=(6,),
    acceleration=(6,),
    loads=(5, 18),
    motion=(12,),
    twist=(6,),
    unrest=(1,),
    columns=(COLUMNS,),
    beside=(6,),
    torques=(len(TORQUES), 6),
    ahead=(6,),
    states=(NUM_STATES,),
    others=(NUM_MODELS, NUM_JOINTS),
)


class Learning:
    """Holds encoders and camera against the plan, in a part of the law's memory.

    A tick takes note of what it hears, with `hear`, and plans with what was known before: its command does
    not wait. `learn` does the rest, after the reply of the message or at the beginning of the next tick.
    """

    def __init__(self, model: ControllerModel, config: SelfCalibratingConfig) -> None:
        """Builds the parts. Raises what they raise."""
        self._model, self._period = model, model.period
        self._half = max(1, round(_DIFFERENCE / model.period))
        self.tip_model = TipModel(model, config.estimator.spread)
        self.estimator = TipEstimator(self.tip_model, config.estimator)
        of_drives = config.drives, config.drive, self.tip_model.has_gear_errors
        self.drives = DriveModel(model, *of_drives)
        self.feedback = MotorFeedback(*of_drives, self.drives.moved_by_friction, model.period)
        self.delay = CommandDelay(model.period, config.dead_time)
        self.events, self.steps = EventLog(), EncoderSteps()
        reach = _REACH + max(model.command_delay, config.dead_time.longest) + model.camera_delay
        length = int(np.ceil(reach / model.period))
        self.plan, self.encoders = History(PLAN.size, length), History(2 * NUM_JOINTS, length)
        # Gears yield later than they are loaded, by what their damping holds back.
        self._load_lag = float(np.median(self.tip_model.lag[:6]))
        search = {"search": self.drives.search.layout, "looks": (1,), "taken": (1,)}  # and gains taken
        self.arrays = {
            "estimator": self.estimator.layout,
            "drives": self.drives.layout,
            "feedback": self.feedback.layout,
            "gains": Layout(**search) if self.drives.finds_gains else Layout(),
            "repeats": Layout(count=(1,), looks=(1,), sigma=(1,)),  # of the probe, see `Pace.look`
            "shown_at": (1,),  # the planned instant at which a probe that does not wait has shown gains
            "learn_from": (1,),  # s, the planned instant from which on motors show what their drives are
            "plan": self.plan.layout,
            "encoders": self.encoders.layout,
            "steps": self.steps.layout,  # of the encoders
            "delay": self.delay.layout,
            "events": self.events.layout,
            "heard": Layout(  # at the last tick
                is_new=(1,),  # whether nothing has been learnt of it yet
                time=(1,),
                joints=(1,),  # when they were there, s
                has_pose=(1,),
                newest=(1,),  # exposure of the newest pose, s
                X_WE=(4, 4),
                accepted=(1,),  # when the last pose came that was learnt from, s
                path_start=(1,),
            ),
            "pair": Layout(theta=(6,), then=PLAN, now=PLAN, X_WE=(4, 4)),  # room for that of an exposure
            "passed": PLAN,  # room for the plan of an instant that has passed
            "first": (1,),  # the first planned instant
            "off": (2 * self._half + 1, 6),  # rad, by which motors were behind the plan at the last instants
            "compared": (1,),  # how many planned instants encoders have been compared at
            "upset_at": (1,),
            "load": Layout(mass=(1,), time=(1,), samples=(1,)),  # kg and s at an upset, and how many since
            "paused_until": (1,),
            "implausible": (1,),  # the most parameters that were beyond all bounds so far
        }

    def start(self, memory: SimpleNamespace) -> None:
        """Writes what is known before the first sample."""
        self.estimator.start(memory.estimator)
        self.drives.start(memory.drives)
        self.steps.start(memory.steps)
        memory.off[:] = np.nan
        memory.upset_at[0] = memory.paused_until[0] = memory.learn_from[0] = -np.inf
        memory.heard.newest[0] = memory.heard.accepted[0] = memory.heard.joints[0] = -np.inf
        self.delay.start(memory.delay, self._model.command_delay)

    def hear(
        self,
        memory: SimpleNamespace,
        time: float,
        samples: tuple[JointSample, PoseSample],
        path_start: float,
    ) -> None:
        """Takes note of samples, from which there is to learn once the command of this tick is out.

        Args:
            memory: of the law.
            time: of the tick in s.
            samples: of joints and camera.
            path_start: when the path begins, s.
        """
        joints, sample = samples
        row = np.concatenate((joints.position, joints.velocity))
        self.encoders.append(memory.encoders, joints.time, row)
        self.steps.hear(memory.steps, joints.position)
        self.delay.search.measure(memory.delay.search, joints.time, joints.position)
        heard = memory.heard
        heard.time[0], heard.is_new[0], heard.path_start[0] = time, 1.0, path_start
        heard.joints[0] = joints.time
        heard.has_pose[0] = sample.valid and sample.time > heard.newest[0]
        if heard.has_pose[0]:
            heard.newest[0], heard.X_WE[:] = sample.time, sample.X_WE.GetAsMatrix4()

    def learn(self, memory: SimpleNamespace) -> None:
        """Learns from what was heard last; once."""
        heard = memory.heard
        if not heard.is_new[0]:
            return
        heard.is_new[0] = 0.0
        time = float(heard.time[0])
        self._watch_delay(memory, time)
        self._compare_drives(memory)
        if heard.has_pose[0]:
            pair = self.pair(memory, float(heard.newest[0]), heard.X_WE)
            if pair is not None:
                event = self.estimator.add(memory.estimator, pair)
                if event is not None:
                    self.events.note(memory.events, time, event)
                    if event.kind == LOAD_UNLIKE_BELIEF:
                        is_on_path = time > heard.path_start[0]
                        self.drives.widen(memory.drives, is_told_otherwise=True, is_on_path=is_on_path)
                self._note_load(memory)
                heard.accepted[0] = time
        self.estimator.work(memory.estimator)

    def pair(self, memory: SimpleNamespace, stamp: float, X_WE: np.ndarray) -> Pair | None:
        """The encoders and the plan at the instant of an exposure; None if they are not known, or astray.

        The pair is made of windows of the memory, in which the next one takes its place.

        Args:
            memory: of the law.
            stamp: of the exposure in s, as the camera has it.
            X_WE: the pose seen, (4, 4).
        """
        encoders, plan, at = memory.encoders, memory.plan, memory.pair
        count = int(encoders.count[0])
        if not count or not plan.count[0]:
            return None
        newest = float(encoders.times[(count - 1) % self.encoders.length])
        exposure = min(stamp + self.estimator.clock_offset(memory.estimator, stamp), newest)
        then, now = at.then, at.now
        rings = Ring(encoders.count, encoders.times, encoders.rows), Ring(plan.count, plan.times, plan.rows)
        # As it would have been seen had the clock been right: the column stands for all of the offset.
        at.X_WE[:] = X_WE
        rows, ahead = (at.theta, then.all, now.all), exposure - stamp
        off = kernels.instants.read(*rings, exposure, self._load_lag, *rows, now.twist, ahead, at.X_WE)
        if memory.delay.known[0] and off > _ASTRAY:
            return None
        is_settling = exposure < memory.delay.settled[0] + _SETTLING or exposure < memory.paused_until[0]
        unrest = UNREST if is_settling else float(now.unrest[0])
        gears = then.states, then.others
        return Pair(at.theta, then.loads, then.motion, now.twist, at.X_WE, unrest, *gears, stamp)

    def encoders_at(self, memory: SimpleNamespace, time: float) -> np.ndarray | None:
        """Positions between two samples, a cubic through positions and velocities, rad, (6,)."""
        encoders = memory.encoders
        count = int(encoders.count[0])
        if not count:
            return None
        position = np.empty(NUM_JOINTS)
        kernels.history.cubic_at(count, encoders.times, encoders.rows, time, position)
        return position

    def _watch_delay(self, memory: SimpleNamespace, time: float) -> None:
        """Searches for the dead time until it is known, and again while the motors do what no drive does."""
        since_start = time - memory.start_time[0]
        if not memory.planner.started[0]:
            return
        is_upset = time < memory.paused_until[0]
        if memory.delay.known[0] and not is_upset:
            return
        if round(time / self._period) % _LOOK_EVERY == 0:
            was_known = bool(memory.delay.known[0])
            change = self.delay.look(memory.delay)
            if was_known and change:
                self.events.note(memory.events, time, Event(DEAD_TIME_CHANGED, change, 0.0))
                memory.upset_at[0], memory.load.samples[0] = time, 0.0  # it was not the load
        if since_start > _GIVE_UP:
            memory.delay.known[0] = 1.0

    def _compare_drives(self, memory: SimpleNamespace) -> None:
        """Learns from where the motors were at planned instants that have passed."""
        plan, count, off = memory.plan, int(memory.plan.count[0]), memory.off
        newest = memory.encoders.times[(int(memory.encoders.count[0]) - 1) % self.encoders.length]
        for k in range(max(int(memory.compared[0]), count - self.plan.length + self._half), count):
            instant = plan.times[k % self.plan.length]
            if instant > newest + 1e-9:
                break
            memory.compared[0] = k + 1
            actual = self.encoders_at(memory, instant)
            off[:-1], off[-1] = off[1:], np.nan
            if actual is not None:
                off[-1] = plan.rows[k % self.plan.length, :NUM_JOINTS] - actual
            if k >= self._half:  # how motors moved at an instant is known when the next ones have passed
                then = (k - self._half) % self.plan.length
                memory.passed.all[:] = plan.rows[then]
                self._learn_instant(memory, plan.times[then], off[self._half])

    def _learn_instant(self, memory: SimpleNamespace, instant: float, off: np.ndarray) -> None:
        """Learns from the instant that has just passed, at which motors were so far behind, rad, (6,)."""
        needed = self._deviate(memory)
        if self._asks_for_gains(memory):
            self.drives.search.follow(memory.gains.search, memory.passed.torques + needed)
        if not self.is_on_plan(memory, instant) or np.isnan(off[0]):
            memory.drives.deviation.all[:] = 0.0  # that motors were elsewhere then was no friction's doing
            return
        actual = memory.passed.theta - off
        if self._asks_for_gains(memory):
            self._look_for_gains(memory, instant, actual)
        if instant > memory.learn_from[0]:
            self._learn_drives(memory, instant, actual)

    def is_on_plan(self, memory: SimpleNamespace, instant: float) -> bool:
        """Whether motors are on their plan at an instant but for what drives leave."""
        has_begun = instant >= memory.first[0] + _FIRST_LEARNT
        return bool(has_begun) and self.delay.is_settled(memory.delay, instant)

    def feed_back(self, memory: SimpleNamespace, command: DriveCommand, instant: float) -> DriveCommand:
        """A command for an instant with what encoders say of motors now."""
        off = memory.off[-1] if self.is_on_plan(memory, instant) else np.zeros(NUM_JOINTS)
        of_motors = off, self.steps.sigma(memory.steps), float(memory.delay.delay[0])
        return self.feedback.add(memory.feedback, command, *of_motors)

    def _deviate(self, memory: SimpleNamespace) -> np.ndarray:
        """What motors needed beyond their plan, as they moved otherwise, `DriveModel.deviate`."""
        before, off, behind = memory.off[[0, self._half, -1]]
        span = self._half * self._period
        dv = np.nan_to_num((before - behind) / (2.0 * span))
        da = np.nan_to_num((2.0 * off - before - behind) / span**2)
        return self.drives.deviate(memory.drives, memory.passed.velocity, dv, da)

    def _look_for_gains(self, memory: SimpleNamespace, instant: float, actual: np.ndarray) -> None:
        """Holds the instant that has just passed against drives with other gains; after a probe, decides."""
        row, gains, search = memory.passed, memory.gains, self.drives.search
        smoothed, rate = row.columns.reshape(-1, NUM_JOINTS)[LATE]
        search.add(gains.search, np.array([row.velocity + rate, smoothed]), row.theta + row.ahead - actual)
        if instant < memory.shown_at[0] + memory.waited[0]:
            return
        gains.looks[0] += 1.0
        found = search.find(gains.search, *memory.drives.gains.factors)
        if found and gains.looks[0] <= _MOST_GAINS:
            self.drives.prepare_gains(memory.drives, found)

    def begin(self, memory: SimpleNamespace, shown: float) -> None:
        """The robot begins to move; in ``shown`` s most of the probe will be over, if there is one."""
        memory.shown_at[0], memory.drives.coming.factors[:] = memory.first[0] + shown, 0.0
        memory.feedback.beside[:] = 0.0
        if not memory.amplitude.any():
            memory.delay.known[0], memory.shown_at[0] = 1.0, np.inf  # nothing will show them

    def wait(self, memory: SimpleNamespace, instant: float, probe: Probe, path_start: float) -> float:
        """Lets the probe wait for the dead time, and begin anew where drives have other gains.

        Args:
            memory: of the law.
            instant: that is planned, s.
            probe: of the law.
            path_start: s.

        Returns:
            How long it has waited, s.
        """
        since, until = instant - float(memory.first[0]), path_start - float(memory.first[0])
        if not self.delay.is_settled(memory.delay, instant):
            memory.waited[0] = probe.waited(since, float(memory.waited[0]))
        elif probe.is_over(since - memory.waited[0], until):
            self._repeat_probe(memory, instant, probe.window(until)[1])
        return float(memory.waited[0])

    def _repeat_probe(self, memory: SimpleNamespace, instant: float, length: float) -> None:
        """Begins the probe anew, which takes so many s, if it has shown other gains or not enough."""
        time, sigma = float(memory.heard.time[0]), float(memory.repeats.sigma[0])
        has_gains = memory.drives.coming.factors.any()
        if has_gains:
            size = self.drives.take_gains(memory.drives)
            self.events.note(memory.events, time, Event(GAINS_UNLIKE_BELIEF, size, 0.0))
            memory.gains.search.all[:], memory.gains.taken[0] = 0.0, memory.gains.looks[0]
            memory.learn_from[0] = instant
        elif sigma:
            self.events.note(memory.events, time, Event(PROBE_REPEATED, sigma, sigma))
        if has_gains or sigma:
            memory.waited[0] += length
            memory.repeats.count[0] += 1.0
            memory.repeats.sigma[0] = 0.0

    def _asks_for_gains(self, memory: SimpleNamespace) -> bool:
        return self.drives.finds_gains and memory.gains.looks[0] == memory.gains.taken[0]

    def _open_load(self, memory: SimpleNamespace) -> None:
        """Motors that do what no drive does may carry another load; the camera will say which."""
        load = memory.load
        if not load.samples[0]:  # else it is the same change still
            load.mass[0], load.time[0] = self._mass(memory), memory.upset_at[0]
        load.samples[0] = 1.0
        self.estimator.open_load(memory.estimator)

    def _note_load(self, memory: SimpleNamespace) -> None:
        """Says by how much the load has changed, once enough has been seen since the motors were upset."""
        load = memory.load
        load.samples[0] += load.samples[0] > 0.0
        if load.samples[0] <= _LOOKED_AT:
            return
        load.samples[0] = 0.0
        change = self._mass(memory) - float(load.mass[0])
        if abs(change) > _LEAST_CHANGE * self._model.load_scale:
            self.events.note(memory.events, float(load.time[0]), Event(LOAD_CHANGED, change, 0.0))

    def note_implausible(self, memory: SimpleNamespace, time: float, number: int) -> None:
        """Says that so many parameters have come beyond all bounds, if there were never more."""
        if number > memory.implausible[0]:
            self.events.note(memory.events, time, Event(IMPLAUSIBLE, float(number), 0.0))
            memory.implausible[0] = number

    def _mass(self, memory: SimpleNamespace) -> float:
        return float(self.estimator.x(memory.estimator)[self.tip_model.M][0])

    def _learn_drives(self, memory: SimpleNamespace, instant: float, actual: np.ndarray) -> None:
        """Learns from the instant that has just passed."""
        drives, row = memory.drives, memory.passed
        motion = row.theta, row.velocity, row.acceleration
        planned_then = motion, row.columns, row.beside
        is_watched, is_paused = instant > memory.heard.path_start[0], np.isfinite(memory.paused_until[0])
        most = -1.0 if is_paused else _UPSET if is_watched else np.inf
        left = self.drives.look_back(drives, *planned_then, actual, most)
        if left <= most:
            return
        if left > _UPSET and is_watched:
            if instant > memory.upset_at[0] + _CALM_AGAIN:
                memory.upset_at[0] = instant
                self._open_load(memory)
            until = min(instant + _UPSET_PAUSE, memory.upset_at[0] + _LONGEST_PAUSE)
            if until > instant:  # or what is believed would be opened again at every instant
                memory.paused_until[0] = until
        if instant <= memory.paused_until[0]:
            return
        if np.isfinite(memory.paused_until[0]):
            memory.paused_until[0] = -np.inf
            self.drives.widen(drives)
        self.drives.look_back(drives, *planned_then, actual)
