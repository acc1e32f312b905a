"""A simulated robot host at a port, for tests of programs that receive the omote line protocol, as a face."""

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
    """A robot host that sends the commands of a script to the program that opens its port, and counts the answers.

    script : its timed commands. link : path of a symbolic link to the pseudo-terminal, or None.
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
        """Path that the tested program opens."""
        return str(self._link or self._port.path)

    def report(self) -> dict[str, Any]:
        """Return the numbers of lines ``sent``, ``accepted``, ``refused``, ``unanswered``, ``damaged`` and more."""
        return self._host.report()

    def wait_until(self, condition: Callable[[dict[str, Any]], object], timeout_s: float = 10.0) -> None:
        """Wait until a condition on the report holds. Raises AssertionError after ``timeout_s``, with the report."""
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
        """End the script, and close and remove the port."""
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
    """Open a robot host that plays a script (a name from configs/scripts or a file), or ``steps``.

    steps : as ``"0.5 SET jawOpen 0.5"``, time (s) and command; they are written to a new folder in ``folder``.
    loop_s : period after which the steps are repeated; 0 plays them once.

    Raises ConfigError: no such script, or it is wrong. PortError: the system has no pseudo-terminals.
    """
    name = script
    if steps:
        file = Path(tempfile.mkdtemp(dir=folder)) / "steps.toml"
        file.write_text(tomli_w.dumps({"name": "steps", "loop_s": float(loop_s), "steps": list(steps)}), "utf-8")
        name = str(file)
    return ScriptedHost(load_script(name, PARAMETERS), link)
