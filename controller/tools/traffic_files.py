"""Writes and reads records of the traffic on a bus: pcapng for files with that suffix, else text logs."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from controller.base.errors import ConfigError
from controller.base.files import place_hint
from drivers.base.errors import DriverError
from drivers.core import pcapng
from drivers.core.traffic import Decoder, Decoder1, Decoder2
from drivers.core.trafficlog import MAX_PIECES, Piece, TrafficRecord, Wire, format_piece, read_log
from drivers.sim.serving.replay import Replay
from drivers.sim.wire.simulator import simulator_of
from drivers.tables.tables import load_table
from surface.base import files

SUFFIX = ".pcapng"
log = logging.getLogger(__name__)


class TrafficWriter:
    """Writes the traffic of a bus to a file, piece by piece; a context manager. Any thread may call ``tap``.

    path : file to replace; pcapng if its name ends in .pcapng, else a text log. wire : description of the bus.

    Once the file has the size that omote can still read, or cannot be written, the rest is omitted, with one message.

    Raises ConfigError: the file cannot be written.
    """

    def __init__(self, path: Path, wire: Wire) -> None:
        self._path, self._is_pcapng = path, path.suffix.lower() == SUFFIX
        self._begun_s, self._begun_ns = time.monotonic(), time.time_ns()
        self._room, self._pieces = files.DATA_LIMIT if self._is_pcapng else files.TEXT_LIMIT, MAX_PIECES
        try:
            self._file = path.open("wb", buffering=0)  # unbuffered, since it matters most when the program crashes
            self._write_header(pcapng.file_head(wire) if self._is_pcapng else wire.head().encode())
        except OSError as error:
            raise ConfigError(f"{path}: cannot be written: {error.strerror}", hint=place_hint(error, path)) from error

    def _write_header(self, header: bytes) -> None:
        """Write the header. If that raises OSError, the file is closed."""
        self._room, self._pieces = self._room - len(header), self._pieces - 1
        try:
            self._file.write(header)
        except OSError:
            self._file.close()
            raise

    def tap(self, sent: bool | None, data: bytes) -> None:
        """Write bytes that passed; ``sent`` is None if the direction is not known."""
        piece = Piece(time.monotonic() - self._begun_s, sent, bytes(data))
        self._write(pcapng.packet(piece, self._begun_ns) if self._is_pcapng else format_piece(piece).encode())

    def _write(self, data: bytes) -> None:
        if self._file.closed or self._room < 0:
            return
        self._room -= len(data)
        self._pieces -= 1
        if self._room < 0 or self._pieces < 0:
            log.warning("%s is full: what passes from now on is not recorded", self._path)
            self._room = -1
            return
        try:
            self._file.write(data)
        except OSError as error:  # an error of the record must not stop the bus
            log.error("%s: %s; what passes from now on is not recorded", self._path, error.strerror)
            self._room = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._file.close()


def read_traffic(path: Path) -> TrafficRecord:
    """Read a record in either format. Raises ConfigError: it cannot be read, or is not such a record."""
    with files.reading(path, ConfigError, hint="record it again"):
        data = files.read_file(path)
        is_pcapng = data.startswith(pcapng.MAGIC)
        if path.suffix.lower() == SUFFIX and not data.startswith((pcapng.MAGIC, b"#")):  # a text log begins with #
            raise ValueError(f"it is damaged: a pcapng file begins with {pcapng.MAGIC.hex(' ')}")
        if not is_pcapng and len(data) > files.TEXT_LIMIT:
            raise ValueError(f"is larger than {files.TEXT_LIMIT >> 20} MB")
        text = "" if is_pcapng else files.decode(data)
    try:
        return pcapng.read_pcapng(data) if is_pcapng else read_log(text)
    except DriverError as error:
        raise ConfigError(f"{path}: {error}", hint=error.hint) from error


def decoder_of(record: TrafficRecord, protocol: int | None = None, model: str = "") -> Decoder:
    """Return a decoder for a record. ``protocol`` and ``model``, unless None and empty, override the record's.

    Raises DriverError: no such model.
    """
    wire = record.wire
    tables = {number: load_table(name) for number, name in wire.servos.items()}
    default = load_table(model or wire.model) if model or wire.model else None
    known = {table.protocol for table in tables.values()} | ({default.protocol} if default else set())
    if protocol or known or wire.family in ("dynamixel", "feetech"):
        number = protocol or (1 if 1 in known else 2)
        return Decoder1(tables, default) if number == 1 else Decoder2(tables, default)
    return simulator_of(wire.family).decoder(Replay(record))


def describe_traffic(path: Path) -> str:
    """Describe a record in one line. Raises ConfigError: it cannot be read."""
    record = read_traffic(path)
    seconds = record.pieces[-1].time_s if record.pieces else 0.0
    size = sum(len(piece.data) for piece in record.pieces)
    return f"traffic {path.name}: {len(record.pieces)} pieces, {size} bytes, {seconds:.1f} s, {record.wire.family}"


Tap = Callable[[bool, bytes], None]


def combine_taps(*taps: Tap) -> Tap:
    """Return a tap that calls all ``taps``."""

    def call(sent: bool, data: bytes) -> None:
        for tap in taps:
            tap(sent, data)

    return call
