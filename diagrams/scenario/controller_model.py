"""From `servo.model` of a scenario to the beliefs of its controller."""

from dataclasses import replace

import numpy as np

from diagrams.scenario.scenario import Scenario
from diagrams.scenario.scenario_file import ScenarioError
from robots.description.calibration import is_same_robot
from robots.description.model import NUM_JOINTS, RobotModel, load_robot
from robots.description.variation import Factors, varied
from systems.controller_model import ControllerModel, ControllerModelConfig


def controller_model(scenario: Scenario, robot: RobotModel | None = None) -> ControllerModel:
    """What the controller of a scenario believes; where `servo.model` is empty, what the station is.

    Args:
        scenario: what to do.
        robot: the robot as the controller knows it. A calibrated one is what it knows, a nominal one unless
            `servo.model.robot` names another; None for the scenario's.

    Raises:
        ScenarioError: if `servo.model` asks for something impossible.
        RobotFileError: if a robot file cannot be read.
    """
    station, config = scenario.station, scenario.servo.model
    draw = _Draw(config)
    payload = station.payload if config.payload is None else config.payload
    payload *= draw.payload
    drive = station.drive
    return ControllerModel(
        robot=_believed_robot(_named_robot(scenario, robot), config, draw, payload),
        payload=payload,
        period=station.period,
        preview=scenario.reference.preview,
        camera_period=station.camera.period if config.camera_period is None else config.camera_period,
        camera_delay=station.camera.delay if config.camera_delay is None else config.camera_delay,
        command_delay=(
            drive.command_delay + drive.dead_time if config.command_delay is None else config.command_delay
        ),
        elasticity=config.elasticity or station.elasticity,
        takes_torque=station.kind == "simulated" and station.interface == "direct",
    )


class _Draw:
    """The random deviations of one seed; each kind is the same whatever the shares of the others are."""

    def __init__(self, config: ControllerModelConfig) -> None:
        mismatch = config.mismatch
        rng = np.random.default_rng(mismatch.seed)

        def factors(share: float, *shape: int) -> np.ndarray:
            return 1.0 + share * rng.uniform(-1.0, 1.0, shape)

        self.gears = factors(mismatch.stiffness, NUM_JOINTS)
        self.bearings = factors(mismatch.stiffness, NUM_JOINTS, 2)
        self.beams = factors(mismatch.stiffness, NUM_JOINTS, 3)
        self.friction = factors(mismatch.friction, NUM_JOINTS)
        self.payload = float(factors(mismatch.payload, 1)[0])


def _named_robot(scenario: Scenario, robot: RobotModel | None) -> RobotModel:
    name = scenario.servo.model.robot
    if not name or (robot is not None and robot.calibration.of):
        return robot or load_robot(scenario.robot)
    named = load_robot(name)
    if named.calibration.of and not is_same_robot(named.calibration.of, scenario.robot):
        raise ScenarioError(
            f"servo.model.robot: {named.name} was calibrated on '{named.calibration.of}', "
            f"the scenario has '{scenario.robot}'"
        )
    return named


def _believed_robot(
    robot: RobotModel, config: ControllerModelConfig, draw: _Draw, payload: float
) -> RobotModel:
    """The robot with the believed springs, friction and payload."""
    structure = 1.0 if config.structure is None else config.structure
    factors = Factors(
        gears=draw.gears * _per_joint(config.stiffness),
        bearings=draw.bearings * structure,
        beams=draw.beams * structure,
        friction=draw.friction * _per_joint(config.friction),
    )
    limits = robot.payload
    if config.payload_centre_mm:
        limits = replace(limits, center_of_mass=1e-3 * np.array(config.payload_centre_mm))
    is_own = config.payload is not None or config.mismatch.payload > 0.0
    if is_own and payload > limits.largest_mass > 0.0:
        # A belief may be wrong by more than a robot may carry; the inertia goes on in proportion.
        inertia = payload / limits.largest_mass * limits.inertia
        limits = replace(limits, largest_mass=payload, inertia=inertia)
    return varied(replace(robot, payload=limits), factors)


def _per_joint(given: list[float]) -> np.ndarray:
    """Factors of the joints, shape (6,), from none, one or six."""
    return np.ones(NUM_JOINTS) * (given or [1.0])
