"""Takes in MCAP files, which Foxglove and other tools of robotics read: JSON messages with a schema (the extra mcap).

Source of the container: the MCAP format specification 1.0; it is read and written by the package ``mcap``. A message is
an object with ``parameters`` by name, at the time it is logged at.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from controller.base.errors import TakeError
from controller.base.files import replacing
from controller.base.parameters import Flags, Floats, Parameters
from controller.takes.livelink import Take
from surface.base import files
from surface.base.extras import importing

TOPIC = "/omote/face"
MOST_MESSAGES = 1_000_000
_CHUNK_LIMIT = 64 << 20
_HINT = 'it needs messages of JSON such as {"parameters": {"jawOpen": 0.5}}; omote convert writes such files'


def write_mcap(path: Path, times: Floats, values: Floats, mask: Flags, parameters: Parameters) -> None:
    """Write times (n,) s and values (n, P) of the parameters in ``mask`` : (P,); six decimals.

    Raises MissingPackage: mcap is not installed. ControllerError: the file cannot be written.
    """
    with importing("a file of MCAP", "mcap"):
        from mcap.writer import Writer  # optional: the extra mcap
    chosen = [(parameters.names[i], int(i)) for i in np.flatnonzero(mask)]
    with replacing(path) as temporary, temporary.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="omote")
        schema = writer.register_schema("omote.Face", "jsonschema", json.dumps(_schema(chosen, parameters)).encode())
        channel = writer.register_channel(TOPIC, "json", schema)
        for n, (time_s, row) in enumerate(zip(times.tolist(), values.tolist(), strict=True)):
            message = {"parameters": {name: round(row[i], 6) for name, i in chosen}}
            at_ns = round(time_s * 1e9)
            writer.add_message(channel, at_ns, json.dumps(message).encode(), at_ns, n)
        writer.finish()  # type: ignore[no-untyped-call]


def mcap_take(path: Path, parameters: Parameters) -> Take:
    """A take from the first topic of a file whose messages hold parameters.

    Raises MissingPackage: mcap is not installed. TakeError: the file cannot be read, or has no such topic.
    """
    with importing("a file of MCAP", "mcap"):
        import mcap.exceptions  # optional: the extra mcap
    try:
        with files.reading(path, TakeError, hint=_HINT), files.open_file(path) as file:
            rows = _rows(_plain(_messages(file), path), parameters)
    except (mcap.exceptions.McapError, *files.DAMAGED) as error:
        if isinstance(error, TakeError):
            raise
        why = str(error) or type(error).__name__
        raise TakeError(f"{path}: no whole MCAP file: {why[:200]}", hint=_HINT) from error
    if not rows:
        raise TakeError(f"{path}: no message in it holds parameters", hint=_HINT)
    return _take(path.name, rows, parameters)


def _plain(messages: Iterator[tuple[str, int, bytes]], path: Path) -> Iterator[tuple[str, int, bytes]]:
    """The same messages; a text that the package cannot read is reported in plain words. Raises TakeError."""
    try:
        yield from messages
    except UnicodeDecodeError as error:
        raise TakeError(f"{path}: no whole MCAP file: a text in it is not UTF-8", hint=_HINT) from error


def _messages(file: IO[bytes]) -> Iterator[tuple[str, int, bytes]]:
    """Topics, times (ns) and contents of all messages in JSON, as they stand in the file."""
    from mcap.records import Channel, Chunk, Message  # optional: the extra mcap
    from mcap.stream_reader import StreamReader, breakup_chunk

    topics: dict[int, str] = {}
    count = 0
    for record in StreamReader(file, emit_chunks=True, record_size_limit=_CHUNK_LIMIT).records:
        for each in breakup_chunk(_unpacked(record)) if isinstance(record, Chunk) else [record]:
            if isinstance(each, Channel) and each.message_encoding == "json":
                topics[each.id] = each.topic
            elif isinstance(each, Message) and each.channel_id in topics:
                count += 1
                if count > MOST_MESSAGES:
                    raise ValueError(f"more than {MOST_MESSAGES} messages")
                yield topics[each.channel_id], each.log_time, each.data


def _unpacked(chunk: Any) -> Any:
    """A chunk whose records are not compressed, of bounded size whatever it says. Raises ValueError: it is larger."""
    data = chunk.data
    if chunk.compression == "zstd":
        import zstandard  # comes with mcap

        try:
            data = zstandard.ZstdDecompressor().stream_reader(data).read(_CHUNK_LIMIT + 1)
        except zstandard.ZstdError as error:
            raise ValueError(f"a damaged chunk: {error}") from error
    elif chunk.compression == "lz4":
        import lz4.frame  # comes with mcap

        data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=_CHUNK_LIMIT + 1)
    if len(data) > _CHUNK_LIMIT:
        raise ValueError(f"a chunk of more than {_CHUNK_LIMIT / (1 << 20):g} MB")
    chunk.data, chunk.compression = data, ""
    return chunk


def _rows(messages: Iterator[tuple[str, int, bytes]], parameters: Parameters) -> list[tuple[int, dict[int, float]]]:
    """Times (ns) and values by position of the topic that holds parameters first."""
    wanted, rows = "", list[tuple[int, dict[int, float]]]()
    for topic, time_ns, content in messages:
        if wanted in ("", topic) and (found := _values(content, parameters)):
            wanted = topic
            rows.append((time_ns, found))
    return sorted(rows, key=lambda row: row[0])


def _values(content: bytes, parameters: Parameters) -> dict[int, float]:
    """Values by position; none for what is no object with parameters."""
    try:
        found = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    table = found.get("parameters") if isinstance(found, dict) else None
    if not isinstance(table, dict):
        return {}
    places = ((parameters.find(name), value) for name, value in table.items())
    return {at: float(value) for at, value in places if at is not None and _is_number(value)}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6 and math.isfinite(value)


def _take(name: str, rows: list[tuple[int, dict[int, float]]], parameters: Parameters) -> Take:
    """A value that a message does not name stays as it was; of messages at one time the last counts."""
    by_time: dict[int, dict[int, float]] = {time_ns: {} for time_ns, _ in rows}
    for time_ns, given in rows:
        by_time[time_ns] |= given
    times = np.array([*by_time], dtype=np.int64)
    values, mask = np.zeros((len(times), len(parameters))), np.zeros(len(parameters), dtype=bool)
    held = np.zeros(len(parameters))
    for n, given in enumerate(by_time.values()):
        at = [*given]
        held[at] = [*given.values()]
        mask[at] = True
        values[n] = held
    return Take(name, (times - times[0]) * 1e-9, values, mask, parameters.low, parameters.high)


def _schema(chosen: list[tuple[str, int]], parameters: Parameters) -> dict[str, Any]:
    ranges = {
        name: {"type": "number", "minimum": float(parameters.low[i]), "maximum": float(parameters.high[i])}
        for name, i in chosen
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "omote.Face",
        "type": "object",
        "properties": {"parameters": {"type": "object", "properties": ranges}},
        "required": ["parameters"],
    }
