"""The controller as a diagram: the same one against a simulated and against a real station."""

from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder

from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario
from robots.description.model import NUM_JOINTS, RobotModel
from systems.feedforward import FEEDFORWARDS
from systems.guard.guard import CommandGuard
from systems.reference.reference import Reference
from systems.servo import BLIND_LAWS, LAWS, LawConfig

# Laws whose position commands start from where the motors are: the gears are wound up there already.
_FROM_MOTORS = ("pbvs",)


class Servo(Diagram):
    """Reference, law and guard.

    Ports, the mirror image of a station's:
        in  ``joint_sample``      JointSample
        in  ``pose_sample``       PoseSample
        out ``position_command``  vector 6 in rad
        out ``velocity_command``  vector 6 in rad/s
        out ``torque_feedforward``  vector 6 in N m, only with a feedforward
    and to look at:
        out ``X_WE_desired``      RigidTransform
        out ``correction``        vector 6 in rad and m, rotation first
        out ``guard_status``      counts of `systems.guard.guard.KINDS`
    """

    def __init__(self, robot: RobotModel, scenario: Scenario, law: str) -> None:
        """Builds the controller of one law.

        Args:
            robot: as the controller knows it, unless `servo.model` says otherwise.
            scenario: what to do, and what the controller believes of the station.
            law: which law to use.

        Raises:
            ValueError: if the law is unknown or a part refuses its configuration.
        """
        super().__init__()
        if law not in LAWS:
            raise ValueError(f"law must be one of {', '.join(LAWS)}, got '{law}'")
        config = scenario.servo.laws.get(law, LawConfig())
        guard_config = scenario.servo.guard
        self.model = controller_model(scenario, robot)
        builder = DiagramBuilder()
        self.reference = builder.AddNamedSystem("reference", Reference(scenario.reference, self.model.period))
        servo = builder.AddNamedSystem("law", LAWS[law](self.model, config, guard_config))
        feedforward = scenario.servo.feedforward
        has_torque = feedforward.kind != "none"
        guard = builder.AddNamedSystem(
            "guard",
            CommandGuard(
                self.model.robot,
                guard_config,
                self.model.period,
                config.correction_limit,
                config.correction_limit_deg,
                uses_camera=law not in BLIND_LAWS,
                passes_torque=has_torque,
                is_speed_only=config.drive == "velocity",
            ),
        )
        builder.Connect(self.reference.GetOutputPort("X_WE_preview"), servo.GetInputPort("X_WE_desired"))
        builder.Connect(self.reference.GetOutputPort("V_WE_preview"), servo.GetInputPort("V_WE_desired"))
        for name in ("correction", "measurement"):
            builder.Connect(servo.GetOutputPort(name), guard.GetInputPort(name))
        builder.Connect(guard.GetOutputPort("deviation"), servo.GetInputPort("deviation"))
        joints = builder.ExportInput(servo.GetInputPort("joint_sample"), "joint_sample")
        commands = {name: servo.GetOutputPort(name) for name in ("position_command", "velocity_command")}
        if has_torque:
            model = FEEDFORWARDS[feedforward.kind](self.model, feedforward)
            ahead = builder.AddNamedSystem("feedforward", model)
            for name in ("X_WE", "V_WE", "A_WE"):
                source = self.reference.GetOutputPort(f"{name}_preview")
                builder.Connect(source, ahead.GetInputPort(f"{name}_desired"))
            builder.ConnectInput(joints, ahead.GetInputPort("joint_sample"))
            offsets = {"velocity_command": "velocity_offset"}
            if law not in _FROM_MOTORS:
                offsets["position_command"] = "position_offset"
            for name, offset in offsets.items():
                total = builder.AddNamedSystem(f"{name}_with_feedforward", Adder(2, NUM_JOINTS))
                builder.Connect(commands[name], total.get_input_port(0))
                builder.Connect(ahead.GetOutputPort(offset), total.get_input_port(1))
                commands[name] = total.get_output_port()
            torque = guard.GetInputPort("torque_feedforward")
            builder.Connect(ahead.GetOutputPort("torque_feedforward"), torque)
            builder.ExportOutput(guard.GetOutputPort("torque_feedforward"), "torque_feedforward")
        for name, port in commands.items():
            builder.Connect(port, guard.GetInputPort(name))
        builder.ConnectInput(joints, guard.GetInputPort("joint_sample"))
        builder.ExportInput(servo.GetInputPort("pose_sample"), "pose_sample")
        builder.ExportOutput(guard.GetOutputPort("position_command"), "position_command")
        builder.ExportOutput(guard.GetOutputPort("velocity_command"), "velocity_command")
        builder.ExportOutput(self.reference.GetOutputPort("X_WE_desired"), "X_WE_desired")
        builder.ExportOutput(servo.GetOutputPort("correction"), "correction")
        builder.ExportOutput(guard.GetOutputPort("guard_status"), "guard_status")
        builder.BuildInto(self)
        self.set_name("servo")
