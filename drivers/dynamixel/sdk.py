"""dynamixel-sdk with its known faults overridden, all in this one place.

:class:`Port` (in drivers/dynamixel/port.py) and :class:`Packets` are the SDK's handlers and can be given to any
SDK code. What is mended; each fault has a test in tests/drivers/dynamixel/test_sdk.py that shows it on the bare SDK:

====  ========================================================================================================
S1    transmitted packets are byte-stuffed (the SDK builds the stuffed packet and throws it away)
S2    unstuffing scans the bytes as received, so it is the inverse of stuffing
S3    input left over from before is thrown away ahead of every instruction
S4    a reply must have the id **and the length** that was asked for; a servo that missed its time must answer
      a ping before it is asked for data again, so a late reply never answers another question
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

S15 (``fastBulkRead`` mixes up ids and lengths) is avoided by never using it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from dynamixel_sdk import protocol2_packet_handler, robotis_def

from drivers.dynamixel.frames import STATUS_SIZE, GroupRead, Quick, Rows, Run
from drivers.dynamixel.port import Port
from drivers.packets import packet
from drivers.packets.packet import Instruction, StatusPacket, StatusReader, encode_instruction

PING_DATA = 3
PING_SLOT_MS = 3.0
_LATE_CHUNKS = 16


class Exchange(NamedTuple):
    """What came back for one instruction.

    Attributes
    ----------
    replies : by servo id; only those with the right id, length and CRC.
    missing : ids that were asked and are not in ``replies``.
    corrupt : True when damaged bytes arrived too, so that a missing reply may have been one of them.
    joint_lost : True when nobody answered a fast read, whoever answered the plain one after it.
    """

    replies: dict[int, StatusPacket]
    missing: tuple[int, ...]
    corrupt: bool
    joint_lost: bool = False


class Packets(protocol2_packet_handler.Protocol2PacketHandler):  # type: ignore[misc]  # without types
    """The SDK's Protocol 2.0 packet handler with its faults overridden, and group transactions of our own."""

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

    def txPacket(self, port: Port, txpacket: list[int]) -> int:
        """Stuff, sum and send a packet of the SDK's making (S1, S3, S5)."""
        if port.is_using:
            return int(robotis_def.COMM_PORT_BUSY)
        self.send(port, encode_instruction(txpacket[4], txpacket[7], _params(txpacket)))
        return int(robotis_def.COMM_SUCCESS)

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

    def txRxPacket(self, port: Port, txpacket: list[int]) -> tuple[list[int] | None, int, int]:
        """One instruction and its reply; the reply's id and length must be those asked for (S4)."""
        if port.is_using:
            return None, robotis_def.COMM_PORT_BUSY, 0
        servo, instruction = txpacket[4], txpacket[7]
        if servo == packet.BROADCAST_ID or instruction == Instruction.ACTION:
            result = self.txPacket(port, txpacket)
            port.is_using = False
            return None, result, 0
        params = _params(txpacket)
        got = self.ask(port, servo, instruction, params, _reply_length(instruction, params))
        reply = got.replies.get(servo)
        if reply is None:
            return None, robotis_def.COMM_RX_CORRUPT if got.corrupt else robotis_def.COMM_RX_TIMEOUT, 0
        return list(_frame(reply)), robotis_def.COMM_SUCCESS, reply.error

    def broadcastPing(self, port: Port) -> tuple[dict[int, list[int]], int]:
        """Model number and firmware of everybody who answers, by id; waits without spinning (S12)."""
        found = {servo: [m[0] | m[1] << 8, m[2]] for servo, m in self.ping_all(port).items()}
        return found, robotis_def.COMM_SUCCESS if found else robotis_def.COMM_RX_TIMEOUT

    # ------------------------------------------------------------------ exchanges the driver uses

    def send(self, port: Port, frame: bytes) -> None:
        """Clear the input and send one packet; the port stays in use until the reply was taken."""
        port.is_using = True
        try:
            port.clearPort()
            port.transmit(frame)
        except BaseException:
            port.is_using = False
            raise

    def tell(self, port: Port, frame: bytes) -> None:
        """Send a packet, or several, that nobody answers (S13)."""
        port.is_using = True
        try:
            port.transmit(frame)
        finally:
            port.is_using = False

    def ask(self, port: Port, servo: int, instruction: int, params: bytes, length: int) -> Exchange:
        """One instruction to one servo and its reply of ``length`` data bytes.

        A servo that missed its time before must first answer a ping: its replies come in order, so whatever
        it still owed has arrived by then. Never ask for three bytes: that is the length of a ping's reply.
        """
        if servo in port.suspects and instruction != Instruction.PING and not self.revive(port, servo):
            return Exchange({}, (servo,), False)
        frame = encode_instruction(servo, instruction, params)
        return self.exchange(port, frame, {servo: length})

    def hello(self, port: Port, servo: int) -> StatusPacket | None:
        """A servo's answer to a ping (``params``: model number low, high, firmware), or None."""
        return self.ask(port, servo, Instruction.PING, b"", PING_DATA).replies.get(servo)

    def revive(self, port: Port, servo: int) -> bool:
        """Ping a servo that missed its time; True when it is in step again (S4)."""
        return self.hello(port, servo) is not None

    def ping_all(self, port: Port) -> dict[int, bytes]:
        """Three bytes (model low, high, firmware) of everybody who answers a broadcast ping, by id.

        Takes the best part of a second: a servo may wait for its turn in the order of ids.
        """
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

    def read_group(self, port: Port, ids: Sequence[int], address: int, length: int, *, fast: bool = False) -> Exchange:
        """One sync read, or fast sync read, keeping every reply that arrived (S7, S10, S14).

        Servos in ``port.suspects`` are not asked and count as missing until :meth:`revive` brought them back.
        """
        left_out = tuple(servo for servo in ids if servo in port.suspects) if port.suspects else ()
        asked = tuple(servo for servo in ids if servo not in left_out)
        if not asked:
            return Exchange({}, left_out, False)
        group = group_read((Run(asked, address, length),), fast)
        got = self.read_rows(port, group)
        if isinstance(got, Exchange):
            return got._replace(missing=got.missing + left_out)
        return Exchange(_replies(group.runs, got), left_out, False)

    def read_rows(self, port: Port, group: GroupRead, sweep: Quick | None = None) -> list[Rows] | Exchange:
        """Ask a group that was made before. None of it may be in ``port.suspects``.

        Parameters
        ----------
        sweep : takes what it can by itself.

        Returns
        -------
        list of Rows : what every servo said, run by run, when all is as it should be (nothing more where `sweep`
            has taken it); otherwise an Exchange with whatever arrived.
        """
        port.suspects.update(group.wanted)  # until they have answered, so also when this is interrupted
        self.send(port, group.frame)
        try:
            port.expect(group.size)
            if sweep is not None:
                sweep.prepare()
            data = self._fill(port, group.size)
            taken = sweep is not None and sweep.take(data, port.clock())
            rows = [] if taken else group.decode(data)
            if rows is not None:
                port.suspects.difference_update(group.wanted)
                return rows
            if not group.fast:
                return self._collect(port, group.wanted, data)
            got = self._salvage(port, group, data)
        finally:
            port.is_using = False
        return self._read_behind(port, group, got)

    def write_group(self, port: Port, address: int, length: int, rows: bytes) -> None:
        """One sync write that nobody answers (S11, S13).

        Parameters
        ----------
        address, length : the register.
        rows : for each servo its id and ``length`` bytes, one behind the other.

        Raises
        ------
        ValueError : ``rows`` does not hold whole rows.
        """
        if not rows or len(rows) % (length + 1):
            raise ValueError(f"rows: {len(rows)} bytes are not whole rows of 1 + {length}")
        head = bytes((address & 0xFF, address >> 8, length & 0xFF, length >> 8))
        self.tell(port, encode_instruction(packet.BROADCAST_ID, Instruction.SYNC_WRITE, head + rows))

    def exchange(self, port: Port, frame: bytes, wanted: Mapping[int, int]) -> Exchange:
        """Send a packet and collect the replies to it.

        Parameters
        ----------
        wanted : data bytes expected, by servo id, in the order of the replies.
        """
        size = len(wanted) * STATUS_SIZE + sum(wanted.values())
        port.suspects.update(wanted)
        self.send(port, frame)
        try:
            port.expect(size)
            return self._collect(port, wanted, self._fill(port, size))
        finally:
            port.is_using = False

    def _fill(self, port: Port, size: int) -> bytes:
        """Received bytes, at least ``size`` of them unless the deadline passes.

        Once the first have come, the others are known to take their time on the wire: sleeping through it costs
        one awakening instead of one for every few bytes.
        """
        data = more = port.link.read(port.deadline_s)
        while more and len(data) < size:
            more = port.more(size - len(data))
            data += more
        return data

    def _collect(self, port: Port, wanted: Mapping[int, int], data: bytes) -> Exchange:
        """The replies in ``data`` and in what still comes, whatever lies between them."""
        reader, box, late = StatusReader(), _Sorter(wanted), 0
        box.take(reader.feed(data))
        while len(box.replies) < len(wanted) and late < _LATE_CHUNKS:
            data = port.link.read(port.deadline_s)
            if not data:
                box.take(reader.flush())
                break
            late += port.isPacketTimeout()
            box.take(reader.feed(data))
        port.stray += box.stray
        corrupt = bool(reader.broken_frames or reader.noise_bytes or box.twice)
        return _settle(port, wanted, box.unique(), corrupt)

    def _salvage(self, port: Port, group: GroupRead, data: bytes) -> Exchange:
        """What can be read of a joint reply that is cut short, damaged, or has something before it."""
        devices, raw = list(group.wanted.items()), bytearray(data)
        replies = packet.decode_fast(bytes(raw), devices)
        while data and len(replies) < len(devices) and len(raw) < _LATE_CHUNKS * packet.MAX_LENGTH:
            data = port.link.read(port.deadline_s)
            raw += data
            if data:
                replies = packet.decode_fast(bytes(raw), devices)
        return _settle(port, group.wanted, {reply.id: reply for reply in replies}, len(raw) >= group.size)

    def _read_behind(self, port: Port, group: GroupRead, got: Exchange) -> Exchange:
        """Ask those behind the first silent servo plainly: it cut them off from the joint reply (S14).

        What they might still send of that is no packet, so it cannot be taken for an answer.
        """
        behind = set(got.missing[1:])
        runs = tuple(run for run in (run.among(behind) for run in group.runs) if run.ids)
        lost = not got.replies
        if not runs:
            return got._replace(joint_lost=lost)
        more = self.read_rows(port, group_read(runs, False))
        if not isinstance(more, Exchange):
            more = Exchange(_replies(runs, more), (), False)
        return Exchange(got.replies | more.replies, got.missing[:1] + more.missing, got.corrupt or more.corrupt, lost)


