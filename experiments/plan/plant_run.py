"""A motion driven by the plant: what its motors and gears really do, and how the wrist rings after it."""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from diagrams.scenario.scenario import StationConfig
from experiments.feedforward.trial import RINGING, SETTLE, WristWatch, at_rest, criterion
from experiments.plan.timings import Timing, held
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import add_robot
from robots.planning.limit_use import Use, energy, use_of
from robots.planning.limits import MotionLimits
from robots.planning.path_dynamics import Demand, PathDynamics


@dataclass(frozen=True)
class PlantRun:
    """What happened, at n ticks from the start of the motion to the end of the ringing."""

    times: np.ndarray  # (n,) s
    demand: Demand
    criterion: float  # C of Reiner (2010), eq. (6.1), in m/s
    duration: float  # s, of the motion

    def use(self, limits: MotionLimits) -> Use:
        """Of limits; torque is averaged over the motion, the others count until the robot is at rest."""
        whole = use_of(self.demand, limits, self.times)
        moving = self.times <= self.duration
        squares = np.mean(self.demand.motor_torque[moving] ** 2, axis=0)
        return Use(whole.names, whole.shares, np.sqrt(squares) / limits.continuous_torque)

    def energy(self, recuperation: bool = False) -> float:
        """Of all motors in J until the robot is at rest."""
        return energy(self.demand, self.times, recuperation)


class PlantDriver:
    """A station with elastic gears and structure, and the commands that move it along a path.

    Motors are told where the planner's own inverse model has them, and their torque half a tick later, in
    the middle of the time for which drives hold it.
    """

    def __init__(
        self, robot: RobotModel, payload: float, dynamics: PathDynamics, plant: RobotModel | None = None
    ) -> None:
        """Takes the path.

        Args:
            robot: as the controller knows it.
            payload: mass at the flange in kg.
            dynamics: of that robot with elastic structure on the path, whatever the motion was planned with.
            plant: what stands in the station, None for the same robot.
        """
        self._dynamics, self._true = dynamics, plant or robot
        self._config = StationConfig(elasticity="structure", payload=payload)
        self._plant = MultibodyPlant(0.0)
        self._parts = add_robot(self._plant, robot, "rigid", payload)
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()

    def run(self, timing: Timing) -> PlantRun:
        """Drives a motion. Raises RuntimeError if the simulation breaks off."""
        period, drive = self._config.period, self._config.drive
        settle = round(SETTLE / period) * period
        stop = settle + timing.duration
        ticks = period * np.arange(round((stop + RINGING) / period) + 2)
        told = self._commands(timing, ticks + drive.command_delay + drive.dead_time - settle)
        simulator, station, integration = at_rest(self._true, self._config, told)
        integration.advance(simulator, settle)
        watch, rows, rings = WristWatch(station), [], False
        times = ticks[(ticks > settle - 0.5 * period) & (ticks <= stop + RINGING)]
        of_plant = station.plant.GetMyContextFromRoot(simulator.get_context())
        of_station = station.GetMyContextFromRoot(simulator.get_context())
        for time in times:
            if not rings and time > stop:
                integration.advance(simulator, stop)
                watch.begin(simulator)
                rings = True
            integration.advance(simulator, time)
            motors = station.GetOutputPort("truth.motor_state").Eval(of_station)[NUM_JOINTS:]
            torque = station.GetOutputPort("truth.motor_torque").Eval(of_station)
            gears = station.plant.get_actuation_input_port().Eval(of_plant)
            rows.append(np.array([motors, torque, gears]))
        demand = self._demand(np.array(rows), timing, times - settle)
        return PlantRun(times - settle, demand, criterion(*watch.found), timing.duration)

    def _commands(self, timing: Timing, times: np.ndarray) -> np.ndarray:
        """Positions, velocities and torques beyond the drives' gravity compensation, (n, 3, 6)."""
        now, later = held(timing, times), held(timing, times + 0.5 * self._config.period)
        torque = self._dynamics.torque(later)
        for row, motors in zip(torque, self._dynamics.motors(later), strict=True):
            self._plant.SetPositions(self._context, motors)
            row += self._parts.load(self._context)
        return np.stack([self._dynamics.motors(now), self._dynamics.demand(now).speed, torque], axis=1)

    def _demand(self, rows: np.ndarray, timing: Timing, times: np.ndarray) -> Demand:
        """Of what is measured, (n, 3, 6): speeds and torques of motors, torques of gears; else as wanted."""
        speed, torque, gears = rows.transpose(1, 0, 2)
        rate = np.diff(gears, axis=0, prepend=gears[:1]) / self._config.period
        wanted = self._dynamics.demand(held(timing, times))
        return replace(wanted, speed=speed, motor_torque=torque, gear_torque=gears, gear_torque_rate=rate)
