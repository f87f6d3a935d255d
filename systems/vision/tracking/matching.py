"""Matching of blobs to markers whose approximate positions are known."""

import numpy as np


def match_to_prediction(predicted: np.ndarray, blobs: np.ndarray, gate: float) -> np.ndarray:
    """Pairs markers with blobs near their predicted images, and only where the pairing is unambiguous.

    A marker with two blobs inside its gate, or a blob inside the gates of two markers, is left unmatched:
    what is left out costs a little accuracy, what is confused costs the pose.

    Args:
        predicted: pixels of m markers in n cameras, shape (n, m, 2); NaN for a marker that is not expected.
        blobs: shape (n, b, 2), NaN where there is none.
        gate: px, how far a blob may be from its prediction.

    Returns:
        Indices of blobs, shape (n, m), -1 for none.
    """
    near = _squared_distances(predicted, blobs) < gate * gate  # (n, m, b)
    certain = near & (near.sum(2) == 1)[:, :, None] & (near.sum(1) == 1)[:, None]
    return np.where(certain.any(2), certain.argmax(2), -1)


def unexplained_share(predicted: np.ndarray, blobs: np.ndarray, reach: float) -> float:
    """How many of the blobs about the body are at no marker of it, from 0 to 1.

    About the body is inside the box of its markers' images in each camera; a blob further than ``reach`` px
    from all of them is at none. Arguments as in `match_to_prediction`.
    """
    low, high = np.fmin.reduce(predicted, axis=1) - reach, np.fmax.reduce(predicted, axis=1) + reach
    about = ((blobs >= low[:, None]) & (blobs <= high[:, None])).all(-1)
    explained = (_squared_distances(predicted, blobs) < reach * reach).any(1)
    return float((about & ~explained).sum() / max(about.sum(), 1))


def _squared_distances(predicted: np.ndarray, blobs: np.ndarray) -> np.ndarray:
    du = predicted[:, :, None, 0] - blobs[:, None, :, 0]
    dv = predicted[:, :, None, 1] - blobs[:, None, :, 1]
    return du * du + dv * dv
