"""A law that puts the tip on the path by knowing the robot: it calibrates robot, load and delays at work."""

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues

from robots.description.model import NUM_JOINTS, RobotModel
from systems.controller_model import ControllerModel
from systems.estimation.drives.drive_model import DEAD_TIME
from systems.estimation.events import PATH_UNSEEN, Event
from systems.estimation.findings import calibrated_robot, findings, path_knowledge
from systems.estimation.memory import Layout, Views
from systems.estimation.parameter_lead import ParameterLead
from systems.estimation.preview_planner import PreviewPlanner, Wanted
from systems.estimation.probing.path_needs import PathNeeds, Standing
from systems.estimation.probing.path_reach import PathReach
from systems.estimation.probing.probe import Probe
from systems.estimation.probing.probe_design import designed
from systems.estimation.tip_model import Pair
from systems.guard.guard import GuardConfig
from systems.reference.cartesian_path import CartesianPath
from systems.reference.reference import PathAhead
from systems.sampled_system import SampledSystem
from systems.samples import JointSample, PoseSample
from systems.servo.self_calibrating.ahead import NextCommand, Pace
from systems.servo.self_calibrating.config import SelfCalibratingConfig
from systems.servo.self_calibrating.learning import UNREST, Learning

_STARTING, _LED_IN = 1.5, 2.0  # s
_IN_REACH = 0.3  # s before the path begins, from which on the robot as it is known has to reach it
_FOLLOWED = 4.0  # rad of the lead's frequency, after which nine tenths of a step are followed


