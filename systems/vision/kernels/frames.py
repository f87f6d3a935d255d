"""What a tracker does in every frame, as loops that numba compiles.

Ten cameras with ten markers are so few numbers that an operation of numpy on them costs more than they do.
"""

import numpy as np

from robots.compiled import compiled


@compiled
def linearize(focal, center, radial, tangential, R_CW, p_CW, p_E, X_WE):
    """Pixels of markers at a pose and their derivatives by it; `pose_refinement.linearize` says how.

    The lens is that of `systems.vision.camera_model`.

    Args:
        focal, center, radial, tangential: of n cameras, (n, 2), (n, 2), (n, 3), (n, 2).
        R_CW, p_CW: the world in the cameras, (n, 3, 3) and (n, 3).
        p_E: markers in the tool's frame, (m, 3).
        X_WE: the tool's frame in the world, (4, 4).
    """
    n, m = len(focal), len(p_E)
    pixels, J = np.empty((n, m, 2)), np.empty((n, m, 2, 6))
    arm = np.empty((m, 3))
    for k in range(m):
        for i in range(3):
            arm[k, i] = X_WE[i, 0] * p_E[k, 0] + X_WE[i, 1] * p_E[k, 1] + X_WE[i, 2] * p_E[k, 2]
    for c in range(n):
        fu, fv, p1, p2 = focal[c, 0], focal[c, 1], tangential[c, 0], tangential[c, 1]
        k1, k2, k3 = radial[c, 0], radial[c, 1], radial[c, 2]
        for k in range(m):
            a, b, d = arm[k, 0], arm[k, 1], arm[k, 2]
            X, Y, Z = a + X_WE[0, 3], b + X_WE[1, 3], d + X_WE[2, 3]
            z = R_CW[c, 2, 0] * X + R_CW[c, 2, 1] * Y + R_CW[c, 2, 2] * Z + p_CW[c, 2]
            if not z > 0.0:
                pixels[c, k] = np.nan
                J[c, k] = np.nan
                continue
            x = (R_CW[c, 0, 0] * X + R_CW[c, 0, 1] * Y + R_CW[c, 0, 2] * Z + p_CW[c, 0]) / z
            y = (R_CW[c, 1, 0] * X + R_CW[c, 1, 1] * Y + R_CW[c, 1, 2] * Z + p_CW[c, 1]) / z
            r2 = x * x + y * y
            scale = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
            across = 2.0 * (p1 * y + p2 * x)
            pixels[c, k, 0] = fu * (x * (scale + across) + p2 * r2) + center[c, 0]
            pixels[c, k, 1] = fv * (y * (scale + across) + p1 * r2) + center[c, 1]
            slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2))
            xx = scale + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
            yy = scale + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
            xy = slope * x * y + 2.0 * (p1 * x + p2 * y)
            for row, f, du, dv in ((0, fu, xx, xy), (1, fv, xy, yy)):
                du, dv = f / z * du, f / z * dv
                dz = -(du * x + dv * y)
                jx = du * R_CW[c, 0, 0] + dv * R_CW[c, 1, 0] + dz * R_CW[c, 2, 0]
                jy = du * R_CW[c, 0, 1] + dv * R_CW[c, 1, 1] + dz * R_CW[c, 2, 1]
                jz = du * R_CW[c, 0, 2] + dv * R_CW[c, 1, 2] + dz * R_CW[c, 2, 2]
                row_of_J = J[c, k, row]
                row_of_J[0], row_of_J[1], row_of_J[2] = b * jz - d * jy, d * jx - a * jz, a * jy - b * jx
                row_of_J[3], row_of_J[4], row_of_J[5] = jx, jy, jz
    return pixels, J


@compiled
def normal_equations(predicted, J, pixels):
    """The sums J^T J (6, 6) and J^T e (6,) over the pixels that are seen and predicted, and their number.

    Args:
        predicted, pixels: shape (n, k, 2), NaN for none.
        J: of the predicted ones by the pose, (n, k, 2, 6).
    """
    information, right = np.zeros((6, 6)), np.zeros(6)
    count = 0
    for c in range(predicted.shape[0]):
        for k in range(predicted.shape[1]):
            if np.isnan(pixels[c, k, 0] - predicted[c, k, 0]):
                continue
            count += 1
            for row in range(2):
                e = pixels[c, k, row] - predicted[c, k, row]
                for i in range(6):
                    g = J[c, k, row, i]
                    right[i] += g * e
                    for j in range(i + 1):
                        information[i, j] += g * J[c, k, row, j]
    for i in range(6):
        for j in range(i):
            information[j, i] = information[i, j]
    return information, right, count


