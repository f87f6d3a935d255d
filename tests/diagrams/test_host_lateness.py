"""How late the own machine was, as the message that ends a run says it."""

import pytest

from diagrams.host_lateness import HostLateness


def test_a_message_is_late_if_anything_before_it_was():
    host = HostLateness()
    for late in (0.0, 4e-4, 0.04, 2e-3):  # two polls before each of two messages
        host.note(late, 112.3 if late == 0.04 else 100.0)
        host.note(0.0, 100.0, is_message=True)
    assert (host.messages, host.late) == (4, 2)
    assert (host.worst, host.worst_at) == (0.04, 112.3)
    assert host.sentence(100.0).startswith("this machine was late by 40 ms at 12.3 s (2 of 4 messages late, ")
    assert host.reason(100.0).startswith(f"; {host.sentence(100.0)}")


def test_a_machine_that_was_hardly_late_is_no_reason(monkeypatch):
    monkeypatch.setattr(HostLateness, "crowding", 0.1)
    host = HostLateness()
    host.note(4e-3, 1.0, is_message=True)
    assert host.reason(0.0) == ""


def test_whoever_else_waited_for_a_processor_is_named(tmp_path, monkeypatch):
    """The other end of the wire may have been late, though this one was not."""
    monkeypatch.setattr("diagrams.host_lateness._PRESSURE", tmp_path / "cpu")
    (tmp_path / "cpu").write_text(
        "some avg10=0.00 avg60=0.00 avg300=0.00 total=5000\nfull avg10=0.00 total=0\n"
    )
    host = HostLateness()
    assert host.reason(0.0) == ""
    (tmp_path / "cpu").write_text("some avg10=0.00 avg60=0.00 avg300=0.00 total=5005000\n")
    assert host.reason(0.0) == "; processes of this machine waited for a processor 100 % of the time"
    assert HostLateness(keeps_time=False).reason(0.0) == ""


def test_waiting_for_a_processor_is_counted_from_the_start():
    assert HostLateness().waited == pytest.approx(0.0, abs=1.0)
