"""The process that looks for people: never waited for, ended with its run, and no orphan."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from systems.samples import ImageSample, Person, PersonSample
from systems.vision.people.background import Memory
from systems.vision.people.people_follower import Mind
from systems.vision.people.shared_watch import SharedWatch
from systems.vision.people.watch_process import Lookout, WatchProcess, look_until_ended

pytestmark = pytest.mark.real_time

PATIENCE = 60.0  # s, for a process to start on a busy machine


class Slow:
    """Finds somebody in images, and takes its time."""

    def __init__(self, pause: float) -> None:
        self._pause = pause

    def after(self, mind: Mind, images: ImageSample, q: np.ndarray) -> Mind:
        time.sleep(self._pause)
        person = Person(1, q[None, :3], 0.04, np.zeros(3))
        return Mind(mind.memory, sample=PersonSample(images.time, True, (person,)))


class Steady:
    """Images whenever somebody asks, with the time of the newest joints."""

    def __init__(self, shared: SharedWatch) -> None:
        self._shared, self._given = shared, -1.0

    def newest(self) -> ImageSample | None:
        heard = self._shared.newest_joints()
        if heard is None or heard[0] <= self._given:
            return None
        self._given = heard[0]
        return ImageSample(heard[0])

    def close(self) -> None:
        """Nothing is open."""


def slow(shared: SharedWatch) -> Lookout:
    return Lookout(Slow(0.3), Steady(shared), Mind(Memory((), np.zeros(0, bool))))  # type: ignore[arg-type]


def refusing(shared: SharedWatch) -> Lookout:
    raise ValueError("camera 3 has no stream")


def is_there(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return "Z" not in Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]


def wait_until(is_so, seconds: float = PATIENCE) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end and not is_so():
        time.sleep(0.02)
    return is_so()


@pytest.mark.slow
def test_a_cycle_reads_people_at_once_while_the_process_is_busy_and_it_ends_with_the_run():
    watch = WatchProcess(slow)
    try:
        spent, number = [], 0

        def cycle() -> bool:
            nonlocal number
            began = time.thread_time()
            watch.shared.note_joints(0.004 * number, np.full(6, float(number)))
            watch.shared.people()
            spent.append(time.thread_time() - began)
            number += 1
            return watch.shared.sets >= 3

        assert wait_until(cycle)
        # It is busy 0.3 s for each set; what a cycle does is some copies.
        assert np.median(spent) < 1e-3
        person = watch.shared.people().people[0]
        assert person.points[0, 0] == pytest.approx(watch.shared.people().time / 0.004)
        assert not watch.problem
    finally:
        watch.end()
    assert watch.pid is not None
    assert not is_there(watch.pid)


@pytest.mark.slow
def test_who_cannot_look_says_why():
    watch = WatchProcess(refusing)
    try:
        assert wait_until(lambda: bool(watch.problem))
        assert watch.problem == "camera 3 has no stream"
    finally:
        watch.end()


@pytest.mark.slow
def test_it_does_not_outlive_a_run_that_is_killed():
    code = (
        "import time\n"
        "from tests.systems.vision.people.test_watch_process import slow\n"
        "from systems.vision.people.watch_process import WatchProcess\n"
        "if __name__ == '__main__':\n"
        "    print(WatchProcess(slow).pid, flush=True)\n"
        "    time.sleep(600)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        pid = int(run.stdout.readline())
        run.send_signal(signal.SIGKILL)
    assert wait_until(lambda: not is_there(pid))


def test_of_images_that_come_too_quickly_only_the_newest_are_looked_at():
    """Ten sets come while one is worked on; nine of them are never looked at."""
    shared, looked = SharedWatch(), []

    class Camera:
        time = 0.0

        def newest(self) -> ImageSample | None:
            if self.time > 1.0:
                shared.end()
            return ImageSample(self.time)

        def close(self) -> None:
            """Nothing is open."""

    camera = Camera()

    def after(mind: Mind, images: ImageSample, q: np.ndarray) -> Mind:
        looked.append(images.time)
        for _ in range(10):
            camera.time += 0.01
            shared.note_joints(camera.time, np.zeros(6))
        return Mind(mind.memory, sample=PersonSample(images.time, True))

    shared.note_joints(0.0, np.zeros(6))
    mind = Mind(Memory((), np.zeros(0, bool)))
    look_until_ended(Lookout(SimpleNamespace(after=after), camera, mind), shared)  # type: ignore[arg-type]
    np.testing.assert_allclose(np.diff(looked), 0.1)
    assert shared.people().time == looked[-1]


def test_an_empty_cell_that_nobody_has_stored_is_learnt_until_the_path_begins():
    """Of a real station: the first images, apart in time, and none once the path runs."""
    shared, learnt = SharedWatch(), []
    times = iter(np.arange(1, 200) * 0.05)

    class Camera:
        def newest(self) -> ImageSample | None:
            now = float(next(times))
            if now > 2.0:
                shared.begin_path(2.0)
            if now > 4.0:
                shared.end()
            shared.note_joints(now, np.full(6, now))
            return ImageSample(now, np.zeros((1, 1, 1, 3), np.uint8))

        def close(self) -> None:
            """Nothing is open."""

    def learn(images: list, joints: list) -> Memory:
        learnt[:] = [q[0] for q in joints]
        return Memory((), np.zeros(0, bool))

    follower = SimpleNamespace(
        detector=SimpleNamespace(learn=learn),
        after=lambda mind, images, q: Mind(mind.memory, sample=PersonSample(images.time, True)),
    )
    look_until_ended(Lookout(follower, Camera()), shared)  # type: ignore[arg-type]
    assert 3 <= len(learnt) <= 10
    assert np.diff(learnt).min() > 0.19
    assert max(learnt) <= 2.0
    assert shared.sets > 50
