"""``truetip log``: a record is summarised and exported, whole or cut off."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from diagrams.record.log import GuardEvent
from diagrams.record.run_record import write_log
from experiments.main import app
from tests.experiments.synthetic import comparison


@pytest.fixture(scope="module")
def log():
    found = next(iter(comparison(with_joints=True).values()))[0]
    return replace(found, guard_events=[GuardEvent(2.0, "interrupted", 'no message, "for" 50 ms')])


def test_a_record_is_summarised_and_exported(log, tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path, "", log)
    files = {"--csv": "csv", "--parquet": "parquet", "--npz": "run.npz"}
    exports = [word for option, name in files.items() for word in (option, str(tmp_path / name))]
    result = CliRunner().invoke(app, ["log", str(path), *exports])
    assert result.exit_code == 0, result.output
    assert f"law {log.law}, ran its path to the end" in result.output
    assert "50.0 Hz" in result.output
    with np.load(tmp_path / "run.npz") as arrays:
        np.testing.assert_array_equal(arrays["command.position"], log.position_command)
    table = np.genfromtxt(tmp_path / "csv" / "command.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["position_3"], log.position_command[:, 2], rtol=1e-11, atol=1e-12)
    parquet = pq.read_table(tmp_path / "parquet" / "command.parquet")
    np.testing.assert_array_equal(parquet["position_3"], log.position_command[:, 2])
    texts = pq.read_table(tmp_path / "parquet" / "guard_event.parquet")
    assert texts["detail"].to_pylist() == ['no message, "for" 50 ms']
    events = (tmp_path / "csv" / "guard_event.csv").read_text().splitlines()
    assert events[1] == '2,interrupted,"no message, ""for"" 50 ms"'


def test_a_record_that_was_cut_off_is_summarised_and_said_to_be_so(log, tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path, "", log)
    path.write_bytes(path.read_bytes()[:-2000])
    result = CliRunner().invoke(app, ["log", str(path)])
    assert result.exit_code == 0, result.output
    assert "was cut off" in result.output
    assert "/command" in result.output


@pytest.mark.parametrize(
    ("kept", "says"),
    [
        (lambda whole: whole[:5], "run.mcap: the MCAP file ends early at byte 5, before its first message"),
        (lambda whole: whole[:70], "run.mcap: the MCAP file ends early at byte 70, before its first message"),
        (
            lambda whole: whole[:500],
            "was cut off: it ends early at byte 500, within its first block of messages, of which none can "
            "be read without the rest\n",
        ),
        (lambda whole: whole[:-20_000], "was cut off: it ends early at byte"),
        (lambda whole: whole[:9000] + b"?" + whole[9001:], "was cut off: it is damaged before byte"),
    ],
)
def test_a_copy_that_broke_off_or_is_damaged_is_told_from_what_is_no_record(kept, says: str, log, tmp_path):
    """Damage ended in a traceback of the decompression, or passed as other numbers."""
    path = tmp_path / "run.mcap"
    write_log(path, "extends: misaligned\n", log)
    path.write_bytes(kept(path.read_bytes()))
    result = CliRunner().invoke(app, ["log", str(path)], catch_exceptions=False)
    assert says in result.output


@pytest.mark.parametrize("content", [b"no record, but of some length", b""])
def test_what_is_no_record_is_refused(content: bytes, tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(content)
    result = CliRunner().invoke(app, ["log", str(path)])
    assert result.exit_code == 2
    assert "not an MCAP file" in result.stderr
