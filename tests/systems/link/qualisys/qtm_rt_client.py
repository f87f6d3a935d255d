"""The official client, for a process of its own: asks a server for everything and prints what it got as JSON.

Arguments: port, number of frames of a stream. Each line of the output is an answer by the name of its
question, or the stage that has been reached, so that the test knows when frames are waited for.
"""

import asyncio
import json
import math
import sys

import qtm_rt
from qtm_rt.packet import QRTPacket


def poses(packet: QRTPacket) -> list:
    """Position in mm, the nine numbers of the rotation as they come, residual in mm; null for a NaN."""
    component = packet.get_6d_residual()
    assert component is not None
    _, bodies = component
    flat = [[*position, *rotation.matrix, residual.residual] for position, rotation, residual in bodies]
    return [[None if math.isnan(value) else value for value in body] for body in flat]


def frame(packet: QRTPacket) -> dict:
    return {"time": packet.timestamp, "number": packet.framenumber, "bodies": poses(packet)}


async def say(name: str, value: object) -> None:
    print(json.dumps({name: value}), flush=True)


class Datagrams(asyncio.DatagramProtocol):
    """Streaming over UDP, which the package asks for but leaves to its user to receive."""

    def __init__(self, wanted: int) -> None:
        self.frames: list[dict] = []
        self.wanted, self.done = wanted, asyncio.get_running_loop().create_future()
        self.receiver = qtm_rt.receiver.Receiver(
            {
                qtm_rt.packet.QRTPacketType.PacketData: self.take,
                qtm_rt.packet.QRTPacketType.PacketNoMoreData: id,
            }
        )

    def datagram_received(self, data: bytes, addr: tuple) -> None:
        self.receiver.data_received(data)

    def take(self, packet: QRTPacket) -> None:
        self.frames.append(frame(packet))
        if len(self.frames) == self.wanted:
            self.done.set_result(None)


async def stream_tcp(connection: qtm_rt.QRTConnection, wanted: int) -> list[dict]:
    found, done = [], asyncio.get_running_loop().create_future()

    def take(packet: QRTPacket) -> None:
        found.append(frame(packet))
        if len(found) == wanted:
            done.set_result(None)

    await say("stage", "tcp")
    await connection.stream_frames(components=["6dres"], on_packet=take)
    await asyncio.wait_for(done, 10.0)
    await connection.stream_frames_stop()
    return found


async def stream_udp(connection: qtm_rt.QRTConnection, wanted: int) -> list[dict]:
    loop = asyncio.get_running_loop()
    transport, protocol = await loop.create_datagram_endpoint(
        lambda: Datagrams(wanted), local_addr=("127.0.0.1", 0)
    )
    port = transport.get_extra_info("sockname")[1]
    # As stream_frames does it, but without waiting for an answer that UDP does not give.
    await connection._protocol.send_command(f"streamframes allframes udp:{port} 6dres", callback=False)
    await say("stage", "udp")
    await asyncio.wait_for(protocol.done, 10.0)
    await connection.stream_frames_stop()
    transport.close()
    return protocol.frames


async def main(port: int, wanted: int) -> None:
    connection = await qtm_rt.connect("127.0.0.1", port=port)
    assert connection is not None
    await say("state idle", (await connection.get_state()).name)
    await say("version", (await connection.qtm_version()).decode())
    await say("byte order", (await connection.byte_order()).decode())
    await say("parameters", (await connection.get_parameters(["6d"])).decode())
    await say("tcp", await stream_tcp(connection, wanted))
    await say("udp", await stream_udp(connection, wanted))
    await say("state measuring", (await connection.get_state()).name)
    await say("stage", "frame")
    await say("frame", frame(await connection.get_current_frame(["6dres"])))
    connection.disconnect()


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]), int(sys.argv[2])))
