"""controller.tools.traffic_files: records in both forms, written and read, and decoded."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.tools.check import check_anything
from controller.tools.traffic_files import TrafficWriter, decoder_of, read_traffic
from drivers.core.traffic import Decoder1, Decoder2, HexDecoder, TextDecoder
from drivers.core.trafficlog import Piece, TrafficRecord, Wire
from surface.base import files

WIRE = Wire("dynamixel", 1_000_000, {1: "xl330-m288"})
PING = bytes.fromhex("FFFFFD0001030001194E")


def record(path: Path) -> None:
    with TrafficWriter(path, WIRE) as writer:
        writer.tap(True, PING)
        writer.tap(None, b"\1")
    writer.tap(True, b"after the end")


@pytest.mark.parametrize("name", ["a.log", "a.txt", "a.pcapng", "a.PCAPNG"])
def test_what_is_written_is_read(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    record(path)
    found = read_traffic(path)
    assert found.wire == WIRE
    assert [piece[1:] for piece in found.pieces] == [(True, PING), (None, b"\1")]
    assert path.read_bytes().startswith(b"\x0a\x0d\x0d\x0a" if name.lower().endswith("pcapng") else b"# omote traffic")


@pytest.mark.parametrize("name", ["a.log", "a.pcapng"])
def test_it_can_be_checked(tmp_path: Path, name: str) -> None:
    record(tmp_path / name)
    assert check_anything(str(tmp_path / name)) == [f"traffic {name}: 2 pieces, 11 bytes, 0.0 s, dynamixel: good"]
    (tmp_path / name).write_bytes(b"\x0a\x0d\x0d\x0a1234")
    with pytest.raises(ConfigError, match=f"{name}: it is damaged"):
        check_anything(str(tmp_path / name))
    (tmp_path / name).write_bytes(b"# omote traffic = 1\n\xff")
    with pytest.raises(ConfigError, match="Latin-1"):
        check_anything(str(tmp_path / name))


def test_a_full_file_ends_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(files, "TEXT_LIMIT", 200)
    with caplog.at_level(logging.WARNING), TrafficWriter(tmp_path / "a.log", WIRE) as writer:
        for _ in range(20):
            writer.tap(True, PING)
    assert caplog.text.count("is full") == 1
    assert 1 <= len(read_traffic(tmp_path / "a.log").pieces) < 20
    (tmp_path / "a.log").write_text(WIRE.head() + "0 > 00\n" * 100)
    with pytest.raises(ConfigError, match="larger than"):
        read_traffic(tmp_path / "a.log")


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be written") as error:
        TrafficWriter(tmp_path / "no" / "a.log", WIRE)
    assert error.value.hint.startswith("mkdir -p")


def test_the_decoder_is_that_of_the_wire() -> None:
    def decoder(wire: Wire, protocol: int | None = None, model: str = "") -> object:
        return decoder_of(TrafficRecord(wire, (Piece(0.0, True, b"x"),)), protocol, model)

    assert isinstance(decoder(WIRE), Decoder2)
    assert isinstance(decoder(Wire("feetech", servos={1: "sts3215"})), Decoder1)
    assert isinstance(decoder(Wire(model="ax-12a")), Decoder1)
    assert isinstance(decoder(Wire(), model="ax-12a"), Decoder1)
    assert isinstance(decoder(Wire(), protocol=1), Decoder1)
    assert isinstance(decoder(Wire("maestro")), HexDecoder)
    assert isinstance(decoder(Wire("ssc32")), TextDecoder)


def test_a_full_disk_is_told_with_the_name_of_the_file() -> None:
    with pytest.raises(ConfigError, match="/dev/full: cannot be written: No space left") as error:
        TrafficWriter(Path("/dev/full"), Wire("dynamixel", 1_000_000))
    assert error.value.hint == "make room on the disk: df -h /dev"


def test_a_damaged_network_record_is_not_told_to_be_saved_as_text(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    with TrafficWriter(path, WIRE) as writer:
        writer.tap(True, b"\xff\xfe")
    path.write_bytes(b"\xff" + path.read_bytes()[1:])
    with pytest.raises(ConfigError, match="is damaged: a pcapng file begins with 0a 0d 0d 0a") as error:
        read_traffic(path)
    assert error.value.hint == "record it again"


def test_a_disk_that_fills_ends_the_record_and_nothing_else(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with TrafficWriter(tmp_path / "bus.log", Wire("dynamixel", 1_000_000)) as writer:
        writer._file.close()
        writer._file = Path("/dev/full").open("wb", buffering=0)  # noqa: SIM115  the writer closes it
        for _ in range(3):
            writer.tap(True, b"abc")
    assert [record.message for record in caplog.records] == [
        f"{tmp_path / 'bus.log'}: No space left on device; what passes from now on is not recorded"
    ]


@pytest.mark.parametrize(("limit", "size", "read"), [(3 << 20, 3 << 20, True), (3 << 20, (3 << 20) + 1, False)])
def test_a_text_may_be_as_long_as_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: int, size: int, read: bool
) -> None:
    monkeypatch.setattr(files, "TEXT_LIMIT", limit)
    text = WIRE.head()
    (tmp_path / "a.log").write_text(text + "#" * (size - len(text)))
    if read:
        assert read_traffic(tmp_path / "a.log").pieces == ()
    else:
        with pytest.raises(ConfigError, match="is larger than 3 MB"):
            read_traffic(tmp_path / "a.log")
