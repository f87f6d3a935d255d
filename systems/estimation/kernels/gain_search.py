"""Following errors of drives with many gains, and sums for what fits what motors did with each of them."""

import numpy as np

from robots.compiled import compiled


@compiled
def follow(steps, torques, last, z):
    """Goes on by a period with each set of gains.

    Args:
        steps: (n, 6, 2, 4), of n sets, as of `drive_gains.filter_steps`.
        torques: (k, 6), that are missing now; last: (k, 6), a period ago, are renewed.
        z: (n, k, 6, 2), integral of the error, and error; is renewed.
    """
    for s in range(steps.shape[0]):
        for i in range(6):
            one, two = steps[s, i, 0], steps[s, i, 1]
            for k in range(torques.shape[0]):
                integral, e, before = z[s, k, i, 0], z[s, k, i, 1], last[k, i]
                change = torques[k, i] - before
                z[s, k, i, 0] = one[0] * integral + one[1] * e + one[2] * before + one[3] * change
                z[s, k, i, 1] = two[0] * integral + two[1] * e + two[2] * before + two[3] * change
    for k in range(torques.shape[0]):
        for i in range(6):
            last[k, i] = torques[k, i]


@compiled
def add(z, late, left, behind, A, b, square):
    """Adds an instant to the sums of least squares.

    Args:
        z: as of `follow`.
        late: (2, 6) rad/s, what a time shifts: the rate of the commands, and how a planner smooths it.
        left: (n,), of what motors were behind by at first, with each set of gains.
        behind: rad, by which motors are behind what they were told, (6,).
        A: (n, 6, k + 4, k + 4), its lower half; b: (n, 6, k + 4); square: (6,); are renewed. After the
            columns of the torques come those of ``late``, a constant, and that of ``left``.
    """
    k = z.shape[1]
    x = np.empty(k + 4)
    for i in range(6):
        square[i] += behind[i] * behind[i]
        x[k], x[k + 1], x[k + 2] = late[0, i], late[1, i], 1.0
        for s in range(z.shape[0]):
            x[k + 3] = left[s]
            for j in range(k):
                x[j] = z[s, j, i, 1]
            for j in range(k + 4):
                b[s, i, j] += x[j] * behind[i]
                for m in range(j + 1):
                    A[s, i, j, m] += x[j] * x[m]
