"""Sums over the pixels of components, compiled by numba; imported when the first picture is looked at."""

from robots.kinematics.kernels import compiled


@compiled
def moments(pixels, labels, left, top, level, weighted, plain):
    """What the pixels of each component add up to, in one pass over a part of an image.

    Args:
        pixels: brightness, (h, w).
        labels: of components, zero for the background, (h, w).
        left, top: u and v of the first pixel in the image.
        level: brightness above which a pixel belongs to a component.
        weighted: sums of w, wu, wv, wuu, wuv, wvv over each component with w the brightness above the level,
            (n, 6); is added to.
        plain: the same with w = 1, (n, 6); is added to.
    """
    height, width = labels.shape
    for row in range(height):
        v = top + row
        for column in range(width):
            k = labels[row, column]
            if k == 0:
                continue
            u = left + column
            excess = float(pixels[row, column]) - level
            for sums, w in ((weighted, excess), (plain, 1.0)):
                wu, wv = w * u, w * v
                sums[k, 0] += w
                sums[k, 1] += wu
                sums[k, 2] += wv
                sums[k, 3] += wu * u
                sums[k, 4] += wu * v
                sums[k, 5] += wv * v
