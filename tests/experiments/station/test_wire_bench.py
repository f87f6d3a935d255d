"""What the wire's benchmark counts against the servo, and what it does not."""

import numpy as np

from experiments.bench.wire import PERIOD, missed_ticks


def test_a_missed_message_is_excused_only_if_the_next_one_came_too_soon():
    """Each gap is judged by itself: a burst elsewhere excuses nothing."""
    stamps = 1000.0 + PERIOD * np.arange(50)
    crowded_at = stamps[[12, 13, 40]]
    heard = stamps.copy()
    heard[[12, 20, 21, 39]] = np.nan
    # 12 was overtaken by 13 and 39 by 40, which came too soon; 20 and 21 had all the time there is.
    assert missed_ticks(heard, crowded_at) == (2, 2)
    assert missed_ticks(heard, np.array([])) == (4, 0)
    assert missed_ticks(stamps, crowded_at) == (0, 0)


def test_nothing_is_missed_before_the_first_answer_and_after_the_last():
    stamps = np.full(10, np.nan)
    stamps[3:7] = 1.0 + PERIOD * np.arange(4)
    assert missed_ticks(stamps, np.array([])) == (0, 0)
