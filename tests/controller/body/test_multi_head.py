"""controller.body.multi_head: several heads of one stage in this process."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.body.messages import RunOptions
from controller.body.multi_head import MultiHeadBody
from controller.layers.commands import CommandState
from controller.stage.dry_run import dry_run
from controller.stage.stage import Stage, heads_of, load_stage

JAW = P.index("jawOpen")
TWO = """
name = "two"
liveliness = 1.0
[[heads]]
name = "maple"
[[heads]]
name = "oak"
seed = 7
position_mm = [600, 0, 0]
robots = ["head24"]
[groups]
both = ["maple", "oak"]
"""


def stage_of(tmp_path: Path, text: str = TWO) -> Stage:
    path = tmp_path / "stage.toml"
    path.write_text(text)
    return load_stage(str(path), P)


@contextmanager
def running_heads(stage: Stage, options: RunOptions = RunOptions()) -> Iterator[tuple[MultiHeadBody, list[Mailbox]]]:
    with ExitStack() as stack:
        boxes = [stack.enter_context(Mailbox.create(len(P))) for _ in stage.heads]
        yield MultiHeadBody(stage, P, boxes, options=options), boxes


def until(condition: Callable[[], object]) -> None:
    for _ in range(2000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("waited in vain")


def ticked(several: MultiHeadBody, boxes: list[Mailbox], count: int) -> np.ndarray:
    """(count, heads, P) what is published, tick by tick."""
    rows, out = [], np.zeros(len(P))
    for k in range(1, count + 1):
        several.tick(10**9 + k * 10**7, 0.01)
        row = []
        for box in boxes:
            box.read(out)
            row.append(out.copy())
        rows.append(row)
    return np.array(rows)


def test_every_head_moves_as_it_would_alone(tmp_path: Path) -> None:
    stage = stage_of(tmp_path)
    with running_heads(stage) as (several, boxes):
        several.heads.find("both").set_parameters([JAW], [0.7], 1)
        several.heads.find("oak").expression("happiness", 1.0, None, 1)
        found = ticked(several, boxes, 150)
    for i, (own, smiles) in enumerate(zip(heads_of(stage), (False, True), strict=True)):
        alone, out = own.state(P), P.neutral()
        alone.live(1.0, 0, "auto")
        alone.set_parameters([JAW], [0.7], 1)
        if smiles:
            alone.expression("happiness", 1.0, None, 1)
        for k in range(150):
            alone.tick(10**9 + (k + 1) * 10**7, 0.01, out)
            np.testing.assert_array_equal(found[k, i], out)
    assert (found[-1, 0] != found[-1, 1]).any()


def test_turns_between_heads_are_taken_in_every_tick(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = stage_of(tmp_path, TWO.replace("[[heads]]", 'turns = "auto"\n[[heads]]', 1))
    with running_heads(stage) as (several, boxes):
        assert several.heads.turns is not None
        ticks: list[int] = []
        monkeypatch.setattr(several.heads.turns, "tick", ticks.append)
        ticked(several, boxes, 3)
    assert ticks == [10**9 + k * 10**7 for k in (1, 2, 3)]


def test_servos_links_and_reports_belong_to_their_heads(tmp_path: Path) -> None:
    more = '[[heads.links]]\nkind = "json"\nlisten = "udp:127.0.0.1:0"\n'
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    text = TWO.replace("[groups]", more.replace(":0", f":{port}") + "[groups]")
    with running_heads(stage_of(tmp_path, text)) as (several, _):
        several.start()
        try:
            several.begin()
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.sendto(b'{"jawOpen": 0.5}', ("127.0.0.1", port))
            until(lambda: several.bodies[1].newest()[0][JAW] > 0.4)
            assert several.bodies[0].newest()[0][JAW] < 0.1
            several.check()
            several.state.stop_latch.stop("test", time.monotonic_ns())
            until(lambda: not any(loop.bus.running for loop in several.bodies[1].buses))
            report = json.loads(json.dumps(several.report()))
        finally:
            several.stop()
    assert [bus["name"] for bus in report["buses"]] == ["oak/head"] and report["buses"][0]["head"] == "oak"
    assert [(link["head"], link["accepted"]) for link in report["links"]] == [("oak", 1)]
    assert [head["head"] for head in report["heads"]] == ["maple", "oak"]


def test_json_faces_go_to_whom_they_name(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    text = TWO.replace('["head24"]', "[]").replace("liveliness = 1.0", "liveliness = 0.0")
    stage = stage_of(tmp_path, text + f'[[links]]\nkind = "json"\nlisten = "udp:127.0.0.1:{port}"\n')
    smile = P.index("mouthSmileLeft")
    with running_heads(stage) as (several, _):
        several.start()
        try:
            several.begin()
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.connect(("127.0.0.1", port))
                for message in (
                    {"to": "oak", "jawOpen": 0.5},
                    {"mouthSmileLeft": 0.6},
                    {"to": "nobody", "jawOpen": 1.0},
                ):
                    sender.send(json.dumps(message).encode())
                maple, oak = (body.newest for body in several.bodies)
                until(lambda: oak()[0][JAW] > 0.45 and maple()[0][smile] > 0.55)
                assert maple()[0][JAW] == 0.0 and oak()[0][smile] == 0.0
                sender.send(b'{"to": "both", "jawOpen": 0.9}')
                until(lambda: min(maple()[0][JAW], oak()[0][JAW]) > 0.85)
            (link,) = several.report()["links"]  # type: ignore[misc]
            until(lambda: link["refused"] == {"for a head that is not here": 1})
        finally:
            several.stop()


def test_what_stands_at_the_top_of_a_stage_is_the_first_heads_who_can_pass_it_on(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('name = "s"\nsteps = ["0.0 @oak SET jawOpen 1", "0.0 SET jawOpen 0.4"]\n')
    stage = stage_of(tmp_path, TWO.replace('name = "two"', 'name = "two"\nshow = "s.toml"'))
    with running_heads(stage, RunOptions(record=tmp_path / "a.rec")) as (several, boxes):
        for body in several.bodies:
            body._begun.set()
        ticked(several, boxes, 3)
        assert [state.held()[JAW] for state in (body.state for body in several.bodies)] == [0.4, 1.0]
        shows = several.state.shows
        assert shows is not None
        shows.abandon(2 * 10**9)
        assert [state.held() for state in (body.state for body in several.bodies)] == [{}, {}]
        for body in several.bodies:
            body._closers.close()
    assert sorted(path.name for path in tmp_path.glob("*.rec")) == ["a-maple.rec", "a-oak.rec"]


def test_a_dry_run_names_the_head(tmp_path: Path) -> None:
    found = dry_run(stage_of(tmp_path), None, 0.05, P)
    assert {row["servo"].partition("/")[0] for row in found.rows} == {"oak"}
    assert [bus["head"] for bus in found.buses] == ["oak"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[heads]]\nname = "a b"\n', "heads[0].name: a name begins with a letter"),
        ('[[heads]]\nname = "All"\n', "heads[0].name: @all means every head"),
        ('[[heads]]\nname = "a"\n[[heads]]\nname = "A"\n', "heads[1].name: 'A' is the name of heads[0]"),
        ('[[heads]]\nname = "a"\nperson = "nobody"\n', "heads[0].person: no person 'nobody'"),
        ('[[heads]]\nname = "a"\nrobots = ["none"]\n', "heads[0].robots[0]: no robot 'none'"),
        ('[[heads]]\nname = "oak"\n[groups]\nb = ["oka"]\n', "groups.b: no head called 'oka', did you mean 'oak'?"),
        ('[[heads]]\nname = "a"\n[groups]\na = ["a"]\n', "groups.a: choose another name"),
        ('[groups]\na = ["a"]\n', "groups: groups of heads need [[heads]]"),
    ],
)
def test_faults_of_heads_are_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        stage_of(tmp_path, f'name = "x"\n{text}')
    assert said in str(caught.value)


def test_a_stage_without_heads_has_states_without_names(tmp_path: Path) -> None:
    stage = stage_of(tmp_path, 'name = "one"\n')
    state = stage.state(P)
    assert (stage.heads, heads_of(stage), state.heads.names) == ((), (stage,), ())
    assert isinstance(state, CommandState) and "head" not in state.status()
