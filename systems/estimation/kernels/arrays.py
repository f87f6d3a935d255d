"""The arrays that compiled functions are given, by name."""

from typing import NamedTuple

import numpy as np

SHIFTS, TURNS_BEFORE, TURNS_BEHIND = 0, 1, 2  # what a parameter does to the placement of its body
# A keyframe: encoder positions, deflection of the gears, joint velocity and acceleration, twist, time, the
# rows of the pose that was seen, its weight in samples, and shapes of the gears' errors if there are any.
THETA, GEARS, MOTION, TWIST, TIME, POSE, WEIGHT, SHAPES = 0, 6, 12, 24, 30, 31, 43, 44


class Drawing(NamedTuple):
    """What does not depend on parameters: C columns are joints, two tilts of each bearing, parameters."""

    entries: np.ndarray  # (m, 5) of body after body: parameter, body, what it does, axis, column or -1
    translation: np.ndarray  # (8, 3) of base, links and tool in the frame before
    rotation: np.ndarray  # (8, 3, 3)
    nominal: np.ndarray  # (48,), of angles to which parameters are added
    joint_turns: np.ndarray  # (3, 6, 3, 3): a joint turns by the first + sin second + cos third
    axes: np.ndarray  # (C, 3), of columns in their frame, where they are constant
    is_shift: np.ndarray  # (C,)
    frame: np.ndarray  # (C,), to which a column belongs: 0 for the world, 1 to 6 for the links


class Constants(NamedTuple):
    """What a value of the parameters makes of the robot."""

    p: np.ndarray  # (48,)
    chosen: np.ndarray  # (g,), those of them that have a column
    along: np.ndarray  # (6, 3, 4), the pose of a link in the one before is along + sin sine + cos cosine
    sine: np.ndarray
    cosine: np.ndarray
    tool: np.ndarray  # (3, 4), in the last link
    turn: np.ndarray  # (C, 3), axes of turning columns in the frame that they belong to
    way: np.ndarray  # (C, 3), by which the tool would move if it were at the origin of that frame
    frame: np.ndarray  # (C,), as of `Drawing`


class Masses(NamedTuple):
    """Six links, then a kilogram of payload, which moves with the last link."""

    mass: np.ndarray  # (7,) kg
    centres: np.ndarray  # (7, 3) m, in the frame of the link
    inertia: np.ndarray  # (7, 3, 3) kg m^2, about the centre, in the axes of the link
    axes: np.ndarray  # (6, 3, 3), rows: axis of the joint, two axes about which its bearing tilts
    spring: np.ndarray  # (7,) of the counterbalance: stiffness (0 if there is none) and preload,
    # radii of its base and its arm, angle of the dead centre, way along the axis, least length; SI


class Unknowns(NamedTuple):
    """A value of the unknowns x, with what does not change.

    In x are g geometric errors, 18 factors of compliance, mass and first moment of the payload,
    offset and drift of the clock, and errors of gears if there are any.
    """

    x: np.ndarray  # (size,)
    sigma: np.ndarray  # (size,), units of the columns
    compliance: np.ndarray  # (18,) rad per N m


class Seen(NamedTuple):
    """What is known of n instants beside encoder positions."""

    twist: np.ndarray  # (n, 6), of the tip
    time: np.ndarray  # (n,) s, since the camera's clock was compared first
    shapes: np.ndarray  # (n, 7, 6) of the gears' errors, or (n, 0, 6)


class SeenOnce(NamedTuple):
    """The same of one instant."""

    twist: np.ndarray  # (6,)
    time: float  # s
    shapes: np.ndarray  # (7, 6) or (0, 6)


class PathInstant(NamedTuple):
    """What is wanted at one instant."""

    X_WE: np.ndarray  # (4, 4), on the path
    V_WE: np.ndarray  # (6,)
    left: float  # share of the way from where the robot began onto the path
    fading: float  # by which it changes per s
    parameter_rate: np.ndarray  # (g,), of the chosen parameters
    aside: np.ndarray  # (3, 6), a motion of the joints beside the path: rad and derivatives
    step: float  # s since the instant before
    newton_step: float  # rad, a step of Newton's method that is small enough to be the last
    likely: np.ndarray  # (m, 6), how likely each model of a gear is


class FollowerState(NamedTuple):
    """What planning one instant hands on to the next."""

    q: np.ndarray  # (6,) rad, of the joints behind the gears
    rates: np.ndarray  # (2, 6), of the last two instants, newest first
    wander: np.ndarray  # (6,) rad/s, by which joints move because parameters do
    start_error: np.ndarray  # (6,), from the tip to the path where the robot began
    start_yield: np.ndarray  # (6,) rad, by which motors were further ahead then than they should have been
    yields: np.ndarray  # (4, 6) rad, by which motors are ahead, newest first
    gears: np.ndarray  # (1 + 3 m, 6), of `GearErrors` with m models of each gear
    shares: np.ndarray  # (m, 6), by which these count; they follow how likely they are


