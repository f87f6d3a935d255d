"""The controller: the same one against a simulated and against a real station."""

from inspect import signature
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, InputPort, OutputPort, System
from pydrake.systems.primitives import Adder, ConstantVectorSource, Demultiplexer

from diagrams.live_watch import LiveWatch
from diagrams.record.coverage import Prediction
from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.own_laws import own_gains
from diagrams.scenario.scenario import Scenario, ScenarioError
from diagrams.tick_clock import TickClock
from diagrams.watching import Watch
from robots.description.model import NUM_JOINTS, RobotModel
from systems.controller_model import ControllerModel
from systems.feedforward import FEEDFORWARDS
from systems.feedforward.feedforward import Feedforward
from systems.feedforward.joint_motion import Standing
from systems.feedforward.predictive.config import PredictiveConfig
from systems.feedforward.predictive.correction import PredictiveCorrection
from systems.guard.guard import CommandGuard, GuardConfig
from systems.reference.reference import Reference
from systems.servo import LAWS, LawConfig
from systems.servo.contract import SIZES, check_ports, law_traits
from systems.servo.sample_watch import SampleWatch

_FROM_REFERENCE = {"X_WE_desired": "X_WE_preview", "V_WE_desired": "V_WE_preview", "reference": "reference"}


class Controller:
    """Reference, law and guard, put into a diagram beside the station that they command.

    In a diagram of its own, see `Servo`, it would be slower in a simulation: at every step the
    integrator goes through all diagrams.

    Ports, the mirror image of a station's, in ``inputs`` and ``outputs`` by name:
        in  ``joint_sample``      JointSample
        in  ``pose_sample``       PoseSample
        out ``position_command``  vector 6 in rad
        out ``velocity_command``  vector 6 in rad/s
        out ``torque_feedforward``  vector 6 in N m, only with a feedforward or a law that knows torques
    and if it watches for people:
        in  ``image_sample``      ImageSample; ``person_sample`` in its place where another process looks,
                                with ``acknowledge`` as of `SeparationMonitor`
        out ``person_sample``, ``speed_share``, ``stop``, ``separation``  as of `PeopleWatcher` and
                                  `SeparationMonitor`
    and on a real station with `servo.guard.obey_utilization`:
        in  ``speed_share_controller``  vector 1: the share of the planned speed that the controller can do
    and to look at:
        out ``X_WE_desired``      RigidTransform
        out ``path_time``         vector 2: the time on the path in s and its rate
        out ``correction``        vector 6 in rad and m, rotation first
        out ``guard_status``      counts of `systems.guard.guard.KINDS`

    Attributes:
        law: the system of the law.
        traits: what it is.
        model: what the controller believes.
        drive: the drive that it commands, ``"position"``, ``"velocity"`` or ``"cascade"``.
        has_torque: whether there is a torque to feed forward.
        guard: the system of the guard.
        tick_clock: of the law's updates, if the servo has made the law.
        obeys_controller: whether it slows the path for a controller that cannot do it.
    """

    def __init__(
        self,
        builder: DiagramBuilder,
        robot: RobotModel,
        scenario: Scenario,
        law: str | type[System] | System,
        watch: Watch | LiveWatch | None = None,
        standing: Standing | None = None,
    ) -> None:
        """Adds the parts of the controller of one law.

        Args:
            builder: of the diagram that they come into.
            robot: as the controller knows it, unless `servo.model` says otherwise.
            scenario: what to do, and what the controller believes of the station.
            law: a shipped law by name, ``FILE.py:CLASS``, a class, or any system with the ports of a law.
            watch: what slows the path for people.
            standing: the robot before the run, if a camera has looked at it.

        Raises:
            ValueError: if the law is unknown or has not the ports, or a part refuses its configuration.
        """
        # An input may lead to several systems.
        self.inputs: dict[str, list[InputPort]] = {}
        self.outputs: dict[str, OutputPort] = {}
        law = LAWS.find(law) if isinstance(law, str) else law
        self.model = controller_model(scenario, robot)
        self.traits = law_traits(law)
        config = law_config(scenario, law)
        self.drive = config.drive
        self.tick_clock = TickClock()
        if isinstance(law, type):
            law = _built(self.tick_clock.timed(law), self.model, config, scenario.servo.guard)
        self.law: Any = law  # which may say more than a System does
        check_ports(self.law)
        if self.traits.uses_camera:
            _refuse_slow_camera(scenario)
        slowed_by = ["law"] if self.law.HasOutputPort("speed_share") else []
        slowed_by += ["separation"] if watch else []
        self.obeys_controller = scenario.servo.guard.obey_utilization and scenario.station.kind != "simulated"
        slowed_by += ["controller"] if self.obeys_controller else []
        self.reference = builder.AddNamedSystem(
            "reference", Reference(scenario.reference, self.model.period, slowed_by)
        )
        self._prepare_law(scenario)
        builder.AddNamedSystem("law", self.law)
        feedforward = scenario.servo.feedforward
        self.has_torque = feedforward.kind != "none" or self.law.HasOutputPort("torque_feedforward")
        self.guard = guard = builder.AddNamedSystem("guard", self._guard(config, scenario.servo.guard))
        self._issued = _issued(builder, guard)
        self._connect_reference(builder)
        if self.law.HasInputPort("deviation"):
            builder.Connect(guard.GetOutputPort("deviation"), self.law.GetInputPort("deviation"))
        self._take(guard, "joint_sample")
        self._take(self.law, "joint_sample")
        if watch:
            self._add_watch(builder, watch)
        commands = self._connect_camera(builder)
        for name in ("position_command", "velocity_command", "torque_feedforward"):
            if self.law.HasOutputPort(name):
                commands[name] = self.law.GetOutputPort(name)
        if feedforward.kind != "none":
            ahead = builder.AddNamedSystem("feedforward", self._feedforward(scenario, standing))
            self._take(ahead, "joint_sample")
            self._add_feedforward(builder, ahead, commands)
        if feedforward.predictive.kind != "none":
            correction = self._add_predictive_correction(builder, feedforward.predictive, commands)
            self._take(correction, "joint_sample")
        if self.obeys_controller:
            self._take(self.reference, "speed_share_controller")
        for name, port in commands.items():
            builder.Connect(port, guard.GetInputPort(name))
        self.outputs |= self._issued
        for name in ("torque_feedforward", "guard_status"):
            if guard.HasOutputPort(name):
                self.outputs[name] = guard.GetOutputPort(name)
        self.outputs |= {name: self.reference.GetOutputPort(name) for name in ("X_WE_desired", "path_time")}
        self.outputs["correction"] = commands["correction"]

    def _take(self, system: System, *names: str) -> None:
        """Inputs lead to the ports of the same names of a system, beside others."""
        for name in names:
            self.inputs.setdefault(name, []).append(system.GetInputPort(name))

    def read(self, root_context: Context, name: str) -> Any:
        """What an output says now."""
        port = self.outputs[name]
        return port.Eval(port.get_system().GetMyContextFromRoot(root_context))

    def _prepare_law(self, scenario: Scenario) -> None:
        """Lets laws see the path that cannot follow every one, or do something before a run."""
        check_path = getattr(self.law, "check_path", None)
        if check_path is not None:
            check_path(self.reference.path)
        prepare = getattr(self.law, "prepare", None)
        if prepare is not None:
            prepare(self.reference.path, np.deg2rad(scenario.home_deg))

    def _guard(self, law: LawConfig, guard: GuardConfig) -> CommandGuard:
        """The guard, with the limits of the law."""
        return CommandGuard(
            self.model.robot,
            guard,
            self.model.period,
            law.correction_limit,
            law.correction_limit_deg,
            uses_camera=self.traits.uses_camera,
            passes_torque=self.has_torque,
            is_speed_only=law.drive == "velocity",
        )

    def _feedforward(self, scenario: Scenario, standing: Standing | None) -> Feedforward:
        """The inverse model, prepared for the path. Raises ScenarioError if somebody may slow the path."""
        config = scenario.servo.feedforward
        kind = FEEDFORWARDS.find(config.kind)
        if not issubclass(kind, Feedforward):
            raise ScenarioError(f"feedforward {config.kind}: class {kind.__name__} must extend Feedforward")
        model = kind(self.model, config)
        if self.reference.is_slowed and model.is_computed_beforehand:
            raise ScenarioError(
                f"servo.feedforward.kind={config.kind} is computed before the run and needs the planned "
                "speed, but reference.override or the law slows the path"
            )
        # One of somebody's own may do without the robot that a camera has looked at.
        looked_at = (standing,) if len(signature(model.prepare).parameters) > 2 else ()
        model.prepare(self.reference.path, np.deg2rad(scenario.home_deg), *looked_at)
        return model

    def _connect_reference(self, builder: DiagramBuilder) -> None:
        """What the law wants to know of the path, and what it says of its speed."""
        for name, source in _FROM_REFERENCE.items():
            if self.law.HasInputPort(name):
                builder.Connect(self.reference.GetOutputPort(source), self.law.GetInputPort(name))
        if self.reference.is_slowed:
            for name, port in (("speed_share", "speed_share_law"), ("look_ahead", "look_ahead")):
                if self.law.HasOutputPort(name) and self.reference.HasInputPort(port):
                    builder.Connect(self.law.GetOutputPort(name), self.reference.GetInputPort(port))

    def _add_watch(self, builder: DiagramBuilder, watch: Watch | LiveWatch) -> None:
        """People in whole images, and the share of the speed that they allow."""
        monitor = builder.AddNamedSystem("separation_monitor", watch.monitor)
        self._take(monitor, "joint_sample")
        if isinstance(watch, LiveWatch):
            self._take(monitor, "person_sample", "acknowledge")
        else:
            watcher = builder.AddNamedSystem("people_watcher", watch.watcher)
            self._take(watcher, "image_sample", "joint_sample")
            builder.Connect(watcher.GetOutputPort("person_sample"), monitor.GetInputPort("person_sample"))
            self.outputs["person_sample"] = watcher.GetOutputPort("person_sample")
        for source, port in (
            (self._issued["velocity_command"], monitor.GetInputPort("velocity_command")),
            (self.reference.GetOutputPort("path_time"), monitor.GetInputPort("path_time")),
            (monitor.GetOutputPort("speed_share"), self.reference.GetInputPort("speed_share_separation")),
        ):
            builder.Connect(source, port)
        self.outputs |= {name: monitor.GetOutputPort(name) for name in ("speed_share", "stop", "separation")}

    def path_time(self, root_context: Context) -> float:
        """The time on the path in s at the time of a context; the same unless the path is slowed."""
        if not self.reference.is_slowed:
            return root_context.get_time()
        return float(self.read(root_context, "path_time")[0])

    def path_rate(self, root_context: Context) -> float:
        """How fast the time on the path runs, 1 as planned."""
        return float(self.read(root_context, "path_time")[1])

    def _connect_camera(self, builder: DiagramBuilder) -> dict[str, OutputPort]:
        """The camera to the law; what the law says of it and of its correction, or what stands for that."""
        said = {}
        if self.law.HasInputPort("pose_sample"):
            self._take(self.law, "pose_sample")
        if self.law.HasOutputPort("measurement"):
            said["measurement"] = self.law.GetOutputPort("measurement")
        else:
            watch = builder.AddNamedSystem("sample_watch", SampleWatch(self.model.period))
            said["measurement"] = watch.get_output_port()
            self._take(watch, "pose_sample")
        if self.law.HasOutputPort("correction"):
            said["correction"] = self.law.GetOutputPort("correction")
        else:
            nothing = builder.AddNamedSystem(
                "no_correction", ConstantVectorSource([0.0] * SIZES["correction"])
            )
            said["correction"] = nothing.get_output_port()
        return said

    def _add_predictive_correction(
        self, builder: DiagramBuilder, config: PredictiveConfig, commands: dict[str, OutputPort]
    ) -> PredictiveCorrection:
        """Puts a correction on top of the torques. Raises ScenarioError where the drives take none."""
        if self.drive != "cascade" or "torque_feedforward" not in commands:
            raise ScenarioError(
                f"servo.feedforward.predictive.kind={config.kind} corrects the torques that a feedforward "
                "tells cascades: choose servo.feedforward.kind and the law's drive=cascade"
            )
        correction = builder.AddNamedSystem("predictive_correction", PredictiveCorrection(self.model, config))
        builder.Connect(self.reference.GetOutputPort("reference"), correction.GetInputPort("reference"))
        for name in ("position_command", "velocity_command"):
            builder.Connect(self._issued[name], correction.GetInputPort(name))
        total = builder.AddNamedSystem("corrected_torque", Adder(2, NUM_JOINTS))
        builder.Connect(commands["torque_feedforward"], total.get_input_port(0))
        builder.Connect(correction.GetOutputPort("torque"), total.get_input_port(1))
        commands["torque_feedforward"] = total.get_output_port()
        return correction

    def _add_feedforward(
        self, builder: DiagramBuilder, ahead: System, commands: dict[str, OutputPort]
    ) -> None:
        """Puts what an inverse model says on top of the commands, in place."""
        for name in ("X_WE", "V_WE", "A_WE"):
            source = self.reference.GetOutputPort(f"{name}_preview")
            builder.Connect(source, ahead.GetInputPort(f"{name}_desired"))
        added = {"velocity_command": "velocity_offset", "torque_feedforward": "torque_feedforward"}
        # Where the motors are, the gears are wound up already.
        if not self.traits.commands_motors:
            added["position_command"] = "position_offset"
        for name, offset in added.items():
            if name not in commands:
                commands[name] = ahead.GetOutputPort(offset)
                continue
            total = builder.AddNamedSystem(f"{name}_with_feedforward", Adder(2, NUM_JOINTS))
            builder.Connect(commands[name], total.get_input_port(0))
            builder.Connect(ahead.GetOutputPort(offset), total.get_input_port(1))
            commands[name] = total.get_output_port()


