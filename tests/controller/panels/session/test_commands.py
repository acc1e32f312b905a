"""controller.panels.session.commands"""

from __future__ import annotations

import numpy as np

from controller.body.messages import Hold, Live, LookAt, Neutral, Show
from controller.panels.session.commands import Commands, Settings


def made(life: float = 0.0) -> tuple[Commands, list[object]]:
    sent: list[object] = []
    return Commands(sent.append, life, show_moves=lambda moves: sent.append(("moves", moves))), sent


def test_what_is_set_is_sent_once() -> None:
    commands, sent = made()
    commands.hold({3: 0.25, 5: 0.5})
    commands.hold({3: 0.25, 5: None})
    commands.show("anger", 0.7)
    commands.set_gaze((1.0, 2.0, 300.0))
    commands.set_life(0.5)
    assert sent == [
        Hold(3, 0.25),
        Hold(5, 0.5),
        Hold(5, None),
        Show("anger", 0.7),
        LookAt((1.0, 2.0, 300.0)),
        Live(0.5),
    ]


def test_everything_is_undone_and_redone_to_the_bit() -> None:
    commands, sent = made(life=0.3)
    moves, states = np.full((2, 3), 0.1), [commands.now]
    for change in (
        lambda: commands.hold({1: 0.1 + 0.2}),
        lambda: commands.show("fear", 1 / 3),
        lambda: commands.set_gaze((0.0, 0.0, 500.0)),
        lambda: commands.set_life(1.0),
        lambda: commands.set_moves(moves),
        commands.return_to_neutral,
    ):
        change()
        states.append(commands.now)
    for before in reversed(states[:-1]):
        commands.undo()
        assert commands.now is before
    assert not commands.undoable and sent[-1] == Hold(1, None)
    for after in states[1:]:
        commands.redo()
        assert commands.now is after
    assert not commands.redoable and commands.now == Settings(life=1.0, moves=moves)
    shown = [what[1] for what in sent if isinstance(what, tuple)]
    assert shown[0] is moves and shown[1] is None and shown[2] is moves
    assert Neutral(0.6) in [what for what in sent if not isinstance(what, tuple)]


def test_changes_of_one_drag_are_undone_together() -> None:
    commands, sent = made()
    for i in range(10):
        commands.hold({1: i / 10}, "drag")
    commands.end_step()
    commands.hold({1: 1.0}, "drag")
    commands.undo()
    assert commands.now.held == {1: 0.9}
    commands.undo()
    assert commands.now == Settings() and sent[-1] == Hold(1, None)
    commands.undo()
    commands.redo()
    assert commands.now.held == {1: 0.9}


def test_a_new_change_ends_what_could_be_redone() -> None:
    commands, _ = made()
    commands.show("anger", 1.0)
    commands.undo()
    assert commands.redoable
    commands.show("joy", 1.0)
    assert not commands.redoable
    commands.redo()
    assert commands.now.expression == Show("joy", 1.0)


def test_undo_has_no_limit() -> None:
    commands, _ = made()
    for i in range(5000):
        commands.hold({1: i / 5000})
    for _ in range(5000):
        commands.undo()
    assert commands.now == Settings() and not commands.undoable
