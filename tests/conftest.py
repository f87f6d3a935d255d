"""What all tests share: the same examples of hypothesis in every run, and patience with the clock."""

import pytest
from hypothesis import settings

settings.register_profile("truetip", derandomize=True, deadline=None, database=None)
settings.load_profile("truetip")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What keeps the time of the clock may fail where other work took the processor: it runs again."""
    for item in items:
        if item.get_closest_marker("real_time") is not None:
            item.add_marker(pytest.mark.flaky(reruns=2))