class Servo(Controller, Diagram):
    """A controller as a diagram of its own, which exports the ports."""

    def __init__(self, *args: Any, **options: Any) -> None:
        """Builds it. Arguments and errors are those of `Controller`, without its builder."""
        Diagram.__init__(self)
        builder = DiagramBuilder()
        Controller.__init__(self, builder, *args, **options)
        for name, (first, *others) in self.inputs.items():
            index = builder.ExportInput(first, name)
            for port in others:
                builder.ConnectInput(index, port)
        for name, port in self.outputs.items():
            builder.ExportOutput(port, name)
        builder.BuildInto(self)
        self.set_name("servo")
        self.inputs = {name: [self.GetInputPort(name)] for name in self.inputs}
        self.outputs = {name: self.GetOutputPort(name) for name in self.outputs}


def _issued(builder: DiagramBuilder, guard: CommandGuard) -> dict[str, OutputPort]:
    """The two parts of the command in what the guard decides; Drake's own system splits it without Python."""
    decision = guard.GetOutputPort("decision")
    parts = Demultiplexer([NUM_JOINTS, NUM_JOINTS, decision.size() - 2 * NUM_JOINTS])
    issued = builder.AddNamedSystem("issued", parts)
    builder.Connect(decision, issued.get_input_port())
    return {"position_command": issued.get_output_port(0), "velocity_command": issued.get_output_port(1)}


