"""Ways between configurations: clear along all their length, straight where possible, refused else."""

from itertools import pairwise

import numpy as np
import pytest

from robots.description.model import load_robot
from robots.description.placement import Placement
from robots.measurement_design.clear_ways import ClearWays
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations
from robots.measurement_design.design import design_measurements
from robots.measurement_design.obstacles import Obstacle

ROBOT = load_robot("irb1200")
CLEARANCE = 0.01
# A wall beside the robot's front, which the stretched arm cannot pass.
WALL = Obstacle("wall", np.array([0.1, 0.02, 1.0]), Placement(np.array([0.45, 0.0, 0.6])))
LEFT, RIGHT = (np.array([turn, 0.9, -0.6, 0.0, 0.5, 0.0]) for turn in (-0.8, 0.8))


def admissible(*obstacles: Obstacle) -> AdmissibleConfigurations:
    return AdmissibleConfigurations(ROBOT, AdmissibleConfig(clearance=CLEARANCE, obstacles=obstacles))


def everywhere(check: AdmissibleConfigurations, stations: list[np.ndarray]) -> bool:
    """Whether a way is admissible at very many places along it."""
    fine = np.linspace(0.0, 1.0, 300)[:, None]
    return all(check(start + fine * (end - start)).all() for start, end in pairwise(stations))


def test_a_way_that_is_clear_stays_straight():
    ways = ClearWays(ROBOT, admissible(), CLEARANCE)
    assert len(ways.between(LEFT, RIGHT)) == 0


@pytest.mark.slow
def test_around_a_wall_there_is_a_way_that_is_clear_all_along():
    check = admissible(WALL)
    ways = ClearWays(ROBOT, check, CLEARANCE)
    assert not ways.is_clear(LEFT, RIGHT)
    via = ways.between(LEFT, RIGHT)
    assert len(via) >= 1
    assert everywhere(check, [LEFT, *via, RIGHT])
    np.testing.assert_array_equal(via, ways.between(LEFT, RIGHT))  # the same seed, the same way


def test_what_has_no_way_is_refused():
    """The wall is as if everywhere but at the two ends."""
    ends = np.stack([LEFT, RIGHT])

    def only_ends(q: np.ndarray) -> np.ndarray:
        return (np.abs(q[:, None] - ends).max(axis=-1) < 1e-9).any(axis=1)

    with pytest.raises(ValueError, match=r"none was found from -45\.8"):
        ClearWays(ROBOT, only_ends, CLEARANCE).between(LEFT, RIGHT)


@pytest.mark.slow
def test_no_way_of_a_design_is_in_collision():
    """Between its configurations in the order of their visit, from joints at zero on."""
    check = admissible()
    q = design_measurements(ROBOT, 75, "b3", admissible=check).configurations
    q = np.vstack([np.zeros(6), q])
    vias = ClearWays(ROBOT, check, CLEARANCE).through(q)
    assert all(everywhere(check, [a, *via, b]) for (a, b), via in zip(pairwise(q), vias, strict=True))
