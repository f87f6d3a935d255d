"""A motion driven by the plant: what its motors and gears really do, and how the wrist rings after it."""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from diagrams.scenario.scenario import StationConfig
from experiments.feedforward.trial import RINGING, WristWatch, at_rest, criterion
from experiments.plan.timings import Timing, held
from robots.description.model import NUM_JOINTS, RobotModel
from robots.dynamics.plant import add_robot
from robots.planning.limit_use import Use, energy, use_of
from robots.planning.limits import MotionLimits
from robots.planning.path_dynamics import Demand, PathDynamics
from systems.controller_model import ControllerModel
from systems.feedforward import FeedforwardConfig
from systems.feedforward.stable_inverse.bounded_inverse import NoBoundedMotionError
from systems.feedforward.stable_inverse.flexible_arm import FlexibleArm
from systems.feedforward.stable_inverse.stable import StableFeedforward

SETTLE = 0.3  # s at rest before the motion, in which motors may begin
_AFTER = 0.2  # s at rest that the stable inverse is told of
_SAMPLE = 2e-3  # s
_PLACES = 21  # on the path
_HARDLY = 0.02  # of the best direction: how well axes 1 to 3 move the tip where it has no stable inverse
STABLE, APPROXIMATE = "stable", "approximate"  # inverse models


@dataclass(frozen=True)
class PlantRun:
    """What happened, at n ticks from where motors begin to move to the end of the ringing."""

    times: np.ndarray  # (n,) s, from the start of the motion
    demand: Demand
    criterion: float  # C of Reiner (2010), eq. (6.1), in m/s
    duration: float  # s, of the motion
    inverse: str  # what told the motors, `STABLE` or `APPROXIMATE`

    def use(self, limits: MotionLimits) -> Use:
        """Of limits; torque is averaged over the motion, the others count until the robot is at rest."""
        whole = use_of(self.demand, limits, self.times)
        moving = (self.times >= 0.0) & (self.times <= self.duration)
        squares = np.mean(self.demand.motor_torque[moving] ** 2, axis=0)
        return Use(whole.names, whole.shares, np.sqrt(squares) / limits.continuous_torque)

    def energy(self, recuperation: bool = False) -> float:
        """Of all motors in J until the robot is at rest."""
        return energy(self.demand, self.times, recuperation)


