"""What is ahead of the self-calibrating law: its next command, and how fast the path may go on."""

import math
from types import SimpleNamespace

import numpy as np

from systems.controller_model import ControllerModel
from systems.estimation.gears.gear_feedback import samples_alike
from systems.estimation.memory import Layout
from systems.estimation.probing.path_needs import PathNeeds
from systems.reference.reference import PathAhead
from systems.servo.self_calibrating.config import SelfCalibratingConfig
from systems.servo.self_calibrating.learning import Learning
from systems.servo.self_calibrating.motors import PLAN

_CAREFUL = 0.25  # of the planned speed, while the dead time or the load is not what it was
_BEFORE_PATH = 0.6  # s, at which it is held until the dead time is found; a slowed path needs time to stop
_MISSED = 5.0  # samples one after the other that no camera loses by chance: it is blind
_LOOK_EVERY = 0.2  # s, between two looks at how well the path ahead is known
_STEP = 0.85  # from one speed to the next slower one; larger ones make the arm ring
_CLEARLY = 0.8  # of what a speed allows, before it is gone back to
_BEGIN = 0.5  # s of the path that have to be known well enough for it to begin
_PLENTY = 150.0  # samples a second without more noise than believed: what they leave is not for want of more
_NEXT = 0.3  # s of the path that are looked at while it is; about what is still run while it is slowed


def _renewed(memory: SimpleNamespace) -> list[np.ndarray]:
    """What working out a command renews, apart from the command."""
    drives, delay = memory.drives, memory.delay
    return [
        memory.lead.all,
        memory.planner.all,
        memory.columns.ravel(),
        memory.planned,
        memory.feedback.all,
        memory.waited,
        memory.by_knowledge,
        memory.repeats.all,
        memory.estimator.loose.aside.ravel(),
        drives.started,
        drives.z.ravel(),
        drives.w.ravel(),
        drives.correction,
        drives.led.ravel(),
        drives.smoothed,
        drives.wound.ravel(),
        drives.aside.ravel(),
        drives.by_torque.ravel(),
        drives.gains.all,
        drives.coming.all,
        delay.delay,
        delay.rate,
        delay.settled,
    ]


class NextCommand:
    """Where the command of a tick lies, and whether it is that of the next one already.

    A command depends on what was learnt and on the path, but not on what the message of its tick says, unless
    the robot does not run. So it can be there when the message comes. If it turns out to be for another time,
    or the path's time has changed, what working it out has renewed is taken back.
    """

    def __init__(self, memory: Layout) -> None:
        """Lays out the memory, a part of the law's, which is given without it."""
        whole = memory.view(np.zeros(memory.size))
        self._ends = np.cumsum([part.size for part in _renewed(whole)])
        self.layout = Layout(
            is_ready=(1,),
            time=(1,),  # of its tick, s
            path_time=(1,),  # of the instant that it is for, s
            begins_path=(1,),  # whether the path begins at this instant
            is_led_in=(1,),  # whether motors are on their plan from this instant on
            commands=(3, 6),  # position, velocity, torque
            row=PLAN,
            before=(int(self._ends[-1]),),
        )

    def keep(self, memory: SimpleNamespace) -> None:
        """Remembers how things are before the next command is worked out."""
        np.concatenate(_renewed(memory), out=memory.next.before)

    def is_for(self, memory: SimpleNamespace, time: float, reference: PathAhead) -> bool:
        """Whether the command is there, for a tick at this time in s and the path as it is timed now."""
        coming = memory.next
        if not coming.is_ready[0] or coming.time[0] != time:
            return False
        return reference.path_time(float(memory.planned[0])) == coming.path_time[0]

    def take_back(self, memory: SimpleNamespace) -> None:
        """Forgets the command if there is one."""
        if not memory.next.is_ready[0]:
            return
        memory.next.is_ready[0] = 0.0
        start = 0
        for part, end in zip(_renewed(memory), self._ends, strict=True):
            part[:] = memory.next.before[start:end]
            start = end


