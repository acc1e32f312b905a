"""Moved skin is saved as a group in a real window, which opens again with its slider; undo goes back past that."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.stage.stage import load_stage
from tests.controller.panels.window.test_face import on_a_display, shown

PROGRAM = """
import json, os, sys
import numpy as np
os.chdir(sys.argv[1])
from controller.panels.window.face import WindowFace

told, real = {"windows": 0}, WindowFace._gui


def act(face):
    panel, n = face._panel, getattr(face, "n", 0)
    face.n = n + 1
    if n == 0:
        told["windows"] += 1
    first, editor = told["windows"] == 1, face._mouse.editor
    if first and n == 3:
        rest = editor._rig.rest.copy()
        moves = np.zeros_like(rest)
        moves[np.argsort(np.linalg.norm(rest - [45.0, -30.0, 85.0], axis=1))[:5]] = [1.0, 0.5, 5.0]
        panel.commands.set_moves(moves)
        told["moved"] = bool((editor._rig.rest != rest).any())
        panel.commands.undo()
        told["to the bit"] = bool((editor._rig.rest == rest).all())
        panel.commands.redo()
        panel.commands.hold({0: 0.25})
        panel.saving.save("dimple", "group")
    if not first and n == 3:
        parameters = panel._options.parameters
        told["held"] = {parameters.names[i]: x for i, x in panel.commands.now.held.items()}
        told["button"] = "dimple" in panel._options.vocabulary.names
        told["slider"] = any(parameters.index("dimple") in row for row in panel.sliders.rows("mouth"))
        told["moves"] = panel.commands.now.moves is not None
        told["drawn"] = "dimple" in face._head.parameters
    if not first and n > 3 and "shown" not in told:
        value = face._values.full[panel._options.parameters.index("dimple")]
        if value > 0.99:
            told["shown"] = float(value)
            panel.commands.undo()
            dimple = panel._options.parameters.index("dimple")
            told["undone"] = bool(editor.sculpted) and dimple not in panel.commands.now.held
            face._ended = True
    if n > 900:
        face._ended = True
    real(face)


WindowFace._gui = act
sys.argv = ["omote", "edit", "demo", "--seconds", "120"]
from controller.cli.app import main
try:
    main()
finally:
    print(json.dumps(told))
"""


@pytest.mark.slow
@on_a_display
def test_a_saved_group_is_a_slider_of_the_window_that_opens_again(tmp_path: Path) -> None:
    lines = shown(PROGRAM, str(tmp_path)).splitlines()
    told = json.loads(next(line for line in reversed(lines) if line.startswith("{")))
    assert told["windows"] == 2 and told["moved"] and told["to the bit"]
    assert told["held"] == {PARAMETERS.names[0]: 0.25, "dimple": 1.0}
    assert told["button"] and told["slider"] and told["drawn"] and not told["moves"]
    assert told["shown"] > 0.99 and told["undone"]
    stage = load_stage("demo", PARAMETERS, [tmp_path / "mine.toml"])
    assert "dimple" in stage.parameters.names and np.isfinite(stage.load_head().values({"dimple": 1.0})).all()
    assert json.loads((Path(os.environ["OMOTE_STATE"]) / "last.json").read_text())["vocabularies"]
