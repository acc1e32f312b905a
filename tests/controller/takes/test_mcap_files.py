"""Takes in MCAP: the package's own reader reads what is written, and what its writer writes is a take."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.errors import OMOTE_ERRORS, TakeError
from controller.base.parameters import PARAMETERS as P
from controller.takes import mcap_files
from controller.takes.mcap_files import TOPIC, mcap_take, write_mcap
from controller.takes.reader import load_take
from controller.tools.motion_file import convert
from surface.base.errors import MissingPackage

JAW, SMILE = P.index("jawOpen"), P.index("mouthSmileLeft")


def written(path: Path, *messages: tuple[str, float, Any], compression: str = "ZSTD") -> Path:
    """A file that the package's own writer writes: topics, times (s) and objects."""
    writer_module = pytest.importorskip("mcap.writer")
    with path.open("wb") as file:
        writer = writer_module.Writer(file, compression=writer_module.CompressionType[compression])
        writer.start()
        channels: dict[str, int] = {}
        for topic, time_s, content in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", 0)
            data = content if isinstance(content, bytes) else json.dumps(content).encode()
            writer.add_message(channels[topic], round(time_s * 1e9), data, 0)
        writer.finish()
    return path


def test_a_take_is_read_by_the_packages_own_reader(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    (tmp_path / "a.csv").write_text("time,jawOpen,headYaw\n0,0.25,-0.5\n0.5,0.75,0.5\n")
    convert(tmp_path / "a.csv", tmp_path / "a.mcap", P)
    with (tmp_path / "a.mcap").open("rb") as file:
        found = list(reader.make_reader(file, validate_crcs=True).iter_messages())
    assert [(channel.topic, schema.encoding, message.log_time) for schema, channel, message in found] == [
        (TOPIC, "jsonschema", 0), (TOPIC, "jsonschema", 500_000_000)]  # fmt: skip
    assert json.loads(found[1][2].data) == {"parameters": {"jawOpen": 0.75, "headYaw": 0.5}}
    schema = json.loads(found[0][0].data)["properties"]["parameters"]["properties"]
    assert schema == {"jawOpen": {"type": "number", "minimum": 0.0, "maximum": 1.0},
                      "headYaw": {"type": "number", "minimum": -1.0, "maximum": 1.0}}  # fmt: skip


def test_a_take_comes_back(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    rng = np.random.default_rng(1)
    times, values = np.arange(200) / 60, rng.uniform(P.low, P.high, (200, len(P)))
    write_mcap(tmp_path / "a.mcap", times, values, np.ones(len(P), dtype=bool), P)
    take = load_take(tmp_path / "a.mcap", P)
    assert take.mask.all()
    np.testing.assert_allclose(take.times_s, times, atol=1e-8)
    np.testing.assert_allclose(take.values, values, atol=1e-6)


def test_a_text_that_is_not_utf_8_is_told_in_plain_words(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mcap", (TOPIC, 0.0, {"parameters": {"jawOpen": 0.5}}), compression="NONE")
    data = path.read_bytes()
    assert TOPIC.encode() in data
    path.write_bytes(data.replace(TOPIC.encode(), b"\xad" * len(TOPIC)))
    with pytest.raises(TakeError, match="not a complete MCAP file") as caught:
        mcap_take(path, P)
    assert "codec" not in str(caught.value)


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
def test_other_topics_are_left_out_and_what_is_not_named_stays(tmp_path: Path, compression: str) -> None:
    take = mcap_take(
        written(
            tmp_path / "a.mcap", ("/odometry", 99.0, {"x": 1}), ("/face", 102.0, {"parameters": {"jawOpen": 0.5}}),
            ("/other", 100.0, {"parameters": {"jawOpen": 1.0}}), ("/face", 101.0, {"parameters": {"jaw_open": 0.25}}),
            ("/face", 103.0, {"parameters": {"mouthSmileLeft": 1.0, "x": 1, "headYaw": "a"}}), ("/face", 104.0, b"{"),
            compression=compression,
        ), P,
    )  # fmt: skip
    assert take.times_s.tolist() == [0.0, 1.0, 2.0] and np.flatnonzero(take.mask).tolist() == sorted([JAW, SMILE])
    assert take.values[:, JAW].tolist() == [0.25, 0.5, 0.5] and take.values[2, SMILE] == 1.0


def test_a_file_without_faces_is_told(tmp_path: Path) -> None:
    with pytest.raises(TakeError, match="no message in it holds parameters"):
        mcap_take(written(tmp_path / "a.mcap", ("/x", 0.0, {"parameters": 5}), ("/y", 0.0, [1])), P)


def test_damaged_files_are_one_message(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mcap", *(("/face", n / 60, {"parameters": {"jawOpen": n / 100}}) for n in range(100)))
    good, draw = path.read_bytes(), random.Random(1)
    for n in range(300):
        data = bytearray(good[: draw.randrange(len(good))] if n % 3 == 0 else good)
        for _ in range(draw.choice((0, 1, 5, 30)) if data else 0):
            data[draw.randrange(len(data))] = draw.randrange(256)
        path.write_bytes(data)
        try:
            mcap_take(path, P)
        except OMOTE_ERRORS as error:
            assert str(path) in str(error)


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
def test_what_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: str) -> None:
    many = [("/face", n / 60, {"parameters": {"jawOpen": 0.5}}) for n in range(2000)]
    path = written(tmp_path / "a.mcap", *many, compression=compression)
    monkeypatch.setattr(mcap_files, "_MAX_CHUNK_BYTES", 40_000)
    with pytest.raises(TakeError, match=r"not a complete MCAP file|a chunk of more than 0\.0"):
        mcap_take(path, P)
    monkeypatch.undo()
    monkeypatch.setattr(mcap_files, "MAX_MESSAGES", 1000)
    with pytest.raises(TakeError, match="more than 1000 messages"):
        mcap_take(path, P)


def test_a_missing_package_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surface.base.extras.find_spec", lambda name: None)
    (tmp_path / "a.mcap").write_bytes(b"")
    for act in (
        lambda: mcap_take(tmp_path / "a.mcap", P),
        lambda: write_mcap(tmp_path / "b.mcap", np.zeros(1), np.zeros((1, len(P))), np.ones(len(P), dtype=bool), P),
    ):
        with pytest.raises(MissingPackage) as caught:
            act()
        assert "omote[mcap]" in caught.value.hint
    assert not (tmp_path / "b.mcap").exists()