class _Sorter:
    """Sorts replies into those asked for and strays; two under one id are both worth nothing.

    Parameters
    ----------
    wanted : data bytes expected, by servo id.
    """

    def __init__(self, wanted: Mapping[int, int]) -> None:
        self._wanted = wanted
        self.replies: dict[int, StatusPacket] = {}
        self.twice: set[int] = set()
        self.stray = 0

    def take(self, arrived: list[StatusPacket]) -> None:
        """Sort some more."""
        for reply in arrived:
            length = self._wanted.get(reply.id)
            refused = bool(reply.error & 0x7F) and not reply.params
            if length is None or (len(reply.params) != length and not refused):
                self.stray += 1
            elif self.replies.setdefault(reply.id, reply) is not reply:
                self.twice.add(reply.id)
                self.stray += 2

    def unique(self) -> dict[int, StatusPacket]:
        """Replies that came once."""
        return {servo: reply for servo, reply in self.replies.items() if servo not in self.twice}


def _settle(port: Port, wanted: Mapping[int, int], replies: dict[int, StatusPacket], corrupt: bool) -> Exchange:
    """Who answered is in step; the others stay suspects."""
    missing = tuple(servo for servo in wanted if servo not in replies)
    port.suspects.difference_update(replies)
    return Exchange(replies, missing, corrupt and bool(missing))


