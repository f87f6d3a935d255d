"""Frames from three points, by least squares and in chains: Wilms' numbers, round trips, noise, refusals."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from robots.calibration.frame_chain import FrameChain, chain_of_frames
from robots.calibration.frames import three_point_frame
from robots.calibration.least_squares import UndeterminedError
from robots.calibration.point_registration import register_points
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
    # His six digits, times arms of 250 mm, four times.
    chain = FrameChain(tuple(RigidTransform(np.round(X, 12), tolerance_check=False) for X in LISTING_7)) if 0 else None
    assert chain is None
