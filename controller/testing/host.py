"""A simulated robot host at a port, for tests of faces and other programs that take the omote line protocol."""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Self

import tomli_w

from controller.base.parameters import PARAMETERS
from controller.links.line.host import RobotHost
from controller.links.line.hostport import HostPort
from controller.links.line.script import Script, load_script

_END_S = 5.0


class ScriptedHost:
    """A robot host that sends a script to whatever opens its port, and counts the answers.

    script : what it sends. link : path that shall point at the pseudo-terminal, or None.
    """

    def __init__(self, script: Script, link: Path | None = None) -> None:
        self._port, self._link = HostPort(link), link
        self._host = RobotHost(self._port, script, PARAMETERS)
        self._over = threading.Event()
        self._thread = threading.Thread(
            target=self._host.run, args=(lambda: not self._over.is_set(),), name="robot-host", daemon=True
        )
        self._thread.start()

    @property
    def port(self) -> str:
        """What a program opens."""
        return str(self._link or self._port.path)

    def report(self) -> dict[str, Any]:
        """Lines ``sent``, ``accepted``, ``refused``, ``unanswered``, ``damaged`` so far, ``refusals`` and more."""
        return self._host.report()

    def wait_until(self, condition: Callable[[dict[str, Any]], object], timeout_s: float = 10.0) -> None:
        """Wait until a condition on the report holds. Raises AssertionError after a time, with the report."""
        __tracebackhide__ = True
        end_s = time.monotonic() + timeout_s
        while not condition(self.report()):
            if time.monotonic() > end_s:
                raise AssertionError(f"it did not happen within {timeout_s:g} s; the host counted {self.report()}")
            time.sleep(0.01)

    def all_accepted(self) -> None:
        """Assert that there were answers, and that each line so far was accepted or still waits for its answer."""
        __tracebackhide__ = True
        report = self.report()
        if not report["accepted"] or report["refused"] or report["unanswered"] or report["damaged"]:
            raise AssertionError(
                f"{report['accepted']} lines were accepted, {report['refused']} refused, {report['unanswered']} not "
                f"answered, {report['damaged']} answers damaged" + "".join(f"\n  {line}" for line in report["refusals"])
            )

    def close(self) -> None:
        """End the script and take the port away."""
        self._over.set()
        self._thread.join(_END_S)
        self._port.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_host(
    script: str = "tour", *, folder: Path, steps: Sequence[str] = (), loop_s: float = 0.0, link: Path | None = None
) -> ScriptedHost:
    """A robot host that plays a script of configs/scripts or a file, or ``steps`` as ``"0.5 SET jawOpen 0.5"``.

    loop_s : after how long the steps begin again, 0 for once. folder : in a new folder below it the steps are written.

    Raises ConfigError: there is no such script, or it is wrong. PortError: no pseudo-terminals here.
    """
    name = script
    if steps:
        file = Path(tempfile.mkdtemp(dir=folder)) / "steps.toml"
        file.write_text(tomli_w.dumps({"name": "steps", "loop_s": float(loop_s), "steps": list(steps)}), "utf-8")
        name = str(file)
    return ScriptedHost(load_script(name, PARAMETERS), link)
