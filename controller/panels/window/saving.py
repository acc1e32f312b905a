"""Saves the present face, or moved control points, into the user's own vocabulary; draws what that needs.

An expression and a gesture can be used immediately. A group and a corrective are parameters, which the window opens
again with; everything that was set is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any, Literal, get_args

from controller.base.errors import ControllerError, ParameterError
from controller.base.parameters import PARAMETERS, Floats, Parameters, fold
from controller.body.messages import Learn, PanelRequest
from controller.face.point_editing import PointEditor
from controller.panels.session.commands import Commands, History
from controller.panels.session.own_anchors import save_anchor
from controller.panels.session.own_expressions import check_name, save_expression
from controller.panels.session.own_groups import place_of, save_corrective, save_own_group
from controller.vocabulary.expression import Expression
from controller.vocabulary.vocabulary import Vocabulary

Kind = Literal["expression", "gesture", "group", "corrective", "anchor"]
KINDS: tuple[Kind, ...] = get_args(Kind)
STEMS: dict[Kind, str] = {
    "expression": "face", "gesture": "gesture", "group": "fold", "corrective": "corrective", "anchor": "anchor",
}  # fmt: skip
"""Beginnings of the names that omote chooses, by kind."""
ABOUT: dict[Kind, str] = {
    "expression": "the present face, as a mood",
    "gesture": "the present face, which keeps the mood meanwhile",
    "group": "the moved skin, as a slider",
    "corrective": "the moved skin, whenever the face is like the present one",
    "anchor": "where the last point was pulled to, for a servo",
}


@dataclass(frozen=True)
class Words:
    """The user's vocabulary.

    vocabulary : of the stage; what is saved is added. own : the file that is saved to; servo anchors go beside it.
    earlier : the vocabularies before it. parameters : of the stage.
    """

    vocabulary: Vocabulary
    own: Path
    earlier: Sequence[Path] = ()
    parameters: Parameters = field(default_factory=lambda: PARAMETERS)


class Saving:
    """Draws the name, the kind and the button.

    newest : the newest parameters (P,). send : reports a saved expression to the body.

    Attributes
    ----------
    editor : the points of the face that the mouse drags; None without a picture.
    reopen : opens the window again with the vocabulary and what was set; None where that cannot be.
    """

    def __init__(
        self, words: Words, commands: Commands, newest: Callable[[], Floats], send: Callable[[PanelRequest], None]
    ) -> None:
        self._words, self._commands, self._newest, self._send = words, commands, newest, send
        self.editor: Callable[[], PointEditor] | None = None
        self.reopen: Callable[[History, Mapping[str, float]], None] | None = None
        self.kind: Kind = "expression"
        self.message, self._name = "", ""

    def __call__(self) -> None:
        """Draw; called once per frame."""
        from imgui_bundle import imgui  # optional

        width = imgui.get_content_region_avail().x
        imgui.set_next_item_width(imgui.get_font_size() * 7.5)
        self._choose(imgui)
        imgui.same_line()
        imgui.set_next_item_width(max(width - imgui.get_font_size() * 12.5, imgui.get_font_size() * 4))
        entered, self._name = imgui.input_text_with_hint(
            "##name", self.suggested(self.kind), self._name, imgui.InputTextFlags_.enter_returns_true
        )
        imgui.same_line()
        if imgui.button("save##word") or entered:
            self.save(self._name)
        self._wrapped(imgui, self.message or ABOUT[self.kind])

    def _choose(self, imgui: Any) -> None:
        """The list of kinds."""
        if not imgui.begin_combo("##kind", self.kind):
            return
        for kind in KINDS:
            if imgui.selectable(f"{kind}##kind", kind == self.kind)[0]:
                self.kind, self.message = kind, ""
        imgui.end_combo()

    def suggested(self, kind: Kind) -> str:
        """Return a name that nothing has yet."""
        words = self._words
        known = {fold(name) for name in (*words.vocabulary.names, *words.parameters.names)}
        names = (f"{STEMS[kind]}_{i}" for i in count(1))
        return next(name for name in names if fold(name) not in known and not self._is_file(name))

    def _is_file(self, name: str) -> bool:
        folder = self._words.own.parent
        return any((folder / file).exists() for file in (f"{name}.json", f"{name}-anchor.toml"))

    @staticmethod
    def _wrapped(imgui: Any, words: str) -> None:
        imgui.text_wrapped(words)

    def save(self, name: str, kind: Kind | None = None) -> None:
        """Save under a name, or one that omote chooses, as the chosen kind without ``kind``; reports what cannot be
        saved."""
        name = name.strip() or self.suggested(kind or self.kind)
        makers: dict[Kind, Callable[[str], str]] = {
            "expression": lambda name: self._expression(name, "user"),
            "gesture": lambda name: self._expression(name, "gesture"),
            "group": self._group,
            "corrective": self._corrective,
            "anchor": self._anchor,
        }
        try:
            self.message = makers[kind or self.kind](name)
        except ControllerError as error:
            self.message = f"{error}; {error.hint}" if getattr(error, "hint", "") else str(error)

    def _expression(self, name: str, kind: str) -> str:
        words, face = self._words, self._newest().copy()
        weights = save_expression(words.own, name, face, words.vocabulary, words.parameters, words.earlier, kind)
        words.vocabulary.add(Expression(name, weights, kind=kind))
        self._send(Learn(name, tuple(map(float, weights)), kind))
        return f"wrote {name} to {shorten_path(words.own)}"

    def _group(self, name: str) -> str:
        words, editor = self._words, self._editor()
        group = editor.group()
        save_own_group(
            words.own, name, group, place_of(editor.head, group), words.vocabulary, words.parameters, words.earlier
        )
        return self._open_again(name, {name: 1.0})

    def _corrective(self, name: str) -> str:
        words, editor = self._words, self._editor()
        group = editor.group()
        place, face = place_of(editor.head, group), self._newest()
        save_corrective(words.own, name, group, face, place, words.vocabulary, words.parameters, words.earlier)
        return self._open_again(name, {})

    def _anchor(self, name: str) -> str:
        """Save the anchor of a servo, and the face that the pull made as an expression."""
        place, pull = self._editor().last_pull(self._newest())
        check_name(name, self._words.vocabulary)
        path = self._words.own.parent / f"{name}-anchor.toml"
        save_anchor(path, name, place, pull, self._words.parameters)
        return f"{self._expression(name, 'user')}; its servo is in {shorten_path(path)}"

    def _editor(self) -> PointEditor:
        if self.editor is None:
            raise ParameterError("nothing can be dragged here", hint="omote edit")
        return self.editor()

    def _open_again(self, name: str, held: Mapping[str, float]) -> str:
        """Open the window, where it can be, with the new parameter in place of moved control points; hold ``held``."""
        history = self._commands.history
        if self.reopen is not None:
            now = replace(history.now, moves=None, light=())
            self.reopen(History(now, (*history.past, history.now), ()), held)
        return f"wrote {name} to {shorten_path(self._words.own)}"


def shorten_path(path: Path) -> Path:
    """Return a path as a user names it: from the present folder where it is in there."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
