"""Runs in which the guard did not let a law lead the tip to the end of its path."""

from collections.abc import Mapping, Sequence

from diagrams.record.log import RunLog

_SHARE = 0.9  # of a path: a joint that stands at a limit for so long has never been led
_AT_ONCE = 0.1  # s, in which a command at a limit is no error of a law that learns, but one of its units
_SLACK = 0.1  # s, between the last tick and the last sample of a log


def unfinished(log: RunLog) -> str:
    """What kept the tip from being led to the end of its path, in words; empty where nothing did.

    A stop in the dwell is none: the path is over then, and the tip at rest.
    """
    if log.ended_early:
        return log.ended_early
    events = log.guard_events
    held = next((event for event in events if event.kind == "path_held"), None)
    if held is not None:
        return f"at {held.time:.1f} s: {held.detail}"
    limit = next((event for event in events if event.kind == "position_limit"), None)
    unit = ""
    if limit is not None and limit.time - log.time[0] < _AT_ONCE:
        unit = "; joints were commanded beyond their range at once: are commands in rad and rad/s?"
    stop = next((event for event in reversed(events) if event.kind == "stopped"), None)
    if stop is not None and stop.time < log.dwell_start and stop.end >= log.time[-1] - _SLACK:
        return f"the guard stopped the robot at {stop.time:.1f} s and it did not go on{unit}"
    if limit is not None and limit.lasted >= _SHARE * (log.path_end - log.path_start):
        return (
            f"the guard held a joint at the end of its range from {limit.time:.1f} to {limit.end:.1f} s{unit}"
        )
    return ""


def unfinished_cycles(cycles: Sequence[RunLog]) -> str:
    """As `unfinished`, of the runs of one law; where there are several, with their numbers."""
    numbers: dict[str, list[int]] = {}
    for number, log in enumerate(cycles, 1):
        if ending := unfinished(log):
            numbers.setdefault(ending, []).append(number)
    if len(cycles) == 1:
        return "".join(numbers)
    return "; ".join(
        f"cycle{'s' if len(each) > 1 else ''} {', '.join(map(str, each))}: {ending}"
        for ending, each in numbers.items()
    )


def never_finished(failures: Mapping[str, Sequence[str | None]]) -> str:
    """Which laws have no run that came to its end, in words; empty where each has one.

    Args:
        failures: of each law by its name: why a run failed, empty or None where it did not.
    """
    lost = [law for law, reasons in failures.items() if all(reasons)]
    if not lost:
        return ""
    which = f" of {', '.join(lost)}" if len(lost) < len(failures) else ""
    return f"no run{which} came to its end"
