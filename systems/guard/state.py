"""What a guard remembers from tick to tick, beside its counts: where what stands in a vector."""

from systems.guard.config import KINDS

# What was issued last (NaN before the first command), the velocity from which a braking began, the mode, the
# times of the first tick and of the last command, the refused samples seen, and the way back after a stop:
# how long it is in s, how much of it is done, where it began as seen from the law's command, position and
# velocity, and where it is now; where the joints were at the last tick; what was issued before the last; the
# accelerations with which position and velocity came to what was issued; and whether the joints are led
# elsewhere than the law would have them.
POSITION, VELOCITY, BRAKING, LAST_BUT_ONE = 0, 6, 12, 48  # where six numbers begin
POSITIONS, VELOCITIES, ISSUED, BRAKING_FROM = slice(0, 6), slice(6, 12), slice(0, 12), slice(12, 18)
MODE, FIRST_TICK, LAST_COMMAND, REFUSED_SEEN, WAY, DONE = range(18, 24)
OFFSET, OFFSET_RATE, ASIDE, WERE_AT = slice(24, 30), slice(30, 36), slice(36, 42), slice(42, 48)
BEFORE = slice(48, 54)
TURNING, SPEEDING = slice(54, 60), slice(60, 66)
DEVIATES = 66
WIDTH = 67
GOING, HOLDING, STOPPING, RESUMING, IDLE, AWAY = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0

# What it decides at a tick: the state until then, which of `KINDS` it counts (0 or 1), when the last usable
# sample arrived, and where the joints are, NaN where they have a part in the state already.
COUNTED, LAST_SAMPLE = slice(WIDTH, WIDTH + len(KINDS)), WIDTH + len(KINDS)
JOINTS = slice(LAST_SAMPLE + 1, LAST_SAMPLE + 7)
DECISION_WIDTH = LAST_SAMPLE + 7
