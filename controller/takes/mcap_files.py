"""Reads and writes takes in MCAP files, which Foxglove and other robotics tools read (the extra mcap).

The package ``mcap`` reads and writes the container, MCAP format specification 1.0. Messages are JSON with a schema. A
message is an object with ``parameters`` by name; its time is its log time.
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
MAX_MESSAGES = 1_000_000
_MAX_CHUNK_BYTES = 64 << 20
_HINT = 'it needs messages of JSON such as {"parameters": {"jawOpen": 0.5}}; omote convert writes such files'


def write_mcap(path: Path, times: Floats, values: Floats, mask: Flags, parameters: Parameters) -> None:
    """Write times (n,) s and values (n, P) of the parameters in ``mask`` : (P,), with six decimals.

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
            time_ns = round(time_s * 1e9)
            writer.add_message(channel, time_ns, json.dumps(message).encode(), time_ns, n)
        writer.finish()  # type: ignore[no-untyped-call]


def mcap_take(path: Path, parameters: Parameters) -> Take:
    """Return a take of the first topic in a file whose messages hold parameters.

    Raises MissingPackage: mcap is not installed. TakeError: the file cannot be read, or has no such topic.
    """
    with importing("a file of MCAP", "mcap"):
        import mcap.exceptions  # optional: the extra mcap
    try:
        with files.reading(path, TakeError, hint=_HINT), files.open_file(path) as file:
            rows = _rows(_explain_errors(_messages(file), path), parameters)
    except (mcap.exceptions.McapError, *files.DAMAGED) as error:
        if isinstance(error, TakeError):
            raise
        why = str(error) or type(error).__name__
        raise TakeError(f"{path}: not a complete MCAP file: {why[:200]}", hint=_HINT) from error
    if not rows:
        raise TakeError(f"{path}: no message in it holds parameters", hint=_HINT)
    return _take(path.name, rows, parameters)


def _explain_errors(messages: Iterator[tuple[str, int, bytes]], path: Path) -> Iterator[tuple[str, int, bytes]]:
    """Yield the same messages. Raises TakeError: the file contains a string that is not UTF-8."""
    try:
        yield from messages
    except UnicodeDecodeError as error:
        raise TakeError(
            f"{path}: not a complete MCAP file: it contains a string that is not UTF-8", hint=_HINT
        ) from error


def _messages(file: IO[bytes]) -> Iterator[tuple[str, int, bytes]]:
    """Yield the topic, time (ns) and content of each JSON message, in the order of the file."""
    from mcap.records import Channel, Chunk, Message  # optional: the extra mcap
    from mcap.stream_reader import StreamReader, breakup_chunk

    topics: dict[int, str] = {}
    count = 0
    for record in StreamReader(file, emit_chunks=True, record_size_limit=_MAX_CHUNK_BYTES).records:
        for each in breakup_chunk(_decompress(record)) if isinstance(record, Chunk) else [record]:
            if isinstance(each, Channel) and each.message_encoding == "json":
                topics[each.id] = each.topic
            elif isinstance(each, Message) and each.channel_id in topics:
                count += 1
                if count > MAX_MESSAGES:
                    raise ValueError(f"more than {MAX_MESSAGES} messages")
                yield topics[each.channel_id], each.log_time, each.data


def _decompress(chunk: Any) -> Any:
    """Decompress the records of a chunk in place and return it. Raises ValueError: they are too large or damaged."""
    data = chunk.data
    if chunk.compression == "zstd":
        import zstandard  # comes with mcap

        try:
            data = zstandard.ZstdDecompressor().stream_reader(data).read(_MAX_CHUNK_BYTES + 1)
        except zstandard.ZstdError as error:
            raise ValueError(f"a damaged chunk: {error}") from error
    elif chunk.compression == "lz4":
        import lz4.frame  # comes with mcap

        data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=_MAX_CHUNK_BYTES + 1)
    if len(data) > _MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk of more than {_MAX_CHUNK_BYTES / (1 << 20):g} MB")
    chunk.data, chunk.compression = data, ""
    return chunk


def _rows(messages: Iterator[tuple[str, int, bytes]], parameters: Parameters) -> list[tuple[int, dict[int, float]]]:
    """Return times (ns) and values, by parameter index, of the first topic that holds parameters, sorted by time."""
    wanted, rows = "", list[tuple[int, dict[int, float]]]()
    for topic, time_ns, content in messages:
        if wanted in ("", topic) and (found := _values(content, parameters)):
            wanted = topic
            rows.append((time_ns, found))
    return sorted(rows, key=lambda row: row[0])


def _values(content: bytes, parameters: Parameters) -> dict[int, float]:
    """Return the values of a message by parameter index; an empty dict if it holds no parameters."""
    try:
        found = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    table = found.get("parameters") if isinstance(found, dict) else None
    if not isinstance(table, dict):
        return {}
    pairs = ((parameters.find(name), value) for name, value in table.items())
    return {index: float(value) for index, value in pairs if index is not None and _is_number(value)}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e6 and math.isfinite(value)


def _take(name: str, rows: list[tuple[int, dict[int, float]]], parameters: Parameters) -> Take:
    """Return a take in which parameters that a message does not name keep their value.

    Of several messages with the same time, the last value of each parameter counts.
    """
    by_time: dict[int, dict[int, float]] = {time_ns: {} for time_ns, _ in rows}
    for time_ns, given in rows:
        by_time[time_ns] |= given
    times = np.array([*by_time], dtype=np.int64)
    values, mask = np.zeros((len(times), len(parameters))), np.zeros(len(parameters), dtype=bool)
    held = np.zeros(len(parameters))
    for n, given in enumerate(by_time.values()):
        indices = [*given]
        held[indices] = [*given.values()]
        mask[indices] = True
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
