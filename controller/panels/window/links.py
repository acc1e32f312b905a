"""The links of the stage: what arrives at each, how evenly, how old it is, and what is wrong."""

from __future__ import annotations

from controller.body.panel_state import LINK_COLUMNS, PanelState


class Links:
    """Draws them as a table, as ``STATUS`` has them; ``state`` None: nothing is known."""

    def __init__(self, state: PanelState | None) -> None:
        self._state = state

    def __call__(self) -> None:
        """Draw; called once a frame."""
        from imgui_bundle import imgui  # optional

        rows = self._state.links if self._state is not None else []
        if not rows:
            imgui.text_wrapped("This stage has no links. docs/links.md: a phone, a VTuber program, a microcontroller.")
            return
        flags = imgui.TableFlags_.borders_inner_h | imgui.TableFlags_.resizable | imgui.TableFlags_.sizing_stretch_prop
        if not imgui.begin_table("links", len(LINK_COLUMNS), flags):
            return
        for title in LINK_COLUMNS:
            imgui.table_setup_column(title)
        imgui.table_headers_row()
        for row in rows:
            imgui.table_next_row()
            for cell in row:
                imgui.table_next_column()
                imgui.text_wrapped(cell)
        imgui.end_table()
