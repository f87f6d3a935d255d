"""Designs of measurements: exact gains, proven bounds, allowed places, short ways."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.description.model import load_robot
from robots.kinematics.forward import Kinematics
from robots.measurement_design.candidate_grid import AxisRange, CandidateGrid
from robots.measurement_design.candidates import Candidates
from robots.measurement_design.constraints import AdmissibleConfig, AdmissibleConfigurations, View
from robots.measurement_design.criteria import NAMES, SmallestEigenvalue, criterion
from robots.measurement_design.design import MeasurementDesign, design_measurements
from robots.measurement_design.visiting_order import visiting_order, way_length
from tests.robots.urdfs import published

ROBOT = load_robot("irb1200")
COARSE = tuple(
    AxisRange(a, b, 5) for a, b in ((-100, 100), (-45, 90), (-90, 30), (-180, 180), (-90, 90), (-180, 180))
)


@pytest.fixture(scope="module")
def grid() -> CandidateGrid:
    return CandidateGrid(ROBOT)


@pytest.fixture(scope="module")
def best() -> MeasurementDesign:
    """The source's task: 75 configurations of 13 samples per axis, no restriction."""
    return design_measurements(ROBOT)


def test_the_grid_is_the_source_s_and_a_full_turn_counts_once(grid: CandidateGrid):
    assert grid.shape == (13, 13, 13, 12, 13, 12)  # 13^6 with +180 degrees twice at joints 4 and 6
    assert len(np.unique(grid.configurations(np.arange(0, len(grid), 97)), axis=0)) == len(
        range(0, len(grid), 97)
    )


@pytest.mark.parametrize("position_only", [False, True])
def test_screening_is_exact(position_only: bool):
    """Rounding of products of matrices, relative to the largest gain."""
    grid, rng = CandidateGrid(ROBOT, COARSE, position_only), np.random.default_rng(0)
    root = rng.normal(size=(grid.parameters.rank, 3))
    numbers = rng.integers(0, len(grid), 200)
    gains = grid.screen(root)[numbers]
    direct = np.einsum("nij,ij->n", grid.information(grid.configurations(numbers)), root @ root.T)
    np.testing.assert_allclose(gains, direct, atol=1e-12 * direct.max())


def test_the_design_is_better_than_the_source_s_and_nearly_as_good_as_any(best: MeasurementDesign):
    """Probst (2024), section 4.2, reached 3.3 for 75 configurations in 26 h."""
    assert best.b3 == pytest.approx(best.value)
    assert best.value >= 3.34
    assert best.bound <= 3.3605
    assert len(np.unique(best.configurations, axis=0)) == 75


# Two corners of a box within reach, in m; the smaller one of the UR10 leaves a hundredth of the grid.
BOXES = [
    ("irb1200", (0.2, -0.5, 0.1, 0.8, 0.5, 0.9)),
    ("irb140", (0.2, -0.5, 0.1, 0.8, 0.5, 0.9)),
    ("kr16", (0.6, -0.8, 0.3, 1.5, 0.8, 1.5)),
    ("puma560", (0.3, -0.5, 0.3, 0.8, 0.5, 1.1)),
    ("ur10", (0.3, -0.6, 0.1, 1.0, 0.6, 1.0)),
    ("ur10", (0.4, -0.4, 0.2, 0.9, 0.4, 0.8)),
    ("ur5", (0.2, -0.5, 0.1, 0.7, 0.5, 0.7)),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "corners"), [*((name, None) for name in sorted({name for name, _ in BOXES})), *BOXES]
)
def test_any_robot_has_a_design_within_a_hundredth_of_the_bound(name: str, corners: tuple[float, ...] | None):
    """With its own ranges, floor and arm, anywhere or in a box."""
    robot = load_robot(str(published("ur5_robot.urdf")) if name == "ur5" else name)
    box = None if corners is None else (np.array(corners[:3]), np.array(corners[3:]))
    admissible = AdmissibleConfigurations(robot, AdmissibleConfig(box=box))
    design = design_measurements(robot, admissible=admissible)
    assert 0.99 * design.bound <= design.value <= design.bound
    assert admissible(design.configurations).all()


