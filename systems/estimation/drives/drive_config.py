"""What is believed of the drives, and how well it is known."""

from dataclasses import dataclass


@dataclass
class DriveModelConfig:
    """How the motors are believed to be controlled, and how well that is known."""

    position: float = 25.0  # 1/s, gain of the position loop of the cascade
    velocity: float = 100.0  # 1/s, of the speed loop, joint torque per speed and inertia
    integral: float = 10.0  # 1/s
    # Of drives that follow positions alone: N m of the motor for a rad, and for that over a second
    stiffness: float = 80.0
    restoring: float = 1.0
    # Of drives that follow speeds alone: N m of the motor for a rad/s; and how their motors are brought back
    # to the plan, 1/s, less where commands are late
    braking: float = 100.0
    held_to_plan: float = 7.0
    feedback: float = 20.0  # 1/s, of what a cascade leaves, at most; 0: none
    following: float = (
        20.0  # 1/s, with which the planner of a robot's controller follows references, as of EGM
    )
    # Standard deviations. That of one following error is larger than its noise by far, because what the
    # model leaves of it stays the same for many samples.
    following_sigma: float = 4e-4  # rad
    dead_time_sigma: float = 3e-3  # s, of all joints alike
    lag_sigma: float = 3e-4  # s, of each joint
    smoothing_sigma: float = 5e-4  # s, by which a controller's planner smooths speeds
    speed_lag_sigma: float = 1e-3  # s, by which drives that take torques know their speed late
    # Of a robot that carries 7 kg; of a larger one in proportion
    payload_sigma: float = 0.5  # kg
    moment_sigma: float = 0.07  # kg m, first moment of the payload: 7 kg whose centre is off by 10 mm