class PlantDriver:
    """A station with elastic gears and structure, and the commands that move it along a path.

    Motors are told what the stable inverse of the arm has for the whole motion. Where there is none, as of a
    stretched arm, they are told where the planner's own inverse model has them, which takes what links and
    bearings yield for as quick as their load. Torques are those of half a tick later, in the middle of the
    time for which drives hold them. A motion that is known beforehand is sent a tick earlier than a law can,
    so that the drives' fine interpolation need not guess the next command.
    """

    def __init__(
        self,
        robot: RobotModel,
        payload: float,
        dynamics: PathDynamics,
        plant: RobotModel | None = None,
        is_for_law: bool = False,
    ) -> None:
        """Takes the path.

        Args:
            robot: as the controller knows it.
            payload: mass at the flange in kg.
            dynamics: of that robot with elastic structure on the path, whatever the motion was planned with.
            plant: what stands in the station, None for the same robot.
            is_for_law: whether a law will move the robot, which knows the present of the motion alone: then
                the approximate inverse does, and commands come no earlier than a law's.
        """
        self._dynamics, self._true = dynamics, plant or robot
        config = StationConfig(elasticity="structure", payload=payload)
        early = replace(config.drive, command_delay=2.0 * config.period)
        self._config = config if is_for_law else replace(config, drive=early)
        self._plant = MultibodyPlant(0.0)
        self._parts = add_robot(self._plant, robot, "rigid", payload)
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        self._stable: StableFeedforward | None = None
        if not is_for_law and robot.drive_trains is None and self._moves_freely(robot, payload):
            believed = ControllerModel(robot, payload, self._config.period)
            self._stable = StableFeedforward(believed, FeedforwardConfig(STABLE))

    @property
    def inverse(self) -> str:
        """What tells the motors, `STABLE` or `APPROXIMATE`."""
        return APPROXIMATE if self._stable is None else STABLE

    def _moves_freely(self, robot: RobotModel, payload: float) -> bool:
        """Whether the arm is nowhere stretched, and its tip never on axis 1."""
        arm = FlexibleArm(robot, payload)
        return min(map(arm.mobility, self._dynamics.path.at(np.linspace(0.0, 1.0, _PLACES)))) > _HARDLY

    def run(self, timing: Timing) -> PlantRun:
        """Drives a motion. Raises RuntimeError if the simulation breaks off."""
        period, drive = self._config.period, self._config.drive
        settle = round(SETTLE / period) * period
        stop = settle + timing.duration
        ticks = period * np.arange(round((stop + RINGING) / period) + 2)
        told, first = self._commands(timing, ticks + drive.command_delay + drive.dead_time - settle)
        simulator, station, integration = at_rest(self._true, self._config, told)
        begin = settle + min(first, 0.0)
        integration.advance(simulator, period * np.floor(begin / period))
        watch, rows, rings = WristWatch(station), [], False
        times = ticks[(ticks > begin - 0.5 * period) & (ticks <= stop + RINGING)]
        context = simulator.get_context()
        of_plant = station.plant.GetMyContextFromRoot(context)
        for time in times:
            if not rings and time > stop:
                integration.advance(simulator, stop)
                watch.begin(simulator)
                rings = True
            integration.advance(simulator, time)
            motors = station.read(context, "truth.motor_state")[NUM_JOINTS:]
            torque = station.read(context, "truth.motor_torque")
            gears = station.plant.get_actuation_input_port().Eval(of_plant)
            rows.append(np.array([motors, torque, gears]))
        demand = self._demand(np.array(rows), timing, times - settle)
        return PlantRun(times - settle, demand, criterion(*watch.found), timing.duration, self.inverse)

    def _commands(self, timing: Timing, times: np.ndarray) -> tuple[np.ndarray, float]:
        """What the drives are told, and from when on.

        Returns:
            Positions, velocities and torques beyond the drives' gravity compensation, (n, 3, 6), and the time
            in s at which motors begin to move.
        """
        if self._stable is not None:
            try:
                return self._of_stable_inverse(self._stable, timing, times)
            except NoBoundedMotionError:
                self._stable = None  # whatever else is driven along this path shall have no better one
        now, later = held(timing, times), held(timing, times + 0.5 * self._config.period)
        torque = self._dynamics.torque(later)
        for row, motors in zip(torque, self._dynamics.motors(later), strict=True):
            self._plant.SetPositions(self._context, motors)
            row += self._parts.load(self._context)
        told = np.stack([self._dynamics.motors(now), self._dynamics.demand(now).speed, torque], axis=1)
        return told, 0.0

    def _of_stable_inverse(
        self, stable: StableFeedforward, timing: Timing, times: np.ndarray
    ) -> tuple[np.ndarray, float]:
        fine = np.arange(times[0], timing.duration + _AFTER, _SAMPLE)
        plan = stable.plan(fine, self._dynamics.path.at(held(timing, fine)[0]))
        half = 0.5 * self._config.period
        now, later = (np.minimum(each, plan.rigid.x[-1]) for each in (times, times + half))
        told = np.stack([plan.position(now), plan.velocity(now), plan.torque(later)], axis=1)
        return told, plan.first

    def _demand(self, rows: np.ndarray, timing: Timing, times: np.ndarray) -> Demand:
        """Of what is measured, (n, 3, 6): speeds and torques of motors, torques of gears; else as wanted."""
        speed, torque, gears = rows.transpose(1, 0, 2)
        rate = np.diff(gears, axis=0, prepend=gears[:1]) / self._config.period
        wanted = self._dynamics.demand(held(timing, times))
        return replace(wanted, speed=speed, motor_torque=torque, gear_torque=gears, gear_torque_rate=rate)
