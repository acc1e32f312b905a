"""Every fault of a configuration at once, each with its path in the file."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import Field

from controller.base.config import Settings, load
from controller.base.errors import ConfigError


class Wheel(Settings):
    radius: float = Field(gt=0)


class Cart(Settings):
    name: str
    wheels: list[Wheel] = []
    spare: Wheel | None = None


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "cart.toml"
    path.write_text(text)
    return path


def test_reads_a_good_file(tmp_path: Path) -> None:
    cart = load(write(tmp_path, 'name = "a"\nwheels = [{ radius = 2 }]'), Cart)
    assert (cart.name, cart.wheels[0].radius) == ("a", 2.0)


def test_lists_every_fault_with_its_key(tmp_path: Path) -> None:
    text = 'wheels = [{ radius = 2 }, { radius = -1, raduis = 3 }]\nspare = { radius = "x" }'
    with pytest.raises(ConfigError) as caught:
        load(write(tmp_path, text), Cart)
    message = str(caught.value)
    assert "cart.toml: 4 faults" in message
    assert "  name: missing" in message
    assert "  wheels[1].raduis: unknown key, did you mean 'radius'?" in message
    assert "  wheels[1].radius: input should be greater than 0 (is -1" in message
    assert "  spare.radius: " in message
    assert "omote check" in caught.value.hint


@pytest.mark.parametrize("text", ["name = ", 'name = "a', "= 1", "\ufeff\x00"])
def test_broken_toml_names_the_file(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match=r"cart\.toml: not valid TOML"):
        load(write(tmp_path, text), Cart)


def test_a_missing_file_and_a_folder_are_one_message(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(ConfigError, match="cannot be read") as caught:
            load(path, Cart)
        assert caught.value.hint
