"""controller.face.fit_colours: a head is painted by its distance from its mesh, and gets its own colours back."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from controller.face.fit_colours import NOT_MEASURED, FitColours, figures_of, plain_theme, unmeasured
from surface.base.error_colours import FULL_MM, SCALE
from surface.head import Head, save_data
from surface.head.posing.fit_error import write_fit_error
from surface.view.scene.theme import THEMES
from tests.surface.small_head import part, small_head


@pytest.fixture
def head(tmp_path: Path) -> Head:
    """A head with a measured patch, whose last vertex was not, and one that was not measured at all."""
    save_data(tmp_path, small_head(parts=[part("face", -40), part("neck", 40), part("tooth", 100, "jaw")], seams=[]))
    mm = np.linspace(0.0, FULL_MM, len(Head.load(tmp_path).part("face").vertices))
    mm[-1] = np.nan
    write_fit_error(tmp_path, {"face": mm}, Head.load(tmp_path).parts)
    return Head.load(tmp_path)


def test_skin_has_the_colours_of_the_scale_until_the_paint_is_off(head: Head) -> None:
    own, colours = [part.attributes for part in head.parts], FitColours()
    assert colours.paint(head)
    face = head.part("face").attributes["albedo"]
    np.testing.assert_allclose(face[0], SCALE[0], atol=1e-6)
    np.testing.assert_allclose(face[-2], SCALE[-1], atol=0.02)
    np.testing.assert_allclose(face[-1], NOT_MEASURED, atol=1e-6)
    np.testing.assert_allclose(head.part("neck").attributes["albedo"], [NOT_MEASURED] * len(head.part("neck").vertices))
    colours.clear()
    assert all(part.attributes is before for part, before in zip(head.parts, own, strict=True))


def test_another_head_is_painted_and_the_first_gets_its_colours_back(head: Head) -> None:
    own, colours = head.part("face").attributes, FitColours()
    colours.paint(head)
    assert not colours.paint(Head(small_head()))  # it was not measured
    assert head.part("face").attributes is own


def test_the_figures_are_of_what_was_measured(head: Head) -> None:
    mm = head.part("face").attributes["fit_error"][:-1].astype(float)
    found = figures_of(head)
    assert found is not None and found.part == "face" and unmeasured(head)
    assert found.rms == pytest.approx(np.sqrt(np.mean(mm**2))) and found.most == pytest.approx(mm.max())
    assert str(found) == f"face: RMS {found.rms:.2f} mm, 99 % within {found.p99:.2f} mm, most {found.most:.2f} mm"
    assert figures_of(Head(small_head())) is None


def test_the_figures_are_of_the_face_also_where_the_back_has_more_vertices(head: Head) -> None:
    """As on heads whose scan or mesh is finer behind."""
    neck = head.part("neck")
    neck.attributes["fit_error"] = np.full(len(neck.vertices), 0.2, np.float32)
    head.part("face").attributes["fit_error"][1:] = np.nan
    for name in ("neck", "face"):
        head.data.contacts[:] = [SimpleNamespace(part=name)]
        found = figures_of(head)
        assert found is not None and found.part == name


def test_the_theme_that_shows_them_takes_painted_colours_and_keeps_the_background() -> None:
    robot = THEMES["robot"]
    shown = plain_theme(robot)
    assert shown.use_painted and not robot.use_painted and len(set(shown.wrap)) == 1
    assert (shown.background_top, shown.background_bottom) == (robot.background_top, robot.background_bottom)
