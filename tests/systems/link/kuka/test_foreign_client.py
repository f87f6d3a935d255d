"""A client of RSI that others wrote moves the virtual controller, configured as the documentation says."""

import re
import socket
from pathlib import Path

import numpy as np
import pytest

from systems.link.kuka.controller import RsiController, RsiRunConfig
from tests.systems.link.kuka.rsi_loop import CYCLE, ROBOT, START

pytestmark = pytest.mark.real_time

CONFIG = Path("docs/kuka/RSI_EthernetConfig.xml")


@pytest.mark.slow
def test_rsipi_turns_the_axes(tmp_path):
    rsi_api = pytest.importorskip("RSIPI.rsi_api", reason="the package RSIPI is not installed")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    config = tmp_path / "RSI_EthernetConfig.xml"
    config.write_text(re.sub(r"<PORT>\d+", f"<PORT>{port}", CONFIG.read_text()))
    controller, planned = RsiController(ROBOT, RsiRunConfig()), START.copy()
    with (
        rsi_api.RSIAPI(str(config), rsi_mode="relative") as api,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as cell,
    ):
        cell.settimeout(0.5)
        api.start()
        api.client.publish_corrections({"AKorr": {"A1": 0.05, "A4": -0.1}})
        coming = controller.report(100.0, planned, planned, np.zeros(6))
        for cycle in range(1, 201):
            time = 100.0 + CYCLE * cycle
            controller.cycle(time, planned)
            asked, coming = coming, controller.report(time, planned, planned, np.zeros(6))
            assert asked is not None
            cell.sendto(asked, ("127.0.0.1", port))
            try:
                controller.receive(cell.recv(4096), time, planned)
            except TimeoutError:
                continue  # it is not there yet
            reference, _ = controller.references
            planned = planned if np.isnan(reference).any() else reference
        read = api.client.send_variables.copy()
    turned = np.rad2deg(planned - START)
    assert turned[0] == pytest.approx(0.05 * round(turned[0] / 0.05), abs=1e-6)
    assert turned[0] > 2.0
    np.testing.assert_allclose(turned, [turned[0], 0.0, 0.0, -2.0 * turned[0], 0.0, 0.0], atol=1e-6)
    assert read["AIPos"]["A1"] == pytest.approx(np.rad2deg(planned[0]), abs=0.2)
