"""What the drives of a robot have done with recorded commands: the drives of the cell, played once more."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator
from scipy.integrate import cumulative_trapezoid

from robots.description.model import NUM_JOINTS, RobotModel
from robots.identification.closed_loop.driven_arm import STEPS, DriveTorques, at_steps
from robots.identification.motion import MotionCase
from systems.cell.drive import Drive, DriveConfig

_COMMANDS = ("position_command", "velocity_command", "torque_feedforward")


@dataclass(frozen=True)
class Led:
    """How drives lead the motors along a case, before gains come in; N steps of the integration."""

    position: np.ndarray  # set-points beyond where the motors were measured in rad, (N, 6)
    integral: np.ndarray  # of that, rad s, (N, 6)
    speed: np.ndarray  # of the set-points beyond that of the motors in rad/s, (N, 6)
    held: np.ndarray  # torque in N m beside the controllers', (N, 6)


class DriveReplay:
    """Cascades that are told recorded commands, with the motors where they were measured."""

    def __init__(self, robot: RobotModel, config: DriveConfig, period: float, payload: float) -> None:
        """Builds the drives.

        Args:
            robot: as the drives know it.
            config: gains and delays.
            period: time between commands in s.
            payload: mass at the flange in kg, as the drives know it.

        Raises:
            ValueError: if the delay is shorter than a period.
        """
        self._drive, self._period = Drive(robot, "cascade", config, period, payload, True), period
        gains = self._drive.gains
        self._gains = np.stack([gains.proportional, gains.integral, gains.derivative])

    def torques(self, led: Led) -> DriveTorques:
        """What the controllers give along a case."""
        by_position, by_integral, by_speed = self._gains
        told = by_position * led.position + by_integral * led.integral + by_speed * led.speed + led.held
        return DriveTorques(told, self._gains, np.zeros(NUM_JOINTS))

    def led(self, case: MotionCase, commands: np.ndarray) -> Led:
        """How the drives lead a case that begins at a tick, at rest where the commands are; with any gains.

        Args:
            case: with the motors as measured.
            commands: at the ticks; positions in rad, velocities in rad/s and torques in N m, (ticks, 3, 6).
        """
        wanted, held = self._ticks(case, commands)
        position, speed = wanted - np.stack([at_steps(case.theta), at_steps(case.rate)])
        integral = cumulative_trapezoid(position, dx=case.period / STEPS, axis=0, initial=0.0)
        # A torque that changes at a tick is half of both there, as the trapezoidal rule takes it.
        held[1:] = np.where(held[1:] != held[:-1], 0.5 * (held[1:] + held[:-1]), held[1:])
        return Led(position, integral, speed, held)

    def _ticks(self, case: MotionCase, commands: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Set-points and their speeds, (2, N, 6), and torques beside the controllers', (N, 6)."""
        simulator = Simulator(self._drive)
        context, period = simulator.get_mutable_context(), self._period
        setpoint = np.stack([commands[0, 0], np.zeros(NUM_JOINTS)])
        samples = max(1, round(period / case.period))
        N = (len(case.theta) - 1) * STEPS + 1
        since = np.arange(samples * STEPS)[:, None] * case.period / STEPS
        wanted, held = [], []
        self._drive.set_at_rest(context, commands[0, 0])
        for tick in range(-(-N // len(since))):
            # What a tick reads was issued a tick before.
            issued = commands[min(max(tick - 1, 0), len(commands) - 1)]
            measured = np.concatenate([case.theta[tick * samples], case.rate[tick * samples]])
            inputs = dict(zip(_COMMANDS, issued, strict=True))
            for name, value in (inputs | {"setpoint": setpoint.ravel(), "motor_state": measured}).items():
                self._drive.GetInputPort(name).FixValue(context, value)
            if not tick:
                simulator.Initialize()
            simulator.AdvanceTo((tick + 0.5) * period)
            a = self._drive.GetOutputPort("acceleration").Eval(context)
            (p, v), s = setpoint, since
            wanted.append(np.stack([p + v * s + 0.5 * a * s**2, v + a * s]))
            held.append(np.tile(self._drive.GetOutputPort("added_torque").Eval(context), (len(s), 1)))
            setpoint = np.stack([p + v * period + 0.5 * a * period**2, v + a * period])
        return np.concatenate(wanted, axis=1)[:, :N], np.concatenate(held)[:N]
