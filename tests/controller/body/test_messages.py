"""controller.body.messages: every record survives the pipe between the two processes."""

from __future__ import annotations

import multiprocessing
from dataclasses import FrozenInstanceError, fields
from pathlib import Path

import pytest

from controller.body import messages
from controller.body.sources import Voice

OPTIONS = messages.RunOptions(Path("a.csv"), True, Voice("-", 8000, alone=True), Path("b.rec"))


@pytest.mark.parametrize(
    "message",
    [
        messages.BodyOrders("stage.toml", OPTIONS),
        messages.Begin(),
        messages.Stop(),
        messages.Hold(3, 0.5),
        messages.Hold(3, None),
        messages.Show("joy", 0.7),
        messages.Neutral(0.6),
        messages.StopServos(),
        messages.StartServos(),
        messages.Ready(),
        messages.Failed("why", "what to do"),
        messages.Finished(),
        messages.Report({"buses": [1, 2]}),
    ],
    ids=lambda message: type(message).__name__,
)
def test_a_message_arrives_as_it_was_sent(message: object) -> None:
    ours, theirs = multiprocessing.Pipe()
    with ours, theirs:
        ours.send(message)
        assert theirs.recv() == message


def test_orders_without_options_play_the_links() -> None:
    options = messages.BodyOrders("s").options
    assert options == messages.RunOptions(take=None, mirror=False, voice=None, record=None)


def test_messages_are_not_mistaken_for_each_other() -> None:
    assert [field.name for field in fields(messages.Hold)] == ["index", "value"]
    assert messages.Begin() != messages.Stop() and messages.Failed("x").hint == ""
    assert messages.Report().content == {}


def test_records_cannot_be_changed() -> None:
    for record in (
        messages.RunOptions,
        messages.BodyOrders,
        messages.Begin,
        messages.Stop,
        messages.Hold,
        messages.Show,
        messages.Neutral,
        messages.StopServos,
        messages.StartServos,
        messages.Ready,
        messages.Failed,
        messages.Finished,
        messages.Report,
    ):
        with pytest.raises(FrozenInstanceError):
            object.__new__(record).anything = 1
