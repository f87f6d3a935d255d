"""Two commits in turn: the same files on both sides move the same and cost the same."""

import pytest

from experiments.bench.against import NEW, OLD, ROOT, SLICE, Commit, take_turns


@pytest.mark.slow
def test_the_same_files_on_both_sides_move_alike_bit_for_bit_and_cost_alike():
    """Within a factor of two: a turn is some ten milliseconds, and others may use the machine."""
    commits = {OLD: Commit(ROOT), NEW: Commit(ROOT)}
    try:
        turns, change = take_turns(commits, "open_loop", 5 * SLICE)
    finally:
        for commit in commits.values():
            commit.close()
    assert change == 0.0
    assert all(len(times) == 4 and (times > 0.0).all() for times in turns.cpu.values())
    assert 0.5 < turns.ratio("bare") < 2.0
    assert 0.5 < turns.ratio("closed") < 2.0
    assert turns.beyond_bare(NEW) > 0.0
