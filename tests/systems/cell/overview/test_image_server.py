"""A virtual cell's images over HTTP, read as those of network cameras are."""

import threading
import time

import numpy as np
import pytest

from systems.cell.overview.image_server import ImageServer
from systems.vision.people.camera_streams import CameraStreams

pytestmark = [pytest.mark.slow, pytest.mark.real_time]

WIDTH, HEIGHT, PERIOD = 64, 48, 0.05  # px, s
GREY = {"left": 60, "right": 180}


class Publisher:
    """Publishes the same images again and again."""

    def __init__(self, server: ImageServer, images: np.ndarray) -> None:
        self._server, self._images, self._ended = server, images, threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.wait(PERIOD):
            self._server.publish(self._images)

    def end(self) -> None:
        self._ended.set()
        self._thread.join()


def test_what_is_published_arrives_camera_by_camera_and_a_camera_that_is_not_there_is_refused():
    images = np.empty((2, HEIGHT, WIDTH, 3), np.uint8)
    images[0], images[1] = GREY.values()
    server = ImageServer(list(GREY), port=0)
    address = f"http://127.0.0.1:{server.port}/{{camera}}"

    def streams(names: list[str]) -> CameraStreams:
        return CameraStreams(address, names, (WIDTH, HEIGHT), PERIOD, delay=0.0)

    with pytest.raises(ValueError, match="/middle: no video that can be read"):
        streams(["middle"])
    publisher = Publisher(server, images)
    source = streams(list(GREY))
    try:
        deadline = time.monotonic() + 20.0
        while (found := source.newest()) is None or not found.images.any(axis=(1, 2, 3)).all():
            assert time.monotonic() < deadline, "no set with both cameras"
            time.sleep(0.005)
        np.testing.assert_allclose(found.images.mean(axis=(1, 2, 3)), list(GREY.values()), atol=2.0)  # JPEG
        assert server.are_all_seen
    finally:
        publisher.end()
        source.close()
        server.close()
