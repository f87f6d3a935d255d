"""The tool centre point by pivoting: Wilms' tool, his scatter, what is predicted, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robots.metrology.least_squares import UndeterminedError
from robots.metrology.tcp_calibration import tool_centre

# Wilms (2016), listings 9 and 10: tool, pivot and standard deviation of a pose; his listing has 12 poses.
TOOL = np.array([-1.747805, 44.586360, -87.648108]) / 1000  # m
PIVOT = np.array([-253.032904, 107.040686, -3.215224]) / 1000  # m
SIGMA = 0.443922 / 1000  # m
POSES = 12


def flange_poses(turns: np.ndarray, noise: np.ndarray | float = 0.0) -> np.ndarray:
    """Poses of the flange, turned by rotation vectors (n, 3), whose tip stands on the pivot but for noise."""
    X = np.tile(np.eye(4), (len(turns), 1, 1))
    X[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    X[:, :3, 3] = PIVOT - X[:, :3, :3] @ TOOL + noise
    return X


def tilts(rng: np.random.Generator, count: int = POSES, largest: float = 0.6) -> np.ndarray:
    return rng.uniform(-largest, largest, (count, 3))


@given(st.integers(0, 2**32 - 1), st.integers(4, 20))
def test_exact_poses_give_the_tool_exactly(seed: int, count: int):
    """From four on: one in some thousand triples turns about one axis only, which is refused."""
    tool = tool_centre(flange_poses(tilts(np.random.default_rng(seed), count, 1.0)))
    # A few random orientations may be nearly about one axis, which loses digits.
    assert tool.p_FE == pytest.approx(TOOL, abs=1e-11)
    assert tool.p_BP == pytest.approx(PIVOT, abs=1e-11)
    assert tool.statistics.outliers == ()


def test_the_tool_of_wilms_comes_back_with_his_scatter_and_within_the_confidence():
    # Of 3 n residuals the fit takes six away, so that the scatter of the tip itself is larger than his s0.
    per_axis = SIGMA * np.sqrt(POSES / (3 * POSES - 6))
    scatter, inside, one_by_one, runs = [], 0, np.zeros(6), 500
    rng = np.random.default_rng(9)
    for _ in range(runs):
        tool = tool_centre(flange_poses(tilts(rng), per_axis * rng.standard_normal((POSES, 3))))
        scatter.append([tool.standard_deviation_of_a_pose, tool.statistics.sigma])
        error = np.concatenate([tool.p_FE - TOOL, tool.p_BP - PIVOT])
        inside += tool.statistics.covers(error, slice(0, 6))
        one_by_one += np.abs(error) <= tool.statistics.half_widths()
    # A share of 95 % of 500 is known to 1 %: three of that. A scatter with 30 degrees of freedom to 0.6 %.
    assert inside / runs == pytest.approx(0.95, abs=0.03)
    assert one_by_one / runs == pytest.approx(np.full(6, 0.95), abs=0.03)
    rms = np.sqrt(np.mean(np.square(scatter), axis=0))
    assert rms == pytest.approx([SIGMA, per_axis], rel=0.02)


def test_the_two_standard_deviations_are_the_same_residuals_divided_differently():
    rng = np.random.default_rng(2)
    tool = tool_centre(flange_poses(tilts(rng), 1e-4 * rng.standard_normal((POSES, 3))))
    squares = np.sum(tool.residual**2)
    assert tool.statistics.degrees_of_freedom == 3 * POSES - 6
    assert tool.standard_deviation_of_a_pose == pytest.approx(np.sqrt(squares / POSES))
    assert tool.statistics.sigma == pytest.approx(np.sqrt(squares / (3 * POSES - 6)))


def test_tilting_in_one_plane_more_than_in_another_leaves_one_coordinate_uncertain():
    rng = np.random.default_rng(0)
    turns = tilts(rng, 40) * [1.0, 0.2, 0.2]  # mostly about x of the flange, along which little is seen
    tool = tool_centre(flange_poses(turns, 1e-4 * rng.standard_normal((40, 3))))
    x, y, z = tool.statistics.standard_deviations[:3]
    assert x > 3.0 * max(y, z)


@given(st.integers(0, POSES - 1), st.integers(0, 20))
def test_a_tip_that_slipped_is_named_and_the_rest_is_not(slipped: int, seed: int):
    rng = np.random.default_rng(seed)
    noise = 1e-4 * rng.standard_normal((POSES, 3))
    noise[slipped] += 5e-3 * np.array([0.6, -0.5, 0.6])
    assert slipped in tool_centre(flange_poses(tilts(rng), noise)).statistics.outliers


def test_false_alarms_are_as_rare_as_promised():
    rng = np.random.default_rng(5)
    alarms = sum(
        bool(tool_centre(flange_poses(tilts(rng), rng.normal(0.0, SIGMA, (POSES, 3)))).statistics.outliers)
        for _ in range(500)
    )
    # One in a hundred at most; 500 trials scatter by 2.2.
    assert alarms <= 5 + 3 * 2.2


def test_two_slipped_tips_are_both_named_the_worse_first():
    rng = np.random.default_rng(3)
    noise = 1e-4 * rng.standard_normal((POSES, 3))
    noise[2] += [4e-3, 0.0, 0.0]
    noise[7] += [0.0, 2e-3, 0.0]
    assert tool_centre(flange_poses(tilts(rng), noise)).statistics.outliers == (2, 7)


REFUSED = {
    "none": (np.zeros((0, 3)), "at least 3 poses, got 0"),
    "two": (np.array([[0.5, 0, 0], [0, 0.5, 0]]), "got 2; along the axis that turns one pose into the other"),
    "alike": (np.linspace(0.0, 0.02, 15).reshape(5, 3), "too much alike: 0.[0-9]+ degrees"),
    "one axis": (np.outer(np.linspace(0.0, 2.0, 6), [0, 0, 1]), r"one axis only, \(0.00, 0.00, 1.00\)"),
    "about -y": (np.outer(np.linspace(0.0, 2.0, 6), [0, -1, 0]), r"one axis only, \(0.00, 1.00, 0.00\)"),
}


@pytest.mark.parametrize(("turns", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_poses_that_leave_the_tool_unknown_are_refused(turns, reason):
    with pytest.raises(UndeterminedError, match=reason):
        tool_centre(flange_poses(turns))


@pytest.mark.parametrize("seed", range(5))
def test_angles_in_another_order_leave_no_tip_on_one_spot(seed: int):
    poses = flange_poses(tilts(np.random.default_rng(seed), largest=1.0))
    poses[:, :3, :3] = np.swapaxes(poses[:, :3, :3], 1, 2)  # of the base in the flange
    with pytest.raises(UndeterminedError, match=r"no tip stays on one spot: .* another order of them"):
        tool_centre(poses)
    still = flange_poses(
        tilts(np.random.default_rng(seed)), np.random.default_rng(seed).normal(0, 1e-3, (POSES, 3))
    )
    assert tool_centre(still).standard_deviation_of_a_pose < 3e-3


def test_two_poses_never_determine_the_tool():
    """Against Wilms (2016), who counts six equations for six unknowns: their matrix has rank five."""
    R = Rotation.from_rotvec([[0.5, 0.2, 0.1], [-0.3, 1.0, 0.4]]).as_matrix()
    matrix = np.concatenate([R, np.broadcast_to(-np.eye(3), R.shape)], axis=-1).reshape(6, 6)
    assert np.linalg.matrix_rank(matrix, tol=1e-9) == 5
