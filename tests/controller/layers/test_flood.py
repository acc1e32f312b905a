"""Random commands, older and newer than the ticks, while a show, idle motion and a voice play."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.layers.settings import default_layers
from controller.links.line.script import Script
from controller.links.line.show import Shows
from controller.takes.voice import VoiceEnvelope
from controller.vocabulary.vocabulary import Vocabulary

STEP_NS = 10_000_000
VOCABULARY = Vocabulary.load(P)
STEPS = [(0.0, "NEUTRAL 0"), (0.0, "EXPR smile 1 0.05"), (0.03, "SET jawOpen 0.5"), (0.05, "GAZE 20 0")]
SCRIPT = Script((*STEPS, (0.07, "NEUTRAL 0")), loop_s=0.08, name="short", marks={"middle": 0.05})
NOISE = np.random.default_rng(1).uniform(-1.0, 1.0, 160)

seconds = st.sampled_from([0.0, 1e-9, 0.01, 0.05, 1.0, 60.0])
share = st.floats(0.0, 1.0)
index = st.integers(0, len(P) - 1)
late_ns = st.sampled_from([-10 * STEP_NS, -STEP_NS, -1, 0, 1, STEP_NS // 2, STEP_NS, 3 * STEP_NS, 100 * STEP_NS])
command = st.one_of(
    st.tuples(st.just("set_parameters"), st.tuples(st.lists(index, min_size=1, max_size=3)), share),
    st.tuples(st.just("release"), st.tuples(st.lists(index, max_size=3))),
    st.tuples(st.just("expression"), st.tuples(st.sampled_from(VOCABULARY.names), share, st.none() | seconds)),
    st.tuples(st.just("gaze"), st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))),
    st.tuples(st.just("gaze_at"), st.tuples(*[st.floats(-1e3, 1e3)] * 3)),
    st.tuples(st.just("gaze_off"), st.just(())),
    st.tuples(st.just("neutral"), st.tuples(seconds)),
    st.tuples(st.just("live"), st.tuples(share)),
    st.tuples(st.just("show"), st.sampled_from([("SEEK", 0.0), ("SEEK", "middle"), ("PAUSE",), ("PLAY",), ("start",)])),
)


def do(state: CommandState, shows: Shows, given_: tuple, stamp_ns: int) -> None:  # type: ignore[type-arg]
    name, arguments, *more = given_
    if name == "show":
        shows.start("short") if arguments == ("start",) else shows.control(*arguments)
    elif name == "set_parameters":
        (indices,) = arguments
        state.set_parameters(indices, more * len(indices), stamp_ns)
    else:
        getattr(state, name)(*arguments, stamp_ns)


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(st.lists(st.tuples(command, late_ns, st.integers(0, 2)), min_size=1, max_size=60))
def test_whatever_is_commanded_whenever_it_came_nothing_fails_and_every_limit_holds(flood: list) -> None:  # type: ignore[type-arg]
    state = CommandState(P, VOCABULARY, default_layers(), seed=3)
    shows = Shows(lambda _: SCRIPT, state)
    state.shows = shows
    shows.start("short")
    state.live(1.0, 0)
    voice, now, values, path = VoiceEnvelope(P, 16_000), 10**9, P.neutral(), []
    for given_, late, ticks in flood:
        do(state, shows, given_, now + late)
        for _ in range(ticks):
            now += STEP_NS
            state.write_layer("speech", voice.process(NOISE), voice.mask, now, now)
            shows.tick(now)
            state.tick(now, 0.01, values)
            path.append(values.copy())
    assert state.parts.report() == []
    moved = np.array(path).reshape(-1, len(P))
    assert np.isfinite(moved).all() and (moved >= P.low).all() and (moved <= P.high).all()
    assert (np.abs(np.diff(moved, axis=0)) <= P.max_speed * 0.01 * (1 + 1e-9)).all()


def test_a_command_between_two_ticks_that_takes_no_time_does_not_divide_by_it() -> None:
    state, values = CommandState(P, VOCABULARY), P.neutral()
    state.tick(10**9, 0.01, values)
    state.neutral(0.0, 10**9 + STEP_NS + 5)  # the tick below read the clock before, and got the lock after it
    state.tick(10**9 + STEP_NS, 0.01, values)
    state.expression("smile", 1.0, 0.05, 10**9 + STEP_NS + 7)
    state.neutral(0.0, 10**9 + 2 * STEP_NS + 9)
    state.tick(10**9 + 2 * STEP_NS, 0.01, values)
    assert state.parts.report() == [] and state.status()["ticks"] == 3
