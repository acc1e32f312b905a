"""The program that makes garments makes those that are shipped, as near as the head's skin was changed since."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from surface.fit.wardrobe import __main__ as program
from surface.fit.wardrobe.skin import ANCHORS, Skin
from surface.head import Head

Arrays = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def head(root: Path) -> Head:
    return Head.load(root / "configs/heads/ict")


@pytest.fixture(scope="module")
def made(head: Head, root: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[Arrays, Arrays]]:
    """Arrays of a garment as it is made now, and of the shipped file."""
    folder, skin = tmp_path_factory.mktemp("wardrobe"), Skin(head)

    def make(name: str) -> tuple[Arrays, Arrays]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(program, "Head", lambda: None)
            patch.setattr(program.Head, "load", lambda folder: head, raising=False)
            patch.setattr(program, "Skin", lambda head: skin)
            program.main("the head", str(folder), name)
        assert [path.name for path in folder.iterdir()] == [f"{name}.npz"]
        found = dict(np.load(folder / f"{name}.npz"))
        (folder / f"{name}.npz").unlink()
        return found, dict(np.load(root / "configs/wardrobe" / f"{name}.npz"))

    return make


def places(head: Head, garment: Arrays, part: str) -> np.ndarray:
    """(n, 3) control points of a part of a garment on the head, mm."""
    anchor, out = garment[f"{part}/anchor"], garment[f"{part}/points"].astype(float)
    for k, name in enumerate(ANCHORS):
        own = np.rint(anchor[:, 0]) == k
        if own.any():
            out[own] += head.part(name).surface.evaluate(anchor[own, 1:].astype(float))
    return out


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["hair-afro", "hair-bun", "hair-crop", "hair-short", "hair-swept", "hair-thin", "beard-full", "beard-short"],
)
def test_hair_and_beards_are_like_the_shipped_ones(
    name: str, made: Callable[[str], tuple[Arrays, Arrays]], head: Head
) -> None:
    """Where strands grow depends on the head's last digits; how many, how long and how dark on average does not."""
    found, shipped = made(name)
    part = name.partition("-")[0]
    assert found.keys() == shipped.keys()
    at, wanted = (places(head, garment, part) for garment in (found, shipped))
    assert len(at) == pytest.approx(len(wanted), rel=0.05)
    np.testing.assert_allclose(at.mean(axis=0), wanted.mean(axis=0), atol=2.5)
    np.testing.assert_allclose(at.std(axis=0), wanted.std(axis=0), atol=2.5)
    for key in ("strands", "shade", "sway", "follow"):
        one, other = (garment[f"{part}/{key}"].astype(float) for garment in (found, shipped))
        np.testing.assert_allclose(one.mean(axis=0), other.mean(axis=0), atol=0.02 * max(np.abs(other).max(), 1e-9))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["clothes-crew", "clothes-shirt", "clothes-turtleneck"])
def test_clothes_lie_within_a_millimetre_of_the_shipped_ones(
    name: str, made: Callable[[str], tuple[Arrays, Arrays]], head: Head
) -> None:
    found, shipped = made(name)
    assert found.keys() == shipped.keys()
    part = name.partition("-")[0]
    assert np.linalg.norm(places(head, found, part) - places(head, shipped, part), axis=1).max() < 1.0
    for key, wanted in shipped.items():
        if key.startswith((f"{part}/knots", f"{part}/mesh", f"{part}/sway", f"{part}/follow", f"{part}/shade")):
            np.testing.assert_allclose(found[key], wanted, atol=2e-3)
        elif key.endswith("/strands"):
            np.testing.assert_allclose(found[key], wanted, atol=0.05)
        elif key.endswith("/tint"):
            np.testing.assert_allclose(found[key].astype(float), wanted, atol=12)
        elif key.startswith(("cover/", "hidden/")):  # the edges of what lies below have moved by a pixel or two
            assert np.abs(found[key].astype(float) - wanted).mean() < 3.0


@pytest.mark.slow
def test_long_hair_hangs_in_tresses_of_the_shipped_length(
    made: Callable[[str], tuple[Arrays, Arrays]], head: Head
) -> None:
    found, shipped = made("hair-long")
    cap, wanted = places(head, found, "hair"), places(head, shipped, "hair")
    assert np.linalg.norm(cap - wanted, axis=1).max() < 1.0
    for key in ("tresses/points", "tresses/sway", "tresses/strands", "tresses/shade"):
        one, other = (each[key].astype(float).reshape(len(each[key]), -1) for each in (found, shipped))
        spread = np.abs(other).max()
        np.testing.assert_allclose(one.mean(axis=0), other.mean(axis=0), atol=0.02 * spread)
        np.testing.assert_allclose(one.std(axis=0), other.std(axis=0), atol=0.02 * spread)
