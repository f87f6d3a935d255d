"""The controller as a diagram: the same one against a simulated and against a real station."""

from pydrake.systems.framework import Diagram, DiagramBuilder

from diagrams.scenario import Scenario
from robots.model import RobotModel
from systems.guard import CommandGuard
from systems.reference import Reference
from systems.servo import BLIND_LAWS, LAWS, LawConfig


class Servo(Diagram):
    """Reference, law and guard.

    Ports, the mirror image of a station's:
        in  ``joint_sample``      JointSample
        in  ``pose_sample``       PoseSample
        out ``position_command``  vector 6 in rad
        out ``velocity_command``  vector 6 in rad/s
    and to look at:
        out ``X_WE_desired``      RigidTransform
        out ``correction``        vector 6 in rad and m, rotation first
        out ``guard_status``      counts of `systems.guard.KINDS`
    """

    def __init__(self, robot: RobotModel, scenario: Scenario, law: str) -> None:
        """Builds the controller of one law.

        Raises:
            ValueError: if the law is unknown or a part refuses its configuration.
        """
        super().__init__()
        if law not in LAWS:
            raise ValueError(f"law must be one of {', '.join(LAWS)}, got '{law}'")
        config = scenario.servo.laws.get(law, LawConfig())
        guard_config, period = scenario.servo.guard, scenario.station.period
        preview = scenario.reference.preview
        builder = DiagramBuilder()
        self.reference = builder.AddNamedSystem("reference", Reference(scenario.reference, period))
        servo = builder.AddNamedSystem(
            "law",
            LAWS[law](
                robot,
                config,
                guard_config,
                period,
                preview=preview,
                memory_span=scenario.station.camera.delay + guard_config.hold_after,
                payload=scenario.station.payload,
            ),
        )
        guard = builder.AddNamedSystem(
            "guard",
            CommandGuard(
                robot,
                guard_config,
                period,
                config.correction_limit,
                config.correction_limit_deg,
                uses_camera=law not in BLIND_LAWS,
            ),
        )
        builder.Connect(self.reference.GetOutputPort("X_WE_preview"), servo.GetInputPort("X_WE_desired"))
        builder.Connect(self.reference.GetOutputPort("V_WE_preview"), servo.GetInputPort("V_WE_desired"))
        for name in ("position_command", "velocity_command", "correction", "measurement"):
            builder.Connect(servo.GetOutputPort(name), guard.GetInputPort(name))
        joints = builder.ExportInput(servo.GetInputPort("joint_sample"), "joint_sample")
        builder.ConnectInput(joints, guard.GetInputPort("joint_sample"))
        builder.ExportInput(servo.GetInputPort("pose_sample"), "pose_sample")
        builder.ExportOutput(guard.GetOutputPort("position_command"), "position_command")
        builder.ExportOutput(guard.GetOutputPort("velocity_command"), "velocity_command")
        builder.ExportOutput(self.reference.GetOutputPort("X_WE_desired"), "X_WE_desired")
        builder.ExportOutput(servo.GetOutputPort("correction"), "correction")
        builder.ExportOutput(guard.GetOutputPort("guard_status"), "guard_status")
        builder.BuildInto(self)
        self.set_name("servo")
