"""What sensors would say of the unknowns of an arm in a motion that was not recorded, or without them."""

from dataclasses import dataclass

import numpy as np

from robots.description.model import RobotModel
from robots.identification.arm_along_motion import ElasticArm
from robots.identification.arm_response import ArmResponse, Grid
from robots.identification.elastic_parameters import ElasticParameters
from robots.identification.motion import MotionCase, SensorPlace

# Sensitivities need less than readings that are compared: with finer ones standard deviations are the same to
# a hundredth.
_KNOT_TIME, _BASE_STEP, _GRID = 0.04, 4, Grid(1, 2, 4)
_SHIFT = 1.0  # samples, by which the times of robot and sensors may be apart, as the identification has it


@dataclass(frozen=True)
class Sighting:
    """A motion and the sensors that would watch it."""

    robot: RobotModel  # with the springs as identified: where the arm sags
    payload: float  # kg
    case: MotionCase  # its motors; its readings are not looked at
    sensors: list[SensorPlace]
    spread: np.ndarray  # (channels,) rad/s or m/s^2, what the model would leave of the readings
    parameters: ElasticParameters
    values: np.ndarray  # (n,), the unknowns as identified

    def information(self) -> np.ndarray:
        """What each of the sensors would say, (sensors, n + 1, n + 1).

        The last unknown is the lag of the sensors' clock in this motion, in samples.
        """
        arm = ElasticArm(self.robot, self.payload, self.sensors)
        along = arm.along(self.case, _KNOT_TIME, _BASE_STEP)
        parameters, ratio = self.parameters, self.robot.gear_ratio
        response = ArmResponse([along], [self.case], self.sensors, parameters, ratio, _GRID)
        shown = response(self.values)
        assert shown.sensitivity is not None
        by_shift = np.gradient(shown.readings[:, 0], axis=0) / response.step
        J = np.concatenate([shown.sensitivity[:, 0], -by_shift[..., None]], axis=2)
        J = (J / self.spread[:, None]).reshape(len(J), len(self.sensors), 3, -1)
        return np.einsum("mkin,mkij->knj", J, J)


def without_lag(information: np.ndarray) -> np.ndarray:
    """What is left of the unknowns' information (n + 1, n + 1) where the lag has to be found, too, (n, n)."""
    of_lag = information[-1, -1] + 1.0 / _SHIFT**2
    return information[:-1, :-1] - np.outer(information[:-1, -1], information[-1, :-1]) / of_lag
