"""Matching of blobs to markers whose approximate positions are known."""

import numpy as np

from systems.vision import kernels


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
    return kernels.frames.match(predicted, blobs, gate)


def unexplained_share(predicted: np.ndarray, blobs: np.ndarray, reach: float) -> float:
    """How many of the blobs about the body are at no marker of it, from 0 to 1.

    About the body is inside the box of its markers' images in each camera; a blob further than ``reach`` px
    from all of them is at none. Arguments as in `match_to_prediction`.
    """
    strange, about = kernels.frames.unexplained(predicted, blobs, reach)
    return strange / max(about, 1)
