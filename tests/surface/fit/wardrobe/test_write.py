"""surface.fit.wardrobe.write: garments in files, and pictures over (u, v) of what they do to the skin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_head import small_head

from surface.fit.wardrobe import write as module
from surface.fit.wardrobe.beards import BEARDS
from surface.fit.wardrobe.clothes import NECKS
from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.skin import ANCHORS, Skin
from surface.fit.wardrobe.styles import cap
from surface.fit.wardrobe.write import SIZE, beard_fields, cloth_fields, hair_fields, picture, write_garment
from surface.head.model.look import Worn
from surface.head.model.wardrobe import outline, read_garment


@pytest.fixture(scope="module")
def line(skin: Skin) -> Hairline:
    return Hairline(skin)


def test_a_garment_that_was_written_is_read_again(
    tmp_path: Path, skin: Skin, line: Hairline, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(skin, "data", small_head())
    hair = cap(skin, line, lambda at: np.full(len(at), 6.0))
    fields = {"cover/face": np.linspace(-0.5, 1.5, 9).reshape(3, 3), "hidden/back": np.zeros((2, 2))}
    path = write_garment(
        tmp_path / "cap.npz", skin, {"hair": ("strand", [hair]), "more": ("tress", [hair, hair])}, fields
    )
    found = read_garment(Worn(path, (0.1, 0.1, 0.1)))
    assert found.anchors == ANCHORS and found.fit == outline(small_head(), ANCHORS)
    assert [(part.name, part.material) for part in found.parts] == [("hair", "strand"), ("more", "tress")]
    assert len(found.parts[1].arrays["points"]) == 2 * len(found.parts[0].arrays["points"]) == 2 * 32 * 10
    np.testing.assert_allclose(found.fields["cover/face"], np.clip(fields["cover/face"], 0, 1), atol=0.002)
    assert found.fields.keys() == fields.keys()


def test_a_picture_has_the_values_of_the_samples_about_each_pixel(skin: Skin) -> None:
    """Rows along u, columns along v."""
    for part in (0, 1):
        own = skin.part == part
        np.testing.assert_array_equal(picture(skin, part, np.where(own, 0.25, 9.0)), np.full((SIZE, SIZE), 0.25))
        at = np.linspace(0.0, 1.0, SIZE)
        for axis, wanted in ((0, at[:, None]), (1, at[None])):
            found = picture(skin, part, skin.uv[:, axis])
            inner = slice(10, -10)
            assert np.abs(found - wanted)[inner, inner].max() < 0.03


def test_hair_colours_the_skin_between_its_roots_and_hides_it_deep_inside(skin: Skin, line: Hairline) -> None:
    fields = hair_fields(skin, line)
    assert fields.keys() == {f"{kind}/{name}" for kind in ("cover", "hidden") for name in ANCHORS}
    inside = line.inside(skin.points)
    for part, name in enumerate(ANCHORS):
        cover, hidden = fields[f"cover/{name}"], fields[f"hidden/{name}"]
        assert cover.shape == hidden.shape == (SIZE, SIZE) and (hidden <= cover + 1e-9).all()
        pixel = np.rint(skin.uv * (SIZE - 1)).astype(int)

        def near(field: np.ndarray, low: float, high: float, part: int = part, pixel: np.ndarray = pixel) -> np.ndarray:
            own = (skin.part == part) & (inside > low) & (inside < high)
            return np.asarray(field[tuple(pixel[own].T)])

        assert np.median(near(cover, 12.0, 99.0)) == 1.0 and np.median(near(cover, -99.0, -15.0)) == 0.0
        assert np.median(near(hidden, 28.0, 99.0)) == 1.0 and np.median(near(hidden, -99.0, 5.0)) == 0.0
    wider = hair_fields(skin, line, (-25.0, -15.0))
    assert wider["cover/face"].sum() > fields["cover/face"].sum() + 100.0
    np.testing.assert_array_equal(wider["hidden/face"], fields["hidden/face"])


def test_clothes_hide_and_beards_colour_what_lies_below(skin: Skin) -> None:
    cloth = cloth_fields(skin, NECKS["clothes-crew"])
    assert cloth.keys() == {"hidden/face", "hidden/back"}
    low, high = cloth["hidden/face"][:, : SIZE // 4], cloth["hidden/face"][:, -SIZE // 3 :]
    assert low.mean() > 0.95 and not high.any()
    (beard,) = beard_fields(skin, BEARDS["beard-full"]).items()
    assert beard[0] == "cover/face" and 0.0 < beard[1].max() <= BEARDS["beard-full"].cover
    assert not beard[1][:, -SIZE // 5 :].any() and module.SIZE == SIZE
