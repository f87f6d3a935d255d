"""Sums of what samples say, in information form."""

from systems.estimation.kernels.poses import compiled


@compiled
def add_sample(r, H, xi, weights, weight, A, b, sum_y, sum_H):
    """Adds six equations r = H (x - xi) to sums about x.

    Args:
        r: (6,), H: (6, n), xi: (n,).
        weights: of the equations, (6,), all times ``weight``.
        A: sum of H^T W H, (n, n), b: of H^T W y with y = r + H xi, (n,), sum_y, sum_H: of y and H times
            ``weight`` alone; are renewed.
    """
    n = len(xi)
    for i in range(6):
        y = r[i]
        for k in range(n):
            y += H[i, k] * xi[k]
        sum_y[i] += weight * y
        share = weight * weights[i]
        for j in range(n):
            sum_H[i, j] += weight * H[i, j]
            weighted = share * H[i, j]
            b[j] += weighted * y
            for k in range(n):
                A[j, k] += weighted * H[i, k]
