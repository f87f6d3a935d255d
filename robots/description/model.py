"""What a six-axis robot is: geometry, limits, masses and drive trains, read from one YAML file.

A robot file is the dataclass tree below, field for field; ``extends`` names a robot or a file on top of which
it stands. Every part carries a ``source``: where its
numbers come from, or the word ``assumed``. Angles in the file are in degrees and say so in the name
of their field; the arrays that `RobotModel` offers to the rest of the code are in SI units.

Frames: W is the world, B the robot's base, link i is moved by joint i, F is the flange (the frame of
the last link) and E the tool. At zero joint angles the frame of link i sits at
``translation`` in the frame of link i-1, turned by ``rotation_zyx_deg``.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

import numpy as np

from robots.configuration.extended import FileKind, extends, read_extended
from robots.configuration.nodes import ConfigurationError, Node, read_nodes
from robots.configuration.quantity import numbers, positive, quantity
from robots.configuration.suggestion import did_you_mean, why_no_file
from robots.configuration.typed import typed
from robots.description.beam import Beam, beam_surrogate
from robots.description.calibration import FILES, Calibration, names_file, with_nominal_from
from robots.description.counterbalance_spring import CounterbalanceSpring
from robots.description.drive_train import DriveLimits, DriveTrain, Tilting, drive_trains
from robots.description.measuring import MeasuringRange
from robots.description.pictures.picture import Picture, with_paths_from
from robots.description.placement import Placement, tool_problem
from robots.description.urdf_in.reader import is_urdf, read_urdf
from robots.drivetrain.counterbalance import Counterbalance
from robots.drivetrain.stiffness import SpringRow
from robots.drivetrain.train import DriveTrains

NUM_JOINTS = 6
SPEED_UP = 0.035  # s, assumed: from rest to the largest speed, where a file says no acceleration


class RobotFileError(ConfigurationError):
    """A robot file is missing, cannot be parsed, or describes an impossible robot."""


@dataclass
class JointLimits:
    """Range, largest speed and largest acceleration of one joint."""

    lower_deg: float = 0.0  # smallest angle
    upper_deg: float = 0.0  # largest angle
    speed_deg_s: float = positive(0.0, "deg/s")  # largest speed, in both directions
    source: str = ""  # where the numbers come from, or ``assumed``
    # Of a command; 0 where it is not known: the largest speed is then reached within `SPEED_UP`
    acceleration_deg_s2: float = quantity(0.0, 0.0, unit="deg/s^2")
    # Of a command or a planned motion; 0 for no limit
    jerk_deg_s3: float = quantity(0.0, 0.0, unit="deg/s^3")


@dataclass
class Joint:
    """A revolute joint and the frame of the link that it moves; without ``tilting`` its bearing is stiff.

    Without ``drive_limits`` only its speed and its acceleration limit a planned motion.
    """

    # Its direction in the link's frame
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    placement: Placement = field(default_factory=Placement)
    limits: JointLimits = field(default_factory=JointLimits)
    drive_train: DriveTrain = field(default_factory=DriveTrain)
    tilting: Tilting | None = None  # how the bearing yields; left out: stiff
    drive_limits: DriveLimits | None = None  # of motor and gear, for planned motions


@dataclass
class Link:
    """A body, rigid without a ``beam``; its inertia is that about the centre of mass."""

    mass: float = positive(0.0, "kg")  # of the link alone
    inertia: np.ndarray = field(default_factory=lambda: np.zeros(3))  # kg m^2, about x, y, z
    products: np.ndarray = field(default_factory=lambda: np.zeros(3))  # kg m^2, entries xy, xz, yz
    source: str = ""  # where mass and inertia come from, or ``assumed``
    center_of_mass: np.ndarray = field(default_factory=lambda: np.zeros(3))  # m, in the link frame
    center_of_mass_source: str = ""  # where it comes from, or ``assumed``
    radius: float = positive(0.05, "m")  # of the capsules that picture the link
    radius_source: str = ""  # where the radius comes from, or ``assumed``
    beam: Beam | None = None  # how the link bends and twists; left out: rigid
    pictures: list[Picture] = field(default_factory=list)  # in place of the capsule

    @property
    def inertia_matrix(self) -> np.ndarray:
        """About the centre of mass in the axes of the link's frame in kg m^2, shape (3, 3)."""
        (xx, yy, zz), (xy, xz, yz) = self.inertia, self.products
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@dataclass
class PayloadLimits:
    """The largest mass at the flange, with the centre of mass and the inertia of that mass.

    The inertia of a smaller payload is taken in proportion to its mass.
    """

    largest_mass: float = quantity(0.0, 0.0, unit="kg")  # that the robot may carry at its flange
    inertia: np.ndarray = field(default_factory=lambda: np.zeros(3))  # kg m^2, about its centre
    source: str = ""  # where mass and inertia come from, or ``assumed``
    center_of_mass: np.ndarray = field(default_factory=lambda: np.zeros(3))  # m, in the flange frame
    center_of_mass_source: str = ""  # where it comes from, or ``assumed``


