"""Looking for servos that speak Protocol 1.0 framing: Dynamixel AX and MX, Feetech STS and SCS. Nothing is written.

There is no broadcast ping that all of them obey, so each id is asked; the questions follow each other as closely as
the wire allows, and answers are told apart by the id they carry.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from drivers.base.bus import ServoInfo
from drivers.base.errors import DriverError
from drivers.packets.packet1 import MAX_ID, Instruction1, Packet1, Reader1, encode
from drivers.port.serialport import SerialPort, latency_s
from drivers.tables.tables import ControlTable, Item, known_models, load_table, model_name

PING_BYTES = 12
"""Question and answer of a ping on the wire."""
RETURN_DELAY_S = 0.0006
"""Longest time a servo takes before it answers, as they leave the factory (500 us) and a little more."""
SLACK_S = 0.001
WAIT_S = 0.03
"""How long a last answer is waited for, beyond the adapter's latency timer: a busy host."""
TRIES = 3
HEAD_BYTES = 6
FEETECH_ID, DYNAMIXEL_ID = 5, 3
"""Where either maker keeps the id; the model number is at 3 and at 0."""


@dataclass(frozen=True)
class Heard:
    """What one round of pings brought: the ids that answered, and whether there was anything that is no answer."""

    ids: tuple[int, ...]
    noise: bool


def ping_all(link: SerialPort, tell: Callable[[int], None] = lambda servo: None) -> Heard:
    """Ask every id of an open port once.

    Parameters
    ----------
    link : the port, open at the rate to try.
    tell : called with each id as it is asked.

    Raises
    ------
    PortLost
    """
    reader, heard = Reader1(), Counter[int]()
    gap = PING_BYTES * 10.0 / link.baud + RETURN_DELAY_S + SLACK_S
    for servo in range(MAX_ID + 1):
        tell(servo)
        link.write(encode(servo, Instruction1.PING))
        heard.update(_answers(reader, _until(link, time.monotonic() + gap)))
    heard.update(_answers(reader, _until(link, time.monotonic() + WAIT_S + _latency(link))))
    noise = reader.broken_frames + reader.noise_bytes + reader.pending > 0
    echoes = len(heard) > MAX_ID  # nobody has every id: the adapter gives back what it was sent
    return Heard(tuple(sorted(servo for servo, count in heard.items() if count > echoes)), noise)


def describe(link: SerialPort, servo: int) -> ServoInfo | None:
    """What a servo is; None where it keeps quiet. An unknown model keeps its number and lacks all else.

    Raises
    ------
    PortLost
    """
    head = _read(link, servo, 0, HEAD_BYTES)
    if head is None:
        return None
    number, firmware = _identity(head, servo)
    name = model_name(number)
    try:
        table = load_table(number)
    except DriverError:
        return ServoInfo(servo, number, name, firmware)
    volts = read_item(link, servo, table, "Present Voltage")
    warm = read_item(link, servo, table, "Present Temperature")
    torque = read_item(link, servo, table, "Torque Enable")
    return ServoInfo(
        servo,
        number,
        name,
        firmware,
        None if volts is None else volts / 10.0,
        None if warm is None else float(warm),
        _error(link, servo),
        None if torque is None else bool(torque),
    )


def _identity(head: bytes, servo: int) -> tuple[int, int]:
    """Model number and firmware in the first bytes of a control table, which either maker lays out its own way."""
    little, big = head[3] | head[4] << 8, head[3] << 8 | head[4]
    if head[FEETECH_ID] == servo and (head[DYNAMIXEL_ID] != servo or _known(little) or _known(big)):
        return (big if _known(big) and not _known(little) else little), head[0]
    return head[0] | head[1] << 8, head[2]


def _known(number: int) -> bool:
    return number in known_models()


def _error(link: SerialPort, servo: int) -> int | None:
    answer = ask(link, servo, Instruction1.PING, b"", 0)
    return None if answer is None else answer.code


def read_item(link: SerialPort, servo: int, table: ControlTable, name: str) -> int | None:
    """One register of a servo; None where its model has none of that name, or no good answer comes."""
    item: Item | None = table.get(name)
    data = None if item is None else _read(link, servo, item.address, item.size)
    return None if item is None or data is None else item.decode(data)


def _read(link: SerialPort, servo: int, address: int, size: int) -> bytes | None:
    answer = ask(link, servo, Instruction1.READ, bytes((address, size)), size)
    return None if answer is None else answer.params


def ask(link: SerialPort, servo: int, code: int, params: bytes, size: int) -> Packet1 | None:
    """One instruction and its answer, tried a few times.

    Parameters
    ----------
    size : bytes of parameters that the answer must have; our own question that an adapter echoes does not.

    Returns
    -------
    Packet1 or None : ``code`` is the servo's error byte.

    Raises
    ------
    PortLost
    """
    question = encode(servo, code, params)
    for _ in range(TRIES):
        link.drain()
        link.write(question)
        reader = Reader1()
        echo: Packet1 | None = Packet1(servo, code, params)
        end = time.monotonic() + (len(question) + size + 6) * 10.0 / link.baud + WAIT_S + _latency(link)
        while time.monotonic() < end:
            for packet in reader.feed(link.read(end)):
                if packet == echo:
                    echo = None  # an adapter gives back what it was sent, once
                elif packet.id == servo and len(packet.params) == size:
                    return packet
    return None


def _latency(link: SerialPort) -> float:
    return latency_s(link.path) or 0.0


def _until(link: SerialPort, end_s: float) -> bytes:
    data = b""
    while time.monotonic() < end_s:
        data += link.read(end_s)
    return data


def _answers(reader: Reader1, data: bytes) -> list[int]:
    """Ids in answers to pings: no parameters. An echoed question reads as an answer with error 1 (input voltage)."""
    return [packet.id for packet in reader.feed(data) if not packet.params]
