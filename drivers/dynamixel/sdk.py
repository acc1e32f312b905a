"""The packet handler of dynamixel-sdk for Protocol 2.0, its known faults corrected, and omote's group transactions.

:class:`Port` (in drivers/servos/port.py) and :class:`Packets` are subclasses of the SDK's handlers and can be given to
any code that uses the SDK. They correct these faults, each of which a test in tests/drivers/dynamixel/test_sdk.py shows
in the unchanged SDK:

====  ========================================================================================================
S1    transmitted packets are byte-stuffed (the SDK builds the stuffed packet and throws it away)
S2    unstuffing scans the bytes as received, so it is the inverse of stuffing
S3    input left over from before is thrown away ahead of every instruction
S4    a reply must have the id **and the length** that was requested; a servo that missed its deadline must
      answer a ping before data are read from it again, so a late reply never answers another request
S5    ``is_using`` is reset on every way out of a transaction
S6    everything an unplugged device raises becomes PortLost
S7    the timeout is wire time plus a margin from the adapter's latency timer, not 34 ms
S8    time is monotonic
S9    a second thread in the middle of a transaction gets a clear error
S10   the error byte of every reply is kept, also of group reads
S11   group writes check the size of their data before anything is sent
S12   reads block until a deadline instead of spinning
S13   goals are sent without waiting for a status packet
S14   group reads keep what arrived; fast ones are decoded by position, each servo with its own CRC
====  ========================================================================================================

Corrections for every protocol are in drivers/servos/exchange.py (S3 to S5, S13) and drivers/servos/port.py (S7, S9).
S15 (``fastBulkRead`` mixes up ids and lengths) is avoided by never using it.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, ClassVar

from dynamixel_sdk import protocol2_packet_handler, robotis_def

from drivers.dynamixel.compiled_read import CompiledRead
from drivers.dynamixel.frames import STATUS_SIZE, GroupRead, Run
from drivers.packets import packet
from drivers.packets.packet import Instruction, StatusPacket, StatusReader, encode_instruction
from drivers.servos import exchange
from drivers.servos.exchange import Exchange, R, finish_exchange
from drivers.servos.port import Port

PING_DATA = 3
PING_SLOT_MS = 3.0
_LATE_CHUNKS = 16
Got = Exchange[StatusPacket]


class SdkExchanges(exchange.Exchanges[R]):
    """Overrides that the SDK's packet handlers of both protocols share: sending, and an instruction with its reply.

    id_at, code_at : where id and instruction lie in a packet that the SDK makes.
    unanswered : instructions that no servo answers.
    """

    id_at: ClassVar[int]
    code_at: ClassVar[int]
    unanswered: ClassVar[tuple[int, ...]] = ()

    @abstractmethod
    def _params(self, txpacket: Sequence[int]) -> bytes:
        """Parameters of a packet that the SDK makes; ValueError where too little data left its list too short (S11)."""

    @abstractmethod
    def _reply_length(self, code: int, params: bytes) -> int:
        """Data bytes of the reply to an instruction."""

    @abstractmethod
    def _frame(self, reply: R) -> list[int]:
        """A reply in the form in which the SDK returns packets."""

    def txPacket(self, port: Port, txpacket: list[int]) -> int:
        """Send a packet that the SDK makes, stuffed and with its checksum (S1, S3, S5, S11)."""
        if port.is_using:
            return int(robotis_def.COMM_PORT_BUSY)
        self.send(port, self.encode(txpacket[self.id_at], txpacket[self.code_at], self._params(txpacket)))
        return int(robotis_def.COMM_SUCCESS)

    def txRxPacket(self, port: Port, txpacket: list[int]) -> tuple[list[int] | None, int, int]:
        """One instruction and its reply; the reply's id and length must be the requested ones (S4)."""
        if port.is_using:
            return None, robotis_def.COMM_PORT_BUSY, 0
        servo, code = txpacket[self.id_at], txpacket[self.code_at]
        if servo == packet.BROADCAST_ID or code in self.unanswered:
            result = self.txPacket(port, txpacket)
            port.is_using = False
            return None, result, 0
        params = self._params(txpacket)
        got = self.ask(port, servo, code, params, self._reply_length(code, params))
        reply = got.replies.get(servo)
        if reply is None:
            return None, robotis_def.COMM_RX_CORRUPT if got.corrupt else robotis_def.COMM_RX_TIMEOUT, 0
        return self._frame(reply), robotis_def.COMM_SUCCESS, reply.error


