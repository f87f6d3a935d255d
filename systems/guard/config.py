"""What the guard may be told, and what it counts."""

from dataclasses import dataclass

from robots.configuration.quantity import choice, quantity

KINDS = (
    "velocity_limit",  # a joint would have moved faster than it may; all joints are slowed alike
    "acceleration_limit",  # a joint would have changed its speed faster than it may
    "position_limit",  # a joint would have left its range
    "correction_limit",  # the law's correction stands at its limit
    "no_command",  # the law gave no finite command, or the joints are not known; the robot is slowed down
    "measurement_refused",  # a sample too far from the path to be true
    "measurement_held",  # no usable sample for a while; the law holds its correction
    "stopped",  # no usable sample or no command for too long, or the robot does not run; it is at rest
    "resumed",  # the robot is led from rest back to the law's command
)


@dataclass
class GuardConfig:
    """Limits and time-outs of the guard; read from a scenario file."""

    # Without a usable sample: the correction is held, the path goes on
    hold_after: float = quantity(0.05, 1e-3, 10.0, "s")
    stop_after: float = quantity(0.5, 1e-3, 60.0, "s")  # without a usable sample or command: smooth stop
    stop_time: float = quantity(0.25, 1e-3, 10.0, "s")  # from full motion to rest
    # Whether to go on when what caused a stop is over, be it camera, law or controller
    resume: bool = False
    resume_time: float = quantity(1.0, 1e-3, 60.0, "s")  # at least, from rest back to the law's command
    speed_share: float = quantity(1.0, 0.0, 1.0, is_open=True)  # of the robot's largest joint speeds
    # On a real station: whether the path is slowed where the controller reports that it would need more than
    # all of its performance (utilisation rate of EGM)
    obey_utilization: bool = False
    # What becomes of a law that corrects by more than its limit
    on_correction_limit: str = choice("limit", ("limit", "stop"))
    # From the path: a sample further away is taken for a false detection
    largest_deviation: float = quantity(0.2, 1e-4, 2.0, "m")
    largest_deviation_deg: float = quantity(40.0, 0.01, 180.0, "deg")  # as the distance, of the orientation
