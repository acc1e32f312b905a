"""MIDI ports, through mido with ports that exist in this process only."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import closing
from types import ModuleType
from typing import Any

import pytest

from controller.base.errors import LinkError
from controller.formats.format import FORMATS
from controller.links.net.address import parse_address
from controller.links.net.opening import open_receiver
from controller.links.net.senders import open_sender

mido = pytest.importorskip("mido")
FORM = FORMATS.get("midi")


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A port that gives back what is sent to it, under the name ``nanoKONTROL2 MIDI 1``."""
    port = mido.ports.EchoPort()
    names = ["Midi Through", "nanoKONTROL2 MIDI 1"]
    monkeypatch.setitem(sys.modules, "rtmidi", ModuleType("rtmidi"))
    for way in ("input", "output"):
        monkeypatch.setattr(mido, f"get_{way}_names", lambda: names)
        monkeypatch.setattr(mido, f"open_{way}", lambda name: port if name == names[1] else None)
    yield port


def test_messages_go_both_ways(wire: Any) -> None:
    address = parse_address("midi:nanoKONTROL2", FORM)
    with closing(open_receiver(address)) as receiver, closing(open_sender(address, b"")) as sender:
        assert receiver.receive(0.0) == []
        assert sender.send(b"\xb0\x01\x7f\xb0\x02\x40")
        assert receiver.receive(1.0) == [("nanoKONTROL2 MIDI 1", b"\xb0\x01\x7f\xb0\x02\x40")]


def test_a_port_that_is_not_there_is_told_with_those_that_are(wire: Any) -> None:
    with pytest.raises(LinkError, match="midi:nanoKONTROX: no such MIDI port") as caught:
        open_receiver(parse_address("midi:nanoKONTROX", FORM))
    assert "Midi Through, nanoKONTROL2 MIDI 1" in caught.value.hint


def test_missing_packages_are_named_with_their_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rtmidi", None)
    for opening in (open_receiver, lambda address: open_sender(address, b"")):
        with pytest.raises(LinkError, match="mido and python-rtmidi") as caught:
            opening(parse_address("midi:x", FORM))
        assert caught.value.hint == "pip install 'omote[midi]'"


def test_only_midi_travels_by_midi() -> None:
    assert str(parse_address("midi:x", FORM)) == "midi:x" and parse_address("midi:x", FORM).is_local
    with pytest.raises(ValueError, match="does not travel by midi"):
        parse_address("midi:x", FORMATS.get("vmc"))
