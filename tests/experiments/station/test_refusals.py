"""What a station's commands refuse, in one line and with exit code 2."""

import socket

import pytest
from typer.testing import CliRunner

from experiments.main import app


@pytest.fixture(scope="module")
def taken():
    """A UDP port and a TCP port that somebody else has."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp,
        socket.create_server(("127.0.0.1", 0)) as tcp,
    ):
        udp.bind(("127.0.0.1", 0))
        yield udp.getsockname()[1], tcp.getsockname()[1]


@pytest.mark.parametrize("command", ["run", "compare", "latency", "cell"])
def test_a_port_that_is_taken_is_said_in_one_line(command: str, taken, tmp_path):
    udp, tcp = taken
    arguments = {
        "run": ["run", "--station", "egm", "--law", "open_loop", "--out", str(tmp_path)],
        "compare": ["compare", "--quick", "--station", "egm", "--laws", "open_loop", "--out", str(tmp_path)],
        "latency": ["latency", "--report", str(tmp_path / "latency.html")],
        "cell": ["cell", "--duration", "1"],
    }[command]
    ports = ["--set", f"station.link.port={udp}", "--set", f"station.link.camera.server.port={tcp}"]
    result = CliRunner().invoke(app, [*arguments, *ports])
    assert result.exit_code == 2, result.output
    place = f"TCP 127.0.0.1:{tcp}" if command == "cell" else f"UDP 127.0.0.1:{udp}"
    assert result.stderr.strip().endswith(f"cannot listen on {place}: address already in use")
    assert len(result.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_cell_whose_messages_and_ears_are_in_different_networks_is_refused():
    arguments = ["cell", "--duration", "1", "--set", "station.link.address=192.0.2.7"]
    arguments += ["--set", "station.link.camera.server.port=0"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert "would send its messages to 192.0.2.7 and hear commands on 127.0.0.1" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--mode", "path"], "--mode must be one of joint, path_correction, got 'path'"),
        (["--mode", "path_correction"], "add --station egm, or --with-cell"),
        (["--mode", "path_correction", "--station", "rsi"], "is of ABB's EGM, got a station that speaks RSI"),
        (
            ["--mode", "path_correction", "--with-cell", "--scenario", "cell-watched"],
            "--mode path_correction does not watch for people",
        ),
        (["--mode", "path_correction", "--with-cell", "--law", "pbvs"], "--law does not go with"),
        (
            ["--mode", "path_correction", "--with-cell", "--set", "station.link.has_camera=false"],
            "path correction needs a camera",
        ),
    ],
)
def test_path_correction_is_refused_where_it_makes_no_sense(arguments: list[str], said: str, tmp_path):
    result = CliRunner().invoke(app, ["run", *arguments, "--out", str(tmp_path)])
    assert result.exit_code == 2, result.output
    assert said in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
