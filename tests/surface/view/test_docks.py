"""surface.view.docks on ImGui's own parameters; test_window.py opens a real window with docked panels."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from surface.view.docks import LINE, MAIN, Dock, PictureArea, add_docks, find_area, show_docks, text_scale


@pytest.mark.parametrize(
    ("height", "system", "scale"),
    [(600, 1.0, 1.0), (1080, 1.0, 1.0), (2160, 1.0, 2.0), (2160, 2.0, 1.0), (2160, 0.5, 2.0), (4320, 2.0, 2.0)],
)
def test_text_grows_with_the_window_but_not_twice(height: float, system: float, scale: float) -> None:
    assert text_scale((16 / 9 * height, height), system) == pytest.approx(scale)


def params(docks: list[Dock], size: tuple[float, float]) -> object:
    hello_imgui = pytest.importorskip("imgui_bundle").hello_imgui
    found = hello_imgui.RunnerParams()
    add_docks(hello_imgui, found, docks, size, 20.0)
    return found


def nothing() -> None:
    pass


DOCKS = [Dock("sliders", "left", nothing), Dock("expressions", "left", nothing), Dock("servos", "right", nothing)]


def test_panels_of_one_side_share_a_column_and_columns_are_equally_wide() -> None:
    docking = params(DOCKS, (2000.0, 900.0)).docking_params  # type: ignore[attr-defined]
    splits = list(docking.docking_splits)
    assert [split.new_dock for split in splits] == ["left", "right"]
    left = splits[0].ratio * 2000
    right = splits[1].ratio * (2000 - left)  # the second is cut off what the first has left
    assert left == pytest.approx(450, rel=1e-5) and right == pytest.approx(450, rel=1e-5)
    assert [window.dock_space_name for window in docking.dockable_windows] == ["left", "left", "right"]
    assert not any(window.can_be_closed for window in docking.dockable_windows)


def test_one_column_is_wide_enough_for_its_titles_in_a_small_window() -> None:
    splits = params(DOCKS[:2], (800.0, 600.0)).docking_params.docking_splits  # type: ignore[attr-defined]
    assert splits[0].ratio == pytest.approx(0.5625)  # 22.5 lines: of seven titles none is cut


@pytest.mark.parametrize("size", [(640, 480), (800, 600), (1280, 720), (1920, 1080), (3840, 2160)])
@pytest.mark.parametrize("system", [1.0, 1.5, 2.0, 3.0])
def test_a_column_holds_as_many_letters_at_every_size_and_scale(size: tuple[float, float], system: float) -> None:
    text = LINE * system * text_scale(size, system, DOCKS[:2])
    assert text >= LINE  # never smaller than on a plain desktop
    hello_imgui = pytest.importorskip("imgui_bundle").hello_imgui
    found = hello_imgui.RunnerParams()
    add_docks(hello_imgui, found, DOCKS[:2], size, text)
    width = found.docking_params.docking_splits[0].ratio * size[0]
    assert width >= 22.4 * text or text == LINE
    assert width <= 0.61 * size[0]


def test_panels_leave_room_for_the_face_in_a_small_window() -> None:
    docking = params(DOCKS, (400.0, 300.0)).docking_params  # type: ignore[attr-defined]
    room = 1.0
    for split in docking.docking_splits:
        room *= 1.0 - split.ratio
    assert room >= 0.35


def test_panels_are_hidden_and_shown_again() -> None:
    found = params(DOCKS, (2000.0, 900.0))
    docking = found.docking_params  # type: ignore[attr-defined]
    for shown in (False, True):
        show_docks(found, shown=shown)
        assert all(window.is_visible is shown for window in docking.dockable_windows)


def test_a_row_at_the_bottom_is_thirteen_lines_high_and_takes_no_width() -> None:
    bottom = Dock("takes", "bottom", nothing)
    splits = params([bottom, DOCKS[2]], (2000.0, 1000.0)).docking_params.docking_splits  # type: ignore[attr-defined]
    assert [split.ratio for split in splits] == [pytest.approx(0.26), pytest.approx(0.225)]
    (only,) = params([bottom], (2000.0, 300.0)).docking_params.docking_splits  # type: ignore[attr-defined]
    assert only.ratio == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("docks", "size", "scale"),
    [
        (DOCKS[:2], (900.0, 4320.0), 1.5), (DOCKS, (900.0, 4320.0), 1.0), (DOCKS, (1800.0, 4320.0), 2.0),
        (DOCKS[:2], (9000.0, 4320.0), 4.0), ([Dock("a", "bottom", nothing)], (10.0, 4320.0), 4.0),
        (DOCKS[:2], (10.0, 4320.0), 1.0),
    ],
)  # fmt: skip
def test_text_is_as_large_as_the_columns_hold(docks: list[Dock], size: tuple[float, float], scale: float) -> None:
    """22.5 lines of 16 points in 0.6 of the width, or in 0.4 for each of two columns."""
    assert text_scale(size, 1.0, docks) == pytest.approx(scale)


def test_where_nothing_is_docked_the_picture_stays_where_it_is() -> None:
    area = PictureArea(1.0, 2.0, 3.0, 4.0)
    node = SimpleNamespace(pos=SimpleNamespace(x=5.0, y=6.0), size=SimpleNamespace(x=7.0, y=8.0))
    imgui = SimpleNamespace(
        internal=SimpleNamespace(dock_builder_get_central_node=lambda space: node if space else None)
    )
    for space, wanted in ((None, (1.0, 2.0, 3.0, 4.0)), (0, (1.0, 2.0, 3.0, 4.0)), (9, (5.0, 6.0, 7.0, 8.0))):
        docking = SimpleNamespace(dock_space_id_from_name=lambda name, space=space: space if name == MAIN else 1)
        find_area(imgui, docking, area)
        assert (area.left, area.top, area.width, area.height) == wanted
