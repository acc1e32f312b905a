"""Scan for servos with Protocol 1.0 framing: Dynamixel AX and MX, Feetech STS and SCS. Nothing is written to them.

There is no broadcast ping that all of them answer, so each id is pinged, as fast as the wire allows; a reply carries
the id of its servo.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

from drivers.base.bus import ServoInfo
from drivers.packets.packet1 import MAX_ID, Instruction1, Reader1, encode
from drivers.port.serialport import SerialPort, latency_s
from drivers.protocol1.exchange import Exchanges
from drivers.protocol1.registers import Registers
from drivers.servos.port import Port
from drivers.tables.tables import known_models, load_table

PING_BYTES = 12
"""Number of bytes of a ping on the wire, request and reply together."""
RETURN_DELAY_S = 0.0006
"""Longest time before a servo with factory settings answers (500 us), and a little more."""
SLACK_S = 0.001
WAIT_S = 0.03
"""Time to wait for the last reply, beyond the adapter's latency timer, because the host may be busy."""
MAX_TRIES = 3
HEAD_BYTES = 6
FEETECH_ID, DYNAMIXEL_ID = 5, 3
"""Addresses of the id in servos of either maker; the model number is at 3 (Feetech) and 0 (Dynamixel)."""


class Heard(NamedTuple):
    """Result of one round of pings: the ids that answered, and whether other bytes arrived as well."""

    ids: tuple[int, ...]
    noise: bool


def ping_all(link: SerialPort, progress: Callable[[int], None] = lambda servo: None) -> Heard:
    """Ping every id of an open port once; `progress` is called with each id. Raises PortLost."""
    reader, heard = Reader1(), Counter[int]()
    gap_s = PING_BYTES * 10.0 / link.baud + RETURN_DELAY_S + SLACK_S
    last_s = WAIT_S + (latency_s(link.path) or 0.0)
    for servo in range(MAX_ID + 1):
        progress(servo)
        link.write(encode(servo, Instruction1.PING))
        end_s = time.monotonic() + gap_s + last_s * (servo == MAX_ID)
        while time.monotonic() < end_s:
            heard.update(packet.id for packet in reader.feed(link.read(end_s)) if not packet.params)
    noise = reader.broken_frames + reader.noise_bytes + reader.pending > 0
    echoes = len(heard) > MAX_ID  # no bus has every id: the adapter echoes the pings, which look like replies
    return Heard(tuple(sorted(servo for servo, count in heard.items() if count > echoes)), noise)


def registers_on(port: str | SerialPort, baud: int) -> Registers:
    """Create access to registers of unknown servos on a port, with a longer time limit for busy hosts."""
    path = port if isinstance(port, str) else port.path
    return Registers(Exchanges(), Port(port, baud, WAIT_S + (latency_s(path) or 0.0)), ())


def describe(link: SerialPort, servo: int) -> ServoInfo | None:
    """Read model and settings of a servo; None where it does not answer. For an unknown model only its number."""
    registers = registers_on(link, link.baud)
    found = identity(registers, servo)
    return None if found is None else registers.info(servo, *found, lambda: load_table(*found))


def identity(registers: Registers, servo: int) -> tuple[int, int] | None:
    """Read model number and firmware of a servo; None where it does not answer.

    Dynamixel and Feetech keep them at different addresses, so the id beside them decides.
    """
    for _ in range(MAX_TRIES):
        reply = registers.packets.read(registers.port, servo, 0, HEAD_BYTES).replies.get(servo)
        if reply is None or not reply.params:
            continue
        head, known = reply.params, known_models()
        little, big = head[3] | head[4] << 8, head[3] << 8 | head[4]
        if head[FEETECH_ID] == servo and (head[DYNAMIXEL_ID] != servo or little in known or big in known):
            return (big if big in known and little not in known else little), head[0]
        return head[0] | head[1] << 8, head[2]
    return None
