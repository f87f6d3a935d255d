"""Where things stand in the regression of drives: its parameters, its regressors, the torques behind them.

What each joint has of its own stands six by six, in the order of the joints, if nothing else is said.
"""

# Parameters beta.
DEAD_TIME = 0  # s, of all joints alike
LAG = 1  # s, of each joint
INERTIA = 7  # hundredths of s^2
FRICTION = 13  # joint by joint: rotor, viscous and Coulomb friction, its hump at low speeds; shares
OF_FRICTION = 4
CONSTANT = 37  # rad
MASS, MOMENT = 43, 44  # kg, and kg m along x, y and z
SMOOTHED = 47  # s, by which a planner smooths, or drives know their speed late
SHARP = 48  # shares of Coulomb's friction that turn over at once
NOT_HELD = 54  # kg
GIVING = 60  # shares
OTHER_GAINS = 66  # shares of three sets of gains
THIRD = 69  # shares of Coulomb's friction that turn over within a third of the believed width
SIZE = 75

# Torques w: what nobody gives; rotor, viscous and Coulomb friction, its hump at low speeds; the load of a
# kilogram and of a kg m of its first moment along x, y and z; a kilogram that is not held; what friction is
# more than believed where it turns over at once, and within a third of the believed width.
W_MISSING, W_ROTOR, W_VISCOUS, W_COULOMB, W_HUMP = range(5)
W_LOADS, W_NOT_HELD, W_SHARP, W_THIRD = 5, 9, 10, 11
NUM_TORQUES = 12

# Rows of the regressors, of six joints each, that parameters are multiplied by: following errors by torques
# in rad, and others.
ROW_FRICTION, ROW_LOADS, ROW_NOT_HELD = 0, 4, 8
ROW_SMOOTHED = 9  # rad/s, accelerations as a planner smooths them
ROW_RATE = 10  # rad/s, by which the command runs away from the plan
ROW_SHARP, ROW_GIVING, ROW_OTHER_GAINS, ROW_THIRD = 11, 12, 13, 16
NUM_ROWS = 17
