"""Whole images of real cameras from their video streams, the newest frame of each."""

import threading
import time
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from systems.samples import ImageSample

# ms, after which a stream that does not begin, or is silent, counts as ended
_LIMITS = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 10_000, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 5_000]


class CameraStreams:
    """Reads every stream in a thread of its own and keeps only its newest frame.

    A camera whose stream ends or stays silent is black from then on: it is not trusted any more, and with too
    few cameras left nobody can be told to be absent.
    """

    def __init__(
        self,
        address: str,
        cameras: Sequence[str],
        size: tuple[int, int],
        period: float,
        delay: float,
        now: Callable[[], float] = time.perf_counter,
    ) -> None:
        """Opens the streams.

        Args:
            address: what OpenCV can open, a URL or a file; ``{camera}`` in it stands for a name.
            cameras: names of n cameras.
            size: width and height of an image in px.
            period: s, between two sets.
            delay: s, from an exposure until its frame is read.
            now: the steady clock in s.

        Raises:
            ValueError: if a stream cannot be opened; the message names each of them.
        """
        self._size, self._period, self._delay, self._now = size, period, delay, now
        self._names, self._given, self._is_closed = list(cameras), -np.inf, False
        self._frames: list[tuple[float, np.ndarray] | None] = [None] * len(self._names)
        self._problem, self._unopened = "", set[str]()
        places = [address.replace("{camera}", name) for name in self._names]
        opened = [threading.Event() for _ in places]
        self._threads = [
            threading.Thread(target=self._read, args=(number, place, event), daemon=True)
            for number, (place, event) in enumerate(zip(places, opened, strict=True))
        ]
        for thread in self._threads:
            thread.start()
        for each in opened:
            each.wait()
        if self._unopened:
            self.close()
            # In the order of the cameras: which thread was first is chance.
            missing = ", ".join(place for place in places if place in self._unopened)
            raise ValueError(f"station.overview.source: {missing}: no video that can be read")

    def _read(self, number: int, place: str, opened: threading.Event) -> None:
        # Opened here, all at once: a stream may take seconds, in which the frames of the others would wait.
        is_live = "://" in place
        video = cv2.VideoCapture(place, cv2.CAP_FFMPEG, _LIMITS) if is_live else cv2.VideoCapture(place)
        if not video.isOpened():
            self._unopened.add(place)
        opened.set()
        # A file has no clock of its own, a live stream waits for the next frame anyway.
        pause = 0.0 if is_live else self._period
        while not self._is_closed:
            is_there, image = video.read()
            if not is_there:
                break
            if image.shape[1::-1] != self._size:
                width, height = self._size
                seen = f"{image.shape[1]} x {image.shape[0]}"
                self._problem = f"{place}: images must be {width} x {height} px, got {seen} px"
                break
            self._frames[number] = self._now() - self._delay, image
            if pause:
                time.sleep(pause)
        video.release()

    def newest(self) -> ImageSample | None:
        """The newest frames of all cameras as a set; None before the next is due.

        Raises:
            ValueError: if a camera has images of another size.
        """
        if self._problem:
            raise ValueError(self._problem)
        frames = list(self._frames)
        times = [frame[0] for frame in frames if frame is not None]
        if not times or max(times) < self._given + 0.9 * self._period:
            return None
        newest = max(times)
        width, height = self._size
        images = np.zeros((len(frames), height, width, 3), np.uint8)
        for image, frame in zip(images, frames, strict=True):
            # Frames of one set were taken within a period; what is older shows another place of the robot.
            if frame is not None and frame[0] > newest - self._period:
                image[:] = frame[1]
        self._given = newest
        return ImageSample(newest, images)

    def close(self) -> None:
        """Ends the threads."""
        self._is_closed = True
        for thread in self._threads:
            thread.join(1.0)