class SelfCalibrating(SampledSystem):
    """Calibrates, predicts and plans ahead; of the camera nothing is fed back through the dead time.

    Ports:
        in  ``reference``           PathAhead
        in  ``joint_sample``        JointSample
        in  ``pose_sample``         PoseSample
        out ``position_command``    vector 6 in rad, NaN before the first tick
        out ``velocity_command``    vector 6 in rad/s, likewise
        out ``torque_feedforward``  vector 6 in N m, joint side; zero where drives take none
        out ``correction``          vector 6 in rad and m, rotation first: what the geometry that was learnt
                                    moves the tip by
        out ``measurement``         vector 3: when the last usable sample arrived (s), how many were refused,
                                    when the newest one was exposed (s)
        out ``speed_share``         1: less than all of the planned speed while the dead time is wrong or
                                    the tip ahead little known, none before the dead time is found, nor
                                    while a blind camera is waited for
        out ``look_ahead``          1 in s: how far ahead of now the plan is

    Of each camera sample the encoder positions of the same instant are found; the pair teaches the
    `TipEstimator`. The `ParameterLead` takes the estimate over, and the `PreviewPlanner` inverts the robot as
    it is known then, on the path as far ahead as commands take to act. The `DriveModel` learns from the
    encoders what the motors make of that. The parts are plain classes whose arrays all lie in this system's
    discrete state: between ports of their own each would see the others a tick late.
    """

    title = "Self-calibrating"
    colour = "#0f766e"
    uses_camera = False  # what it knows stays true when the camera sees nothing
    learns_from_camera = True
    commands_motors = True
    awaits_joints = False
    is_compared = False
    Config = SelfCalibratingConfig

    def __init__(self, model: ControllerModel, config: SelfCalibratingConfig, guard: GuardConfig) -> None:
        """Builds the parts.

        Raises:
            ValueError: if a part refuses its configuration.
        """
        super().__init__()
        self._model, self._config = model, config
        self._needs: PathNeeds | None = None  # all three once the path is known
        self._forecast: Standing | None = None
        self._reach: PathReach | None = None
        self.period = model.period
        self._learning = learning = Learning(model, config)
        self.tip_model, self.estimator = learning.tip_model, learning.estimator
        self._motors, self._drives = learning.motors, learning.motors.drives
        self._lead = ParameterLead(self.tip_model.size, config.lead_frequency, config.lead_acceleration)
        self._pace = Pace(model, config, learning)
        self._planner = PreviewPlanner(self.tip_model, model.period)
        self._probe = Probe(model.robot, config.probe, model.camera_period, self.tip_model.has_gear_errors)
        arrays = {
            "lead": self._lead.layout,
            "planner": self._planner.layout,
            "columns": (6, len(self.tip_model.chosen)),  # of the tip, as the geometry changes
            "start_time": (1,),
            "planned": (1,),  # the last instant of the plan
            "amplitude": (2, NUM_JOINTS),  # of the probe: knock, oscillations
            "by_knowledge": (1,),  # share of the planned speed, see `Pace.look`
            "waited": (1,),  # s, by its oscillations for dead time and gains to be found and followed
            **learning.arrays,
        }
        self._next = NextCommand(Layout(**arrays))
        self._layout = Layout(next=self._next.layout, **arrays)
        self._views = Views(self._layout)
        self._reference = self.DeclareAbstractInputPort("reference", Value[object]())
        self._joints = self.DeclareAbstractInputPort("joint_sample", Value(JointSample()))
        self._camera = self.DeclareAbstractInputPort("pose_sample", Value(PoseSample()))
        self._outputs = [
            self.DeclareDiscreteState(np.full(NUM_JOINTS, np.nan)),
            self.DeclareDiscreteState(np.full(NUM_JOINTS, np.nan)),
            self.DeclareDiscreteState(np.zeros(NUM_JOINTS)),
            self.DeclareDiscreteState(np.zeros(6)),
            self.DeclareDiscreteState(np.array([-np.inf, 0.0, -np.inf])),
            self.DeclareDiscreteState([1.0]),
            self.DeclareDiscreteState([model.command_delay]),
        ]
        self._rehearse()
        self._memory = self.DeclareDiscreteState(self._first_memory())
        names = "position_command", "velocity_command", "torque_feedforward", "correction", "measurement"
        for name, state in zip((*names, "speed_share", "look_ahead"), self._outputs, strict=True):
            self.DeclareStateOutputPort(name, state)
        self.DeclarePeriodicDiscreteUpdateEvent(model.period, 0.0, self._tick)

    def prepare(self, path: CartesianPath, home: np.ndarray) -> None:
        """Designs the probe for a path, before anything moves.

        Args:
            path: that will be run.
            home: where the joints are near at its start, rad, (6,).
        """
        try:
            self._needs = PathNeeds(self.tip_model, self.estimator.weights, path, home, self._late)
        except ValueError:
            return  # out of reach of the nominal robot: whoever starts the run says so
        self._pace.needs, self._reach = self._needs, PathReach(self._needs, path)
        self._learning.suit(home)
        rate = 1.0 / max(self.period, self._model.camera_period)  # of a tick one sample is taken
        sharp = self._config.probe.sharp
        found = designed(self._needs, self._probe, path.path_start, rate, sharp)
        self._probe.pattern, self._forecast = found

    @property
    def _late(self) -> float:
        """After so many s a sample acts on the path: delays, the lead, and a camera that is blind."""
        delays = self._model.camera_delay + self._model.command_delay
        return delays + _FOLLOWED / self._config.lead_frequency + self._config.probe.blind

    def _first_memory(self) -> np.ndarray:
        vector = np.zeros(self._layout.size)
        memory = self._layout.view(vector)
        self._learning.start(memory)
        memory.lead.x[:] = self.tip_model.mean
        memory.by_knowledge[0] = 1.0
        return vector

    def _rehearse(self) -> None:
        """Runs the parts on scratch memory: what a first call compiles shall not be compiled in a tick."""
        memory, model = self._layout.view(self._first_memory()), self.tip_model
        model.warm_up()
        q, still = np.linspace(0.1, 0.6, NUM_JOINTS), np.zeros(NUM_JOINTS)
        X_WE = model.forward(model.constants(model.mean), model.mean, q[None])[0][0]
        self._planner.start(memory.planner, model.mean, q, X_WE)
        wanted = Wanted(X_WE, still, np.zeros((3, NUM_JOINTS)))
        at = wanted, 0.0, self.period, model.gear_errors.likely(memory.estimator.against)
        for _ in range(2):
            plan = self._planner.step(memory.planner, (model.mean, np.zeros(model.size)), *at)
            motion = plan.theta, plan.velocity, plan.acceleration
            command = self._drives.command(memory.drives, motion, plan.on_motors, self._model.payload)
        self._drives.deviate(memory.drives, still)
        self._drives.look_back(memory.drives, motion, command.regressors, still, q)
        pair = Pair(q, plan.loads, plan.motion, plan.twist, X_WE)
        self._lead.step(memory.lead, model.mean, memory.columns, self.period)
        for _ in range(40):  # the first ones are only looked at
            self.estimator.add(memory.estimator, pair)
        for _ in range(3):  # it is put off once, and what was read is taken over in a tick of its own
            self.estimator.work(memory.estimator)
        memory.estimator.count[0] = 1e6  # from now on samples are judged
        for size in (0.0, 0.1):
            X_WE[0, 3] += size
            self.estimator.add(memory.estimator, pair._replace(X_WE=X_WE))
        self._learning.delay.search.rehearse(memory.delay.search)
        if self._drives.finds_gains:
            self._drives.search.rehearse(memory.gains.search)
        self._motors.rehearse(memory, q)
        self._learning.pair(memory, 0.5, X_WE)

    def memory(self, context: Context) -> SimpleNamespace:
        """All that the law remembers, as arrays that must not be written to."""
        return self._layout.view(context.get_discrete_state(self._memory).value())

    def learnt(self, context: Context) -> dict[str, Any]:
        """What it has found out: `findings`, ``dead_time_s`` from command to motion, the last ``events``.

        ``path`` is how well the tip is known where the path needs it most, as `path_knowledge` has it:
        ``before`` it is reached, as the design of the probe expects, and ``now``.
        """
        memory = self.memory(context)
        late = float(memory.drives.beta[DEAD_TIME])
        return {
            "dead_time_s": float(memory.delay.delay[0]) + late,
            **findings(self.estimator, memory.estimator),
            "path": self._path_knowledge(memory),
            "events": self._learning.events.read(memory.events),
        }

    def _path_knowledge(self, memory: SimpleNamespace) -> dict[str, Any] | None:
        if self._needs is None or self._forecast is None:
            return None
        now = self._needs.standing(self.estimator.covariance(memory.estimator))
        return {
            "before": path_knowledge(self.estimator, self._forecast),
            "now": path_knowledge(self.estimator, now),
        }

    def predicted_tip(self, context: Context) -> tuple[float, np.ndarray, np.ndarray] | None:
        """Where the tip was at the newest exposure as far as is known now, whatever the camera saw.

        Returns:
            The time of the exposure in s, as the joints' clock has it, or that of the newest encoders where
            these have not come so far; the pose (4, 4); and its covariance, rotation (rad^2) first, (6, 6).
            None if there is no sample or no plan for it.
        """
        sample: PoseSample = self._camera.Eval(context)
        memory = self._layout.view(np.array(context.get_discrete_state(self._memory).value()))
        if not sample.valid or not memory.planner.started[0]:
            return None
        pair = self._learning.pair(memory, sample.time, sample.X_WE.GetAsMatrix4())
        if pair is None:
            return None
        exposure = sample.time + self.estimator.clock_offset(memory.estimator, sample.time)
        time = min(exposure, float(memory.encoders.times.max()))  # as that of the pair
        rounding = self._motors.steps.sigma(memory.steps)
        still = pair._replace(twist=np.zeros(6), rounding=rounding)  # of the joints' clock alone
        X_WE = self.estimator.predict(memory.estimator, still).X_WE[0]
        return time, X_WE, self.estimator.tip_covariance(memory.estimator, still)

    def calibrated_robot(self, context: Context, of: str) -> RobotModel:
        """The robot as it is known now, see `systems.estimation.findings.calibrated_robot`."""
        return calibrated_robot(self.estimator, self.memory(context).estimator, of)

    def hear(self, context: Context) -> None:
        """Takes note of the samples of the last tick, whose command did not wait for the joints."""
        state = context.get_mutable_discrete_state()
        memory = self._views(state.get_mutable_value(int(self._memory)))
        joints, reference = self._joints.Eval(context), self._reference.Eval(context)
        samples = joints, self._camera.Eval(context)
        self._hear(memory, state, joints.time, samples, reference.path.path_start)

    def _hear(
        self,
        memory: SimpleNamespace,
        discrete_state: DiscreteValues,
        time: float,
        samples: tuple[JointSample, PoseSample],
        path_start: float,
    ) -> None:
        """Takes note of the samples of a tick at a time in s."""
        self._learning.hear(memory, time, samples, path_start + float(memory.waited[0]))
        seen = (memory.heard.accepted[0], 0.0, memory.heard.newest[0])
        discrete_state.set_value(int(self._outputs[4]), seen)

    def learn(self, context: Context) -> None:
        """Learns from what was heard at the last tick, and works out the next command.

        The next tick does so otherwise. It makes no difference to any command. On a wire it is asked for when
        the reply is on its way, and the next message finds it done.

        Args:
            context: of this system, after its tick.
        """
        reference: PathAhead = self._reference.Eval(context)
        memory = self._views(context.get_mutable_discrete_state(self._memory).get_mutable_value())
        self._learning.learn(memory)
        if memory.planner.started[0] and not memory.next.is_ready[0]:
            time = (round(float(memory.heard.time[0]) / self.period) + 1) * self.period
            self._next.keep(memory)
            self._work_out(memory, reference, time)
            memory.next.is_ready[0], memory.next.time[0] = 1.0, time

    def _tick(self, context: Context, discrete_state: DiscreteValues) -> None:
        time = context.get_time()
        reference: PathAhead = self._reference.Eval(context)
        joints: JointSample = self._joints.Eval(context)
        memory = self._views(discrete_state.get_mutable_value(int(self._memory)))
        self._learning.learn(memory)  # unless somebody has asked for it since the last tick
        if joints.time > memory.heard.joints[0]:  # or they come later, see `hear`
            samples = joints, self._camera.Eval(context)
            self._hear(memory, discrete_state, time, samples, reference.path.path_start)
        if not joints.running:
            # When it runs again it starts from where it stands then.
            self._next.take_back(memory)
            memory.planner.started[0] = 0.0
            commands = joints.position, np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
        else:
            commands = self._command(memory, reference, time, joints.position)
            if self._config.drive == "velocity":
                commands = commands[0], commands[1] + self._motors.to_plan(memory, joints), commands[2]
        for state, command in zip(self._outputs, commands, strict=False):
            discrete_state.set_value(int(state), command)
        ahead = float(memory.planned[0]) - time
        share = self._pace.share(memory, reference, time)
        for state, value in zip(self._outputs[5:], (share, ahead), strict=True):
            discrete_state.set_value(int(state), [value])
        model = self.tip_model
        learnt = memory.lead.x[model.G] - model.mean[model.G]
        discrete_state.set_value(int(self._outputs[3]), memory.columns @ learnt)

    def _command(
        self, memory: SimpleNamespace, reference: PathAhead, time: float, position: np.ndarray
    ) -> np.ndarray:
        """What to command at this tick: position, velocity and torque, (3, 6)."""
        coming = memory.next
        if not self._next.is_for(memory, time, reference):
            self._next.take_back(memory)
            self._work_out(memory, reference, time, position)
        coming.is_ready[0] = 0.0
        self._motors.plan.append(memory.plan, float(memory.planned[0]), coming.row.all)
        self._learning.delay.search.command(memory.delay.search, time, coming.row.theta)
        forecast = self._forecast
        if coming.begins_path[0] or coming.is_led_in[0]:
            self._drives.open_low_speeds(memory.drives, is_early=not coming.begins_path[0])
        if coming.begins_path[0]:
            self._drives.give_by_torque(memory.drives)
        if coming.begins_path[0] and forecast and forecast.sigma > self._config.probe.vague:
            event = Event(PATH_UNSEEN, forecast.sigma, forecast.sigma)
            self._learning.events.note(memory.events, time, event)
        return coming.commands

    def _work_out(
        self, memory: SimpleNamespace, reference: PathAhead, time: float, position: np.ndarray | None = None
    ) -> None:
        """Plans for the instant when a command of a time acts, and works out what to command then.

        Args:
            memory: of the law.
            reference: the path.
            time: of the tick, s.
            position: of the joints in rad, (6,), if the robot may just begin to run.
        """
        instant = time + self._learning.delay.step(memory.delay, float(memory.planned[0]))
        path_start = reference.path.path_start
        delay, coming, drives = memory.delay, memory.next, memory.drives
        is_steady = delay.delay[0] == delay.target[0]
        moment = reference.moment(instant, float(delay.delay[0]) if is_steady else 0.0)
        if position is not None and not memory.planner.started[0]:
            X_WE = np.array([*moment.X_WE, (0.0, 0.0, 0.0, 1.0)])
            J = self._planner.start(memory.planner, memory.lead.x, position, X_WE)
            memory.start_time[0] = time
            memory.planned[0] = instant - self.period
            memory.first[0] = instant
            memory.amplitude[:] = self._probe.amplitude(position, J, path_start - instant)
            self._learning.begin(memory, self._probe.shown(path_start - instant))
        lead, since_start = memory.lead, time - memory.start_time[0]
        found = self.estimator.x_robot(memory.estimator)
        x = self.tip_model.plausible(found)
        self._lead.step(lead, x, memory.columns, self.period)
        self._learning.note_implausible(memory, time, int(np.count_nonzero(x != found)))
        first, last = memory.first[0], memory.planned[0]
        waited = self._learning.wait(memory, instant, self._probe, path_start)
        aside = self._probe.at(instant - first, path_start - first, memory.amplitude, waited)
        is_on_path = reference.path_time(instant) >= path_start
        aside += self._learning.led_aside(memory, instant, instant - float(last), is_on_path)
        wanted = Wanted(moment.X_WE, moment.V_WE, aside)
        at = wanted, since_start, instant - last, self.tip_model.gear_errors.likely(memory.estimator.against)
        plan = self._planner.step(memory.planner, (lead.x, lead.rate), *at)
        memory.columns[:] = plan.columns[:, 18:]
        motion = plan.theta, plan.velocity, plan.acceleration
        command = self._drives.command(drives, motion, plan.on_motors, self._model.payload)
        if self._motors.feedback.acts:
            command = self._motors.feed_back(memory, command, instant)
        is_starting = since_start < _STARTING and np.abs(memory.planner.start_error).max() > 1e-3
        unrest = 0.0 if self._learning.delay.is_settled(memory.delay, instant) and not is_starting else UNREST
        row = (
            *motion,
            plan.loads.ravel(),
            plan.motion,
            plan.twist,
            lead.unrest + unrest,
            command.regressors.ravel(),
            command.beside,
            command.torques.ravel(),
            command.position - plan.theta,
            plan.states,
            plan.others.ravel(),
        )
        np.concatenate(row, out=coming.row.all)
        # While the delay is corrected the path is sent faster or slower than it is to be travelled.
        velocity = (1.0 + memory.delay.rate[0]) * command.velocity
        coming.commands[:] = command.position, velocity, command.torque
        memory.planned[0], coming.path_time[0] = instant, reference.path_time(instant)
        # Later than planned where the probe has waited or begun anew.
        coming.begins_path[0] = reference.path_time(float(last)) < path_start <= coming.path_time[0]
        coming.is_led_in[0] = last < first + _LED_IN <= instant
        self._pace.look(memory, reference, time)
        if self._reach is not None and coming.path_time[0] > path_start - _IN_REACH:
            constants = self._planner.constants(memory.planner, lead.x)
            covariance = partial(self.estimator.covariance, memory.estimator)
            self._reach.look(constants, lead.x, covariance, round(time / self.period))
