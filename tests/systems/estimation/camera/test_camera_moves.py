"""What is of the robot and what of a camera that was moved, held against one that remembers every move."""

import numpy as np
import pytest

from systems.estimation.camera.camera_moves import CameraMoves

SIZE, MOST = 10, 3  # unknowns, and moves


@pytest.mark.parametrize("moves", range(MOST + 1))
def test_robot_and_covariance_are_those_of_a_filter_that_has_each_move_as_unknowns_of_its_own(moves: int):
    rng = np.random.default_rng(moves)
    B = rng.normal(size=(SIZE, 6))
    parts = CameraMoves(B)
    memory = parts.layout.view(np.zeros(parts.layout.size))
    A, xi = np.eye(SIZE), np.zeros(SIZE)
    P, x = np.eye(SIZE + 6 * MOST), np.zeros(SIZE + 6 * MOST)  # of the robot, then of all moves
    for number in range(moves + 1):
        if number:
            A = parts.begin(memory, A, xi)
        for _ in range(3):  # samples of four numbers, which see the robot and the moves so far
            H, y, R = rng.normal(size=(4, SIZE)), rng.normal(size=4), np.diag(rng.uniform(0.1, 1.0, 4))
            whole = np.hstack([H, *(H @ B * (k < number) for k in range(MOST))])
            gain = P @ whole.T @ np.linalg.inv(whole @ P @ whole.T + R)
            P, x = P - gain @ whole @ P, x + gain @ (y - whole @ x)
            b, A = A @ xi + H.T @ np.linalg.solve(R, y), A + H.T @ np.linalg.solve(R, H)
            xi = np.linalg.solve(A, b)
    assert parts.robot(memory, xi) == pytest.approx(x[:SIZE], abs=1e-10)
    assert parts.covariance(memory, np.linalg.inv(A)) == pytest.approx(P[:SIZE, :SIZE], abs=1e-10)
