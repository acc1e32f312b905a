"""Options of a link that speaks the line protocol."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import pytest

from controller.links.line.kind import LINK, LineSettings
from controller.links.links import read_link


def test_a_real_port() -> None:
    settings = LineSettings(port="/dev/ttyUSB0")
    settings.check()
    assert (settings.baud, settings.simulated, settings.address) == (115_200, None, "/dev/ttyUSB0")


@pytest.mark.parametrize(("script", "played"), [(None, "tour"), ("everything", "everything")])
def test_a_simulated_host_plays_a_script(script: str | None, played: str) -> None:
    settings = LineSettings(port="simulated", script=script)
    settings.check()
    assert settings.simulated == played


def test_a_script_needs_a_simulated_host() -> None:
    with pytest.raises(ValueError, match='script needs port = "simulated"'):
        LineSettings(port="/dev/ttyUSB0", script="tour").check()
    with pytest.raises(ValueError, match='script needs port = "simulated"'):
        read_link({"port": "/dev/ttyUSB0", "script": "tour"})


def test_an_address_instead_of_a_port() -> None:
    settings = read_link({"listen": "[::1]:9404", "clients": 2}).own
    assert (settings.where, settings.address, settings.simulated) == (("::1", 9404), "[::1]:9404", None)
    assert str(read_link({"listen": "127.0.0.1:9404"})) == "line on 127.0.0.1:9404"


@pytest.mark.parametrize(
    ("keys", "part"),
    [
        ({}, "give port"),
        ({"port": "/dev/ttyUSB0", "listen": "127.0.0.1:9404"}, "give port"),
        ({"listen": "9404"}, "is not an address"),
        ({"listen": "0.0.0.0:9404"}, "open_to_network = true allows it, with a token"),
        ({"listen": "127.0.0.1:9404", "token": "short"}, "at least 12 characters"),
        ({"listen": "127.0.0.1:9404", "token": "two words of a token"}, "printable ASCII without spaces"),
        ({"listen": "127.0.0.1:9404", "script": "tour"}, 'script needs port = "simulated"'),
        ({"listen": "127.0.0.1:9404", "clients": 65}, "clients"),
    ],
)
def test_what_is_wrong_with_an_address_is_refused(keys: dict[str, object], part: str) -> None:
    with pytest.raises(ValueError, match=part):
        read_link(keys)


@pytest.mark.parametrize(("baud", "good"), [(299, False), (300, True), (12_000_000, True), (12_000_001, False)])
def test_limits_of_the_baud_rate(baud: int, good: bool) -> None:
    table = {"port": "/dev/ttyUSB0", "baud": baud}
    if good:
        assert read_link(table).own == LineSettings(port="/dev/ttyUSB0", baud=baud)
    else:
        with pytest.raises(ValueError, match="baud"):
            read_link(table)


def test_when_checksums_are_demanded() -> None:
    assert LineSettings(port="a").checksum == "latched"
    assert read_link({"port": "a", "checksum": "required"}).own.checksum == "required"
    with pytest.raises(ValueError, match="checksum"):
        read_link({"port": "a", "checksum": "never"})


def test_its_definition() -> None:
    assert (LINK.api, LINK.kind, LINK.settings) == (1, "line", LineSettings)
    assert str(read_link({"port": "simulated"})) == "line on simulated"


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(LineSettings).anything = 1
