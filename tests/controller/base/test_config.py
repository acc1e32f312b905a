"""Every fault of a configuration at once, each with its path in the file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pytest
from pydantic import Field, RootModel, ValidationError

from controller.base.config import Fraction, Positive, Settings, key_path, load
from controller.base.errors import ConfigError
from controller.base.files import NEWER


class Wheel(Settings):
    radius: float = Field(gt=0)


class Cart(Settings):
    name: str
    wheels: list[Wheel] = []
    spare: Wheel | None = None


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "cart.toml"
    path.write_text(text, encoding="utf-8")
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


class Part(Settings):
    share: Fraction = 0.5
    size: Positive = 1.0


class Store(RootModel[dict[str, Part]]):
    """Parts by name, at the top of the file."""


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[a]\nshar = 1", "a.shar: unknown key, did you mean 'share'?"),
        ("[a]\nxyz = 1", "a.xyz: unknown key\n"),
        ("[share]\nsiz = 1", "share.siz: unknown key, did you mean 'size'?"),
        ("a = 3", "a: must be a table (is 3)"),
        ("[a]\nshare = 1.01", "a.share: input should be less than or equal to 1 (is 1.01)"),
        ("[a]\nshare = -0.01", "a.share: input should be greater than or equal to 0 (is -0.01)"),
        ("[a]\nshare = true", "a.share: input should be a valid number (is True)"),
        ("[a]\nshare = '1'", "a.share: input should be a valid number (is '1')"),
        ("[a]\nsize = 0", "a.size: input should be greater than 0 (is 0)"),
        ("[a]\nsize = inf", "a.size: input should be a finite number (is inf)"),
    ],
)
def test_numbers_and_tables_of_tables(tmp_path: Path, text: str, fault: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load(write(tmp_path, text), Store)
    assert "cart.toml: 1 fault\n" in str(caught.value) and fault in str(caught.value) + "\n"


def test_values_at_the_ends_and_whole_numbers_are_taken(tmp_path: Path) -> None:
    read = load(write(tmp_path, "[a]\nshare = 0\n[b]\nshare = 1\nsize = 3"), Store).root
    assert (read["a"].share, read["b"].share, read["b"].size) == (0.0, 1.0, 3.0)
    with pytest.raises(ValidationError):
        read["a"].share = 0.2


def test_faults_between_values_are_found_beside_others(tmp_path: Path) -> None:
    def no_twos(store: Store) -> list[str]:
        return [f"{name}.size: is {part.size:g}" for name, part in store.root.items() if part.size == 2]

    with pytest.raises(ConfigError, match=r"2 faults\n  a\.share: .*\n  b\.size: is 2$") as caught:
        load(write(tmp_path, "[a]\nshare = 7\n[b]\nsize = 2"), Store, no_twos)
    assert caught.value.hint.startswith("correct the file")
    with pytest.raises(ConfigError, match=r"1 fault\n  b\.size: is 2$"):
        load(write(tmp_path, "[b]\nsize = 2"), Store, no_twos)


def test_a_file_of_a_newer_omote_says_how_to_update(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load(write(tmp_path, "[a]\n"), Store, lambda _: [f"format: is 9, {NEWER}"])
    assert "pip install" in caught.value.hint


def test_key_paths() -> None:
    assert key_path(("links", 0, "port")) == "links[0].port"
    assert key_path(()) == "file" and key_path((1,)) == "[1]"


class Box(Settings):
    wide: float = 1.0
    cart: Cart | None = None


def test_unknown_keys_are_compared_with_those_of_their_own_table(tmp_path: Path) -> None:
    for text, fault in (
        ("wdie = 1", "wdie: unknown key, did you mean 'wide'?"),
        ('cart = { name = "a", wheles = [] }', "cart.wheles: unknown key, did you mean 'wheels'?"),
        ('cart = { name = "a", spare = { radius = 1, raduis = 2 } }',
         "cart.spare.raduis: unknown key, did you mean 'radius'?"),
        ('cart = { name = "a", spare = { radius = 1, whels = 2 } }', "cart.spare.whels: unknown key"),
        ('cart = { name = "a", wheels = [{ radius = 1 }, { radius = 1, radiu = 2 }] }',
         "cart.wheels[1].radiu: unknown key, did you mean 'radius'?"),
    ):  # fmt: skip
        with pytest.raises(ConfigError) as caught:
            load(write(tmp_path, text), Box)
        assert str(caught.value).endswith(f"cart.toml: 1 fault\n  {fault}"), text


def test_a_value_of_several_kinds_has_one_fault_without_the_names_of_kinds(tmp_path: Path) -> None:
    class Look(Settings):
        colour: Fraction | Annotated[str, Field(min_length=2)] | tuple[Fraction, Fraction] = 0.0

    (tmp_path / "a.toml").write_text("colour = [1, 2, 3]\nwidth = 1\n")
    with pytest.raises(ConfigError) as caught:
        load(tmp_path / "a.toml", Look)
    kinds = "number, or input should be a valid string, or tuple should have at most 2 items after validation, not 3"
    assert str(caught.value).splitlines()[1:] == [f"  colour: input should be a valid {kinds}", "  width: unknown key"]
