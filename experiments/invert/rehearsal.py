"""A motion that is made once to learn the springs from it, and how the wrist rings when it is made again.

It is made first with the inverse of a rigid robot: the arm rings then, and ringing is what shows the springs.
After the stable inverse there is little of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from diagrams.station import Station
from experiments.cli.workers import Progress
from experiments.feedforward.trial import Trial
from robots.description.model import NUM_JOINTS
from robots.identification.motor_torques import TorqueRecording, springs_from_torques

FIRST, REHEARSED = "rigid", ("elastic_structure", "stable")
_LOG_STEP = 1e-3  # s
_NOISE = 1e-3  # of the largest torque of a joint, standard deviation of what its drive reports


@dataclass(frozen=True)
class Rehearsal:
    """The motion under the inverse of a rigid robot; then again with each kind of `REHEARSED`."""

    trial: Trial  # whose robot is what is believed
    spread: float  # share by which its springs may be off
    seed: int  # of the noise of the torques

    def run(self, progress: Progress | None = None) -> Mapping[str, tuple[np.ndarray, np.ndarray]]:
        """How the wrist rings with what was learnt, see `Trial.ringing`, by kind of `REHEARSED`.

        A kind is missing where it finds no motion.
        """
        rigid = replace(self.trial, config=replace(self.trial.config, kind=FIRST))
        seen = recorded(rigid, self.seed)
        learnt = springs_from_torques(self.trial.robot, self.trial.payload, seen, self.spread)
        found = {}
        for done, kind in enumerate(REHEARSED, 2):
            try:
                config = replace(self.trial.config, kind=kind)
                found[kind] = replace(self.trial, config=config, robot=learnt).ringing()
            except ValueError:  # no bounded motion, or one that begins long before the path
                continue
            finally:
                if progress:
                    progress(done / (1 + len(REHEARSED)))
        return found


def recorded(trial: Trial, seed: int) -> TorqueRecording:
    """What the drives report of a trial, with noise on their torques."""
    logs: list[VectorLogSink] = []

    def note(builder: DiagramBuilder, station: Station) -> None:
        for name in ("truth.motor_state", "truth.motor_torque"):
            logs.append(LogVectorOutput(station.outputs[name], builder, _LOG_STEP))

    _, context = trial.simulated(note=note)
    motors, torque = (log.FindLog(context).data().T for log in logs)
    times = logs[0].FindLog(context).sample_times()
    noise = _NOISE * np.abs(torque).max(axis=0) * np.random.default_rng(seed).standard_normal(torque.shape)
    return TorqueRecording(times, motors[:, :NUM_JOINTS], motors[:, NUM_JOINTS:], torque + noise)
