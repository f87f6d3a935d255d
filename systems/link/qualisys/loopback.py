"""How long a frame takes from the virtual camera to a sample on the same machine; for benchmarks."""

import time

import numpy as np
from pydrake.math import RigidTransform

from systems.link.qualisys.client import MocapConfig
from systems.link.qualisys.receiver import MocapReceiver, MocapReceiverConfig
from systems.link.qualisys.server import CameraServerConfig, VirtualCameraServer


def loopback_latency(transport: str = "udp", frames: int = 1000, period: float = 1e-3) -> np.ndarray:
    """From the call of `VirtualCameraServer.publish` to the sample in the hands of a station's loop.

    Args:
        transport: "udp" or "tcp".
        frames: how many are sent, one after the other.
        period: s between them.

    Returns:
        Shape (frames,), s.

    Raises:
        TimeoutError: if a frame does not arrive within a second.
    """
    X_WB = RigidTransform([0.1, 0.2, 0.3])
    latencies = np.empty(frames)
    with VirtualCameraServer(CameraServerConfig(port=0)) as server:
        config = MocapReceiverConfig(MocapConfig(port=server.port, transport=transport))
        with MocapReceiver(config) as receiver:
            receiver.client.wait(5.0)
            while not server.streams:
                time.sleep(1e-3)
            for frame in range(frames):
                started = time.perf_counter()
                server.publish(round(1e6 * started), frame, {"tool": X_WB})
                while receiver.poll(time.perf_counter()) is None:
                    if time.perf_counter() - started > 1.0:
                        raise TimeoutError(f"frame {frame} of {frames} over {transport} was lost")
                latencies[frame] = time.perf_counter() - started
                time.sleep(period)
    return latencies
