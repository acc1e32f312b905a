"""Request-reply transactions of Protocol 1.0 framing: every reply is checked for sender and length."""

from __future__ import annotations

from functools import lru_cache

from drivers.packets.packet1 import BROADCAST_ID, Instruction1, Packet1, Reader1, encode
from drivers.protocol1 import HELLO
from drivers.servos import exchange
from drivers.servos.exchange import Exchange
from drivers.servos.port import Port


class Exchanges(exchange.Exchanges[Packet1]):
    """Transactions of a driver.

    longest : longest packet, in bytes, that its servos take.
    refusals : flags of the error byte that refuse an instruction; the others are about the servo's state.
    """

    status_size = 6
    number_size = 1
    refusals = 0
    reader = Reader1
    longest = 250

    def encode(self, servo: int, code: int, params: bytes = b"") -> bytes:
        """The packet of an instruction."""
        return encode(servo, code, params)

    def send_only(self, port: Port, frame: bytes) -> None:
        """Clear the input and send one packet without waiting for a reply."""
        self.send(port, frame)
        port.is_using = False

    def hello(self, port: Port, servo: int) -> Exchange[Packet1]:
        """Read the first ``HELLO`` bytes of a servo's registers."""
        return self.exchange(port, _read_frame(servo, 0, HELLO), {servo: HELLO})

    def pings(self, port: Port, servo: int) -> bool:
        """Whether a servo answers a ping, which it does even when it may answer nothing else.

        An answer with the error flags 1 looks like the ping itself and counts as an echo of it.
        """
        frame = encode(servo, Instruction1.PING)
        got = self.exchange(port, frame, {servo: 0}).replies.get(servo)
        return got is not None and got.code != Instruction1.PING

    def _read_ready(self, port: Port, ids: tuple[int, ...], address: int, size: int, manner: str) -> Exchange[Packet1]:
        if manner:
            return self.exchange(port, _group_frame(ids, address, size, manner), dict.fromkeys(ids, size))
        replies: dict[int, Packet1] = {}
        corrupt = False
        for servo in ids:
            got = self.exchange(port, _read_frame(servo, address, size), {servo: size})
            replies |= got.replies
            corrupt |= got.corrupt
        return Exchange(replies, tuple(servo for servo in ids if servo not in replies), corrupt)

    def _max_rows(self, width: int) -> int:
        return (self.longest - 8) // width


@lru_cache(maxsize=1024)
def _read_frame(servo: int, address: int, size: int) -> bytes:
    return encode(servo, Instruction1.READ, bytes((address, size)))


@lru_cache(maxsize=256)
def _group_frame(ids: tuple[int, ...], address: int, size: int, manner: str) -> bytes:
    if manner == "sync":
        return encode(BROADCAST_ID, Instruction1.SYNC_READ, bytes((address, size, *ids)))
    entries = b"".join(bytes((size, servo, address)) for servo in ids)
    return encode(BROADCAST_ID, Instruction1.BULK_READ, b"\0" + entries)
