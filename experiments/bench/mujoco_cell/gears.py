"""Gears with play, hysteresis and uneven ratios for a MuJoCo model, written anew.

Nothing of `robots.drivetrain` is in it. What differs from its parts on purpose: teeth that part may pull as
long as their damper does, hysteresis is made of springs that slip, each from a stretch of its own, in place
of Dahl's rounded one, and the hump of friction at low speeds is another curve.
"""

# MuJoCo's functions are in a library of which type checkers see nothing.
# pyright: reportAttributeAccessIssue=false

from dataclasses import dataclass

import mujoco
import numpy as np

from experiments.bench.mujoco_cell.arm import JOINTS, Arm
from robots.description.model import RobotModel

_ARC_MINUTE = np.deg2rad(1.0 / 60.0)  # rad
SLIPS = np.array([1.5e-4, 4e-4, 1e-3])  # rad, stretches at which the springs of hysteresis slip


@dataclass(frozen=True)
class Wear:
    """What gears have beyond springs and dampers; each is up to a fifth more or less in each joint."""

    play: float = 0.5  # arc minutes, from flank to flank
    grease: float = 0.3  # of the gear's damping, that teeth move against in their gap
    hysteresis: float = 0.1  # of the gear's stiffness, in springs that slip
    unevenness: float = 2e-5  # rad, of the link, twice a turn of the motor
    hump: float = 0.3  # of Coulomb friction, that there is more of at low speeds
    hump_speed: float = 0.02  # rad/s, of the joint, where there is most of it


class WornGears:
    """The gears of a MuJoCo model, whose springs they take over.

    What uneven ratios make of the torque that motors feel, half a hundredth of it, is left out.
    """

    def __init__(self, arm: Arm, robot: RobotModel, wear: Wear, seed: int) -> None:
        """Draws what each gear has.

        Args:
            arm: whose springs and dampers of the gears are from now on set at each step.
            robot: whose numbers the arm has, for gear ratios.
            wear: how large.
            seed: of the draw.
        """
        model, rng = arm.model, np.random.default_rng([seed, 1])

        def about(size: float) -> np.ndarray:
            return size * (1.0 + rng.uniform(-0.2, 0.2, len(JOINTS)))

        self._model, self._motors = model, arm.motors
        self.joints = np.array([model.joint(f"gear_{number}").qposadr[0] for number in JOINTS])
        self.stiffness = model.jnt_stiffness[self.joints].copy()
        self._damping = model.dof_damping[self.joints].copy()
        self.half_play = 0.5 * about(wear.play * _ARC_MINUTE)
        self._grease = about(wear.grease) * self._damping
        self.springs = (about(wear.hysteresis) * self.stiffness)[:, None] / len(SLIPS)
        self._frequency = 2.0 * np.asarray(robot.gear_ratio)
        self._unevenness = about(wear.unevenness)
        self._phase = rng.uniform(0.0, 2.0 * np.pi, len(JOINTS))
        self.hump = about(wear.hump) * model.dof_frictionloss[self._motors]
        self._hump_speed = wear.hump_speed
        self.stretch = np.zeros((len(JOINTS), len(SLIPS)))  # rad, of the springs of hysteresis
        self._last = np.zeros(len(JOINTS))

    def uneven(self, theta: np.ndarray) -> np.ndarray:
        """By how much links are ahead of motors at theta, rad, (6,)."""
        return self._unevenness * np.sin(self._frequency * theta + self._phase)

    def more_friction(self, speed: np.ndarray) -> np.ndarray:
        """What motors need more at low speeds, N m, (6,), at their speeds in rad/s of the joint."""
        share = speed / self._hump_speed
        return self.hump * share * np.exp(0.5 * (1.0 - share**2))

    def rest(self, data: mujoco.MjData) -> None:
        """Teeth lie on the side to which gravity pushes them, and the springs of hysteresis are relaxed."""
        theta = data.qpos[self._motors]
        for _ in range(10):
            mujoco.mj_forward(self._model, data)
            load = -data.qfrc_bias[self.joints]
            x = load / self.stiffness + np.copysign(self.half_play, load)
            data.qpos[self.joints] = x + self.uneven(theta)
        self._last, self.stretch = x, np.zeros_like(self.stretch)

    def step(self, data: mujoco.MjData) -> None:
        """Before a step of the physics: springs and dampers of teeth where they are now, and torques."""
        theta, speed = data.qpos[self._motors], data.qvel[self._motors]
        uneven = self.uneven(theta)
        x = data.qpos[self.joints] - uneven
        meet = np.abs(x) > self.half_play
        model = self._model
        model.jnt_stiffness[self.joints] = np.where(meet, self.stiffness, 0.0)
        model.qpos_spring[self.joints] = np.copysign(self.half_play, x) + uneven
        model.dof_damping[self.joints] = self._grease + np.where(meet, self._damping, 0.0)
        turn, self._last = x - self._last, x
        self.stretch = np.clip(self.stretch + turn[:, None], -SLIPS, SLIPS)
        held = -(self.springs * self.stretch).sum(axis=1)
        data.qfrc_applied[self.joints] = held
        data.qfrc_applied[self._motors] -= self.more_friction(speed)