def _refuse_slow_camera(scenario: Scenario) -> None:
    """Refuses a camera between two samples, or before the first one, of which the guard would intervene."""
    period, patience = scenario.station.camera.period, scenario.servo.guard.hold_after
    if period > patience:
        raise ScenarioError(
            f"station.camera.period={period:g} s must be at most servo.guard.hold_after={patience:g} s: "
            "the guard holds the correction when no sample comes for so long"
        )
    # The first sample is exposed at once, and is late by the delay.
    delay, longest = scenario.station.camera.delay, scenario.servo.guard.stop_after
    if delay + period >= longest:
        raise ScenarioError(
            f"station.camera.delay={delay:g} s and station.camera.period={period:g} s must be below "
            f"servo.guard.stop_after={longest:g} s together: the guard stops the robot when no sample comes "
            "for so long"
        )


def law_config(scenario: Scenario, law: type[System] | System) -> LawConfig:
    """Gains and limits of a law: the scenario's, or those with which its class begins."""
    kind, gains = law if isinstance(law, type) else type(law), scenario.servo.laws
    name = LAWS.name_of(kind)
    if name is not None:
        return gains[name]
    return own_gains(kind, gains.own)


def law_name(law: str | type[System] | System) -> str:
    """What a law is called in logs and results."""
    if isinstance(law, str):
        return law
    return law.__name__ if isinstance(law, type) else type(law).__name__


