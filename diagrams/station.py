"""The robot cell as a diagram with the ports of the contract."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.common import RandomDistribution, RandomGenerator
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import (
    RandomSource,
)

from diagrams.driven_robot import add_driven_robot
from diagrams.inertial_sensors import add_inertial_sensors, seed_noise
from diagrams.integration import Change
from diagrams.scenario.scenario import StationConfig
from diagrams.true_robot import true_robot, with_payload_centre
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.payload_change import carried_inertia
from systems.cell.encoders import Encoders, SteppedReading, erring_encoders
from systems.cell.events.changing_delay import ChangingDelay, shortest_dead_time
from systems.cell.events.displaced_view import DisplacedView
from systems.cell.events.station_events import (
    CameraShift,
    DeadTimeChange,
    PayloadChange,
    camera_losses,
    of_kind,
)
from systems.cell.events.true_geometry import TrueGeometry
from systems.cell.inertial_sensors import InertialLoggerConfig
from systems.cell.joint_sensor import JointSensor
from systems.cell.marker_camera import MarkerCamera
from systems.cell.overview.overview_camera import OverviewCamera
from systems.cell.pose_camera import BLOCK, PoseCamera
from systems.cell.tip_pose import Tip, TipPose

_RUNAWAY = 10.0  # times the largest joint speed: no drive of a working simulation gets there


@dataclass(frozen=True)
class StationRecord:
    """The measurements of a run and, of a simulated station, the truth; n samples."""

    time: np.ndarray  # (n,) s
    joint_position: np.ndarray  # (n, 6) rad
    joint_effort: np.ndarray  # (n, 6) N m, joint side
    exposure_time: np.ndarray  # (m,) s, of the valid samples of the camera
    X_WE_measured: np.ndarray  # (m, 4, 4), what the camera saw
    X_WE_true: np.ndarray  # (n, 4, 4)
    link_position: np.ndarray  # (n, 6) rad, behind the elastic gears


class Station:
    """An elastic robot with its drives and a camera, put into a diagram beside what commands it.

    In a diagram of its own, see `SimulatedStation`, it would be slower: at every step the integrator goes
    through all diagrams around it to each number of the state.

    Ports, the same as those of a real cell, in ``inputs`` and ``outputs`` by name:
        in  ``position_command``  vector 6 in rad
        in  ``velocity_command``  vector 6 in rad/s
        out ``joint_sample``      JointSample
        out ``pose_sample``       PoseSample
    and if its drives take it:
        in  ``torque_feedforward``  vector 6 in N m, joint side
    and if it has whole images of its cameras:
        out ``image_sample``      ImageSample
    and for each logger of inertial sensors on it:
        out ``inertial_sample_1``   vector, see `systems.cell.inertial_sensors`

    Only a simulated station has these; nothing but logs and metrics may use them:
        out ``truth.X_WE``          RigidTransform
        out ``truth.state``         state of the plant: links and structure
        out ``truth.motor_state``   vector 12, positions of the motors (rad), then velocities (rad/s)
        out ``truth.motor_torque``  vector 6 in N m, joint side
        out ``truth.exposure``      vector 14, what the camera saw last, before it says so: time, validity,
                                    rows of X_WE
    """

    # What `record` is made of.
    LOGGED = ("truth.state", "truth.motor_state", "truth.motor_torque", "truth.exposure")

    def __init__(
        self,
        builder: DiagramBuilder,
        robot: RobotModel,
        config: StationConfig,
        drive: str,
        takes_torque: bool = False,
        inertial: list[InertialLoggerConfig] | None = None,
        overview: OverviewCamera | None = None,
    ) -> None:
        """Adds the parts of the cell.

        Args:
            builder: of the diagram that they come into.
            robot: the nominal robot; the true one differs from it by ``config.errors``, ``config.variation``
                and ``config.payload_centre_mm``.
            config: the station part of a scenario.
            drive: ``"position"``, ``"velocity"`` or ``"cascade"``; behind a controller that
                plans, where ``"velocity"`` follows speeds alone, there is no other difference.
            takes_torque: whether the drives take a torque feedforward; behind such a controller they do not.
            inertial: loggers with gyros and accelerometers on the robot.
            overview: takes whole images of the cell.

        Raises:
            ValueError: if a part refuses its configuration.
        """
        self.inputs: dict[str, InputPort] = {}
        self.outputs: dict[str, OutputPort] = {}
        self._motion = None
        self._config, self._nominal = config, robot
        self._delay = _changing_delay(config)
        if self._delay:
            builder.AddNamedSystem("changing_delay", self._delay)
        if config.interface != "direct":
            # The controller plans the motion; its drives follow positions, whatever it is told.
            planner = config.link.planner(config.period, takes_position=drive != "velocity")
            self._motion = builder.AddNamedSystem(config.interface, planner)
            drive, takes_torque = "cascade", False
        self._true_robot = true_robot(robot, config)
        drive_config = replace(
            config.drive, dead_time=shortest_dead_time(config.events, config.drive.dead_time)
        )
        self._encoders = Encoders(robot, config.encoder)
        discs = erring_encoders(self._encoders) if self._encoders.have_errors else None
        config = replace(config, drive=drive_config)
        self._driven = add_driven_robot(builder, robot, self._true_robot, config, drive, discs, takes_torque)
        self.robot, self.drive = self._driven.links, self._driven.drive
        self._geometry = TrueGeometry(self.robot, config.events, config.link_growth_ppm_per_hour)
        self._connect_commands(builder)
        self._add_joint_sensor(builder, _RUNAWAY * float(robot.speed.max()))
        self._noise = self._add_camera(builder, _camera(robot, config), config)
        self._image_noise = self._add_overview(builder, overview) if overview else None
        self._inertial_noise, samples = add_inertial_sensors(builder, self.plant, inertial or [])
        self.outputs |= samples
        self.outputs |= {
            "truth.state": self.plant.get_state_output_port(),
            "truth.motor_state": self._driven.motor_state,
            "truth.motor_torque": self._driven.motor_torque,
        }

    def read(self, root_context: Context, name: str) -> Any:
        """What an output says now."""
        port = self.outputs[name]
        return port.Eval(port.get_system().GetMyContextFromRoot(root_context))

    @property
    def plant(self) -> MultibodyPlant:
        """The links and, if it yields, the structure."""
        return self._driven.plant

    @property
    def setpoint(self) -> OutputPort:
        """Where the interpolated commands are: positions (rad), then velocities (rad/s), vector 12."""
        return self._driven.setpoint

    def _connect_commands(self, builder: DiagramBuilder) -> None:
        """Commands to the drive, through the controller if there is one, which takes no torque."""
        for name in ("position_command", "velocity_command", "torque_feedforward"):
            if not (self._motion or self.drive).HasInputPort(name):
                continue
            if self._motion:
                builder.Connect(self._motion.GetOutputPort(name), self.drive.GetInputPort(name))
            port = (self._motion or self.drive).GetInputPort(name)
            if self._delay:
                builder.Connect(self._delay.GetOutputPort(name), port)
                port = self._delay.GetInputPort(name)
            self.inputs[name] = port

    def _add_joint_sensor(self, builder: DiagramBuilder, runaway: float) -> None:
        motor_state = self._driven.measured_state
        if self._encoders.has_steps:
            reading = SteppedReading(self._encoders, self._config.period)
            builder.AddNamedSystem("stepped_reading", reading)
            builder.Connect(motor_state, reading.get_input_port())
            motor_state = reading.get_output_port()
        sensor = builder.AddNamedSystem("joint_sensor", JointSensor(runaway))
        builder.Connect(motor_state, sensor.GetInputPort("motor_state"))
        builder.Connect(self._driven.motor_torque, sensor.GetInputPort("motor_torque"))
        self.outputs["joint_sample"] = sensor.GetOutputPort("joint_sample")

    def _add_camera(
        self,
        builder: DiagramBuilder,
        camera: PoseCamera | MarkerCamera,
        config: StationConfig,
    ) -> RandomSource:
        """The camera, what it looks at, and the source of its noise, which is returned."""
        builder.AddNamedSystem("camera", camera)
        tip = Tip(self.robot, None if self._geometry.is_constant else self._geometry.apply)
        source: PoseCamera | TipPose
        if isinstance(camera, PoseCamera) and not of_kind(config.events, CameraShift):
            camera.look_at(tip)
            source = camera
        else:
            source = builder.AddNamedSystem("tip", TipPose(tip))
            self._connect_view(builder, source.GetOutputPort("X_WE"), camera.GetInputPort("X_WE"))
        builder.Connect(self.plant.get_state_output_port(), source.GetInputPort("state"))
        if camera.HasInputPort("motor_state"):  # of the arm, which hides markers
            builder.Connect(self._driven.motor_state, camera.GetInputPort("motor_state"))
        port = camera.GetInputPort("noise")
        noise = RandomSource(RandomDistribution.kGaussian, port.size(), BLOCK * config.camera.period)
        builder.AddNamedSystem("noise", noise)
        builder.Connect(noise.get_output_port(), port)
        self.outputs["pose_sample"] = camera.GetOutputPort("pose_sample")
        self.outputs["truth.X_WE"] = source.GetOutputPort("X_WE")
        self.outputs["truth.exposure"] = camera.GetOutputPort("exposure")
        return noise

    def _connect_view(self, builder: DiagramBuilder, true: OutputPort, camera: InputPort) -> None:
        """The tool to a camera, which may be displaced."""
        if of_kind(self._config.events, CameraShift):
            view = builder.AddNamedSystem("displaced_view", DisplacedView(self._config.events))
            builder.Connect(true, view.get_input_port())
            true = view.get_output_port()
        builder.Connect(true, camera)

    def _add_overview(self, builder: DiagramBuilder, overview: OverviewCamera) -> RandomSource:
        """The camera of whole images, and the source of its noise, which is returned."""
        builder.AddNamedSystem("overview", overview)
        port = overview.GetInputPort("noise")
        noise = RandomSource(RandomDistribution.kGaussian, port.size(), self._config.overview.period)
        builder.AddNamedSystem("image_noise", noise)
        builder.Connect(noise.get_output_port(), port)
        builder.Connect(self._driven.motor_state, overview.GetInputPort("motor_state"))
        self.outputs["image_sample"] = overview.GetOutputPort("image_sample")
        return noise

    def set_at_rest(self, root_context: Context, theta: np.ndarray, seed: int) -> None:
        """Puts the motors where encoders say theta (rad, (6,)), all at rest, and seeds the camera's noise."""
        self._driven.set_at_rest(root_context, theta, self._encoders.true_position(theta))
        if self._delay:
            self._delay.set_at_rest(self._delay.GetMyMutableContextFromRoot(root_context), theta)
        if self._motion:
            self._motion.set_at_rest(self._motion.GetMyMutableContextFromRoot(root_context), theta)
        self._noise.SetRandomContext(
            self._noise.GetMyMutableContextFromRoot(root_context), RandomGenerator(seed)
        )
        seed_noise(self._inertial_noise, root_context, seed)
        if self._image_noise:
            context = self._image_noise.GetMyMutableContextFromRoot(root_context)
            self._image_noise.SetRandomContext(context, RandomGenerator(seed))

    def changes(self) -> list[Change]:
        """What a run has to do to the context of the plant at times of events; the rest happens by itself."""
        times = {event.at for event in of_kind(self._config.events, PayloadChange)}
        return [Change(time, self._change) for time in sorted(times.union(self._geometry.change_times))]

    def _change(self, root_context: Context, time: float) -> None:
        context = self.plant.GetMyMutableContextFromRoot(root_context)
        self._geometry.apply(context, time)
        for event in of_kind(self._config.events, PayloadChange):
            if event.at == time:
                self._load(context, event)

    def _load(self, context: Context, event: PayloadChange) -> None:
        """Puts another load at the flange, in a context of the plant."""
        robot = with_payload_centre(self._true_robot, event.centre_mm)
        inertia = carried_inertia(robot, self._config.elasticity, event.payload)
        self.robot.tool.body().SetSpatialInertiaInBodyFrame(context, inertia)

    def planned_position(self, root_context: Context) -> np.ndarray:
        """Where the controller wanted the joints to be at its last cycle, in rad, shape (6,).

        Raises:
            RuntimeError: if the drives take commands directly and nothing plans.
        """
        if self._motion is None:
            raise RuntimeError("only a guided controller plans")
        return self._motion.planned_position(self._motion.GetMyContextFromRoot(root_context))

    def fastest_rate(self, root_context: Context) -> float:
        """The largest eigenvalue in magnitude of plant and drive, linearised about rest, in 1/s.

        With every load that the robot will carry: an empty wrist is stiffer than a loaded one.
        """
        context = self.plant.CreateDefaultContext()
        context.SetTimeStateAndParametersFrom(self.plant.GetMyContextFromRoot(root_context))
        rates = [self._driven.fastest_rate(context)]
        for event in of_kind(self._config.events, PayloadChange):
            self._load(context, event)
            rates.append(self._driven.fastest_rate(context))
        return max(rates)

    def record(self, times: np.ndarray, logged: dict[str, np.ndarray]) -> StationRecord:
        """What the station has measured, and the truth beside it.

        Args:
            times: of the log in s, shape (n,).
            logged: what the ports in `LOGGED` said then, shape (n, size) each.
        """
        state = logged["truth.state"]
        exposure_time, X_WE_measured = _exposures(logged["truth.exposure"])
        theta = logged["truth.motor_state"][:, :NUM_JOINTS]
        if self._geometry.is_constant:
            X_WE_true = self.robot.tool_poses(state)
        else:
            X_WE_true = self._geometry.tool_poses(self.robot, times, state)
        return StationRecord(
            time=times,
            joint_position=self._encoders.rounded(self._encoders.angle(theta)),
            joint_effort=logged["truth.motor_torque"],
            exposure_time=exposure_time,
            X_WE_measured=X_WE_measured,
            X_WE_true=X_WE_true,
            link_position=self.robot.link_positions(state),
        )


