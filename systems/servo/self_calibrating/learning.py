"""What the self-calibrating law learns from encoders and camera, apart from what it commands."""

from types import SimpleNamespace

import numpy as np

from systems.controller_model import ControllerModel
from systems.estimation import kernels
from systems.estimation.drives.dead_time import CommandDelay
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
from systems.estimation.kernels.arrays import Ring
from systems.estimation.memory import Layout
from systems.estimation.probing.probe import Probe
from systems.estimation.tip_estimator import TipEstimator
from systems.estimation.tip_model import Pair, TipModel
from systems.samples import JointSample, PoseSample
from systems.servo.self_calibrating.config import SelfCalibratingConfig
from systems.servo.self_calibrating.motors import PLAN, MotorLearning

_REACH = 0.1  # s, how far back plans and encoders are remembered, beyond the delays
_LOOKED_AT, _LEAST_CHANGE = 250, 0.3  # samples since an upset, until a mass (kg) is compared with that before
_MOST_WAITING = 16  # poses that wait for encoders
_SETTLING = 0.2  # s that the drives take to come to rest after a dead time was corrected
_ASTRAY = 3e-3  # rad, by which motors may miss their plan before its loads are not those of the robot
UNREST = 0.5  # m/s^2, while the robot is led onto its plan, or the plan is not where motors are
_LOOK_EVERY = 5  # ticks, between two searches for the dead time
_GIVE_UP = 1.6  # s after the start: what is believed of the dead time has to do


