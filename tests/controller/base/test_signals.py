"""SIGINT and SIGTERM become a flag and handlers come back."""

from __future__ import annotations

import signal

import pytest

from controller.base.signals import stop_flag
from controller.cli.app import Interrupt


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_sets_the_flag(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with stop_flag() as flag:
        assert not flag.is_set()
        signal.raise_signal(number)
        assert flag.is_set()
    assert signal.getsignal(number) is before


def test_an_interrupt_that_was_swallowed_counts_from_the_beginning() -> None:
    before = signal.signal(signal.SIGINT, handler := Interrupt())
    try:
        with stop_flag() as flag:
            assert not flag.is_set()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with stop_flag() as flag:
            assert flag.is_set()
        assert signal.getsignal(signal.SIGINT) is handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_second_interrupt_is_not_held_back() -> None:
    with pytest.raises(KeyboardInterrupt), stop_flag():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="terminals that close are POSIX")
def test_nohup_keeps_a_run_alive_when_its_terminal_closes() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stop_flag() as flag:
            signal.raise_signal(signal.SIGHUP)
            assert not flag.is_set()
            signal.raise_signal(signal.SIGTERM)
            assert flag.is_set()
    finally:
        signal.signal(signal.SIGHUP, before)
