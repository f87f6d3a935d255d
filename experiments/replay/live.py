"""Live view of a run: the robot in a browser while it is simulated, deviation and deflection magnified."""

import time
from collections.abc import Callable

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator

from diagrams.runs.simulation import Experiment
from experiments.replay.scene import RobotPicture, draw_frame, draw_path, open_meshcat, rgba
from experiments.report.style import WANTED_COLOR, law_colors
from robots.description.model import NUM_JOINTS, RobotModel

WANTED_RADIUS, TRUE_RADIUS, ARROW_RADIUS = 0.003, 0.0015, 0.002  # m
TRAIL_PIECE = 15  # frames after which the path so far gets longer
SPEED, DEVIATION, DEFLECTION = "speed (1 is real time)", "deviation times", "deflection times"
ERROR, TIME = "now: error in mm", "now: time in s"
PAUSE = "pause and go on"
LARGEST_ERROR = 20.0  # mm, the end of the slider that shows it
_PATIENCE = 0.02  # s between two looks at the button while it pauses


class LiveView:
    """A Meshcat window beside an experiment. It only reads the experiment's context, so nothing changes."""

    def __init__(
        self, experiment: Experiment, robot: RobotModel, port: int | None = None, speed: float | None = None
    ) -> None:
        """Starts the server, draws the wanted path and adds the controls.

        Args:
            experiment: what to watch.
            robot: its nominal robot.
            port: where it listens; None for the first free one from 7000 on.
            speed: simulated seconds in a second; None for as many as the machine manages.

        Raises:
            OSError: if no port is free.
        """
        self._experiment, path = experiment, experiment.path
        period = experiment.scenario.station.period
        times = np.append(np.arange(path.path_start, path.lap_end, period), path.lap_end)
        wanted = path.sample(times)[0][:, :3, 3]
        self.meshcat = open_meshcat(wanted, port)
        self._picture = RobotPicture(self.meshcat, robot, experiment.scenario.station.errors)
        self._color = rgba(law_colors([experiment.law])[experiment.law])
        draw_path(self.meshcat, "wanted/path", wanted, WANTED_RADIUS, rgba(WANTED_COLOR, 0.5))
        draw_frame(self.meshcat, "wanted/frame", length=0.14, radius=0.0018, alpha=0.45)
        draw_frame(self.meshcat, "true/frame", length=0.1, radius=0.003, alpha=1.0)
        self.meshcat.SetObject("true/arrow", Cylinder(ARROW_RADIUS, 1.0), self._color)
        self.meshcat.SetObject("true/magnified", Sphere(0.006), self._color)
        self._controls = Controls(self.meshcat, experiment.simulator, path.duration, speed)
        self._trail: list[np.ndarray] = []  # wanted and true positions, (2, 3) each
        self._pieces, self._magnified = 0, self._controls.deviation

    @property
    def address(self) -> str:
        """Where to point a browser."""
        return self.meshcat.web_url()

    def wait_for_browser(self, seconds: float) -> bool:
        """Waits that long at most until somebody has opened the page; whether somebody has."""
        end = time.monotonic() + seconds
        while not (seen := self.meshcat.GetNumActiveConnections() > 0) and time.monotonic() < end:
            time.sleep(_PATIENCE)
        return seen

    def show(self) -> None:
        """Shows the experiment as it is now; stays there while it is paused."""
        context, station = self._experiment.context, self._experiment.station
        now = context.get_time()
        q = station.robot.link_positions(station.read(context, "truth.state"))
        theta = station.read(context, "truth.motor_state")[:NUM_JOINTS]
        X_WE = station.read(context, "truth.X_WE")
        X_WD = _rigid(self._experiment.path.sample(self._experiment.servo.path_time(context))[0])
        off = X_WE.translation() - X_WD.translation()
        self._controls.follow(now, 1e3 * float(np.linalg.norm(off)))
        self._picture.show(now, q + (self._controls.deflection - 1.0) * (q - theta))
        self.meshcat.SetTransform("true/frame", X_WE)
        self.meshcat.SetTransform("wanted/frame", X_WD)
        end = X_WD.translation() + self._controls.deviation * off
        self.meshcat.SetTransform("true/arrow", between(X_WD.translation(), end))
        self.meshcat.SetTransform("true/magnified", RigidTransform(end))
        if now >= self._experiment.path.path_start:
            self._trail.append(np.array([X_WD.translation(), X_WE.translation()]))
        self._lengthen_trail()
        self._controls.wait_while_paused()

    def _lengthen_trail(self) -> None:
        """The way of the magnified tip, in pieces; all of it anew where the magnification has changed."""
        if self._controls.deviation != self._magnified:
            self.meshcat.Delete("true/path")
            self._magnified, self._pieces, piece = self._controls.deviation, 0, self._trail
        else:
            piece = self._trail[self._pieces :]
            if len(piece) <= TRAIL_PIECE:
                return
        wanted, true = np.array(piece).reshape(-1, 2, 3).swapaxes(0, 1)
        if len(wanted) > 1:
            where = wanted + self._magnified * (true - wanted)
            draw_path(self.meshcat, f"true/path/{self._pieces}", where, TRUE_RADIUS, self._color)
            self._pieces = len(self._trail) - 1


