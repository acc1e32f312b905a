"""Bus of Dynamixel servos with Protocol 1.0, and dynamixel-sdk's packet handler for them with its faults overridden.

:class:`Packets1` runs on :class:`~drivers.servos.port.Port` (which overrides S3, S6 to S9 and S12) and can be
given to any SDK code. The numbers are those of ``drivers/dynamixel/sdk.py``, where they apply to Protocol 1.0 too;
each has a test in tests/drivers/dynamixel/test_legacy.py that shows it on the bare SDK:

====  ========================================================================================================
S4    a reply must have the id **and the length** that was requested, and a servo that missed its deadline must
      answer a greeting before data are read from it again; the SDK takes any packet of the servo, so also the
      adapter's echo of the request itself, whose parameters it then returns as register values
S5    ``is_using`` is reset on every way out of a transaction
S10   the error flags of every reply are kept, also of bulk reads
S11   packets with too little data are refused instead of failing in the checksum
P1    ``GroupBulkRead`` works (4.1.0 hands ``bulkReadTx`` an argument too many for Protocol 1.0)
====  ========================================================================================================

S1, S2 (stuffing), S14 and S15 (fast reads) do not exist in Protocol 1.0. S13: goals are sent by sync write, which no
servo answers.
"""

from __future__ import annotations

from collections.abc import Sequence

from dynamixel_sdk import protocol1_packet_handler, robotis_def

from drivers.dynamixel.sdk import SdkExchanges
from drivers.packets.packet1 import BROADCAST_ID, Error1, Instruction1, Packet1, Reader1, encode
from drivers.protocol1.bus import Protocol1Bus
from drivers.protocol1.exchange import Exchanges
from drivers.servos.port import Port

_FRAME = 259
"""More than any packet has."""


class Packets1(SdkExchanges[Packet1], Exchanges, protocol1_packet_handler.Protocol1PacketHandler):  # type: ignore[misc]  # without types
    """The SDK's Protocol 1.0 packet handler with its faults overridden, and omote's own group transactions."""

    longest = 143  # the receive buffer of AX and RX
    refusals = Error1.ANGLE_LIMIT | Error1.RANGE | Error1.CHECKSUM | Error1.INSTRUCTION

    id_at, code_at = 2, 4

    def txPacket(self, port: Port, txpacket: list[int]) -> int:
        """Send a packet that the SDK makes (S5, S11)."""
        result = super().txPacket(port, txpacket)
        if result == robotis_def.COMM_SUCCESS and txpacket[2] != BROADCAST_ID:
            port.suspects.add(txpacket[2])  # until its reply was taken, which some callers never do
        return result

    def rxPacket(self, port: Port) -> tuple[list[int], int]:
        """The next packet of a servo (S5, S12)."""
        reader, result = Reader1(), robotis_def.COMM_RX_TIMEOUT
        try:
            while data := port.readPort(_FRAME):
                result = robotis_def.COMM_RX_CORRUPT
                packets = reader.feed(data)
                if packets:
                    rest = b"".join(encode(*packet) for packet in packets[1:])
                    port._held[:0] = rest + reader.take_pending()
                    return self._frame(packets[0]), robotis_def.COMM_SUCCESS
            return [], result
        finally:
            port.is_using = False

    def _params(self, txpacket: Sequence[int]) -> bytes:
        if len(txpacket) != 4 + txpacket[3]:
            given = f"packet of {4 + txpacket[3]} bytes was given {len(txpacket)}"
            raise ValueError(f"{given}: its parameters are cut short")
        return bytes(txpacket[5:-1])

    def _reply_length(self, code: int, params: bytes) -> int:
        return params[1] if code == Instruction1.READ else 0

    def _frame(self, reply: Packet1) -> list[int]:
        return [*encode(*reply)[:-1], 0]

    def readRx(self, port: Port, dxl_id: int, length: int) -> tuple[list[int], int, int]:
        """The reply of one servo to a read or a bulk read: the next packet with its id and length (S4, S10)."""
        while True:
            frame, result = self.rxPacket(port)
            if result != robotis_def.COMM_SUCCESS:
                return [], result, 0
            if frame[2] == dxl_id and len(frame) == length + 6:
                port.suspects.discard(dxl_id)
                return frame[5:-1], result, frame[4]

    def bulkReadTx(self, port: Port, param: Sequence[int], param_length: int, fast: bool = False) -> int:
        """As the SDK's, with the argument that its ``GroupBulkRead`` gives (P1)."""
        return int(super().bulkReadTx(port, param, param_length))


class LegacyBus(Protocol1Bus):
    """Protocol 1.0 servos on one serial port: MX are read together (bulk read), AX and RX one by one."""

    MODELS = ("ax-12a",)
    PACKETS = Packets1