class Drives(NamedTuple):
    """What is believed of motors and of the cascades that control them."""

    rotor: np.ndarray  # (6,) kg m^2, joint side
    inertia: np.ndarray  # (6,) kg m^2, of what turns as a motor does: rotor, and links without a gap between
    viscous: np.ndarray  # (6,) N m s/rad
    coulomb: np.ndarray  # (6,) N m
    width: np.ndarray  # (6,) rad/s, of the speeds in which friction turns over
    slack: np.ndarray  # (6,) rad, of a following error, that friction makes where it is not as believed
    slow: float  # rad/s, at which what friction has more at low speeds has fallen to a third
    kp: np.ndarray  # (6,) N m/rad, gains of a following error, of its integral and of its rate
    ki: np.ndarray  # (4, 6), and of three other sets of gains
    kd: np.ndarray  # (6,)
    # A period's step from integral, error, torque and its change to the first two, of each set of gains
    step: np.ndarray  # (4, 6, 2, 4)
    period: float  # s
    payload: float  # kg, with which the drives hold the arm
    takes_torque: bool
    # 1/s, gain of a planner that follows references, or of position loops where drives take torques
    following: float
    acceleration: np.ndarray  # (6,) rad/s^2, of commands


class DriveMemory(NamedTuple):
    """What one command hands on to the next."""

    started: np.ndarray  # (1,)
    # Integral of a following error, and the error, of each of twelve torques, with each set of gains
    z: np.ndarray  # (4, 12, 6, 2)
    w: np.ndarray  # (12, 6), those torques; if torques are taken, of the first what changes evenly
    beta: np.ndarray  # (75,), parameters of the regression
    led: np.ndarray  # (2, 75), the same as they are used, which follow those, and their rates
    correction: np.ndarray  # (6,) rad
    smoothed: np.ndarray  # (6,) rad/s, accelerations through 1 / (s + following)
    hung: np.ndarray  # (2, 6) rad, by which motors were off when they were slow, fading, and are if they are
    wound: np.ndarray  # (3, 6), integral and error left of what drives wound up; s, that motors hang
    # (3, 6), what was commanded beside the plan: rad; rad/s, mean speed until then and the commanded one
    aside: np.ndarray
    # (3, 6), of what was learnt the share that torques make up for; rad, the following error that they leave
    # out; and N m, of these torques what changes evenly
    by_torque: np.ndarray


class Gap(NamedTuple):
    """Play of a gear, and what stands beside its teeth, of m models that differ."""

    least: float  # of the compliance that the robot's file says
    grease: float  # N m s/rad, that teeth move against
    held: float  # of the stiffness of the gear, what the hysteresis has
    widths: np.ndarray  # (m,) rad of deflection, after which it has turned over; the first is their unit
    halves: np.ndarray  # (m,) rad, half of the least play


class Gears(NamedTuple):
    """What gears have beyond their springs."""

    ratio: np.ndarray  # (6,)
    compliance: np.ndarray  # (6,) rad per N m
    lag: np.ndarray  # (6,) s, by which damping holds them back
    gap: Gap


class Planned(NamedTuple):
    """A plan of one instant, to be written."""

    motion: np.ndarray  # (4, 6) position, velocity and acceleration of the motors, and the twist of the tip
    moving: np.ndarray  # (3, 6) rad and derivatives of the joints behind the gears
    loads: np.ndarray  # (5, 18)
    columns: np.ndarray  # (6, C)
    states: np.ndarray  # (18,) of the gears
    others: np.ndarray  # (m, 6) rad, by how much links would be further ahead with each model of a gear
    ratios: np.ndarray  # (6,) speed of the joint for that of the motor, 1 but for the waves of its gear


class Ring(NamedTuple):
    """Rows of numbers with their times, the last ones of all that there were."""

    count: np.ndarray  # (1,), of all of them
    times: np.ndarray  # (n,) s
    rows: np.ndarray  # (n, columns)


class OpenKeyframe(NamedTuple):
    """Samples that are being merged: sums of what they say, each times its weight."""

    A: np.ndarray  # (n, n), of H^T W H, its lower half until it is merged
    b: np.ndarray  # (n,), of H^T W y with y = r + H xi
    samples: np.ndarray  # (1,)
    weight: np.ndarray  # (1,)
    first_theta: np.ndarray  # (6,), of the first sample, rad
    means: np.ndarray  # (31,) or (73,), of theta, gears, motion, twist, time and shapes
    y: np.ndarray  # (6,)
    H: np.ndarray  # (6, n)
