"""Runs other people's programs against simulated buses: ``python -m tests.clients [NAME ...]``, or ``make clients``.

Each gets an environment of its own with pinned versions (clients.toml), made once below .venv/clients, which needs a
package index. A program must end well; its servos must then be off, and must have moved without a jump. One that fails
is run once more, and the table says so: some libraries wait for an answer for 50 ms at most, which a busy computer does
not always keep.
"""

from __future__ import annotations

import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from drivers.base.priority import request_realtime, restore_priority
from drivers.testing import ServoBoard, ServoBus, open_board, open_servos

HERE = Path(__file__).resolve().parent
ENVIRONMENTS = HERE.parents[1] / ".venv" / "clients"
INSTALL_S, RUN_S = 600.0, 120.0
DONE = "installed.txt"
TRIES = 2


def environment(name: str, packages: list[str], bare: list[str]) -> Path:
    """The interpreter of a client's environment, which is made where it is not there or has other versions."""
    folder, wanted = ENVIRONMENTS / name, "\n".join([*packages, *bare])
    python, mark = folder / "bin" / "python", folder / DONE
    if mark.exists() and mark.read_text(encoding="utf-8") == wanted:
        return python
    subprocess.run([sys.executable, "-m", "venv", "--clear", folder], check=True, timeout=INSTALL_S)
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    for words in ([*pip, *packages], [*pip, "--no-deps", *bare] if bare else []):
        if words:
            subprocess.run(words, check=True, timeout=INSTALL_S, stderr=subprocess.PIPE, text=True)
    mark.write_text(wanted, encoding="utf-8")
    return python


def opened(client: dict[str, Any]) -> ServoBus | ServoBoard:
    """The simulated servos or the board that a client's section names, on a port.

    The thread that serves them inherits real-time priority where it can be had: it answers in time on a busy computer.
    """
    request_realtime()
    try:
        return _made(client)
    finally:
        restore_priority()  # the client must not inherit it: one that polls would keep bytes from being carried


def _made(client: dict[str, Any]) -> ServoBus | ServoBoard:
    if "board" in client:
        return open_board(client["board"], **client.get("options", {}))
    models = {int(number): model for number, model in client.get("models", {}).items()} or client["model"]
    return open_servos(models, client.get("ids", ()))


def run(python: str | Path, client: dict[str, Any]) -> str:
    """Run a client by an interpreter; what went wrong, or an empty text."""
    with opened(client) as bench:
        words = [python, HERE / "programs" / client["program"], bench.port]
        try:
            done = subprocess.run(words, capture_output=True, text=True, timeout=RUN_S)
        except subprocess.TimeoutExpired:
            return f"it had not ended after {RUN_S:g} s"
        return done.stderr.strip()[-2000:] if done.returncode else faults(bench)


def faults(bench: ServoBus | ServoBoard) -> str:
    """What the assertions of the test bench say."""
    try:
        bench.torque_off_at_exit()
        bench.no_jump()
    except AssertionError as error:
        return str(error)
    goals = [write for write in bench.writes if write.register in ("Goal Position", "target_us")]
    return "" if goals else "it moved nothing"


def result(python: str | Path, client: dict[str, Any]) -> tuple[bool, str]:
    """Whether a client passed, and what the table says; a second try where the first failed."""
    wrong = [run(python, client)]
    while wrong[-1] and len(wrong) < TRIES:
        wrong.append(run(python, client))
    if wrong[-1]:
        return False, wrong[-1]
    return True, f"passed at the second try; the first: {wrong[0].splitlines()[-1]}" if len(wrong) > 1 else "passed"


def _reason(error: subprocess.SubprocessError) -> str:
    """What pip said last, or that it took too long."""
    said = getattr(error, "stderr", None) or str(error)
    return said.strip().splitlines()[-1]


def main(names: list[str]) -> int:
    """Run the clients named, or all; 1 where one failed."""
    clients = tomllib.loads((HERE / "clients.toml").read_text(encoding="utf-8"))
    if unknown := sorted(set(names) - set(clients)):
        sys.exit(f"there is no client {unknown[0]}; there are {', '.join(clients)}")
    table, failed = Table("client", "versions", "seconds", "result"), False
    for name in names or clients:
        client, begun = clients[name], time.monotonic()
        try:
            passed, said = result(environment(name, client["packages"], client.get("bare", [])), client)
        except subprocess.SubprocessError as error:
            passed, said = False, f"its environment cannot be made, is the package index there? {_reason(error)}"
        versions = " ".join(client.get("bare", []) or client["packages"])
        table.add_row(name, versions, f"{time.monotonic() - begun:.1f}", said)
        failed = failed or not passed
    Console().print(table)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
