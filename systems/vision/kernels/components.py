"""Connected bright regions and what their pixels add up to, in one pass over an image, compiled by numba.

A window is mostly dark. OpenCV would go over it three times, for a threshold, for the labels and for its own
statistics, which have no weighted sums; here only bright pixels cost more than a comparison.
"""

import numpy as np

from robots.compiled import compiled

_BLOCK = 64  # pixels of a row that are looked at in one go


@compiled
def components(pixels, level, most):
    """Sums over the pixels of components: neighbours, also across corners, that are brighter than a level.

    Args:
        pixels: brightness, (h, w) of uint8.
        level: brightness above which a pixel belongs to a component.
        most: an image with more pieces of components than that is no picture of markers, and has none.

    Returns:
        weighted: sums of w, wu, wv, wuu, wuv, wvv over each component with w the brightness above the level,
            (n, 6).
        plain: the same with w = 1, (n, 6).
        is_whole: whether a component stays off the edges of the image, (n,).
    """
    height, width = pixels.shape
    weighted, plain = np.zeros((16, 6)), np.zeros((16, 6))
    is_whole, parent = np.ones(16, np.bool_), np.arange(16)
    # Runs of bright pixels in this row and in the one above: first column, the one behind the last, label.
    above, here = np.empty((width // 2 + 1, 3), np.int64), np.empty((width // 2 + 1, 3), np.int64)
    count = num_above = 0
    for row in range(height):
        num_here = nearest = 0
        column = _next_bright(pixels, row, 0, level)
        while column < width:
            first = column
            w = wu = wuu = u = uu = 0
            while column < width and pixels[row, column] > level:
                excess = np.int64(pixels[row, column]) - level
                w, wu, wuu = w + excess, wu + excess * column, wuu + excess * column * column
                u, uu = u + column, uu + column * column
                column += 1
            label = -1
            while nearest < num_above and above[nearest, 1] < first:
                nearest += 1
            for k in range(nearest, num_above):
                if above[k, 0] > column:
                    break
                other = _root(parent, above[k, 2])
                label = other if label < 0 else min(label, other)
            if label < 0:
                label = count
                count += 1
                if count > most:
                    return weighted[:0], plain[:0], is_whole[:0]
                if count > len(parent):
                    weighted, plain, is_whole, parent = _doubled(weighted, plain, is_whole, parent)
            for k in range(nearest, num_above):
                if above[k, 0] > column:
                    break
                parent[_root(parent, above[k, 2])] = label
            _add(weighted, label, w, wu, wuu, row)
            _add(plain, label, column - first, u, uu, row)
            if row == 0 or row == height - 1 or first == 0 or column == width:
                is_whole[label] = False
            here[num_here, 0], here[num_here, 1], here[num_here, 2] = first, column, label
            num_here += 1
            column = _next_bright(pixels, row, column, level)
        above, here, num_above = here, above, num_here
    kept = 0
    for label in range(count):
        root = _root(parent, label)
        if root != label:  # a piece that turned out to belong to an earlier one
            weighted[root] += weighted[label]
            plain[root] += plain[label]
            is_whole[root] &= is_whole[label]
    for label in range(count):
        if parent[label] == label:
            weighted[kept], plain[kept], is_whole[kept] = weighted[label], plain[label], is_whole[label]
            kept += 1
    return weighted[:kept], plain[:kept], is_whole[:kept]


@compiled
def _next_bright(pixels, row, column, level):
    """The next column of a row from ``column`` on that is brighter than the level, or the width."""
    width = pixels.shape[1]
    while column < width:
        end = min(column + _BLOCK, width)
        brightest = np.uint8(0)
        for pixel in pixels[row, column:end]:
            brightest = max(brightest, pixel)
        if brightest > level:
            break
        column = end
    while column < width and pixels[row, column] <= level:
        column += 1
    return column


@compiled
def _add(sums, label, w, wu, wuu, row):
    """Adds a run of one row, v = row, to the sums of a component."""
    sums[label, 0] += w
    sums[label, 1] += wu
    sums[label, 2] += w * row
    sums[label, 3] += wuu
    sums[label, 4] += wu * row
    sums[label, 5] += w * row * row


@compiled
def _root(parent, label):
    while parent[label] != label:
        label = parent[label]
    return label


@compiled
def _doubled(weighted, plain, is_whole, parent):
    """The same with room for twice as many pieces."""
    n = len(parent)
    more = np.zeros((n, 6))
    return (
        np.concatenate((weighted, more)),
        np.concatenate((plain, more)),
        np.concatenate((is_whole, np.ones(n, np.bool_))),
        np.concatenate((parent, np.arange(n, 2 * n))),
    )
