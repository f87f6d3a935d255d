"""What a scenario says of the predictive correction."""

from dataclasses import dataclass

from robots.configuration.quantity import choice, positive, quantity


@dataclass
class PredictiveConfig:
    """Whether motors are corrected for what friction leaves, and what is believed of the drives."""

    kind: str = choice("none", ("none", "motors"))  # motors: by torques on top of the feedforward's
    horizon: float = quantity(0.064, 0.008, 0.5, "s")  # that is looked ahead, beyond the delay of commands
    # What a change of the torque from tick to tick costs against an error of the motors, lambda_u of (5.12);
    # empty: 1.3 / w^2, with the lowest angular frequency w of the stretched arm, which then is hardly excited
    smoothness: float | None = quantity(None, 1e-5, 1.0, "s^2")
    # Of the correction, as a share of the Coulomb friction that is believed
    limit: float = quantity(2.0, 0.0, 10.0)
    # Of the cascades in the drives: speed per position error, torque per speed error and inertia, integral
    position: float = positive(25.0, "1/s")
    velocity: float = positive(100.0, "1/s")
    integral: float = quantity(10.0, 0.0, unit="1/s")