def test_one_screening_proves_the_bound(best: MeasurementDesign, grid: CandidateGrid):
    """For W of trace one no N candidates have a smallest eigenvalue above N max tr(W Theta^T Theta)."""
    assert np.sum(np.square(best.certificate)) == pytest.approx(1.0, abs=1e-12)
    assert 75 * grid.screen(best.certificate).max() == pytest.approx(best.bound, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@given(seed=st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_a_gradient_bounds_its_criterion_everywhere(name: str, seed: int):
    """The inequality behind every bound: value(M') <= tr(G(M) M'), with equality at M."""
    grid = CandidateGrid(ROBOT, COARSE)
    goal, rng = criterion(name, ROBOT, grid), np.random.default_rng(seed)
    M, other = (
        grid.information(grid.configurations(rng.integers(0, len(grid), 40))).sum(axis=0) for _ in range(2)
    )
    root = goal.gradient_root(M)
    assert goal.value(other) <= np.sum((other @ root) * root) * (1.0 + 1e-9)
    if name != "b3":  # whose gradient is that of a soft minimum
        assert np.sum((M @ root) * root) == pytest.approx(goal.value(M), rel=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_what_an_exchange_brings_is_known_to_the_second_order(name: str):
    """Against central differences of the criterion, for B3 of its soft minimum; 1e-4 is their own error."""
    grid, rng = CandidateGrid(ROBOT, COARSE), np.random.default_rng(0)
    goal = SmallestEigenvalue(10.0) if name == "b3" else criterion(name, ROBOT, grid)
    information = grid.information(grid.configurations(rng.integers(0, len(grid), 40)))
    M, step = information.sum(axis=0), 1e-2
    sharpness = 10.0 / np.linalg.eigvalsh(M)[0]

    def value(share: float) -> float:
        there = M + share * (information[0] - information[1])
        if name == "b3":
            return -float(np.log(np.sum(np.exp(-sharpness * np.linalg.eigvalsh(there)))) / sharpness)
        return float(goal.value(there))

    order = goal.second_order(M, information[:2])
    slope, bend = order.slopes[0] - order.slopes[1], order.bends[0] - order.bends[1]
    first, second = (value(step) - value(-step)) / (2.0 * step), value(step) - 2.0 * value(0.0) + value(-step)
    assert slope == pytest.approx(first, rel=1e-3)
    assert order.lift * slope**2 - bend @ bend == pytest.approx(second / step**2, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["d", "i"])
def test_other_criteria_come_close_to_their_bounds_too(name: str):
    design = design_measurements(ROBOT, 40, name, ranges=COARSE)
    assert 0.97 * design.bound < design.value <= design.bound
    assert design.b3 < design_measurements(ROBOT, 40, "b3", ranges=COARSE).b3


def test_a_position_only_design_sees_what_positions_can_show():
    design = design_measurements(ROBOT, 40, position_only=True, ranges=COARSE)
    assert 0.95 * design.bound < design.value <= design.bound


@pytest.mark.slow
def test_no_direction_is_lost_on_the_way():
    """On the full grid one candidate may serve one parameter alone; dropped, the rest would see nothing."""
    design = design_measurements(ROBOT, 40, position_only=True)
    assert 0.98 * design.bound < design.value <= design.bound


@pytest.mark.slow
def test_the_same_seed_gives_the_same_design():
    once, again, other = (design_measurements(ROBOT, 20, ranges=COARSE, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(once.configurations, again.configurations)
    assert not np.array_equal(once.configurations, other.configurations)


@pytest.mark.slow
def test_only_allowed_configurations_are_chosen_and_the_bound_is_theirs():
    allowed = AdmissibleConfigurations(ROBOT, AdmissibleConfig(view=View()))
    design = design_measurements(ROBOT, 30, ranges=COARSE, admissible=allowed)
    assert allowed(design.configurations).all()
    assert design.num_refused > 0
    grid = CandidateGrid(ROBOT, COARSE)
    everywhere = grid.configurations(np.arange(len(grid)))
    gains = grid.screen(design.certificate)
    best_allowed = next(k for k in np.argsort(-gains) if allowed(everywhere[k : k + 1])[0])
    assert design.bound == pytest.approx(30 * gains[best_allowed])


def test_the_floor_the_limits_and_the_camera_refuse():
    allowed = AdmissibleConfigurations(ROBOT)
    upright, into_floor = np.zeros(6), np.array([0.0, 1.9, 0.6, 0.0, 0.0, 0.0])
    beyond = np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert Kinematics(ROBOT).forward(into_floor)[2, 3] < 0.0
    found = allowed(np.array([upright, into_floor, beyond]))
    np.testing.assert_array_equal(found, [True, False, False])
    front = AdmissibleConfigurations(
        ROBOT, AdmissibleConfig(view=View((3.0, 0.0, 0.8), (0.0, 0.0, 1.0), 60.0))
    )
    plates = np.array([[0.0, 0.0, 0.0, 0.0, angle, 0.0] for angle in np.deg2rad([-80.0, 0.0, 80.0])])
    normals = Kinematics(ROBOT).forward(plates)[:, :3, 2]
    assert np.array_equal(front(plates), normals[:, 0] > 0.5)


def test_too_few_measurements_and_impossible_restrictions_are_refused():
    with pytest.raises(ValueError, match="count must be between 5, which 30 parameters need"):
        design_measurements(ROBOT, 4)
    with pytest.raises(ValueError, match="random candidate configurations are admissible"):
        design_measurements(ROBOT, 20, ranges=COARSE, admissible=lambda q: np.zeros(len(q), dtype=bool))
    with pytest.raises(ValueError, match="criterion must be one of b3, d, i, got 'a'"):
        design_measurements(ROBOT, 20, "a", ranges=COARSE)
    with pytest.raises(ValueError, match="joint 2 needs two samples or more in an increasing range"):
        CandidateGrid(ROBOT, (COARSE[0], AxisRange(10, -10), *COARSE[2:]))


def test_the_best_candidates_of_a_screening_are_the_best_allowed_ones():
    grid = CandidateGrid(ROBOT, COARSE)
    candidates = Candidates(grid, lambda q: q[:, 0] > 0.0)
    root = SmallestEigenvalue().gradient_root(np.diag(np.arange(1.0, 31.0)))
    numbers, gains = candidates.best(root, 10, without=np.array([5]))
    everything = grid.screen(root).copy()
    everything[grid.configurations(np.arange(len(grid)))[:, 0] <= 0.0] = -np.inf
    np.testing.assert_allclose(gains, np.sort(everything)[::-1][:10])
    assert (grid.configurations(numbers)[:, 0] > 0.0).all()


@pytest.mark.slow
def test_the_way_is_short():
    """With seven places all ways can be compared; 2-opt comes within a tenth, and never repeats a place."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(-2.0, 2.0, (7, 6))
        order = visiting_order(q, np.zeros(6))
        assert sorted(order) == list(range(7))
        shortest = min(way_length(q[list(way)], np.zeros(6)) for way in permutations(range(7)))
        assert way_length(q[order], np.zeros(6)) <= 1.1 * shortest