@dataclass
class RobotModel:
    """A six-axis serial robot. Load one with `load_robot`."""

    name: str = ""  # as reports call the robot
    base: Placement = field(default_factory=Placement)
    joints: list[Joint] = field(default_factory=list)  # six, from the base to the flange
    tool: Placement = field(default_factory=Placement)
    base_link: Link = field(default_factory=Link)
    links: list[Link] = field(default_factory=list)  # six; each is moved by the joint of its number
    payload: PayloadLimits = field(default_factory=PayloadLimits)
    home_deg: list[float] = numbers((), (0, NUM_JOINTS), unit="deg")  # where it works best; empty: found
    measuring: MeasuringRange = field(default_factory=MeasuringRange)
    calibration: Calibration = field(default_factory=Calibration)
    # A spring that carries the weight of the arm; left out: none
    counterbalance: CounterbalanceSpring | None = None

    @property
    def is_calibrated(self) -> bool:
        """Whether the geometry is that of one robot, found by a calibration."""
        return bool(self.calibration.source)

    def _drive_train(self, name: str) -> np.ndarray:
        return np.array([getattr(joint.drive_train, name) for joint in self.joints])

    def _limit(self, name: str) -> np.ndarray:
        return np.deg2rad([getattr(joint.limits, name) for joint in self.joints])

    @property
    def axes(self) -> np.ndarray:
        """Joint axes in the frames of their links, shape (6, 3)."""
        return np.array([joint.axis / np.linalg.norm(joint.axis) for joint in self.joints])

    @property
    def lower(self) -> np.ndarray:
        """Lower joint limits in rad, shape (6,)."""
        return self._limit("lower_deg")

    @property
    def upper(self) -> np.ndarray:
        """Upper joint limits in rad, shape (6,)."""
        return self._limit("upper_deg")

    @property
    def speed(self) -> np.ndarray:
        """Largest joint speeds in rad/s, shape (6,)."""
        return self._limit("speed_deg_s")

    @property
    def acceleration(self) -> np.ndarray:
        """Largest accelerations of a joint's command in rad/s^2, shape (6,)."""
        known = self._limit("acceleration_deg_s2")
        return np.where(known > 0.0, known, self.speed / SPEED_UP)

    @property
    def gear_ratio(self) -> np.ndarray:
        """Gear ratios, shape (6,)."""
        return self._drive_train("ratio")

    @property
    def reflected_inertia(self) -> np.ndarray:
        """Rotor inertias seen on the link side of the gear in kg m^2, shape (6,)."""
        return self.gear_ratio**2 * self._drive_train("rotor_inertia")

    @property
    def joint_stiffness(self) -> np.ndarray:
        """Stiffness of the gears at rest in N m / rad, joint side, shape (6,)."""
        return self._drive_train("stiffness")

    @property
    def stiffening_gears(self) -> SpringRow | None:
        """The springs of the six gears where one of them stiffens under load, None if all are linear."""
        trains = [joint.drive_train for joint in self.joints]
        return SpringRow([train.spring for train in trains]) if any(t.stiffening for t in trains) else None

    @property
    def drive_trains(self) -> DriveTrains | None:
        """The drive trains of the joints where one of them has parts beyond gear and friction, else None."""
        return drive_trains([joint.drive_train for joint in self.joints])

    @property
    def joint_damping(self) -> np.ndarray:
        """Damping of the gears, parallel to their stiffness, in N m s / rad, joint side, shape (6,)."""
        return self._drive_train("damping")

    @property
    def joint_viscous_friction(self) -> np.ndarray:
        """Viscous friction of the motors in N m s / rad on the link side, Probst (2024) eq. (2.63)."""
        return self.gear_ratio**2 * self._drive_train("viscous_friction")

    @property
    def joint_coulomb_friction(self) -> np.ndarray:
        """Coulomb friction of the motors in N m on the link side, Probst (2024) eq. (2.64)."""
        return self.gear_ratio * self._drive_train("coulomb_friction")

    @property
    def compliance(self) -> np.ndarray:
        """Compliances of the joints that a calibration has found in rad / (N m), zero if none has, (6,)."""
        return np.array(self.calibration.compliance)

    @property
    def has_joint_calibration(self) -> bool:
        """Whether a calibration has found that joints yield, or err with their angle."""
        return bool(self.compliance.any() or self.calibration.joint_errors)

    @property
    def counterbalance_at_axis_2(self) -> Counterbalance | None:
        """What the counterbalance does about axis 2, None where there is none."""
        joint = self.joints[1]
        spring = self.counterbalance
        return None if spring is None else spring.about_axis(self.axes[1], joint.placement.pose())

    @property
    def coulomb_velocity(self) -> np.ndarray:
        """Joint velocity over which the Coulomb friction changes its sign in rad/s, shape (6,)."""
        return self._drive_train("coulomb_velocity")