class SimulatedStation(Station, Diagram):
    """A station as a diagram of its own, which exports the ports."""

    def __init__(self, *args: Any, **options: Any) -> None:
        """Builds the cell. Arguments and errors are those of `Station`, without its builder."""
        Diagram.__init__(self)
        builder = DiagramBuilder()
        Station.__init__(self, builder, *args, **options)
        for name, port in self.inputs.items():
            builder.ExportInput(port, name)
        for name, port in self.outputs.items():
            builder.ExportOutput(port, name)
        builder.BuildInto(self)
        self.set_name("station")
        self.inputs = {name: self.GetInputPort(name) for name in self.inputs}
        self.outputs = {name: self.GetOutputPort(name) for name in self.outputs}


def _camera(robot: RobotModel, config: StationConfig) -> PoseCamera | MarkerCamera:
    """Whichever the scenario asks for. Raises ValueError if it refuses its configuration."""
    camera = replace(config.camera, dropouts=[*config.camera.dropouts, *camera_losses(config.events)])
    return camera.camera(robot)


def _changing_delay(config: StationConfig) -> ChangingDelay | None:
    if not of_kind(config.events, DeadTimeChange):
        return None
    return ChangingDelay(config.events, config.drive.dead_time, config.period)


def _exposures(logged: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times (m,) and poses (m, 4, 4) of the valid exposures in what was logged of a camera, (n, 14)."""
    valid = logged[logged[:, 1] > 0.0]
    _, first = np.unique(valid[:, 0], return_index=True)
    poses = np.tile(np.eye(4), (len(first), 1, 1))
    poses[:, :3] = valid[first, 2:].reshape(-1, 3, 4)
    return valid[first, 0], poses
