"""Distances of many points, compiled by numba; a monitor imports this module when it is made."""

import math

from robots.compiled import compiled


@compiled
def nearest(points, start, end, radius):
    """The smallest distance in m of points (n, 3) from the surfaces of k capsules; negative within one.

    Args:
        points: in the world in m, at least one.
        start, end: of the axes of the capsules in the world in m, (k, 3).
        radius: of the capsules in m, (k,).
    """
    found = math.inf
    for k in range(len(radius)):
        x, y, z = start[k, 0], start[k, 1], start[k, 2]
        a, b, c = end[k, 0] - x, end[k, 1] - y, end[k, 2] - z
        length2 = max(a * a + b * b + c * c, 1e-12)
        least = math.inf
        for i in range(len(points)):
            u, v, w = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            share = min(1.0, max(0.0, (u * a + v * b + w * c) / length2))
            u, v, w = u - share * a, v - share * b, w - share * c
            least = min(least, u * u + v * v + w * w)
        found = min(found, math.sqrt(least) - radius[k])
    return found
