"""What a detection network sees in a frame of a video, and how long a picture takes, on one core and on all.

``python -m experiments.watch.network_bench NETWORK VIDEO [FRAME] [PICTURE.png]``, for example frame 200 of
``vtest.avi`` from Debian's ``opencv-doc``. The picture has the boxes in it, for who counts the people.
"""

import statistics
import sys
import time

import cv2
import numpy as np

from systems.vision.people.person_networks import PersonNetwork

_REPEATS = 30


def main(network: str, video: str, frame: int = 200, picture: str = "") -> None:
    """Prints boxes with their scores and the time for a picture. Exits with a line if it cannot."""
    film = cv2.VideoCapture(video)
    film.set(cv2.CAP_PROP_POS_FRAMES, frame)
    is_there, image = film.read()
    if not is_there:
        sys.exit(f"{video}: no frame {frame} that can be read")
    looks, cores = PersonNetwork(network), cv2.getNumThreads()
    boxes, scores = looks.people(image)
    for box, score in zip(np.rint(boxes).astype(int).tolist(), scores, strict=True):
        print(f"{score:.2f} at {box}")
        cv2.rectangle(image, box[:2], box[2:], (80, 220, 80), 2)
    print(f"{len(boxes)} boxes; a picture takes")
    for threads in sorted({1, cores}):
        cv2.setNumThreads(threads)
        spent = [_time(looks, image) for _ in range(_REPEATS)]
        print(f"{statistics.median(spent):.0f} ms with threads: {threads}; {min(spent):.0f} at best")
    if picture and not cv2.imwrite(picture, image):
        sys.exit(f"{picture}: cannot be written")


def _time(looks: PersonNetwork, image: np.ndarray) -> float:
    """Of one picture by the clock, in ms."""
    began = time.perf_counter()
    looks.people(image)
    return 1e3 * (time.perf_counter() - began)


if __name__ == "__main__":
    given = sys.argv[1:]
    if len(given) < 2:
        sys.exit(__doc__)
    main(given[0], given[1], int(given[2]) if len(given) > 2 else 200, given[3] if len(given) > 3 else "")