@lru_cache(maxsize=256)
def group_read(runs: tuple[Run, ...], fast: bool) -> GroupRead:
    """A group read, made once for the same servos and registers."""
    return GroupRead(runs, fast)


def _replies(runs: Sequence[Run], rows: Sequence[Rows]) -> dict[int, StatusPacket]:
    """The replies of all runs by servo id."""
    return {
        servo: StatusPacket(servo, error, data.tobytes())
        for run, (errors, block) in zip(runs, rows, strict=True)
        for servo, error, data in zip(run.ids, errors.tolist(), block, strict=True)
    }


def _params(txpacket: Sequence[int]) -> bytes:
    """Parameters of an instruction packet of the SDK; too little data leaves its list too short (S11)."""
    length = txpacket[5] | txpacket[6] << 8
    if len(txpacket) != 7 + length:
        raise ValueError(f"packet of {7 + length} bytes was given {len(txpacket)}: its parameters are cut short")
    return bytes(txpacket[8 : 5 + length])


def _reply_length(instruction: int, params: bytes) -> int:
    if instruction == Instruction.READ:
        return params[2] | params[3] << 8
    return PING_DATA if instruction == Instruction.PING else 0


def _frame(reply: StatusPacket) -> bytes:
    """A status packet as the SDK hands it on: unstuffed, with the length of the unstuffed parameters."""
    length = len(reply.params) + 4
    head = packet.HEADER + bytes((0, reply.id, length & 0xFF, length >> 8, Instruction.STATUS, reply.error))
    return head + reply.params + b"\0\0"


def _restuffed(packet_in: list[int], change: Any) -> list[int]:
    """A packet of the SDK (a list from the header on) with its bytes from INST to last parameter changed."""
    length = packet_in[5] | packet_in[6] << 8
    body = change(bytes(packet_in[7 : 5 + length]))
    new = len(body) + 2
    return [*packet_in[:5], new & 0xFF, new >> 8, *body, *packet_in[5 + length : 7 + length]]