def _built(law: type[System], model: ControllerModel, config: LawConfig, guard: GuardConfig) -> System:
    """The law's system. Raises ValueError if the class is not made as a law is."""
    try:
        built = law(model, config, guard)
    except TypeError as error:
        raise ValueError(f"law {law.__name__}: {' '.join(str(error).split())}") from error
    if not isinstance(built, System):
        raise ValueError(f"law {law.__name__}: it must be a LeafSystem or a Diagram")
    return built


def learnt(servo: Controller, root_context: Context) -> dict[str, Any] | None:
    """What a law that learns has found out until now, as its ``learnt(context)`` says; None for others."""
    report = getattr(servo.law, "learnt", None)
    return None if report is None else dict(report(servo.law.GetMyContextFromRoot(root_context)))


def hear(servo: Controller, root_context: Context) -> None:
    """Tells guard and law of samples that came after their tick, see their ``hear(context)``."""
    for part in (servo.guard, servo.law):
        told = getattr(part, "hear", None)
        if told is not None:
            told(part.GetMyMutableContextFromRoot(root_context))


def learn(servo: Controller, root_context: Context) -> None:
    """Lets a law learn that can do so after its command is out, see its ``learn(context)``."""
    catch_up = getattr(servo.law, "learn", None)
    if catch_up is not None:
        catch_up(servo.law.GetMyMutableContextFromRoot(root_context))


def predicted_tip(servo: Controller, root_context: Context) -> Prediction | None:
    """Where a law that predicts it says that the tip was last, see its ``predicted_tip(context)``."""
    predict = getattr(servo.law, "predicted_tip", None)
    return None if predict is None else predict(servo.law.GetMyContextFromRoot(root_context))


def calibrated(servo: Controller, root_context: Context, of: str) -> RobotModel | None:
    """The robot as a law knows it that calibrates robots, see its ``calibrated_robot(context, of)``."""
    robot = getattr(servo.law, "calibrated_robot", None)
    return None if robot is None else robot(servo.law.GetMyContextFromRoot(root_context), of)