def shipped_robots() -> list[str]:
    """The names of the robots that come with the package."""
    names = [entry.name for entry in _data_folder().iterdir()]
    return sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml"))


def load_robot(name: str) -> RobotModel:
    """Reads a shipped robot by name (``"irb1200"``) or any robot file or URDF by its path.

    Raises:
        RobotFileError: if there is no such robot, or its file is not a valid robot.
    """
    try:
        return robot_of(read_extended(name, _robot_file()))
    except RobotFileError:
        raise
    except ConfigurationError as error:
        raise RobotFileError(str(error)) from error


def base_robot(name: str) -> str | None:
    """What a robot file is written on top of, None if it stands alone. Raises ConfigurationError."""
    return extends(name, _robot_file())


def robot_of(node: Node) -> RobotModel:
    """The robot that the nodes of a file describe.

    Raises:
        ConfigurationError: if they describe none, or an impossible one.
    """
    for key in ("joints", "links"):
        node.check_count(key, NUM_JOINTS)
    robot = typed(node, RobotModel)
    keys, problem = _problem(robot)
    if problem:
        raise node.at(keys).refuse(problem)
    return robot


def _robot_file() -> FileKind:
    return FileKind(RobotModel, _find, merges_lists=True, read=_read)


def _read(path: Path, label: str) -> Node:
    if is_urdf(path.name):
        return read_urdf(path, label).nodes
    return with_nominal_from(path.parent, with_paths_from(path.parent, read_nodes(path, label)))


def _find(name: str, beside: Path) -> tuple[Path, str]:
    """Path and label of a robot file."""
    is_file = names_file(name)
    path = beside / name if is_file else Path(str(_data_folder() / f"{name}.yaml"))
    if not path.is_file():
        missing = why_no_file(beside / name, is_file, *FILES)
        raise RobotFileError(
            f"robot '{name}': {missing}; "
            f"give the path of a YAML file or a URDF, or one of {', '.join(shipped_robots())}"
            f"{did_you_mean(name, shipped_robots())}"
        )
    return path, f"robot file {path}"


def _data_folder():
    return files("robots") / "data"


_Keys = tuple[str | int, ...]