class Learning:
    """Holds encoders and camera against the plan, in a part of the law's memory.

    A tick takes note of what it hears, with `hear`, and plans with what was known before: its command does
    not wait. `learn` does the rest, after the reply of the message or at the beginning of the next tick.
    """

    def __init__(self, model: ControllerModel, config: SelfCalibratingConfig) -> None:
        """Builds the parts. Raises what they raise."""
        self._model, self._period = model, model.period
        self.tip_model = TipModel(model, config.estimator.spread)
        self.estimator = TipEstimator(self.tip_model, config.estimator)
        self.delay, self.events = CommandDelay(model.period, config.dead_time), EventLog()
        reach = _REACH + max(model.command_delay, config.dead_time.longest) + model.camera_delay
        length = int(np.ceil(reach / model.period))
        has_play = self.tip_model.has_gear_errors
        self.motors = MotorLearning(model, config, has_play, self.delay, length, self._open_load)
        # Gears yield later than they are loaded, by what their damping holds back.
        self._load_lag = float(np.median(self.tip_model.lag[:6]))
        self.arrays = self.motors.arrays | {
            "estimator": self.estimator.layout,
            "repeats": Layout(count=(1,), looks=(1,), sigma=(1,)),  # of the probe, see `Pace.look`
            "delay": self.delay.layout,
            "events": self.events.layout,
            "heard": Layout(  # at the last tick
                is_new=(1,),  # whether nothing has been learnt of it yet
                time=(1,),
                joints=(1,),  # when they were there, s
                newest=(1,),  # exposure of the newest pose, s
                accepted=(1,),  # when the last pose came that was learnt from, s
                path_start=(1,),
            ),
            # Poses that are waiting for the encoders of their instant: how many, stamps in s, and poses
            "waiting": Layout(count=(1,), stamps=(_MOST_WAITING,), poses=(_MOST_WAITING, 4, 4)),
            "pair": Layout(theta=(6,), then=PLAN, now=PLAN, X_WE=(4, 4)),  # room for that of an exposure
            "load": Layout(mass=(1,), time=(1,), samples=(1,)),  # kg and s at an upset, and how many since
            "implausible": (1,),  # the most parameters that were beyond all bounds so far
        }

    def start(self, memory: SimpleNamespace) -> None:
        """Writes what is known before the first sample."""
        self.estimator.start(memory.estimator)
        self.motors.start(memory)
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
        self.motors.encoders.append(memory.encoders, joints.time, row)
        self.motors.steps.hear(memory.steps, joints.position)
        self.delay.search.measure(memory.delay.search, joints.time, joints.position)
        heard = memory.heard
        heard.time[0], heard.is_new[0], heard.path_start[0] = time, 1.0, path_start
        heard.joints[0] = joints.time
        if sample.valid and sample.time > heard.newest[0]:
            heard.newest[0], waiting = sample.time, memory.waiting
            place = min(int(waiting.count[0]), _MOST_WAITING - 1)
            waiting.stamps[place], waiting.poses[place] = sample.time, sample.X_WE.GetAsMatrix4()
            waiting.count[0] = place + 1.0

    def learn(self, memory: SimpleNamespace) -> None:
        """Learns from what was heard last; once."""
        heard = memory.heard
        if not heard.is_new[0]:
            return
        heard.is_new[0] = 0.0
        time = float(heard.time[0])
        self._watch_delay(memory, time)
        self.motors.compare(memory)
        waiting = memory.waiting
        if self._is_due(memory):
            stamp, X_WE = float(waiting.stamps[0]), waiting.poses[0].copy()
            waiting.count[0] -= 1.0
            waiting.stamps[:-1], waiting.poses[:-1] = waiting.stamps[1:].copy(), waiting.poses[1:].copy()
            pair = self.pair(memory, stamp, X_WE)
            if pair is not None:
                event = self.estimator.add(memory.estimator, pair)
                if event is not None:
                    self.events.note(memory.events, time, event)
                    if event.kind == LOAD_UNLIKE_BELIEF:
                        is_on_path = time > heard.path_start[0]
                        self.motors.drives.widen(memory.drives, is_told_otherwise=True, is_on_path=is_on_path)
                self._note_load(memory)
                heard.accepted[0] = time
        self.estimator.work(memory.estimator)

    def _is_due(self, memory: SimpleNamespace) -> bool:
        """Whether there is a pose whose encoders have come, or that has waited as long as there is room.

        Where the stamps of the joints are late against those of the camera, a pose comes before them.
        """
        waiting, encoders = memory.waiting, memory.encoders
        count, heard = int(waiting.count[0]), int(encoders.count[0])
        if not count or count == _MOST_WAITING or not heard:
            return count > 0
        stamp = float(waiting.stamps[0])
        newest = float(encoders.times[(heard - 1) % self.motors.encoders.length])
        return stamp + self.estimator.clock_offset(memory.estimator, stamp) <= newest + 0.5 * self._period

    def pair(self, memory: SimpleNamespace, stamp: float, X_WE: np.ndarray) -> Pair | None:
        """The encoders and the plan at the instant of an exposure; None if they are not known, or astray.

        A pose that comes later than anything is remembered is left alone: the oldest row is not that of then.

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
        newest = float(encoders.times[(count - 1) % self.motors.encoders.length])
        exposure = min(stamp + self.estimator.clock_offset(memory.estimator, stamp), newest)
        oldest = max(self.motors.encoders.since(encoders), self.motors.plan.since(plan) + self._load_lag)
        if exposure < oldest:
            return None
        then, now = at.then, at.now
        rings = Ring(encoders.count, encoders.times, encoders.rows), Ring(plan.count, plan.times, plan.rows)
        # As it would have been seen had the clock been right: the column stands for all of the offset.
        at.X_WE[:] = X_WE
        rows, ahead = (at.theta, then.all, now.all), exposure - stamp
        off = kernels.history.instant(*rings, exposure, self._load_lag, *rows, now.twist, ahead, at.X_WE)
        if memory.delay.known[0] and off > _ASTRAY:
            return None
        is_settling = exposure < memory.delay.settled[0] + _SETTLING or exposure < memory.paused_until[0]
        unrest = UNREST if is_settling else float(now.unrest[0])
        gears = then.states, then.others
        return Pair(at.theta, then.loads, then.motion, now.twist, at.X_WE, unrest, *gears, stamp)

    def suit(self, home: np.ndarray) -> None:
        """Has teeth led as fast as links follow them where the path starts, joints at home in rad, (6,)."""
        model = self.tip_model
        frames = model.forward(model.constants(model.mean), model.mean, home[None])[1].frames[0]
        inertia = model.loads.inertias(frames, home, model.mean[model.M])
        self.estimator.gear_feedback.suit(model.robot.joint_damping, inertia)

    def led_aside(self, memory: SimpleNamespace, instant: float, step: float, is_on_path: bool) -> np.ndarray:
        """Where joints are led beside the path, since their gears' teeth are not where they were expected.

        Args:
            memory: of the law.
            instant: that is planned, s.
            step: s since the last instant that was planned.
            is_on_path: before the path it does not matter where the tip is, and the robot is little known.

        Returns:
            rad, and its two derivatives, (3, 6).
        """
        feedback, loose = self.estimator.gear_feedback, memory.estimator.loose
        if not (feedback.acts and is_on_path):
            feedback.rest(loose)
            return np.zeros((3, 6))
        stamp = float(loose.exposure[0])
        exposure = stamp + self.estimator.clock_offset(memory.estimator, stamp)
        return feedback.lead(loose, instant - exposure, step)

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
            size = self.motors.take_gains(memory, instant)
            self.events.note(memory.events, time, Event(GAINS_UNLIKE_BELIEF, size, 0.0))
        elif sigma:
            self.events.note(memory.events, time, Event(PROBE_REPEATED, sigma, sigma))
        if has_gains or sigma:
            memory.waited[0] += length
            memory.repeats.count[0] += 1.0
            memory.repeats.sigma[0] = 0.0

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
