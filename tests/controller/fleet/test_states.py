"""controller.fleet.states: what is said of the heads of a process, to whom, and what is answered."""

from __future__ import annotations

import json
from typing import Any

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.fleet.follower import Follower
from controller.fleet.lease import Lease, Token
from controller.fleet.payload import Header
from controller.fleet.states import States, follower_report
from controller.fleet.wire import ALL
from controller.layers.commands import CommandState
from controller.stage.zenoh import ZenohSettings
from tests.controller.fleet.samples import Query, Wire

OTHER = Token(4, 9)


class Process:
    """The states of two heads, of which the second one obeyed another conductor."""

    def __init__(self, role: str, *, listens: bool = True, servos: bool = True) -> None:
        self.wire, self.lease = Wire(listens), Lease(3, 0.25, 0.0, 0.0)
        self.heads = {name: CommandState(P) for name in ("maple", "oak")}
        self.heads["oak"].servo_records = lambda: [{"name": "jaw"}] if servos else []
        self.followers = {name: Follower(P) for name in self.heads}
        self.followers["oak"].take(Header(OTHER, 1, 5), P.neutral())
        tls = {"ca": "secret.pem"}
        settings = ZenohSettings.model_validate({"role": role, "connect": ["tcp/a:1"], "tls": tls})
        self.states = States(self.wire, settings, self.heads, self.followers, self.lease)  # type: ignore[arg-type]

    def conduct(self) -> Token:
        """Begin to conduct."""
        assert self.lease.tick(0.2) is False and self.lease.tick(0.4) is True
        return self.lease.token

    def said(self, head: str, what: str) -> list[Any]:
        """What was sent of a head."""
        sent = self.wire.outlets_of[head, what].sent
        assert all(encoding == "application/json" for _, encoding in sent)
        return [json.loads(data) for data, _ in sent]

    def asked(self, head: str, what: str) -> Any:
        """What is answered; None for nothing."""
        query = Query()
        self.wire.answered[head, what](query)
        if not query.replies:
            return None
        ((key, payload, encoding),) = query.replies
        assert (key, encoding) == ("asked/key", "application/json")
        return json.loads(payload)


@pytest.mark.parametrize(("role", "tail"), [("conductor", ""), ("head", "/head"), ("recorder", "/recorder")])
def test_every_head_answers_and_is_alive_under_keys_of_its_role(role: str, tail: str) -> None:
    wire = Process(role).wire
    assert wire.answered.keys() == {
        (name, what + tail) for name in ("maple", "oak") for what in ("state", "configuration")
    }
    assert wire.alive == [("maple", f"alive/{role}"), ("oak", f"alive/{role}")]
    whats = {"state", "servos"} if role == "head" else {"state"}
    assert wire.outlets_of.keys() == {(name, what) for name in ("maple", "oak") for what in whats}


def test_conductors_are_told_the_highest_token_that_is_obeyed_here() -> None:
    process = Process("head")
    process.states.publish()
    (said,) = process.wire.session.sent[f"omote/{ALL}/state"]
    assert json.loads(said) == {"version": 1, "role": "head", "token": list(OTHER)}
    process = Process("conductor")
    own = process.conduct()
    process.states.publish()
    (said,) = process.wire.session.sent[f"omote/{ALL}/state"]
    assert json.loads(said)["token"] == list(own)


def test_how_a_head_is_is_said_to_who_listens_and_servos_where_there_are_some() -> None:
    process = Process("head")
    process.states.publish()
    (maple,), (oak,) = process.said("maple", "state"), process.said("oak", "state")
    assert maple["token"] == [0, 0] and oak["token"] == list(OTHER)
    assert oak == {"version": 1, "role": "head", "token": list(OTHER), **follower_report(process.followers["oak"])}
    assert process.said("oak", "servos") == [{"version": 1, "servos": [{"name": "jaw"}]}]
    assert process.said("maple", "servos") == []  # it has none
    deaf = Process("head", listens=False)
    deaf.states.publish()
    assert not any(outlet.sent for outlet in deaf.wire.outlets_of.values())
    assert len(deaf.wire.session.sent) == 1  # conductors are told in any case


def test_the_full_state_has_the_parameters_that_are_shown_and_what_was_commanded() -> None:
    process = Process("head")
    head, follower = process.heads["oak"], process.followers["oak"]
    head.set_parameters([P.index("jawOpen")], [0.5], 1)
    for tick in range(300):
        head.tick(10**7 * tick, 0.01, P.neutral())
    follower.take(Header(OTHER, 1, 6), P.neutral())
    found = process.states.state("oak")
    assert found["head"] == "oak" and found["role"] == "head" and found["conducting"] is False
    assert found["token"] == list(OTHER) and found["stopped"] is False
    assert found["parameters"].keys() == set(P.names) and found["parameters"]["jawOpen"] == pytest.approx(0.5, abs=0.05)
    assert found["commanded"]["held"] == {"jawOpen": 0.5}
    assert (found["taken"], found["refused"]) == (1, {"older than the last one": 1})
    assert (found["conducted"], found["exact"]) == (follower.conducted, follower.exact)
    head.stop_latch.stop("somebody", 1)
    assert process.states.state("oak")["stopped"] is True
    assert process.states.state("maple")["token"] == [0, 0]


def test_who_conducts_says_its_own_token() -> None:
    process = Process("conductor")
    own = process.conduct()
    found = process.states.state("oak")
    assert found["conducting"] is True and found["token"] == list(own) != list(OTHER)


def test_a_conductor_answers_only_while_it_conducts_and_others_always() -> None:
    process = Process("conductor")
    assert process.asked("oak", "state") is None and process.asked("maple", "configuration") is None
    process.conduct()
    assert process.asked("oak", "state")["head"] == "oak"
    assert process.asked("maple", "state")["head"] == "maple"
    assert Process("face").asked("maple", "state/face")["head"] == "maple"


def test_the_configuration_says_nothing_of_certificates() -> None:
    found = Process("head").asked("maple", "configuration/head")
    assert found["role"] == "head" and found["connect"] == ["tcp/a:1"] and found["lease_ms"] == 250.0
    assert "tls" not in found and "secret" not in json.dumps(found)
