"""Live view of a run: the robot in a browser while it is simulated."""

from collections.abc import Callable

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.runs.simulation import Experiment
from experiments.replay.scene import FRAME_RATE, RobotPicture, draw_frame, draw_path, open_meshcat, rgba
from experiments.report.style import WANTED_COLOR, law_colors
from robots.description.model import RobotModel

WANTED_RADIUS, TRUE_RADIUS = 0.003, 0.0015  # m
TRAIL_PIECE = 15  # frames after which the path so far gets longer


class LiveView:
    """A Meshcat window beside an experiment. It only reads the experiment's context, so nothing changes."""

    def __init__(self, experiment: Experiment, robot: RobotModel, port: int | None = None) -> None:
        """Starts the server and draws the wanted path.

        Args:
            experiment: what to watch.
            robot: its nominal robot.
            port: where it listens; None for the first free one from 7000 on.

        Raises:
            OSError: if no port is free.
        """
        self._experiment, path = experiment, experiment.path
        times = np.arange(path.path_start, path.duration, experiment.scenario.station.period)
        wanted = path.sample(times)[0][:, :3, 3]
        self._meshcat = open_meshcat(wanted, port)
        self._picture = RobotPicture(self._meshcat, robot, experiment.scenario.station.errors)
        self._color = rgba(law_colors([experiment.law])[experiment.law])
        draw_path(self._meshcat, "wanted/path", wanted, WANTED_RADIUS, rgba(WANTED_COLOR, 0.5))
        draw_frame(self._meshcat, "wanted/frame", length=0.14, radius=0.0018, alpha=0.45)
        draw_frame(self._meshcat, "true/frame", length=0.1, radius=0.003, alpha=1.0)
        self._trail: list[np.ndarray] = []
        self._pieces = 0

    @property
    def address(self) -> str:
        """Where to point a browser."""
        return self._meshcat.web_url()

    def show(self) -> None:
        """Shows the experiment as it is now."""
        context, station = self._experiment.context, self._experiment.station
        time = context.get_time()
        state = station.GetOutputPort("truth.state").Eval(station.GetMyContextFromRoot(context))
        X_WE = station.GetOutputPort("truth.X_WE").Eval(station.GetMyContextFromRoot(context))
        self._picture.show(time, station.robot.link_positions(state))
        self._meshcat.SetTransform("true/frame", X_WE)
        self._meshcat.SetTransform("wanted/frame", _rigid(self._experiment.path.sample(time)[0]))
        if time >= self._experiment.path.path_start:
            self._trail.append(X_WE.translation().copy())
        if len(self._trail) > TRAIL_PIECE:
            draw_path(
                self._meshcat, f"true/path/{self._pieces}", np.array(self._trail), TRUE_RADIUS, self._color
            )
            self._trail = self._trail[-1:]
            self._pieces += 1


def advance_live(
    experiment: Experiment, view: LiveView, progress: Callable[[float], None] | None = None
) -> None:
    """Advances an experiment to its end and shows it about 30 times per simulated second.

    Frames lie on ticks, where the integrator stops anyway: the log is the same, bit for bit, as unwatched.
    """
    period, end = experiment.scenario.station.period, experiment.path.duration
    ticks = max(1, round(1.0 / (FRAME_RATE * period)))
    frame = 0
    view.show()
    while experiment.context.get_time() < end:
        frame += 1
        experiment.advance(until=min(end, frame * ticks * period))
        view.show()
        if progress:
            progress(experiment.context.get_time() / end)


def _rigid(X: np.ndarray) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(X[:3, :3]), X[:3, 3])
