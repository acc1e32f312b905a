"""The panel over the picture: expressions, sliders for every parameter, and the frame rate.

It shows the newest parameters and sends the user's requests to the body; it never writes parameters itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.base.parameters import REGIONS, Parameters
from controller.body.messages import Hold, Neutral, PanelRequest, Show
from controller.body.panel_state import PanelState
from controller.vocabulary.vocabulary import Vocabulary

_BUTTONS_A_ROW = 3
_CALM_S = 0.6


class Panel:
    """Draws the panel once a frame.

    Parameters
    ----------
    parameters : all of them, p. newest : returns the newest ones, (p,) float64. send : sends a request to the body.
    panel_state : the layer that holds each parameter and what the servos show; without, neither is shown.
    """

    def __init__(
        self,
        parameters: Parameters,
        newest: Callable[[], NDArray[np.float64]],
        send: Callable[[PanelRequest], None],
        panel_state: PanelState | None = None,
    ) -> None:
        self._panel_state = panel_state
        self._parameters = parameters
        self._newest, self._send = newest, send
        self._expressions = Vocabulary.load(parameters).names
        self._members = {region: parameters.region(region) for region in REGIONS}
        self._held: set[int] = set()
        self._intensity = 1.0

    def __call__(self) -> None:
        """Draw; called by the window between its frames."""
        from imgui_bundle import imgui  # optional

        imgui.set_next_window_pos(imgui.ImVec2(12, 12), imgui.Cond_.first_use_ever)
        imgui.set_next_window_size(imgui.ImVec2(320, 640), imgui.Cond_.first_use_ever)
        if self._panel_state is not None:
            self._panel_state.refresh()
        if imgui.begin("omote")[0]:
            self._top(imgui)
            for region, members in self._members.items():
                if imgui.collapsing_header(f"{region}{self._away(region)}###{region}"):
                    self._sliders(imgui, members)
        imgui.end()

    def _top(self, imgui: Any) -> None:
        imgui.text(f"{imgui.get_io().framerate:.0f} frames/s")
        imgui.same_line()
        if imgui.small_button("release all"):
            self._held.clear()
            self._send(Neutral(_CALM_S))
        _, self._intensity = imgui.slider_float("intensity", self._intensity, 0.0, 1.0)
        gap = imgui.get_style().item_spacing.x
        width = (imgui.get_content_region_avail().x + gap) / _BUTTONS_A_ROW - gap
        for i, name in enumerate(self._expressions):
            if i % _BUTTONS_A_ROW:
                imgui.same_line()
            if imgui.button(name, imgui.ImVec2(width, 0)):
                self._send(Show(name, self._intensity))

    def _away(self, region: str) -> str:
        """How far the servos of a region are from their wanted angles, for its title."""
        away = None if self._panel_state is None else self._panel_state.away_deg(region)
        return "" if away is None else f"   servos {away:.1f} deg away"

    def _holder(self, imgui: Any, index: int) -> None:
        """Which layer holds a parameter, and what the servos show of it."""
        if self._panel_state is None:
            return
        measured = self._panel_state.measured(index)
        shown = "" if measured is None else f"  servos {measured:.2f}"
        imgui.same_line()
        imgui.text_disabled(f"{self._panel_state.holder(index)}{shown}")

    def _sliders(self, imgui: Any, members: NDArray[np.intp]) -> None:
        values = self._newest()
        for index in map(int, members):
            low, high = self._parameters.low[index], self._parameters.high[index]
            moved, value = imgui.slider_float(self._parameters.names[index], float(values[index]), low, high)
            if moved:
                self._held.add(index)
                self._send(Hold(index, float(np.clip(value, low, high))))
            if index in self._held:
                imgui.same_line()
                if imgui.small_button(f"x##{index}"):
                    self._held.discard(index)
                    self._send(Hold(index, None))
            self._holder(imgui, index)
