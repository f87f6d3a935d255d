"""A client of EGM that others wrote, in a process of its own: moves the robot and prints where it is.

Usage: foreign_client.py PACKAGE PORT MODE, with MODE joint, pose or speed. It counts time in the cycles of
the robot: its own clock would run on where a busy machine lets it wait.
"""

import importlib
import json
import sys

import numpy as np

PACKAGE, PORT, MODE = sys.argv[1], int(sys.argv[2]), sys.argv[3]
PERIOD, MOVING, DURATION = 4.032e-3, 1.0, 2.0  # s
egm = importlib.import_module(
    {"ABBRobotEGM": "ABBRobotEGM.egm", "abb_robot_client": "abb_robot_client.egm"}[PACKAGE]
)
is_newer = PACKAGE == "ABBRobotEGM"


def position(state) -> np.ndarray:
    """The position of the tool in mm."""
    found = state.cartesian.pos if is_newer else state.cartesian[0]
    return np.array([found.x, found.y, found.z]) if is_newer else found


def orientation(state) -> np.ndarray:
    """Its quaternion, w first."""
    found = state.cartesian.orient if is_newer else state.cartesian[1]
    return np.array([found.u0, found.u1, found.u2, found.u3]) if is_newer else found


client = egm.EGM(port=PORT)
print("listening", flush=True)
ok, state = client.receive_from_robot(20.0)
assert ok, "the robot did not speak"
start, pose = state.joint_angles, (position(state), orientation(state))
for cycle in range(int(DURATION / PERIOD)):
    share = min(1.0, cycle * PERIOD / MOVING)
    if MODE == "joint":
        client.send_to_robot(start + share * np.array([2.0, 0.0, -1.0, 0.0, 0.0, 3.0]))
    elif MODE == "speed":
        client.send_to_robot(None, speed_ref=np.array([1.5, 0.0, 0.0, 0.0, 0.0, -2.0]) * (share < 1.0))
    else:
        target = pose[0] + share * np.array([0.0, 10.0, 5.0])
        if is_newer:
            client.send_to_robot(cartesian=(target, pose[1]))
        else:
            client.send_to_robot_cart(target, pose[1])
    ok, state = client.receive_from_robot(0.5)
    assert ok, "the robot fell silent"
moved = (state.joint_angles - start).tolist()
print(
    json.dumps(
        {"joints": moved, "tool": (position(state) - pose[0]).tolist(), "running": state.rapid_running}
    )
)