def _problem(robot: RobotModel) -> tuple[_Keys, str]:
    """The place of the first reason why the robot is impossible, and the reason, empty if there is none."""
    problems: list[tuple[_Keys, str]] = [
        (("joints", index), _joint_problem(joint, index + 1)) for index, joint in enumerate(robot.joints)
    ]
    if robot.base_link.beam is not None:
        problems.append((("base_link", "beam"), "base_link: stands still and takes no beam"))
    bodies: list[tuple[_Keys, str, Link]] = [(("base_link",), "base_link", robot.base_link)]
    bodies += [(("links", index), f"link {index + 1}", link) for index, link in enumerate(robot.links)]
    for keys, label, link in bodies:
        problems.append(((*keys, "inertia"), _inertia_problem(label, link)))
        problems.append(((*keys, "beam"), _beam_problem(label, link)))
        reasons = (picture.problem() for picture in link.pictures)
        problems += [
            ((*keys, "pictures", k), reason and f"{label}: {reason}") for k, reason in enumerate(reasons)
        ]
    if not any(problem for _, problem in problems):
        problems.append((("counterbalance",), _refusal(lambda: robot.counterbalance_at_axis_2)))
    problems.append((("tool", "translation"), tool_problem(robot.tool)))
    problems.append((("calibration",), robot.calibration.problem()))
    problems.append((("measuring",), robot.measuring.problem()))
    if robot.payload.largest_mass > 0.0:
        carried = Link(inertia=robot.payload.inertia)
        problems.append((("payload", "inertia"), _inertia_problem("payload", carried)))
    return next((each for each in problems if each[1]), ((), ""))


def _joint_problem(joint: Joint, number: int) -> str:
    limits, train = joint.limits, joint.drive_train
    if not np.linalg.norm(joint.axis) > 0.0:
        return f"joint {number}: axis must have a direction, got {joint.axis.tolist()}"
    if not limits.lower_deg < limits.upper_deg:
        lower, upper = limits.lower_deg, limits.upper_deg
        return f"joint {number}: lower limit {lower} deg is not below the upper {upper} deg"
    for label in ("damping", "viscous_friction", "coulomb_friction"):
        if getattr(train, label) < 0.0:
            return f"joint {number}: {label} must not be negative, got {getattr(train, label)}"
    positive = {
        "ratio": train.ratio,
        "rotor_inertia": train.rotor_inertia,
        "stiffness": train.stiffness,
        "coulomb_velocity": train.coulomb_velocity,
    }
    return (
        _not_positive(f"joint {number}", positive)
        or _train_problem(f"joint {number}", train)
        or _tilting_problem(f"joint {number}: tilting", joint)
    )


def _train_problem(where: str, train: DriveTrain) -> str:
    problem = _refusal(train.parts)
    return problem and f"{where}: {problem}"


def _tilting_problem(where: str, joint: Joint) -> str:
    tilting = joint.tilting
    if tilting is None:
        return ""
    if len(tilting.stiffness) != 2 or len(tilting.damping) != 2:
        return f"{where} needs two stiffnesses and two dampings, got {tilting.stiffness}, {tilting.damping}"
    problem = _refusal(tilting.springs)
    return problem and f"{where}: {problem}"


def _beam_problem(where: str, link: Link) -> str:
    beam = link.beam
    if beam is None:
        return ""
    if link.products.any():
        return f"{where}: a beam takes no products of inertia, got {link.products.tolist()}"
    problem = _refusal(lambda: beam_surrogate(beam, link.mass, link.center_of_mass, link.inertia))
    return problem and f"{where}: {problem}"


def _refusal(build: Callable[[], object]) -> str:
    try:
        build()
    except ValueError as error:
        return str(error)
    return ""


def _not_positive(where: str, values: dict[str, float]) -> str:
    for label, value in values.items():
        if not value > 0.0:
            return f"{where}: {label} must be positive, got {value}"
    return ""


def _inertia_problem(where: str, body: Link) -> str:
    # No body has a principal moment larger than the sum of the two others; Drake refuses it as well, later.
    moments = np.linalg.eigvalsh(body.inertia_matrix) if body.products.any() else body.inertia
    if moments.min() > 0.0 and 2.0 * moments.max() <= moments.sum() * (1.0 + 1e-9):
        return ""
    return (
        f"{where}: inertia must be three positive moments, none above the sum of the others, "
        f"got {np.asarray(moments).tolist()}"
    )
