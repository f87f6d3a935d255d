"""What is believed of the drives, and how well it is known."""

from dataclasses import dataclass

from robots.configuration.quantity import numbers, positive, quantity
from robots.description.model import NUM_JOINTS


@dataclass
class DriveModelConfig:
    """How the motors are believed to be controlled, and how well that is known."""

    position: float = positive(25.0, "1/s")  # gain of the position loop of the cascade
    velocity: float = positive(100.0, "1/s")  # of the speed loop, joint torque per speed and inertia
    integral: float = positive(10.0, "1/s")
    # Of drives that follow positions alone: N m of the motor for a rad, and for that over a second
    stiffness: float = positive(80.0, "N m/rad")
    restoring: float = positive(1.0, "N m/(rad s)")
    # Of drives that follow speeds alone: N m of the motor for a rad/s; and how their motors are brought back
    # to the plan, less where commands are late
    braking: float = positive(100.0, "N m s/rad")
    held_to_plan: float = positive(7.0, "1/s")
    # Of each joint, times stiffness, restoring and braking: what its motor turns over what the first one did
    motor_factors: list[float] = numbers((1.0,) * NUM_JOINTS, (NUM_JOINTS,), 0.0, is_open=True)
    feedback: float = quantity(20.0, 0.0, unit="1/s")  # of what a cascade leaves, at most; 0: none
    # With which the planner of a robot's controller follows references, as of EGM
    following: float = positive(20.0, "1/s")
    # Standard deviations. That of one following error is larger than its noise by far, because what the
    # model leaves of it stays the same for many samples.
    following_sigma: float = positive(4e-4, "rad")
    dead_time_sigma: float = quantity(3e-3, 0.0, unit="s")  # of all joints alike
    lag_sigma: float = quantity(3e-4, 0.0, unit="s")  # of each joint
    smoothing_sigma: float = quantity(5e-4, 0.0, unit="s")  # by which a controller's planner smooths speeds
    # By which drives that take torques know their speed late
    speed_lag_sigma: float = quantity(1e-3, 0.0, unit="s")
    # Of a robot that carries 7 kg; of a larger one in proportion
    payload_sigma: float = quantity(0.5, 0.0, unit="kg")
    # First moment of the payload: 7 kg whose centre is off by 10 mm
    moment_sigma: float = quantity(0.07, 0.0, unit="kg m")
