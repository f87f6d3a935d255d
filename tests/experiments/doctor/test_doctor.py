"""``truetip doctor``: says what is there, what is missing, and how to get it."""

import json
import socket

import pytest

from experiments.doctor import checks
from tests.experiments.commands import truetip


def test_it_names_versions_cores_and_ports():
    result = truetip("doctor", "--json=-")
    assert result.exit_code == 0
    found = {each["name"]: each for each in json.loads(result.stdout)}
    assert found["Python"]["state"] == "ok"
    assert {"drake", "numpy", "cores", "timer", "real-time priority", "browser", "cluster"} <= set(found)
    assert "Everything that is needed is there." in result.stderr


def test_a_port_that_is_taken_is_named_with_the_way_out():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        try:
            taken.bind(("127.0.0.1", 6510))
        except OSError:
            pytest.skip("another process has the port of EGM")
        found = {each.name: each for each in checks.ports()}
    egm = found["port 6510 (UDP), EGM"]
    assert (egm.state, egm.found) == (checks.OPTIONAL, "address already in use")
    assert "station.link.port" in egm.advice


def test_a_missing_package_ends_it_with_code_one(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(checks, "requires", lambda name: ["nothing-such>=1", 'extra-such; extra == "dev"'])
    result = truetip("doctor")
    assert result.exit_code == 1
    assert "pip install 'nothing-such>=1'" in " ".join(result.stdout.split())
    assert "extra-such" not in result.stdout