@compiled
def squared_residual(predicted, J, pixels, step):
    """The sum of the squares of what a step (6,) leaves of the errors, to first order."""
    total = 0.0
    for c in range(predicted.shape[0]):
        for k in range(predicted.shape[1]):
            if np.isnan(pixels[c, k, 0] - predicted[c, k, 0]):
                continue
            for row in range(2):
                left = pixels[c, k, row] - predicted[c, k, row]
                for i in range(6):
                    left -= J[c, k, row, i] * step[i]
                total += left * left
    return total


@compiled
def match(predicted, blobs, gate):
    """Pairs that are unambiguous; `matching.match_to_prediction` says which, with the same arguments."""
    n, m, b = predicted.shape[0], predicted.shape[1], blobs.shape[1]
    index = np.full((n, m), -1)
    for c in range(n):
        claims = np.zeros(b, np.int64)  # how many markers a blob may belong to
        for k in range(m):
            candidates, last = 0, -1
            for j in range(b):
                du, dv = predicted[c, k, 0] - blobs[c, j, 0], predicted[c, k, 1] - blobs[c, j, 1]
                if du * du + dv * dv < gate * gate:
                    claims[j] += 1
                    candidates, last = candidates + 1, j
            if candidates == 1:
                index[c, k] = last
        for k in range(m):
            if index[c, k] >= 0 and claims[index[c, k]] > 1:
                index[c, k] = -1
    return index


@compiled
def touching(pixels, diameters):
    """Which images touch; `marker_images.touching` says how, with the same arguments."""
    n, m = diameters.shape
    close = np.zeros((n, m, m), np.bool_)
    for c in range(n):
        for i in range(m):
            for j in range(i):
                du, dv = pixels[c, i, 0] - pixels[c, j, 0], pixels[c, i, 1] - pixels[c, j, 1]
                reach = 0.5 * (diameters[c, i] + diameters[c, j])
                close[c, i, j] = close[c, j, i] = du * du + dv * dv < reach * reach
    return close


@compiled
def unexplained(predicted, blobs, reach):
    """How many blobs about the body are at no marker and how many there are; as `unexplained_share` says."""
    strange = about = 0
    for c in range(predicted.shape[0]):
        low, high = np.full(2, np.inf), np.full(2, -np.inf)
        for k in range(predicted.shape[1]):
            for i in range(2):
                if not np.isnan(predicted[c, k, i]):
                    low[i] = min(low[i], predicted[c, k, i] - reach)
                    high[i] = max(high[i], predicted[c, k, i] + reach)
        for j in range(blobs.shape[1]):
            u, v = blobs[c, j, 0], blobs[c, j, 1]
            if not (low[0] <= u <= high[0] and low[1] <= v <= high[1]):
                continue
            about += 1
            for k in range(predicted.shape[1]):
                du, dv = predicted[c, k, 0] - u, predicted[c, k, 1] - v
                if du * du + dv * dv < reach * reach:
                    break
            else:
                strange += 1
    return strange, about


@compiled
def weighted(of_markers, share):
    """What holds for rows of shares (n, s, m): the weighted sums of what holds for the markers, (n, m, d).

    A marker that is NaN has no share in anything; a row of zeros gives NaN.
    """
    n, s, m = share.shape
    mean = np.zeros((n, s, of_markers.shape[2]))
    for c in range(n):
        for i in range(s):
            if not share[c, i].any():
                mean[c, i] = np.nan
            for k in range(m):
                if share[c, i, k] != 0.0:
                    for j in range(of_markers.shape[2]):
                        if not np.isnan(of_markers[c, k, j]):
                            mean[c, i, j] += share[c, i, k] * of_markers[c, k, j]
    return mean