class Pace:
    """The share of the planned speed at which the path may be run with what is known.

    Where gears err, n samples in a row say no more than one, and the tip is known sqrt(n) times less well
    after the same time. A path would take n times as long for that: it is gone on with where the tip is known
    as well as it would be if each of them said something new.
    """

    needs: PathNeeds | None = None  # once the path is known

    def __init__(self, model: ControllerModel, config: SelfCalibratingConfig, learning: Learning) -> None:
        """Takes what it asks."""
        self._period, self._config, self._learning = model.period, config, learning
        self._looked_at = max(1, round(_LOOK_EVERY / model.period))
        self._rate = 1.0 / max(model.period, model.camera_period)  # of a tick one sample is taken
        self._blind_after = _MISSED * max(model.period, model.camera_period)  # s
        has_play = learning.tip_model.has_gear_errors
        alike = samples_alike(max(model.period, model.camera_period)) if has_play else 1.0
        self._known_on_path = math.sqrt(alike) * config.known_on_path

    def share(self, memory: SimpleNamespace, reference: PathAhead, time: float) -> float:
        """None of it before the probe is over, a part while motors are not where they should be.

        Args:
            memory: of the law.
            reference: the path.
            time: of the tick, s.
        """
        instant = float(memory.planned[0])
        path_time, path_start = reference.path_time(instant), reference.path.path_start
        if path_time < path_start - _BEFORE_PATH:
            return 1.0
        begins_anew = memory.drives.coming.factors.any() or memory.repeats.sigma[0]
        is_probing = begins_anew or path_time + memory.waited[0] > instant + self._period
        if path_time < path_start and (is_probing or not memory.delay.known[0]):
            return 0.0
        if self._awaits_camera(memory, path_time, time):
            return 0.0
        by_knowledge = float(memory.by_knowledge[0])
        is_upset = time < memory.paused_until[0] or not self._learning.delay.is_settled(memory.delay, instant)
        return min(_CAREFUL, by_knowledge) if is_upset else by_knowledge

    def look(self, memory: SimpleNamespace, reference: PathAhead, time: float) -> None:
        """Now and then: how fast the path may go on with what is known of the tip where it is planned next.

        What a camera shows acts on the path a dead time later. On a path that is run slowly it comes in time,
        and more of it. Where the tip is known n times less well than it should be, the path goes on at one
        nth of its speed. Without a camera that shows anything nothing is gained by going slowly.

        Args:
            memory: of the law, whose ``by_knowledge`` is renewed.
            reference: the path.
            time: of the tick, s.
        """
        if self.needs is None:
            return
        is_shown = time - memory.heard.accepted[0] < self._config.longest_wait
        is_shown = is_shown and not memory.estimator.is_foreign[0]
        if is_shown:
            self._look_at_begin(memory, self.needs, reference.path.path_start)
        if round(time / self._period) % self._looked_at:
            return
        path_time = reference.path_time(float(memory.planned[0]))
        if path_time < reference.path.path_start - _NEXT:
            return
        beyond = 0.0
        if is_shown:
            rows = self.needs.rows_between(path_time, path_time + _NEXT)
            beyond = self._learning.estimator.sigma(memory.estimator, rows) / self._known_on_path
        share, faster = memory.by_knowledge, memory.by_knowledge[0] / _STEP
        if beyond * share[0] > 1.0 and share[0] > _CAREFUL:
            share[0] *= _STEP
        elif beyond * faster < _CLEARLY:
            share[0] = min(1.0, faster)

    def _look_at_begin(self, memory: SimpleNamespace, needs: PathNeeds, path_start: float) -> None:
        """Once after each probe: whether the first part of the path is known well enough, or it is repeated.

        That helps against noise, with cameras that show little. Where samples are plenty the path shows in no
        time what they have not shown yet, as after a load that was not told; more of the same motion would
        only make the estimate surer of what the model is wrong by.
        """
        repeats, probe = memory.repeats, self._config.probe
        is_due = memory.planned[0] >= memory.shown_at[0] + memory.waited[0]
        if not is_due or repeats.looks[0] > repeats.count[0]:
            return
        repeats.looks[0] += 1.0
        estimator = self._learning.estimator
        rows = needs.rows_between(path_start, path_start + _BEGIN)
        sigma = estimator.sigma(memory.estimator, rows)
        is_wanted = sigma > probe.enough and repeats.count[0] < probe.repeats
        is_wanted &= self._rate < _PLENTY * estimator.variance_factor(memory.estimator)
        repeats.sigma[0] = sigma if is_wanted else 0.0

    def _awaits_camera(self, memory: SimpleNamespace, path_time: float, time: float) -> bool:
        """Whether the camera has gone blind before it has shown what the path needs next; not for ever."""
        since = time - float(memory.heard.accepted[0])
        if self.needs is None or not self._blind_after < since < self._config.longest_wait:
            return False
        P = self._learning.estimator.covariance(memory.estimator)
        return self.needs.sigma_between(P, path_time, path_time + _NEXT) > self._config.known_ahead
