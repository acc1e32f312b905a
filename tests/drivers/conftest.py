"""Fixtures of the drivers' tests."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

import pytest


@pytest.fixture
def patient_sdk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the makers' SDKs wait longer for an answer than the 34 ms they grant a USB adapter.

    On a busy machine a process that simulates servos may take longer to be scheduled.
    """
    for name in ("dynamixel_sdk", "scservo_sdk"):
        if find_spec(name) is not None:
            monkeypatch.setattr(import_module(f"{name}.port_handler"), "LATENCY_TIMER", 200)
