"""Frames from three points, by least squares and in chains: Wilms' numbers, round trips, noise, refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from robots.metrology.frame_chain import FrameChain, chain_of_frames
from robots.metrology.frames import three_point_frame
from robots.metrology.least_squares import UndeterminedError
from robots.metrology.point_registration import register_points
from robots.pose import rotation_vector

# Wilms (2016), listings 2 and 3 (points), 4 (the second frame in the first), 7 (links and chain, in mm).
LISTING_2 = np.array([[1.01, 2, 0], [2, 2, 0], [1, 3, 0]])
LISTING_3 = np.array([[2, 1, 0], [2.01, 2, 0], [1, 1, 0]])
LISTING_4 = [[0.010000, -0.999950, 0, 0.99], [0.999950, 0.010000, 0, -1], [0, 0, 1, 0], [0, 0, 0, 1]]
LISTING_7 = np.array(
    [
        [[0.985230, 0.171207, 0.003152, -252.307704], [-0.171214, 0.985231, 0.002277, -174.796067],
         [-0.002715, -0.002783, 0.999992, 0.462192], [0, 0, 0, 1]],
        [[-0.517979, 0.855393, -0.000047, 236.817210], [-0.855389, -0.517977, 0.003032, -234.055211],
         [0.002569, 0.001611, 0.999995, 0.353946], [0, 0, 0, 1]],
        [[-0.329056, -0.944310, 0.001261, -233.017251], [0.944308, -0.329052, 0.002781, 79.421043],
         [-0.002211, 0.002106, 0.999995, 0.073087], [0, 0, 0, 1]],
        [[0.923591, -0.383376, 0.001418, -264.349646], [0.383375, 0.923593, 0.000398, 242.670564],
         [-0.001462, 0.000176, 0.999999, 0.445352], [0, 0, 0, 1]],
    ]
)  # fmt: skip
CHAIN_7 = np.array(
    [[0.999905, -0.012206, 0.006358, -1.205218], [0.012191, 0.999923, 0.002337, 1.215314],
     [-0.006386, -0.002259, 0.999977, -0.128655], [0, 0, 0, 1]]
)  # fmt: skip

MARKS = np.array([[0, 0, 0], [0.4, 0, 0], [0, 0.3, 0], [0.3, 0.2, 0.1], [0.1, 0.2, 0.3], [-0.1, 0.1, 0.2]])

poses = st.builds(
    lambda turn, p: RigidTransform(RotationMatrix(Rotation.from_rotvec(turn).as_matrix()), np.array(p)),
    st.tuples(*[st.floats(-1.8, 1.8)] * 3),
    st.tuples(*[st.floats(-5.0, 5.0)] * 3),
)


def close(X: RigidTransform, Y: RigidTransform, tolerance: float = 1e-12) -> bool:
    return X.IsNearlyEqualTo(Y, tolerance)


def test_the_frames_of_wilms_stand_as_he_prints_it():
    first, second = (three_point_frame(points).X_DK for points in (LISTING_2, LISTING_3))
    assert first.InvertAndCompose(second).GetAsMatrix4() == pytest.approx(np.array(LISTING_4), abs=1e-6)


def test_the_links_of_wilms_make_the_chain_that_he_prints():
    links = (RotationMatrix.ProjectToRotationMatrix(X[:3, :3]) for X in LISTING_7)
    chain = FrameChain(tuple(RigidTransform(R, X[:3, 3]) for R, X in zip(links, LISTING_7, strict=True)))
    # Six digits of a rotation leave 1e-4 mm of an arm of 250 mm.
    assert chain.X_0N.GetAsMatrix4() == pytest.approx(CHAIN_7, abs=2e-4)
    assert chain.closing_distance == pytest.approx(np.linalg.norm(CHAIN_7[:3, 3]), abs=2e-4)
    # The skew part of the printed product is its small angle.
    assert chain.closing_angle == pytest.approx(np.linalg.norm(rotation_vector(CHAIN_7[:3, :3])), abs=2e-6)


@given(poses, st.floats(0.01, 3.0), st.floats(0.01, 3.0), st.floats(-0.9, 0.9))
def test_the_points_of_a_frame_give_it_back_whatever_their_distance(X_DK, along_x, along_y, lean):
    frame = three_point_frame(
        np.array([X_DK @ p for p in ([0, 0, 0], [along_x, 0, 0], [lean * along_y, along_y, 0])])
    )
    assert close(frame.X_DK, X_DK)
    assert frame.skew == pytest.approx(-np.arctan(lean))


def test_a_fourth_point_tells_the_hand():
    points = MARKS[[0, 1, 2, 4]]
    assert close(three_point_frame(points).X_DK, RigidTransform())
    with pytest.raises(UndeterminedError, match="left-handed") as refusal:
        three_point_frame(points[[0, 2, 1, 3]])
    assert refusal.value.rows == (3,)


REFUSED_FRAMES = {
    "coincident": ([[0, 0, 0], [0, 0, 0], [0, 1, 0]], "point x is 0 mm from the origin", (1,)),
    "metres read as mm": (MARKS[:3] / 1000, "point x is 0.4 mm from the origin.*unit", (1,)),
    "collinear": ([[0, 0, 0], [1, 0, 0], [2, 0.1, 0]], "collinear: 2.86 degrees", (0, 1, 2)),
    "opposite": ([[0, 0, 0], [1, 0, 0], [-2, 0.1, 0]], "collinear: 177 degrees", (0, 1, 2)),
}


@pytest.mark.parametrize(("points", "reason", "rows"), REFUSED_FRAMES.values(), ids=REFUSED_FRAMES.keys())
def test_points_that_define_no_frame_are_refused(points, reason, rows):
    with pytest.raises(UndeterminedError, match=reason) as refusal:
        three_point_frame(np.array(points))
    assert refusal.value.rows == rows


@given(poses, st.integers(3, 6))
def test_registration_finds_the_frame_exactly(X_DK, count):
    fit = register_points(MARKS[:count], (X_DK @ MARKS[:count].T).T)
    assert close(fit.X_DK, X_DK)
    assert fit.scale == pytest.approx(1.0)
    assert fit.statistics.outliers == ()


def test_the_predicted_spread_of_a_registration_is_the_one_that_occurs():
    rng = np.random.default_rng(4)
    X_DK = RigidTransform(RotationMatrix(Rotation.from_rotvec([0.4, -1.0, 0.3]).as_matrix()), [1.0, 2.0, 3.0])
    sigmas = np.array([1, 1, 2, 1, 3, 1]) * 1e-4
    errors, predicted, covered = [], [], 0
    for _ in range(600):
        measured = (X_DK @ MARKS.T).T + sigmas[:, None] * rng.standard_normal(MARKS.shape)
        fit = register_points(MARKS, measured, (1e-4 / sigmas) ** 2)
        turn = X_DK.rotation().matrix() @ fit.X_DK.rotation().matrix().T
        errors.append([*rotation_vector(turn), *(X_DK.translation() - fit.X_DK.translation())])
        predicted.append(fit.statistics.covariance)
        covered += fit.statistics.covers(errors[-1], slice(0, 6))
    # 600 samples know a standard deviation to 3 %, and a share of 95 % to 0.9 %; three of each.
    spread = np.sqrt(np.diag(np.mean(predicted, axis=0)))
    assert np.std(errors, axis=0) == pytest.approx(spread, rel=0.09)
    assert covered / 600 == pytest.approx(0.95, abs=0.027)


def test_the_fit_has_the_least_squares():
    rng = np.random.default_rng(0)
    measured, weights = MARKS + 0.01 * rng.standard_normal(MARKS.shape), rng.uniform(1.0, 9.0, len(MARKS))
    fit = register_points(MARKS, measured, weights)

    def squares(step: np.ndarray) -> float:
        turned = MARKS @ (Rotation.from_rotvec(step[:3]).as_matrix() @ fit.X_DK.rotation().matrix()).T
        return float(weights @ np.sum((measured - turned - fit.X_DK.translation() - step[3:]) ** 2, axis=1))

    assert all(squares(1e-4 * rng.standard_normal(6)) > squares(np.zeros(6)) for _ in range(50))


def test_a_mark_that_was_hit_is_reported():
    rng = np.random.default_rng(1)
    measured = MARKS + 1e-5 * rng.standard_normal(MARKS.shape)
    measured[3] += [2e-3, 0.0, 0.0]
    assert register_points(MARKS, measured).statistics.outliers == (3,)


REFUSED_SETS = {
    "two": ((MARKS[:2], MARKS[:2]), "at least three points, got 2"),
    "line": ((np.outer(np.arange(5.0), [1, 2, 3]),) * 2, "nominal points are collinear"),
    "dot": ((MARKS, MARKS[:1] + np.zeros((6, 1))), "measured points coincide"),
    "units": ((MARKS, 1000.0 * MARKS), "1000 times as far apart"),
    "left-handed": ((MARKS, MARKS * [1, 1, -1]), "left-handed: the measured points are a mirror image"),
    "exchanged": ((MARKS, MARKS[:, [1, 0, 2]] + 1e-4), "left-handed"),
}


@pytest.mark.parametrize(("points", "reason"), REFUSED_SETS.values(), ids=REFUSED_SETS.keys())
def test_point_sets_that_fit_no_frame_are_refused(points, reason):
    with pytest.raises(UndeterminedError, match=reason):
        register_points(*points)


def walk(count: int, marks: np.ndarray, noise: float = 0.0) -> tuple[list[np.ndarray], list[RigidTransform]]:
    """Sights of a closed walk around ``count`` frames, and the frames in the room."""
    rng = np.random.default_rng(7)

    def somewhere() -> RigidTransform:
        turn = Rotation.from_rotvec(rng.uniform(-1.5, 1.5, 3)).as_matrix()
        return RigidTransform(RotationMatrix(turn), rng.uniform(-1.0, 1.0, 3))

    frames = [somewhere() for _ in range(count)]
    sights = []
    for j in range(count):
        X_DR = somewhere().inverse()
        for X_RK in (frames[j], frames[(j + 1) % count]):
            sights.append((X_DR @ X_RK @ marks.T).T + noise * rng.standard_normal(marks.shape))
    return sights, frames


@pytest.mark.parametrize("marks", [MARKS[:3], MARKS], ids=["three points", "six points"])
def test_a_closed_chain_closes_and_an_open_one_leads_to_its_end(marks):
    sights, frames = walk(4, marks)
    closed = chain_of_frames(sights, closed=True)
    assert closed.closing_distance < 1e-12
    assert closed.closing_angle < 1e-12
    assert close(chain_of_frames(sights[:6]).X_0N, frames[0].InvertAndCompose(frames[3]))


def test_more_marks_close_a_noisy_chain_better():
    errors = {n: chain_of_frames(walk(4, MARKS[:n], 1e-4)[0], closed=True) for n in (3, 6)}
    assert errors[6].closing_angle < errors[3].closing_angle
    assert errors[3].repeat_rms == (None,) * 4
    # Both sights scatter by 0.1 mm in three directions, and six parameters of 18 are fitted.
    rms = np.sqrt(np.mean(np.square([value or 0.0 for value in errors[6].repeat_rms])))
    assert rms == pytest.approx(1e-4 * np.sqrt(2 * 3 * 12 / 18), rel=0.3)


def test_a_chain_names_the_sight_that_is_wrong():
    sights, _ = walk(3, MARKS[:3])
    with pytest.raises(UndeterminedError, match=r"as large as when .* \(are units mixed") as refusal:
        chain_of_frames([*sights[:4], 1000.0 * sights[4], sights[5]], closed=True)
    assert refusal.value.part == 4
    with pytest.raises(UndeterminedError, match="at least three points, got 2") as refusal:
        chain_of_frames([*sights[:2], sights[2][:2], sights[3]])
    assert refusal.value.part == 2
    with pytest.raises(UndeterminedError, match="has 4 points, had 3"):
        chain_of_frames([*sights[:2], MARKS[:4], sights[3]])
    with pytest.raises(ValueError, match="an even number, got 5"):
        chain_of_frames(sights[:5])