class Packets(SdkExchanges[StatusPacket], protocol2_packet_handler.Protocol2PacketHandler):  # type: ignore[misc]
    """The SDK's Protocol 2.0 packet handler with its faults overridden, and omote's own group transactions."""

    status_size = STATUS_SIZE
    number_size = 2
    refusals = 0x7F
    reader = StatusReader
    greeting = Instruction.PING
    id_at, code_at = 4, 7
    unanswered = (Instruction.ACTION,)

    # ------------------------------------------------------------------ what the SDK calls by its own names

    def updateCRC(self, crc_accum: int, data_blk_ptr: Sequence[int], data_blk_size: int) -> int:
        """CRC-16 of the first ``data_blk_size`` bytes."""
        return packet.crc16(bytes(data_blk_ptr[:data_blk_size]), crc_accum)

    def addStuffing(self, packet_in: list[int]) -> list[int]:
        """The packet with its parameters stuffed and its length set (S1)."""
        return _restuffed(packet_in, packet.stuff)

    def removeStuffing(self, packet_in: list[int]) -> list[int]:
        """The packet with its parameters unstuffed and its length set (S2)."""
        return _restuffed(packet_in, packet.unstuff)

    def rxPacket(self, port: Port, fast_option: bool) -> tuple[list[int], int]:
        """The next status packet of a servo, or a joint one where ``fast_option`` (S2, S5, S12)."""
        reader, broken = StatusReader(), robotis_def.COMM_RX_TIMEOUT
        try:
            while data := port.readPort(packet.MAX_LENGTH):
                broken = robotis_def.COMM_RX_CORRUPT
                frames = reader.feed_frames(data)
                for place, frame in enumerate(frames):
                    if frame[7] == Instruction.STATUS and (fast_option or frame[4] <= packet.MAX_ID):
                        port._held[:0] = b"".join(frames[place + 1 :]) + reader.take_pending()
                        whole = list(frame)
                        return whole if fast_option else self.removeStuffing(whole), robotis_def.COMM_SUCCESS
            return [], broken
        finally:
            port.is_using = False

    def _params(self, txpacket: Sequence[int]) -> bytes:
        length = txpacket[5] | txpacket[6] << 8
        if len(txpacket) != 7 + length:
            raise ValueError(f"packet of {7 + length} bytes was given {len(txpacket)}: its parameters are cut short")
        return bytes(txpacket[8 : 5 + length])

    def _reply_length(self, code: int, params: bytes) -> int:
        if code == Instruction.READ:
            return params[2] | params[3] << 8
        return PING_DATA if code == Instruction.PING else 0

    def _frame(self, reply: StatusPacket) -> list[int]:
        length = len(reply.params) + 4
        head = packet.HEADER + bytes((0, reply.id, length & 0xFF, length >> 8, Instruction.STATUS, reply.error))
        return list(head + reply.params + b"\0\0")

    def broadcastPing(self, port: Port) -> tuple[dict[int, list[int]], int]:
        """Model number and firmware of all servos that answer, by id; waits without spinning (S12)."""
        found = {servo: [m[0] | m[1] << 8, m[2]] for servo, m in self.ping_all(port).items()}
        return found, robotis_def.COMM_SUCCESS if found else robotis_def.COMM_RX_TIMEOUT

    # ------------------------------------------------------------------ transactions of the driver

    def encode(self, servo: int, code: int, params: bytes = b"") -> bytes:
        """The packet of an instruction."""
        return encode_instruction(servo, code, params)

    def hello(self, port: Any, servo: int) -> Got:
        """A servo's answer to a ping (``params``: model number low, high, firmware)."""
        return self.ask(port, servo, Instruction.PING, b"", PING_DATA)

    def ping_all(self, port: Port) -> dict[int, bytes]:
        """Three bytes (model low, high, firmware) of all servos that answer a broadcast ping, by id; takes 0.8 s."""
        found: dict[int, bytes] = {}
        reader = StatusReader()
        self.send(port, encode_instruction(packet.BROADCAST_ID, Instruction.PING))
        try:
            port.setPacketTimeoutMillis(packet.MAX_ID * (14 * port.tx_time_per_byte + PING_SLOT_MS))
            while not port.isPacketTimeout():
                for reply in reader.feed(port.link.read(port.deadline_s)):
                    if len(reply.params) == PING_DATA:
                        found[reply.id] = reply.params
        finally:
            port.is_using = False
        return found

    def _read_ready(self, port: Any, ids: tuple[int, ...], address: int, size: int, manner: str) -> Got:
        return self.read_prepared(port, group_read((Run(ids, address, size),), manner == "fast"))

    def read_prepared(self, port: Port, group: GroupRead, compiled: CompiledRead | None = None) -> Got:
        """Send a group read and collect the replies. None of its servos may be in ``port.suspects``.

        Replies that `compiled` takes, because they are as expected, are not returned.
        """
        port.suspects.update(group.wanted)  # until they have answered, so also when this is interrupted
        self.send(port, group.frame)
        try:
            port.expect(group.size)
            if compiled is not None:
                compiled.prepare()
            data = self._receive(port, group.size)
            taken = compiled is not None and compiled.take(data, port.clock())
            replies = {} if taken else group.decode(data)
            if replies is not None:
                port.suspects.difference_update(group.wanted)
                return Exchange(replies, (), False)
            if not group.fast:
                return self._find_replies(port, group.wanted, data)
            got = self._decode_joint(port, group, data)
        finally:
            port.is_using = False
        return self._read_behind(port, group, got)

    def _receive(self, port: Any, size: int) -> bytes:
        """Received bytes, at least ``size`` of them unless the deadline passes.

        It sleeps for the time that they take on the wire: one wake-up, not one for every few bytes.
        """
        data: bytes = port.first()
        more = data
        while more and len(data) < size:
            more = port.more()
            data += more
        return data

    def _decode_joint(self, port: Port, group: GroupRead, data: bytes) -> Got:
        """The replies that can be decoded in a joint reply that is cut short, damaged, or has noise before it."""
        devices, raw = list(group.wanted.items()), bytearray(data)
        replies = packet.decode_fast(bytes(raw), devices)
        while data and len(replies) < len(devices) and len(raw) < _LATE_CHUNKS * packet.MAX_LENGTH:
            data = port.link.read(port.deadline_s)
            raw += data
            if data:
                replies = packet.decode_fast(bytes(raw), devices)
        return finish_exchange(port, group.wanted, {reply.id: reply for reply in replies}, len(raw) >= group.size)

    def _read_behind(self, port: Port, group: GroupRead, got: Got) -> Got:
        """Read servos after the first silent one again, one reply each: it cut them off from the joint reply (S14).

        Late bytes of that reply are no packet, so they cannot be taken for one.
        """
        asked = [(tuple(i for i in run.ids if i in got.missing[1:]), run) for run in group.runs]
        runs = tuple(run._replace(ids=ids) for ids, run in asked if ids)
        lost = not got.replies
        if not runs:
            return got._replace(joint_lost=lost)
        more = self.read_prepared(port, group_read(runs, False))
        return Exchange(got.replies | more.replies, got.missing[:1] + more.missing, got.corrupt or more.corrupt, lost)


@lru_cache(maxsize=256)
def group_read(runs: tuple[Run, ...], fast: bool) -> GroupRead:
    """The group read of these servos and registers; cached."""
    return GroupRead(runs, fast)


def _restuffed(packet_in: list[int], change: Any) -> list[int]:
    """A packet of the SDK, a list that begins with the header, with ``change`` applied to its instruction and data."""
    length = packet_in[5] | packet_in[6] << 8
    body = change(bytes(packet_in[7 : 5 + length]))
    new = len(body) + 2
    return [*packet_in[:5], new & 0xFF, new >> 8, *body, *packet_in[5 + length : 7 + length]]
