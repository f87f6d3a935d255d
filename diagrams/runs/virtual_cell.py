"""A robot cell that exists only in this process: the elastic robot behind its controller."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from diagrams.integration import Integration
from diagrams.record.packed_log import PackedLog
from diagrams.runs.start import start_position
from diagrams.scenario.controller_model import controller_model
from diagrams.scenario.scenario import Scenario
from diagrams.station import Station
from robots.description.model import RobotModel
from systems.link.protocols import VirtualController
from systems.reference.paths import make_path
from systems.samples import JointSample, PoseSample

CLOCK_START = 1000.0  # s, what the controller's clock shows at the start: nobody may take it for zero


class Exposure(NamedTuple):
    """A camera sample and the time of its arrival."""

    published: float  # s
    sample: PoseSample


@dataclass(frozen=True)
class CellRecord:
    """The truth of a cell, n cycles. Only reports may see it."""

    time: np.ndarray  # (n,) s, the controller's clock
    X_WE: np.ndarray  # (n, 4, 4)
    link_position: np.ndarray  # (n, 6) rad

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses (m, 4, 4) and link positions (m, 6) at times (m,) of its clock; NaN where none is near."""
        nearest = np.clip(np.searchsorted(self.time, times - 5e-4), 0, len(self.time) - 1)
        is_known = np.abs(self.time[nearest] - times) < 5e-4
        X_WE, links = self.X_WE[nearest].copy(), self.link_position[nearest].copy()
        X_WE[~is_known], links[~is_known] = np.nan, np.nan
        return X_WE, links

    def save(self, file: str | Path) -> None:
        """Writes it for `load`."""
        np.savez_compressed(file, time=self.time, X_WE=self.X_WE, link_position=self.link_position)

    @classmethod
    def load(cls, file: str | Path) -> "CellRecord":
        """Reads what `save` wrote. Raises OSError or ValueError if it cannot be read."""
        with np.load(file) as data:
            return cls(data["time"], data["X_WE"], data["link_position"])


class VirtualCell:
    """Plant, drives and camera of a scenario, moved on by the controller's cycle.

    The controller hears a command at the beginning of a cycle; what the robot does until its end is then
    settled. So the cell is computed a cycle ahead, and a real-time loop only has to hand out the results.
    """

    def __init__(self, scenario: Scenario, robot: RobotModel, with_log: bool = True) -> None:
        """Puts the robot at the start of the scenario's path.

        Args:
            scenario: whose station this is; its controller plans as that of the link, whatever it says.
            robot: the nominal one.
            with_log: whether `record` will be asked for the truth.

        Raises:
            ValueError: if a part refuses its configuration or the start is out of reach.
        """
        config = replace(scenario.station, interface=scenario.station.link.kind)
        self.period = config.period
        self._camera, self._faults = config.camera, config.faults
        builder = DiagramBuilder()
        self._station = Station(builder, robot, config, "cascade")
        ports = {name: self._station.outputs[name] for name in self._station.LOGGED}
        self._log = PackedLog(builder, ports, config.period) if with_log else None
        self._simulator = Simulator(builder.Build())
        self._context = self._simulator.get_mutable_context()
        start = start_position(controller_model(scenario, robot), scenario, make_path(scenario.reference))
        self._station.set_at_rest(self._context, start, scenario.seed)
        standing = np.full(len(start), np.nan)
        inputs = (self._station.inputs[name] for name in ("position_command", "velocity_command"))
        self._inputs = [
            port.FixValue(port.get_system().GetMyMutableContextFromRoot(self._context), standing)
            for port in inputs
        ]
        self._integration = Integration(
            scenario.integrator,
            config.period,
            self._station.fastest_rate(self._context),
            self._station.changes(),
        )
        self._integration.initialize(self._simulator)
        self._cycle = 0
        self._exposure = 0
        self.planned = start

    @property
    def time(self) -> float:
        """How far the cell has been computed, in s."""
        return self._cycle * self.period

    @property
    def stamp(self) -> float:
        """What the controller's clock shows at `time`, in s."""
        return CLOCK_START + self.time + self._faults.clock_offset(self.time)

    @property
    def joints(self) -> JointSample:
        """What the joints say at `time`."""
        sample: JointSample = self._station.read(self._context, "joint_sample")
        return replace(sample, position=sample.position + self._faults.joint_offset(self.time))

    def advance(self, controller: VirtualController) -> list[Exposure]:
        """Computes the next cycle with the controller's references; returns what the camera saw in it."""
        if self._faults.is_deaf(self.time):
            references = self.planned, np.zeros_like(self.planned)
        else:
            references = controller.references
        for value, reference in zip(self._inputs, references, strict=True):
            value.GetMutableData().set_value(reference)
        self._cycle += 1
        end, exposures = self.time, []
        while (published := self._exposure * self._camera.period + self._camera.delay) <= end:
            if published > self._context.get_time():
                self._integration.advance(self._simulator, published)
            exposures.append(Exposure(published, self._station.read(self._context, "pose_sample")))
            self._exposure += 1
        self._integration.advance(self._simulator, end)
        self.planned = self._station.planned_position(self._context)
        return exposures

    def record(self) -> CellRecord:
        """The truth since the start. Raises RuntimeError if the cell was built without a log."""
        if self._log is None:
            raise RuntimeError("the cell was built without a log")
        record = self._station.record(*self._log.read(self._context))
        set_by = np.array([self._faults.clock_offset(time) for time in record.time])
        return CellRecord(CLOCK_START + record.time + set_by, record.X_WE_true, record.link_position)
