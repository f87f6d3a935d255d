"""How often a cell in which nothing changes gives an alarm: ``python -m experiments.bench.alarms [HOURS]``.

For eight hours, if nothing else is said, cumulative sums look at images of the fixed markers, and the tool
watch at every sample of the camera, late by a tick, beside the joints of a robot that runs its path again and
again. It is off by what `everything-realistic` makes it: wrong geometry, elastic gears with backlash and
hysteresis, friction. The lap is simulated once; noise is drawn anew in every one. Then a station is checked
daily for a month. Takes a quarter of an hour.
"""

import sys
from collections.abc import Callable

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.runs.simulation import Experiment
from diagrams.scenario.scenario import load_scenario
from diagrams.tool_watch import ToolWatch
from experiments.cli.console import progress_bar
from experiments.health.check import FRAME_RATE, PER_BLOCK, PIXEL_SIGMA
from experiments.health.study import HealthStudy
from robots.description.model import load_robot
from robots.metrology.change_detection import cusum_changes
from systems.samples import PoseSample
from systems.vision.camera_rig import load_cell
from systems.vision.reference_markers import SHIPPED, ReferenceMarkers

HOURS, DAYS = 8.0, 30
_PART = 36_000  # means of images that are looked at in one go: an hour of them
_KNOCK = 3e-4  # m, by which the tool is displaced in the end

Progress = Callable[[float], None]


def camera_alarms(hours: float, progress: Progress) -> tuple[int, int]:
    """How many cameras are named, and in how many means of images, where none has moved."""
    robot = load_robot("irb1200")
    X_WB = robot.base.pose()
    markers = ReferenceMarkers(load_cell("probst").camera_model(X_WB), SHIPPED @ X_WB.rotation().matrix().T
                               + X_WB.translation(), PIXEL_SIGMA)  # fmt: skip
    left = total = round(3600.0 * hours * FRAME_RATE / PER_BLOCK)
    rng, alarms = np.random.default_rng(1), 0
    while left:
        count = min(left, _PART)
        noise = rng.standard_normal((count, *markers.pixels.shape), dtype=np.float32)
        mean = markers.pixels + PIXEL_SIGMA / np.sqrt(PER_BLOCK) * noise
        white = np.sqrt(PER_BLOCK) * markers.whitened(markers.rotations(mean))
        alarms += len(cusum_changes(white.reshape(count, -1)))
        left -= count
        progress(1.0 - left / total)
    return alarms, total


def tool_alarms(hours: float, progress: Progress) -> tuple[int, int, bool]:
    """Alarms, samples of the camera, and whether a tool that is displaced in the last lap is named."""
    scenario = load_scenario("everything-realistic")
    experiment = Experiment(scenario, "open_loop")
    experiment.advance()
    log, camera = experiment.log(), scenario.station.camera
    lap = (log.time >= log.path_start) & (log.time < log.path_end)
    times, joints, X_WE = log.time[lap] - log.path_start, log.joint_position[lap], log.X_WE_true[lap]
    poses = [(RotationMatrix(X[:3, :3]), X[:3, 3]) for X in X_WE]
    sigma, period = getattr(camera, "position_sigma", 0.0), times[-1] + times[1] - times[0]
    laps, rng = max(1, round(3600.0 * hours / period)), np.random.default_rng(2)
    believed = load_robot(scenario.servo.model.robot or scenario.robot)
    watch, alarms, sample = ToolWatch(believed), 0, PoseSample()
    for number in range(laps + 1):
        noise = sigma * rng.standard_normal((len(times), 3))
        for k, (time, q, (R, p)) in enumerate(zip(times, joints, poses, strict=True)):
            knocked = _KNOCK if number == laps and 2 * k > len(times) else 0.0
            found = watch.note(number * period + time, q, sample)
            alarms += found is not None and number < laps
            if found is not None and knocked:
                return alarms, laps * len(times), True
            place = p + knocked * R.matrix()[:, 0] + noise[k]
            sample = PoseSample(number * period + time, RigidTransform(R, place), True)
        progress((number + 1) / (laps + 1))
    return alarms, laps * len(times), False


def daily_alarms(days: int, progress: Progress) -> int:
    """Alarms of a station that is checked daily and in which nothing changes."""
    scenario = load_scenario("nominal")
    study = HealthStudy(scenario, load_robot(scenario.robot))
    return len(study.alarms(study.continued(study.begun(), days, None, 1, progress)))


def main(hours: float) -> None:
    """Runs the three and prints how often there was an alarm."""
    with progress_bar("cameras") as progress:
        alarms, means = camera_alarms(hours, progress)
    print(f"cameras, {hours:g} h, {means} means of {PER_BLOCK} images: {alarms} alarms", flush=True)
    with progress_bar("tool") as progress:
        alarms, samples, is_named = tool_alarms(hours, progress)
    named = "named" if is_named else "not named"
    print(f"tool, {hours:g} h of motion, {samples} samples: {alarms} alarms", flush=True)
    print(f"then a tool that is displaced by {1e3 * _KNOCK:g} mm: {named}", flush=True)
    with progress_bar("daily checks") as progress:
        alarms = daily_alarms(DAYS, progress)
    print(f"{DAYS} daily checks: {alarms} alarms")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else HOURS)
