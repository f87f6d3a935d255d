"""Rows of numbers found by time in a ring: of one instant all that is known; the steps between readings."""

import numpy as np

from robots.compiled import compiled, inner
from systems.estimation.kernels.poses import move
from systems.estimation.kernels.tip import largest_change


@inner
def around(count, times, time):
    """Places of the rows before and behind a time in a ring, and which share of the way from one it is."""
    length = len(times)
    held, first = min(count, length), count % length if count > length else 0
    newest = (count - 1) % length
    if time >= times[newest]:
        return newest, newest, 0.0
    low, high = 0, held  # the first row that is later than the time is between them
    while low < high:
        middle = (low + high) // 2
        if times[(first + middle) % length] <= time:
            low = middle + 1
        else:
            high = middle
    if low == 0:
        return first, first, 0.0
    before, behind = (first + low - 1) % length, (first + low) % length
    return before, behind, (time - times[before]) / (times[behind] - times[before])


@inner
def between(rows, before, behind, share, out):
    """The row between two; the first one if the share is zero."""
    for k in range(len(out)):
        out[k] = rows[before, k]
        if share != 0.0:
            out[k] = (1.0 - share) * rows[before, k] + share * rows[behind, k]


@compiled
def row_at(count, times, rows, time, out):
    """`History.at` of the first ``count`` rows; there is one at least."""
    before, behind, share = around(count, times, time)
    between(rows, before, behind, share, out)


@compiled
def address(vector):
    """Where an array begins in memory."""
    return vector.ctypes.data


@compiled
def compare(encoders, planned, time, off):
    """Puts by how much motors were behind a plan at a time behind what is known of the instants before.

    Args:
        encoders: `Ring` of positions and velocities in rad and rad/s.
        planned: positions, (6,), or a longer row that begins with them.
        time: s.
        off: rows of the last instants, (n, 6) rad, the newest last, which are moved up by one; not a number
            as long as there are no encoders.
    """
    last = len(off) - 1
    for k in range(last):
        for i in range(6):
            off[k, i] = off[k + 1, i]
    count = int(encoders.count[0])
    if count > 0:
        cubic_at(count, encoders.times, encoders.rows, time, off[last])
    for i in range(6):
        off[last, i] = planned[i] - off[last, i] if count > 0 else np.nan


@compiled
def otherwise(off, half, span, faster, accelerated):
    """By how much motors were faster and more accelerated than planned in the middle of the last instants.

    Args:
        off: rad, by which they were behind, (2 half + 1, 6), the newest last.
        half: how many instants there are before that in the middle.
        span: s, that these take.
        faster, accelerated: rad/s and rad/s^2, (6,), are written; none if encoders are not known.
    """
    newest = 2 * half
    for i in range(6):
        before, now, behind = off[0, i], off[half, i], off[newest, i]
        faster[i], accelerated[i] = (
            (before - behind) / (2.0 * span),
            (2.0 * now - before - behind) / (span * span),
        )
    if np.isnan(accelerated[0]):  # encoders are known of all joints or of none
        faster[:], accelerated[:] = 0.0, 0.0


@inner
def cubic_at(count, times, rows, time, out):
    """Positions at a time, by the cubic through the rows of positions and velocities beside it."""
    before, behind, s = around(count, times, time)
    number = len(out)
    h, r = times[behind] - times[before], 1.0 - s
    for k in range(number):
        out[k] = rows[before, k]
        if before != behind:
            out[k] = (
                (1.0 + 2.0 * s) * r * r * rows[before, k]
                + s * r * r * h * rows[before, number + k]
                + s * s * (3.0 - 2.0 * s) * rows[behind, k]
                - s * s * r * h * rows[behind, number + k]
            )


@compiled
def instant(encoders, plan, exposure, lag, theta, then, now, twist, ahead, X_WE):
    """Encoders and plan at an exposure; there is a row of each at least.

    Args:
        encoders, plan: `Ring`.
        exposure: s, on the clock of both.
        lag: s, by which gears yield later than they are loaded.
        theta: positions of the motors in rad, (6,); then, now: rows of the plan, earlier by the lag and not;
            are written. Rows begin with positions of the motors.
        twist: of the tip, as it lies in ``now``, (6,).
        ahead: s, by which the exposure is later than its stamp.
        X_WE: the pose that was seen, (4, 4), is moved along by that.

    Returns:
        By how much a motor is off its plan at most, rad.
    """
    cubic_at(int(encoders.count[0]), encoders.times, encoders.rows, exposure, theta)
    number = int(plan.count[0])
    row_at(number, plan.times, plan.rows, exposure - lag, then)
    row_at(number, plan.times, plan.rows, exposure, now)
    step = np.empty(6)
    for i in range(6):
        step[i] = ahead * twist[i]
    move(X_WE, step)
    return largest_change(now, theta, 6)


@compiled
def least_change(row, last, least, smaller, count, age, enough, window):
    """Keeps the smallest change from one row to the next that comes again, entry by entry.

    Args:
        row: (n,).
        last: the row before, (n,); not a number before there is one; is renewed.
        least: the smallest change that came often enough, (n,); is renewed.
        smaller: the largest of those that were smaller since, (n,); is renewed.
        count: how many there were, (n,); is renewed.
        age: how many rows ago the first of them was, (n,); is renewed.
        enough: so many make it the smallest one.
        window: within so many rows.
    """
    for k in range(len(row)):
        change = abs(row[k] - last[k])
        last[k] = row[k]
        age[k] += 1.0
        if age[k] > window:
            count[k] = 0.0
        if 0.0 < change < least[k]:  # never of the first row: nothing is less than not a number
            if count[k] == 0.0:
                smaller[k] = age[k] = 0.0
            smaller[k] = max(smaller[k], change)
            count[k] += 1.0
            if count[k] >= enough:
                least[k], count[k] = smaller[k], 0.0