class Controls:
    """Sliders and a button of the window: what is asked for, and what is."""

    def __init__(self, meshcat: Meshcat, simulator: Simulator, duration: float, speed: float | None) -> None:
        """Adds them; ``speed`` as of `LiveView`, ``duration`` of the run in s."""
        self._meshcat, self._simulator = meshcat, simulator
        self._speed = speed
        if speed is not None:
            meshcat.AddSlider(SPEED, 0.1, max(4.0, speed), 0.1, speed, "KeyS", "KeyF")
            self._pace()
        meshcat.AddSlider(DEVIATION, 1.0, 1000.0, 1.0, 10.0, "ArrowDown", "ArrowUp")
        meshcat.AddSlider(DEFLECTION, 1.0, 300.0, 1.0, 1.0, "ArrowLeft", "ArrowRight")
        meshcat.AddSlider(ERROR, 0.0, LARGEST_ERROR, 0.001, 0.0)
        meshcat.AddSlider(TIME, 0.0, duration, 0.01, 0.0)
        meshcat.AddButton(PAUSE, "Space")

    @property
    def deviation(self) -> float:
        """How many times as large the deviation is drawn."""
        return self._meshcat.GetSliderValue(DEVIATION)

    @property
    def deflection(self) -> float:
        """How many times as large the deflection of the gears is drawn."""
        return self._meshcat.GetSliderValue(DEFLECTION)

    def follow(self, now: float, error_mm: float) -> None:
        """Shows time and error, and takes over the speed that was chosen."""
        self._meshcat.SetSliderValue(TIME, now)
        self._meshcat.SetSliderValue(ERROR, min(error_mm, LARGEST_ERROR))
        if self._speed is not None and (chosen := self._meshcat.GetSliderValue(SPEED)) != self._speed:
            self._speed = chosen
            self._pace()

    def wait_while_paused(self) -> None:
        """Returns when the button was pressed an even number of times."""
        if not self._is_paused:
            return
        while self._is_paused:
            time.sleep(_PATIENCE)
        self._simulator.ResetStatistics()  # the pace counts from here

    @property
    def _is_paused(self) -> bool:
        return self._meshcat.GetButtonClicks(PAUSE) % 2 == 1

    def _pace(self) -> None:
        assert self._speed is not None
        self._simulator.set_target_realtime_rate(self._speed)
        self._simulator.ResetStatistics()


def advance_live(
    experiment: Experiment, view: LiveView, progress: Callable[[float], None] | None = None
) -> None:
    """Advances an experiment to the end of its path and shows it about 30 times per simulated second.

    Frames lie on ticks, where the integrator stops anyway: the log is the same, bit for bit, as unwatched.
    """
    view.show()
    experiment.advance(progress=progress, show=view.show)


def between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Where a cylinder of length 1 about z goes from one point (m) to another: (4, 4), stretched along z."""
    way = end - start
    length = float(np.linalg.norm(way))
    X = np.eye(4)
    if length > 0.0:
        X[:3, :3] = RotationMatrix.MakeFromOneVector(way / length, 2).matrix()
    X[:3, 2] *= max(length, 1e-6)  # a viewer cannot draw what has no volume
    X[:3, 3] = 0.5 * (start + end)
    return X


def _rigid(X: np.ndarray) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(X[:3, :3]), X[:3, 3])
