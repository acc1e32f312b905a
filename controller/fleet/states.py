"""Publishes the states of the heads of a process, and answers queries for them."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from controller.fleet import journal
from controller.fleet.follower import Follower
from controller.fleet.lease import Lease
from controller.fleet.sending import is_heard
from controller.fleet.wire import ALL, Wire, reply_json
from controller.layers.commands import CommandState
from controller.stage.zenoh import ZenohSettings

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh


class States:
    """The states of the heads of a process, whose layers are ``heads`` and whose faces come through ``followers``."""

    def __init__(
        self, wire: Wire, settings: ZenohSettings, heads: Mapping[str, CommandState],
        followers: Mapping[str, Follower], lease: Lease,
    ) -> None:  # fmt: skip
        self._wire, self._role, self._heads, self._followers, self._lease = wire, settings.role, heads, followers, lease
        self._conducts = settings.role == "conductor"
        self._states = wire.outlets(heads, "state")
        self._servos = wire.outlets(heads, "servos") if self._role == "head" else {}
        tail = "" if self._conducts else f"/{self._role}"  # Zenoh merges answers with equal keys
        about = settings.model_dump(mode="json", exclude={"tls"})
        for name in heads:
            wire.answer(name, "state" + tail, self._answer(partial(self.state, name)))
            wire.answer(name, "configuration" + tail, self._answer(lambda: about))
            wire.live(name, f"alive/{self._role}")

    def publish(self) -> None:
        """Tell all conductors which token is obeyed here; publish the state of each head that has subscribers."""
        leads = self._lease.token if self._lease.active else None
        tokens = {name: leads or follower.highest for name, follower in self._followers.items()}
        short = {"version": journal.VERSION, "role": self._role}
        newest = json.dumps({**short, "token": list(max(tokens.values()))})
        self._wire.session.put(self._wire.key(ALL, "state"), newest)
        for name, outlet in self._states.items():
            if is_heard(outlet):
                own = {**short, "token": list(tokens[name]), **follower_report(self._followers[name])}
                outlet.put(json.dumps(own), encoding="application/json")
        for name, outlet in self._servos.items():
            if is_heard(outlet) and (servos := self._heads[name].servo_records()):
                outlet.put(json.dumps({"version": journal.VERSION, "servos": servos}), encoding="application/json")

    def state(self, head: str) -> dict[str, Any]:
        """Return the full state of a head, as its queryable answers."""
        state, follower = self._heads[head], self._followers[head]
        values = state.parameters.neutral()
        state.snapshot(values)
        return {
            "version": journal.VERSION,
            "head": head,
            "role": self._role,
            "conducting": self._lease.active,
            "token": list(self._lease.token if self._lease.active else follower.highest),
            "stopped": state.stop_latch.stopped is not None,
            **follower_report(follower),
            "parameters": dict(zip(state.parameters.names, values.tolist(), strict=True)),
            "commanded": journal.snapshot(state),
        }

    def _answer(self, found: Callable[[], dict[str, Any]]) -> Callable[[zenoh.Query], None]:
        def call(query: zenoh.Query) -> None:
            if self._lease.active or not self._conducts:
                reply_json(query, found())

        return call


def follower_report(follower: Follower) -> dict[str, Any]:
    """Return whether a head follows a conductor, and counts of the faces that it accepted and refused."""
    return {
        "conducted": follower.conducted, "exact": follower.exact, "taken": follower.taken,
        "refused": dict(follower.refused),
    }  # fmt: skip
