"""The robot that truly stands in a simulated station, but for its geometric errors."""

from dataclasses import replace

import numpy as np

from diagrams.scenario.scenario import StationConfig
from robots.description.model import NUM_JOINTS, RobotModel
from robots.description.variation import Factors, varied, with_backlash


def true_robot(nominal: RobotModel, config: StationConfig) -> RobotModel:
    """The nominal robot with the station's springs, friction, backlash and centre of the payload.

    Random factors are uniform within plus and minus the shares of ``config.variation``; each kind stays the
    same whatever the shares of the others are.

    Raises:
        ValueError: if a share is not in [0, 1) or the centre of the payload is not three numbers.
    """
    variation = config.variation
    robot = with_payload_centre(with_backlash(nominal, variation.backlash), config.payload_centre_mm)
    shares = (variation.stiffness, variation.friction)
    if not all(0.0 <= share < 1.0 for share in shares):
        raise ValueError(f"station.variation: shares must be in [0, 1), got {shares}")
    if not any(shares):
        return robot
    rng = np.random.default_rng(variation.seed)

    def factors(share: float, *shape: int) -> np.ndarray:
        return 1.0 + share * rng.uniform(-1.0, 1.0, shape)

    gears = factors(variation.stiffness, NUM_JOINTS)
    bearings = factors(variation.stiffness, NUM_JOINTS, 2)
    beams = factors(variation.stiffness, NUM_JOINTS, 3)
    friction = factors(variation.friction, NUM_JOINTS)
    return varied(robot, Factors(gears, bearings, beams, friction))


def with_payload_centre(robot: RobotModel, centre_mm: list[float]) -> RobotModel:
    """A robot whose payload has its centre elsewhere, in mm in the frame of the flange; empty: as it is.

    Raises:
        ValueError: if it is not three finite numbers.
    """
    if not len(centre_mm):
        return robot
    centre = np.asarray(centre_mm, dtype=float)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise ValueError(f"payload_centre_mm must be three finite numbers, got {list(centre_mm)}")
    return replace(robot, payload=replace(robot.payload, center_of_mass=1e-3 * centre))
