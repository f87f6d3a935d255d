"""What tests of EGM share: the messages of a controller, as one would send them."""

import numpy as np

from systems.link.abb.schema import (
    DATA,
    MCI_RUNNING,
    MCI_STOPPED,
    MOTORS_OFF,
    MOTORS_ON,
    RAPID_RUNNING,
    EgmRobot,
)

SPEED = np.full(6, 5.0)  # rad/s, of the joints
HERE, ELSEWHERE = ("127.0.0.1", 50000), ("127.0.0.1", 50001)
PERIOD = 4.032e-3  # s


def report(seqno: int, position=None, time: float | None = None, running: bool = True, motors: bool = True):
    """The bytes of a message; the clock runs with the count unless a time in s is given."""
    message = EgmRobot()
    time = 10.0 + PERIOD * seqno if time is None else time
    message.header.seqno, message.header.tm, message.header.mtype = seqno, int(1e3 * time), DATA
    message.feedBack.joints.joints.extend(np.rad2deg(np.zeros(6) if position is None else position))
    message.feedBack.time.sec, message.feedBack.time.usec = int(time), round(1e6 * (time % 1.0)) % 1_000_000
    message.motorState.state = MOTORS_ON if motors else MOTORS_OFF
    message.mciState.state = MCI_RUNNING if running else MCI_STOPPED
    message.rapidExecState.state = RAPID_RUNNING
    return message.SerializeToString()
