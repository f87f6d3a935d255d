"""What Foxglove shows as the wanted path is the path, also where it is run many times."""

import numpy as np
import pytest
from rich.console import Console

from experiments.cli.prepare import prepare
from experiments.station import guided_command
from systems.reference.paths import make_path


class Server:
    """In place of the one that listens."""

    address = "ws://nowhere"

    def __init__(self, *_: object) -> None:
        self.shown = np.zeros((0, 3))

    def show_path(self, p_W: np.ndarray) -> None:
        self.shown = p_W


def test_corners_are_not_cut_however_many_laps_there_are(monkeypatch: pytest.MonkeyPatch):
    """500 points over 400 laps were about one a lap."""
    monkeypatch.setattr(guided_command, "FoxgloveServer", Server)
    prepared = prepare("cell", ["station.kind=egm", "reference.laps=400"])
    server = guided_command.foxglove_server(Console(quiet=True), prepared, "8765")
    assert isinstance(server, Server)
    path = make_path(prepared.scenario.reference)
    tip = path.sample(np.linspace(path.path_start, path.lap_end, 4000))[0][:, :3, 3]
    between = 0.5 * (server.shown[1:] + server.shown[:-1])  # where a line from point to point is
    away = np.linalg.norm(tip[:, None] - between, axis=2).min(axis=0)
    assert away.max() < 3e-3
