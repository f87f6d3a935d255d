"""What the control cycle and the process that looks for people leave for each other in shared memory.

Neither waits for the other. The cycle writes where the joints are; the other side takes those at an exposure.
People are written between two counts: who finds these different reads again later and keeps what it had.
"""

from multiprocessing import get_context

import numpy as np

from robots.description.model import NUM_JOINTS
from systems.samples import Person, PersonSample

_JOINT_ROWS = 512  # of the newest joint positions: two seconds at 250 Hz
_FEWEST_SAFE = 8  # rows that may be overwritten while they are read
_MOST_PEOPLE, _MOST_POINTS = 16, 8192
_HEARD, _BEGUN, _DONE, _IS_LEARNING, _IS_ENDED, _SETS, _IS_READY = range(7)
_TIME, _TRUSTED, _PEOPLE, _ORIGIN, _SECONDS = range(5)
_OF_PERSON = 6  # number, reach, velocity, how many points
_WORDS = 400  # bytes


class SharedWatch:
    """Joints one way, people the other. Given to a process that is spawned, it is the same memory there."""

    def __init__(self) -> None:
        """Takes the memory. It is without a name, so that nothing is left behind however a process ends."""
        context = get_context("spawn")
        self._raw = (
            context.RawArray("q", 8),
            context.RawArray("d", _JOINT_ROWS * (1 + NUM_JOINTS)),
            context.RawArray("d", 8),
            context.RawArray("d", _MOST_PEOPLE * _OF_PERSON + 3 * _MOST_POINTS),
            context.RawArray("c", _WORDS),
        )
        self._view()
        self._numbers[_TIME] = -np.inf
        self._joints[:] = -np.inf
        self._counts[_IS_LEARNING] = 1

    def __getstate__(self) -> tuple:
        return self._raw

    def __setstate__(self, raw: tuple) -> None:
        self._raw = raw
        self._view()

    def _view(self) -> None:
        counts, joints, numbers, people, self._words = self._raw
        self._counts = np.frombuffer(counts, np.int64)
        self._joints = np.frombuffer(joints).reshape(_JOINT_ROWS, -1)
        self._numbers = np.frombuffer(numbers)
        rows = _MOST_PEOPLE * _OF_PERSON
        self._people = np.frombuffer(people)[:rows].reshape(_MOST_PEOPLE, -1)
        self._points = np.frombuffer(people)[rows:].reshape(_MOST_POINTS, 3)
        self._newest = PersonSample()
        self._seen = -1  # count of `_newest`

    # The side of the control cycle

    def note_joints(self, time: float, position: np.ndarray) -> None:
        """Leaves joint positions (6,) in rad at a steady time in s; newer than those before."""
        heard = int(self._counts[_HEARD])
        row = self._joints[heard % _JOINT_ROWS]
        row[0], row[1:] = time, position
        self._counts[_HEARD] = heard + 1

    def people(self) -> PersonSample:
        """The newest people; those before where new ones are being written. Times are of the steady clock."""
        done = int(self._counts[_DONE])
        if done == self._seen:
            return self._newest
        sample = self._read()
        if int(self._counts[_BEGUN]) == done:
            self._newest, self._seen = sample, done
        return self._newest

    def _read(self) -> PersonSample:
        time, trusted, number = self._numbers[[_TIME, _TRUSTED, _PEOPLE]]
        found, first = [], 0
        for row in self._people[: int(min(max(number, 0), _MOST_PEOPLE))].copy():
            last = first + int(min(max(row[5], 0), _MOST_POINTS))
            found.append(Person(int(row[0]), self._points[first:last].copy(), float(row[1]), row[2:5]))
            first = last
        return PersonSample(float(time), bool(trusted), tuple(found))

    def begin_path(self, time: float) -> None:
        """From this steady time in s on the path runs, and the empty cell is no longer learnt."""
        self._numbers[_ORIGIN] = time
        self._counts[_IS_LEARNING] = 0

    def end(self) -> None:
        """Nobody reads any more."""
        self._counts[_IS_ENDED] = 1

    @property
    def is_ready(self) -> bool:
        """Whether images come and people would be seen."""
        return bool(self._counts[_IS_READY])

    @property
    def problem(self) -> str:
        """Why nobody looks for people any more; empty as long as somebody does."""
        return self._words.value.decode(errors="replace")

    @property
    def sets(self) -> int:
        """How many sets of images have been looked at."""
        return int(self._counts[_SETS])

    @property
    def seconds(self) -> float:
        """Of computation for all of them, CPU time."""
        return float(self._numbers[_SECONDS])

    # The side of who looks for people

    def joints_at(self, time: float, within: float) -> np.ndarray | None:
        """Joint positions (6,) in rad nearest to a steady time in s; None if none are so near."""
        newest = int(self._counts[_HEARD])
        rows = self._joints.copy()
        # What the cycle may have been writing meanwhile is left out, and nothing else.
        changed = np.arange(newest, int(self._counts[_HEARD]) + _FEWEST_SAFE) % _JOINT_ROWS
        rows[changed, 0] = -np.inf
        nearest = rows[np.argmin(np.abs(rows[:, 0] - time))]
        return nearest[1:] if abs(nearest[0] - time) <= within else None

    def newest_joints(self) -> tuple[float, np.ndarray] | None:
        """Steady time in s and joint positions (6,) in rad; None before the first."""
        heard = int(self._counts[_HEARD])
        if not heard:
            return None
        row = self._joints[(heard - 1) % _JOINT_ROWS].copy()
        return float(row[0]), row[1:]

    def publish(self, sample: PersonSample, seconds: float) -> None:
        """Leaves the people of a set of images, which took so many seconds of computation.

        What finds no room makes the sample one that is not trusted.
        """
        number = int(self._counts[_BEGUN]) + 1
        self._counts[_BEGUN] = number
        first, fits = 0, len(sample.people) <= _MOST_PEOPLE
        for row, person in zip(self._people, sample.people, strict=False):
            points = person.points[: _MOST_POINTS - first]
            fits &= len(points) == len(person.points)
            row[:] = person.number, person.reach, *person.velocity, len(points)
            self._points[first : first + len(points)] = points
            first += len(points)
        self._numbers[_TIME], self._numbers[_TRUSTED] = sample.time, sample.trusted and fits
        self._numbers[_PEOPLE] = min(len(sample.people), _MOST_PEOPLE)
        self._numbers[_SECONDS] += seconds
        self._counts[_SETS] += 1
        self._counts[_DONE] = number
        self._counts[_IS_READY] = 1

    def say(self, problem: str) -> None:
        """Leaves the one line on why nobody looks for people any more."""
        self._words.value = problem.encode()[: _WORDS - 1]

    @property
    def origin(self) -> float:
        """Steady time in s at which the path began; 0 before."""
        return float(self._numbers[_ORIGIN])

    @property
    def is_learning(self) -> bool:
        """Whether what is seen is the empty cell: until the path begins."""
        return bool(self._counts[_IS_LEARNING])

    @property
    def is_ended(self) -> bool:
        """Whether nobody reads any more."""
        return bool(self._counts[_IS_ENDED])
