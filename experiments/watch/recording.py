"""Recorded images of a cell: a folder with a folder of pictures or a video of each camera, and the joints.

Or a single video in which every frame is a set: the images of all cameras side by side, row by row in the
order of the cell, with the joints in a table of its name, NAME.csv.

``joints.csv`` has the columns ``time_s`` and ``q1_rad`` to ``q6_rad`` and a line for each set of images. A
camera is a folder of its name with pictures in the order of their names, in which numbers count as such (2
before 10), or a video NAME.mp4, .avi or .mkv. A camera that ends before the joints do is blind from then on.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from experiments.cli.console import count
from robots.description.model import NUM_JOINTS
from robots.text_table import TextTableError, finite_number, parse_fields, read_text

COLUMNS = ("time_s", *(f"q{number}_rad" for number in range(1, NUM_JOINTS + 1)))
JOINTS = "joints.csv"
_VIDEOS, _PICTURES = (".mp4", ".avi", ".mkv"), {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff"}
_SLOWEST = 4.0  # s, between sets of images: beyond it a time is in ms


class Recording:
    """Images and joints that were recorded together."""

    def __init__(self, folder: str | Path, cameras: Sequence[str]) -> None:
        """Opens a folder.

        Args:
            folder: that holds the recording, or a single video.
            cameras: names of the cameras of the cell, in its order.

        Raises:
            ValueError: if something is missing or cannot be read; one line that says what and where.
        """
        folder = Path(folder)
        is_video = folder.suffix.lower() in _VIDEOS and folder.is_file()
        if not (folder.is_dir() or is_video):
            raise ValueError(
                f"--images {folder}: must be a folder with {JOINTS} and a folder of pictures or a video of "
                "each camera, or a video of all of them"
            )
        self._table = folder.with_suffix(".csv") if is_video else folder / JOINTS
        table = _joints(self._table)
        self.times, self.joints = table[:, 0], table[:, 1:]
        self._cameras = list(cameras)
        self._video = folder if is_video else None
        self._sources = [] if is_video else [_source(folder, name) for name in cameras]
        self.ended: dict[str, int] = {}  # cameras whose images ended before the joints, with their number
        self._beyond: dict[str, int] = {}  # images beyond the last set, by what they are of

    def check_range(self, lower: np.ndarray, upper: np.ndarray) -> None:
        """Refuses joints that the robot cannot have, such as degrees.

        Args:
            lower: limits of the joints in rad, (6,).
            upper: likewise.

        Raises:
            ValueError: if one is more than a turn beyond its range; names set and joint.
        """
        beyond = np.maximum(lower - self.joints, self.joints - upper)
        row, joint = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        if beyond[row, joint] > 2.0 * np.pi:
            raise ValueError(
                f"{self._table}: {COLUMNS[1 + joint]} of set {row + 1} is {self.joints[row, joint]:.4g}, its "
                f"range is {lower[joint]:.4g} to {upper[joint]:.4g} rad; is it in degrees?"
            )

    def __len__(self) -> int:
        return len(self.times)

    @property
    def notes(self) -> list[str]:
        """Cameras that ended before the joints did or went on behind them, once all sets were taken."""
        return [
            *(f"camera {name} ended after {count(number, 'set')}" for name, number in self.ended.items()),
            *(
                f"{count(number, 'image')} of {name} {'is' if number == 1 else 'are'} beyond the last line "
                f"of {self._table.name} and left out"
                for name, number in self._beyond.items()
            ),
        ]

    def sets(self, size: tuple[int, int]) -> Iterator[np.ndarray]:
        """The sets of images one after the other, (n, height, width, 3) of uint8 each.

        Args:
            size: width and height that an image has to have in px.

        Raises:
            ValueError: if an image has another size or cannot be read.
        """
        width, height = size
        if self._video is not None:
            yield from self._tiles(self._video, size)
            return
        streams = [_frames(source) for source in self._sources]
        for number in range(len(self)):
            images = np.zeros((len(streams), height, width, 3), np.uint8)
            for i, (name, stream) in enumerate(zip(self._cameras, streams, strict=True)):
                found = None if name in self.ended else next(stream, None)
                if found is None:
                    self.ended.setdefault(name, number)
                    continue
                where, image = found
                if image is None:
                    raise ValueError(f"{where}: no picture that can be read")
                if image.shape != images[i].shape:
                    seen = f"{image.shape[1]} x {image.shape[0]}"
                    raise ValueError(f"{where}: images must be {width} x {height} px, got {seen} px")
                images[i] = image
            yield images
        for name, source, stream in zip(self._cameras, self._sources, streams, strict=True):
            self._count_beyond(f"camera {name}", source, stream)

    def _tiles(self, video: Path, size: tuple[int, int]) -> Iterator[np.ndarray]:
        """The sets of a single video; after its end all cameras are blind."""
        width, height = size
        frames, n = _frames(video), len(self._cameras)
        for number in range(len(self)):
            found = next(frames, None)
            if found is None:
                self.ended = self.ended or dict.fromkeys(self._cameras, number)
                yield np.zeros((n, height, width, 3), np.uint8)
                continue
            where, image = found
            assert image is not None
            columns, rows = image.shape[1] // width, image.shape[0] // height
            if image.shape[:2] != (rows * height, columns * width) or columns * rows < n:
                raise ValueError(
                    f"{where}: must be made of {n} images of {width} x {height} px, "
                    f"got {image.shape[1]} x {image.shape[0]} px"
                )
            tiles = image.reshape(rows, height, columns, width, 3).swapaxes(1, 2)
            yield np.ascontiguousarray(tiles.reshape(-1, height, width, 3)[:n])
        self._count_beyond(video.name, video, frames)

    def _count_beyond(self, name: str, source: Path | list[Path], stream: Iterator[object]) -> None:
        """Notes what is left of a stream behind the last set; pictures are not read for that."""
        left = len(source) - len(self) if isinstance(source, list) else sum(1 for _ in stream)
        if left > 0:
            self._beyond[name] = left


def _source(folder: Path, name: str) -> Path | list[Path]:
    """The pictures of a camera in their order, or its video."""
    for ending in _VIDEOS:
        if (folder / f"{name}{ending}").is_file():
            return folder / f"{name}{ending}"
    inside = folder / name
    pictures = sorted((each for each in inside.glob("*") if each.suffix.lower() in _PICTURES), key=_in_order)
    if not pictures:
        raise ValueError(
            f"--images {folder}: no pictures of camera {name}, neither in {inside} nor as {name}{_VIDEOS[0]}"
        )
    return pictures


def _in_order(picture: Path) -> list[tuple[int, str]]:
    """What pictures are sorted by: 2.png is before 10.png."""
    parts = re.findall(r"[0-9]+|[^0-9]+", picture.name)
    return [(int(part), "") if part[0] in "0123456789" else (-1, part) for part in parts]


def _frames(source: Path | list[Path]) -> Iterator[tuple[str, np.ndarray | None]]:
    """Where each image comes from, and the image; None if it cannot be read."""
    if isinstance(source, list):
        for path in source:
            yield str(path), cv2.imread(str(path), cv2.IMREAD_COLOR)
        return
    video = cv2.VideoCapture(str(source))
    if not video.isOpened():
        raise ValueError(f"{source}: no video that can be read")
    try:
        number = 0
        while True:
            is_there, image = video.read()
            if not is_there:
                return
            number += 1
            yield f"{source}, image {number}", image
    finally:
        video.release()


def _joints(path: Path) -> np.ndarray:
    """Times and joint positions, (n, 7)."""
    table = parse_fields(read_text(path), str(path), has_head=True)
    head, rows = table.rows[0], []
    missing = [name for name in COLUMNS if name not in head]
    if missing:
        raise TextTableError(f"{table.where(0)}: no column {missing[0]}; needed are {', '.join(COLUMNS)}")
    for number, fields in enumerate(table.rows[1:], 1):
        if len(fields) != len(head):
            raise TextTableError(f"{table.where(number)}: {len(head)} fields are needed, got {len(fields)}")
        row = dict(zip(head, fields, strict=True))
        values = [finite_number(row[name]) for name in COLUMNS]
        for name, value in zip(COLUMNS, values, strict=True):
            if value is None:
                raise TextTableError(
                    f"{table.where(number)}: {name} is not a finite number, got '{row[name]}'"
                )
        rows.append(values)
    if len(rows) < 2:
        raise TextTableError(f"{path}: at least two sets are needed, got {len(rows)}")
    times = np.array(rows, dtype=float)
    if not np.all(np.diff(times[:, 0]) > 0.0):
        raise TextTableError(f"{path}: time_s must increase from line to line")
    period = float(np.median(np.diff(times[:, 0])))
    if period > _SLOWEST:
        raise TextTableError(
            f"{path}: sets of images are {period:g} s apart by time_s, which must be in s; is it in ms?"
        )
    return times
