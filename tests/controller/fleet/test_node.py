"""controller.fleet.node: real sessions of Zenoh in one process, on a router of the library itself."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

zenoh = pytest.importorskip("zenoh", reason="pip install 'omote[zenoh]'")

from controller.base.errors import LinkError  # noqa: E402
from controller.base.parameters import PARAMETERS as P  # noqa: E402
from controller.fleet import journal  # noqa: E402
from controller.fleet.lease import Token  # noqa: E402
from controller.fleet.payload import Header, Payloads  # noqa: E402
from controller.fleet.wire import header_of  # noqa: E402
from controller.layers.commands import CommandState  # noqa: E402
from controller.takes.reader import load_take  # noqa: E402
from tests.controller.fleet.nodes import Running, free_port, joined, router, until  # noqa: E402

JAW = P.index("jawOpen")
MANY = ("a", "b", "c", "d", "e")


@pytest.fixture(scope="module")
def hub() -> Iterator[str]:
    with router() as endpoint:
        yield endpoint


def client(endpoint: str) -> zenoh.Session:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def ask(endpoint: str, key: str, payload: str | None = None) -> list[str]:
    """What a session of its own is answered."""
    with client(endpoint) as session:
        replies = session.get(key, payload=payload, timeout=3.0)
        return [reply.ok.payload.to_string() for reply in replies if reply.ok is not None]


@pytest.mark.slow
def test_heads_show_bit_for_bit_what_is_conducted_and_say_so(hub: str, tmp_path: Path) -> None:
    more = {"folder": tmp_path, "prefix": "bits", "heads": ("maple", "oak")}
    with (
        Running(hub, "conductor", **more) as conductor,
        Running(hub, "head", seed=50, folder=tmp_path, prefix="bits") as head,
        Running(hub, "recorder", seed=60, **more) as recorder,
    ):
        follower = head.node.followers["maple"]
        until(lambda: follower.exact and follower.taken > 20)
        begin = len(head.rows["maple"])
        conductor.states["maple"].expression("happiness", 1.0, None, time.monotonic_ns())

        def shown_exactly() -> set[bytes]:
            """What it did not catch up, as after a gap on a busy machine; rows go on coming."""
            exact = zip(head.rows["maple"][begin:], head.exact["maple"][begin:], strict=False)
            return {row.tobytes() for row, own in exact if own}

        until(lambda: follower.taken > 120 and len(shown_exactly()) > 50)
        shown = shown_exactly()
        until(lambda: shown <= {row.tobytes() for row in conductor.rows["maple"]})  # it notes what it has sent
        assert not follower.refused and not head.node.refused
        states = [json.loads(each) for at in ("", "/head") for each in ask(hub, f"bits/maple/state{at}")]
        roles = {state["role"]: state for state in states}
        assert roles["conductor"]["conducting"] and roles["conductor"]["commanded"]["expression"][0] == "happiness"
        assert roles["head"]["conducted"] and roles["head"]["token"] == roles["conductor"]["token"]
        (about,) = ask(hub, "bits/maple/configuration")
        assert json.loads(about)["role"] == "conductor" and "tls" not in json.loads(about)
        assert ask(hub, "bits/oak/commands", "SET jawOpen 0.9") == ["OK SET 1\n"]
        assert ask(hub, "bits/oak/commands", "SET jaw 2")[0].startswith("ERR 23")
        until(lambda: conductor.rows["oak"][-1][JAW] > 0.85)
        until(lambda: recorder.node.followers["oak"].exact and recorder.rows["oak"][-1][JAW] > 0.85)
        report = head.node.report()
        assert report["role"] == "head" and report["heads"]["maple"]["taken"] > 120
    take = load_take(tmp_path / "recorded-oak.csv", P)
    assert take.values[:, JAW].max() > 0.85 and take.duration_s > 0.5


@pytest.mark.slow
def test_a_stage_split_over_processes_moves_as_in_one(hub: str, tmp_path: Path) -> None:
    """What the head shows is, bit for bit, what the layers alone make of the same commands at the same times."""
    calls, more = list[tuple[str, tuple[Any, ...]]](), {"folder": tmp_path, "prefix": "split"}
    with (
        Running(hub, "conductor", journal=lambda name, *given: calls.append((name, given)), **more) as conductor,
        Running(hub, "head", seed=50, **more) as head,
    ):
        until(joined(head))
        begin, state = len(head.rows["maple"]), conductor.states["maple"]
        state.expression("surprise", 0.8, None, time.monotonic_ns())
        state.set_parameters([JAW], [0.4], time.monotonic_ns())
        until(lambda: sum(head.exact["maple"][begin:]) > 100)
        conductor.paused.set()
        until(lambda: head.node.followers["maple"].conducted is False)
    alone, made = CommandState(P, seed=1), set[bytes]()
    for name, given in calls:
        if name == "tick":
            out = P.neutral()
            alone.tick(*given[:2], out)
            made.add(out.tobytes())
        else:
            getattr(alone, name)(*given)
    exact = zip(head.rows["maple"][begin:], head.exact["maple"][begin:], strict=False)
    shown = {row.tobytes() for row, own in exact if own}
    assert len(shown) > 20 and shown <= made


def test_the_parts_of_a_stage_are_alive_as_tokens(hub: str, tmp_path: Path) -> None:
    with Running(hub, "head", folder=tmp_path, prefix="tokens"), client(hub) as session:

        def tokens() -> list[str]:
            return [str(reply.ok.key_expr) for reply in session.liveliness().get("tokens/**") if reply.ok]

        until(tokens)
        found = tokens()
    assert len(found) == 1 and found[0].startswith("tokens/maple/alive/head/")


def test_a_stop_anywhere_stops_the_heads_until_start(hub: str, tmp_path: Path) -> None:
    with (
        Running(hub, "conductor", folder=tmp_path, prefix="stop") as conductor,
        Running(hub, "head", folder=tmp_path, prefix="stop") as head,
    ):
        until(lambda: head.node.followers["maple"].conducted)
        assert ask(hub, "stop/maple/commands", "STOP") == ["OK STOP\n"]
        latch = head.states["maple"].stop_latch
        until(lambda: latch.stopped is not None)
        assert latch.stopped is not None and latch.stopped.who == "conductor"
        ask(hub, "stop/maple/commands", "START")
        until(lambda: latch.stopped is None)
        latch.stop("line here", 1)
        time.sleep(0.1)
        assert latch.stopped is not None  # what was stopped here is let go here
        assert conductor.states["maple"].stop_latch.stopped is None


@pytest.mark.parametrize(("payload", "off"), [("binary", 0.51 / 16384), ("json", 0.0)])
def test_other_payloads_arrive_too(hub: str, tmp_path: Path, payload: str, off: float) -> None:
    with (
        Running(hub, "conductor", folder=tmp_path, prefix=payload, payload=payload) as conductor,
        Running(hub, "head", folder=tmp_path, prefix=payload) as head,
    ):
        conductor.states["maple"].set_parameters([JAW], [0.6], time.monotonic_ns())
        until(lambda: abs(head.rows["maple"][-1][JAW] - 0.6) <= off + 1e-4 and head.node.followers["maple"].exact)


def test_what_is_no_conductors_is_refused_and_counted(hub: str, tmp_path: Path) -> None:
    with Running(hub, "head", folder=tmp_path, prefix="strange") as head, client(hub) as session:
        key, good = "strange/maple/parameters", Payloads(P).encode(P.neutral())
        header = Header(Token(3, 3), 1, 1)
        for payload, attachment in ((good, None), (good, b"x"), (b"x", header.encode())):
            session.put(key, payload, encoding="omote/exact;1", attachment=attachment)
        until(lambda: sum(head.node.refused.values()) == 3)
        session.put(key, good, encoding="omote/exact;1", attachment=header.encode())
        until(lambda: head.node.followers["maple"].taken == 1)
        session.put(key, good, encoding="omote/exact;1", attachment=Header(Token(2, 9), 5, 1).encode())
        until(lambda: head.node.followers["maple"].refused)


@pytest.mark.slow
def test_a_conductor_that_dies_or_is_stopped_is_replaced_and_nobody_obeys_it_again(hub: str, tmp_path: Path) -> None:
    more = {"folder": tmp_path, "prefix": "fail"}
    with Running(hub, "conductor", **more) as first:
        until(lambda: first.node.lease.active)
        first.states["maple"].set_parameters([JAW], [0.7], time.monotonic_ns())
        with Running(hub, "conductor", seed=9, **more) as second, Running(hub, "head", seed=5, **more) as head:
            until(joined(head))
            until(lambda: JAW in second.states["maple"].held())
            if second.node.lease.active:  # else it stands by, and knows what was commanded before it came
                first, second = second, first
            first.states["maple"].expression("anger", 1.0, None, time.monotonic_ns())
            until(lambda: second.states["maple"].status()["expression"] == "anger")
            begin, stopped = len(head.rows["maple"]), time.monotonic()
            first.paused.set()
            until(lambda: second.node.lease.active and head.node.followers["maple"].highest.holder
                  == second.node.lease.holder)  # fmt: skip
            assert time.monotonic() - stopped < 0.5 + 3.0 * slowest(second, head)
            taken = head.node.followers["maple"].taken
            first.paused.clear()
            until(lambda: head.node.followers["maple"].taken > taken + 100)
            until(lambda: [first.node.lease.active, second.node.lease.active].count(True) == 1)
            steps = np.abs(np.diff(np.array(head.rows["maple"][begin:]), axis=0)) / (P.max_speed * 0.01)
            assert steps.max() < 4.0 + 100.0 * slowest(
                head
            )  # of one tick; none is a jump, ticks of a busy machine differ
            assert head.rows["maple"][-1][JAW] > 0.6


@pytest.mark.slow
@pytest.mark.parametrize("role", ["head", "conductor"])
def test_own_layers_are_mixed_before_a_head_goes_over_to_them(hub: str, tmp_path: Path, role: str) -> None:
    """Also where the tick at which the conductor is missed is so long that it would have gone over within it."""
    more = {"folder": tmp_path, "prefix": f"over{role}", "lease_ms": 1000.0}
    with Running(hub, "conductor", **more) as first:
        until(lambda: first.node.lease.active)
        first.states["maple"].set_parameters([JAW], [0.9], time.monotonic_ns())
        with Running(hub, role, seed=9, **more) as other:
            until(lambda: other.node.followers["maple"].conducted and other.rows["maple"][-1][JAW] > 0.85)
            other.stop()
            first.stop()
            node, state, follower = other.node, other.states["maple"], other.node.followers["maple"]
            state.neutral(0.1, time.monotonic_ns())
            values, shown = other.rows["maple"][-1].copy(), list[np.ndarray]()
            for step_s in (*[0.01] * 60, *[2.5] * (role == "head"), *[0.02] * 100):
                time.sleep(step_s)
                now = time.monotonic_ns()
                if not node.rests("maple"):
                    state.tick(now, step_s, values)
                node.relay("maple", now, step_s, values, 0)
                shown.append(values.copy())
            assert not follower.conducted and follower.exact
    within = np.abs(np.diff(np.array(shown)[60:], axis=0))[:, JAW] / 0.02
    assert within.max() < P.max_speed[JAW] * 1.01


def test_one_that_stands_by_asks_what_was_commanded_until_it_is_answered(hub: str, tmp_path: Path) -> None:
    """An answer may be lost, and one that crossed a command may not have it."""
    commanded = {"held": {"jawOpen": 0.6}, "expression": ["anger", 1.0], "gaze": None, "life": [0.0, "auto"]}
    asked, conductor, key = list[int](), Token(5, 3), "asks/maple"
    with client(hub) as session:

        def answer(query: zenoh.Query) -> None:
            asked.append(1)
            if len(asked) == 2:
                event = journal.encode("set_parameters", ([P.index("tongueOut")], [0.5]))
                session.put(f"{key}/events", event or b"", attachment=Header(conductor, 1, 1).encode())
                until(lambda: P.index("tongueOut") in standby.states["maple"].held())
            if len(asked) > 1:
                values = {"held": {"jawOpen": 0.1}} if len(asked) == 2 else {}
                query.reply(f"{key}/state", json.dumps({"conducting": True, "commanded": {**commanded, **values}}))

        queryable = session.declare_queryable(f"{key}/state", answer)
        with Running(hub, "conductor", folder=tmp_path, prefix="asks", lease_ms=10_000) as standby:
            until(lambda: session.put("asks/_/lease", b"", attachment=Header(conductor, 1, 1).encode())
                  or standby.node.lease.highest == conductor)  # fmt: skip
            until(lambda: standby.states["maple"].held().get(JAW) == 0.6)
            assert not standby.node.lease.active and standby.states["maple"].status()["expression"] == "anger"
            assert len(asked) >= 3
        queryable.undeclare()


def slowest(*nodes: Running) -> float:
    """The longest time (s) between two of the last ticks: how busy the machine is."""
    return 1e-9 * max(int(np.diff(node.times[-200:]).max()) for node in nodes)


@pytest.mark.slow
def test_layers_rest_while_another_process_decides_and_who_stands_by_keeps_up(hub: str, tmp_path: Path) -> None:
    more = {"folder": tmp_path, "prefix": "rests", "heads": ("maple", "oak")}
    with Running(hub, "conductor", **more) as first:
        until(lambda: first.node.lease.active)
        with Running(hub, "conductor", seed=9, **more) as second, Running(hub, "head", seed=5, **more) as head:
            until(lambda: all(len(mixed_of(node, follows=True)) > 150 for node in (second, head)))
    assert all(all(mixed_of(node, follows=False)) for node in (first, second, head))
    assert not any(mixed_of(head, follows=True))
    standby = mixed_of(second, follows=True)
    assert sum(standby) == pytest.approx(len(standby) / 5, abs=3)  # every fifth tick of each head


def mixed_of(node: Running, *, follows: bool) -> list[bool]:
    """Of the ticks at which heads followed a conductor, or of the others, whether layers ticked."""
    return [mixed for name in node.mixed for following, mixed in node.mixed[name] if following is follows]


@pytest.mark.slow
def test_a_head_without_a_conductor_lives_on_and_joins_again(hub: str, tmp_path: Path) -> None:
    more = {"folder": tmp_path, "prefix": "alone"}
    with Running(hub, "head", seed=5, **more) as head:
        follower = head.node.followers["maple"]
        with Running(hub, "conductor", **more) as conductor:
            conductor.states["maple"].set_parameters([JAW], [0.8], time.monotonic_ns())
            until(joined(head))
            until(lambda: head.rows["maple"][-1][JAW] > 0.7)
        until(lambda: not follower.conducted)
        until(lambda: head.rows["maple"][-1][JAW] < 0.1)
        with Running(hub, "conductor", **more):
            until(joined(head))


class Far:
    """A conductor on another machine: its clock has nothing in common with that of this one."""

    def __init__(self, session: zenoh.Session, prefix: str, token: Token, ahead_ns: int) -> None:
        self._session, self._prefix, self._token, self._ahead_ns = session, prefix, token, ahead_ns
        self.sequence, self.sent_ns = 0, dict[bytes, int]()
        self._clock = session.declare_queryable(f"{prefix}/_/clock", self._tell)

    def _tell(self, query: zenoh.Query) -> None:
        now = time.monotonic_ns() + self._ahead_ns
        query.reply(query.key_expr, json.dumps([now, now, self._token.holder]))

    def conduct_until(self, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + 60.0
        while time.monotonic() < end and not condition():
            self.sequence += 1
            values, now = P.neutral(), time.monotonic_ns()
            values[JAW] = 0.3 + 1e-4 * self.sequence + 1e-6 * self._token.fence
            self.sent_ns[values.tobytes()] = now
            header = Header(self._token, self.sequence, now + self._ahead_ns)
            self._session.put(f"{self._prefix}/maple/parameters", Payloads(P).encode(values),
                              encoding="omote/exact;1", attachment=header.encode())  # fmt: skip
            time.sleep(0.01)

    def close(self) -> None:
        self._clock.undeclare()


def test_heads_follow_conductors_on_machines_whose_clocks_have_nothing_in_common(hub: str, tmp_path: Path) -> None:
    """The clock of a machine begins when that starts: a conductor that takes over may be days before or after."""
    delay_ms, day_ns = 150.0, 86_400 * 10**9
    with Running(hub, "head", folder=tmp_path, prefix="clocks", delay_ms=delay_ms) as head, client(hub) as session:
        for fence, ahead_ns in ((1, day_ns), (2, -day_ns), (3, 7 * day_ns)):
            far = Far(session, "clocks", Token(fence, fence), ahead_ns)
            begin = len(head.rows["maple"])
            far.conduct_until(lambda begin=begin: sum(head.exact["maple"][begin:]) > 100)  # type: ignore[misc]
            exact = [(at, row) for at, row, own in zip(head.times[begin:], head.rows["maple"][begin:],
                     head.exact["maple"][begin:], strict=False) if own and row.tobytes() in far.sent_ns]  # fmt: skip
            far.close()
            waits = [1e-6 * (at - far.sent_ns[row.tobytes()]) for at, row in exact]
            assert len(waits) > 50
            off_ms = 1e3 * slowest(head)
            assert delay_ms - 1.0 - off_ms < np.percentile(waits, 20) < delay_ms + 20.0 + off_ms, waits[:5]
            assert abs(head.node.report()["clock_offset_ms"] * 1e6 - ahead_ns) < 1e6 * (20.0 + off_ms)


@pytest.mark.slow
def test_all_find_each_other_again_when_the_router_comes_back(tmp_path: Path) -> None:
    more = {"folder": tmp_path, "prefix": "again", "hz": 40.0}
    with ExitStack() as stack:
        hub = stack.enter_context(ExitStack())
        endpoint = hub.enter_context(router())
        first = stack.enter_context(Running(endpoint, "conductor", heads=("maple", *MANY), **more))
        heads = [stack.enter_context(Running(endpoint, role, seed=5, heads=names, **more))
                 for role, names in (("head", ("maple",)), ("face", MANY))]  # fmt: skip
        second = stack.enter_context(Running(endpoint, "conductor", seed=9, heads=("maple", *MANY), **more))
        followers = [head.node.followers[name] for head in heads for name in head.states]
        until(joined(heads[0]))
        hub.close()
        gone = time.monotonic()
        until(lambda: not any(follower.conducted for follower in followers) and second.node.lease.active)
        before = second.node.lease.highest
        time.sleep(max(0.0, gone + 3.3 - time.monotonic()))  # who tries more and more seldom would try again after 7 s
        with router(endpoint=endpoint):
            back = time.monotonic()
            until(lambda: all(f.conducted and f.highest >= before for f in followers))
            assert time.monotonic() - back < 3.0 + 10.0 * slowest(
                first, second, *heads
            )  # 0.5 s where nothing else runs
            until(joined(*heads))
            until(lambda: [first.node.lease.active, second.node.lease.active].count(True) == 1)
            until(lambda: len({follower.highest for follower in followers}) == 1)


@pytest.mark.slow
def test_endpoints_and_files_that_cannot_be_used_are_named(
    hub: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(LinkError, match=r"zenoh at tcp/127\.0\.0\.1"):
        Running("", "head", folder=tmp_path, connect=[], listen=[hub]).node.close()
    monkeypatch.setattr("controller.fleet.session._ATTEMPT_TIMEOUT_MS", 200)
    nowhere = f"tcp/127.0.0.1:{free_port()}"
    with pytest.raises(LinkError, match=f"zenoh at {nowhere}: Unable to connect") as caught:
        Running(nowhere, "head", folder=tmp_path).node.close()
    assert "start a router there" in str(caught.value.hint)
    with pytest.raises(LinkError, match=r"zenoh\.tls\.ca: .*none\.pem cannot be read"):
        Running(f"tls/127.0.0.1:{free_port()}", "head", folder=tmp_path, tls={"ca": "none.pem"})


def test_many_heads_of_a_process_are_sent_in_one_message(hub: str, tmp_path: Path) -> None:
    """Whoever follows many hears a few messages a tick; a process with one head, and one of a user, hears that one."""
    singles, together = list[str](), list[int]()
    with (
        Running(hub, "conductor", folder=tmp_path, prefix="many", hz=40.0, heads=MANY) as conductor,
        Running(hub, "head", seed=60, folder=tmp_path, prefix="many", hz=40.0, heads=MANY) as heads,
        client(hub) as session,
    ):
        until(joined(heads))
        session.declare_subscriber("many/_/faces", lambda sample: together.append(len(sample.payload.to_bytes())))
        session.declare_subscriber("many/b/parameters", lambda sample: singles.append(str(sample.key_expr)))
        until(lambda: len(singles) > 20)
        begin = len(heads.rows["c"])
        conductor.states["c"].expression("happiness", 1.0, None, time.monotonic_ns())
        until(lambda: sum(heads.exact["c"][begin:]) > 20)  # on a busy machine faces are late, and few are shown exactly
        shown = {
            row.tobytes() for row, own in zip(heads.rows["c"][begin:], heads.exact["c"][begin:], strict=False) if own
        }
        until(lambda: shown <= {row.tobytes() for row in conductor.rows["c"].copy()})  # which are noted after sending
        taken = sum(follower.taken for follower in heads.node.followers.values())
        assert not heads.node.refused and not any(f.refused for f in heads.node.followers.values())
        with Running(hub, "head", seed=90, folder=tmp_path, prefix="many", hz=40.0, heads=("d",)) as one:
            until(joined(one))
    assert set(singles) == {"many/b/parameters"}
    assert max(together) > 3 * 475 and taken > 100


@pytest.mark.parametrize("shared", [True, False])
def test_messages_of_many_heads_are_in_shared_memory_where_that_is_asked_for(
    hub: str, tmp_path: Path, shared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    many, found = tuple(f"h{k}" for k in range(8)), list[bool]()
    # Zenoh shares messages from 3 kB. How many heads are in one message depends on the machine: here less is shared.
    low = {"transport": {"shared_memory": {"transport_optimization": {"message_size_threshold": 400}}}}
    (tmp_path / "zenoh.json5").write_text(json.dumps(low))

    def noting(sample: zenoh.Sample) -> Header:
        found.append(sample.payload.as_shm() is not None)
        return header_of(sample)

    monkeypatch.setattr("controller.fleet.hearing.header_of", noting)
    place = {"folder": tmp_path, "prefix": f"shared{shared}", "config": "zenoh.json5"}
    more = {**place, "hz": 20.0, "heads": many, "shared_memory": shared}
    with Running(hub, "conductor", **more), Running(hub, "head", seed=60, **more) as head:
        until(lambda: len(found) > 40 and head.node.followers["h7"].taken > 20)
    assert any(found) is shared


def test_heads_of_a_process_that_hears_many_are_moved_by_the_next_conductor(hub: str, tmp_path: Path) -> None:
    with (
        Running(hub, "head", seed=60, folder=tmp_path, prefix="next", hz=40.0, heads=MANY) as heads,
        Running(hub, "conductor", folder=tmp_path, prefix="next", hz=40.0, heads=MANY) as first,
    ):
        until(joined(heads))
        with Running(hub, "conductor", seed=30, folder=tmp_path, prefix="next", hz=40.0, heads=MANY) as second:
            until(lambda: second.node.followers["a"].conducted)
            before = heads.node.followers["e"].highest
            first.paused.set()
            until(lambda: second.node.lease.active)
            until(lambda: all(f.highest > before for f in heads.node.followers.values()))
            until(joined(heads))
            first.paused.clear()
            until(lambda: not first.node.lease.active)


def test_how_a_head_is_is_said_to_whoever_listens(hub: str, tmp_path: Path) -> None:
    said = list[tuple[str, dict[str, object]]]()
    with (
        Running(hub, "conductor", folder=tmp_path, prefix="said", hz=40.0, heads=MANY) as conductor,
        Running(hub, "head", seed=60, folder=tmp_path, prefix="said", hz=40.0, heads=MANY),
        client(hub) as session,
    ):

        def note(sample: zenoh.Sample) -> None:
            said.append((str(sample.key_expr), json.loads(sample.payload.to_bytes())))

        subscribers = [session.declare_subscriber(f"said/{at}/state", note) for at in ("_", "b")]
        until(lambda: {(key, each["role"]) for key, each in said if each["token"] != [0, 0]} >= {
            (f"said/{at}/state", role) for at in ("_", "b") for role in ("conductor", "head")})  # fmt: skip
        assert list(conductor.node.lease.token) in [each["token"] for _, each in said]
        assert {key for key, _ in said} == {"said/_/state", "said/b/state"}
        for subscriber in subscribers:
            subscriber.undeclare()


def test_a_conductor_hears_of_its_successor_from_a_head(hub: str, tmp_path: Path) -> None:
    """One that has been cut off learns by the states of heads that they obey another."""
    with Running(hub, "conductor", folder=tmp_path, prefix="told") as conductor, client(hub) as session:
        until(lambda: conductor.node.lease.active)
        token = [conductor.node.lease.token.fence + 5, 7]
        session.put("told/_/state", json.dumps({"version": 1, "role": "head", "token": token}))
        until(lambda: conductor.node.lease.highest == Token(*token))
