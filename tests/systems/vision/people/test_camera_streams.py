"""Video streams of real cameras: the newest frame of each, and none of a camera that has ended."""

import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from systems.vision.people.camera_streams import CameraStreams

pytestmark = pytest.mark.real_time

WIDTH, HEIGHT, PERIOD = 64, 48, 0.02  # px, s
GREY = {"left": 60, "right": 180}


def film(path: Path, grey: int, frames: int) -> None:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 1.0 / PERIOD, (WIDTH, HEIGHT))
    for _ in range(frames):
        writer.write(np.full((HEIGHT, WIDTH, 3), grey, np.uint8))
    writer.release()


def streams(folder: Path, size: tuple[int, int] = (WIDTH, HEIGHT)) -> CameraStreams:
    return CameraStreams(str(folder / "{camera}.avi"), list(GREY), size, PERIOD, delay=0.005)


def until(source: CameraStreams, is_enough, patience: float = 20.0) -> np.ndarray:
    """The first set of images that is enough."""
    deadline = time.perf_counter() + patience
    while time.perf_counter() < deadline:
        found = source.newest()
        if found is not None and is_enough(found.images):
            return found.images
        time.sleep(0.001)
    raise AssertionError("no such images came")


def test_a_set_has_the_newest_frame_of_each_camera_and_black_for_one_that_has_ended(tmp_path: Path):
    film(tmp_path / "left.avi", GREY["left"], frames=1000)
    film(tmp_path / "right.avi", GREY["right"], frames=10)
    source = streams(tmp_path)
    try:
        both = until(source, lambda images: (images.mean(axis=(1, 2, 3)) > 10.0).all())
        assert both.mean(axis=(1, 2, 3)) == pytest.approx(list(GREY.values()), abs=3.0)  # JPEG
        one = until(source, lambda images: images[0].any() and not images[1].any())
        assert one[0].mean() == pytest.approx(GREY["left"], abs=3.0)
    finally:
        source.close()


def test_images_of_another_size_and_a_stream_that_is_not_there_are_refused(tmp_path: Path):
    with pytest.raises(ValueError, match=r"left\.avi, \S+right\.avi: no video that can be read"):
        streams(tmp_path)
    for name, grey in GREY.items():
        film(tmp_path / f"{name}.avi", grey, frames=100)
    source = streams(tmp_path, (2 * WIDTH, HEIGHT))
    try:
        with pytest.raises(ValueError, match="images must be 128 x 48 px, got 64 x 48 px"):
            until(source, lambda images: False)
    finally:
        source.close()
