"""Runs other people's programs against simulated buses: ``python -m tests.clients [NAME ...]``, or ``make clients``.

Each gets an environment of its own with pinned versions (clients.toml), made once below .venv/clients, which needs a
package index. A program must end well; its servos must then be off, and must have moved without a jump.
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

from drivers.testing import ServoBus, open_servos

HERE = Path(__file__).resolve().parent
ENVIRONMENTS = HERE.parents[1] / ".venv" / "clients"
INSTALL_S, RUN_S = 600.0, 120.0
DONE = "installed.txt"


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
            subprocess.run(words, check=True, timeout=INSTALL_S)
    mark.write_text(wanted, encoding="utf-8")
    return python


def run(name: str, client: dict[str, Any]) -> str:
    """Run a client; what went wrong, or an empty text."""
    python = environment(name, client["packages"], client.get("bare", []))
    models = {int(number): model for number, model in client.get("models", {}).items()} or client["model"]
    with open_servos(models, client.get("ids", ())) as bus:
        words = [python, HERE / "programs" / client["program"], bus.port]
        try:
            done = subprocess.run(words, capture_output=True, text=True, timeout=RUN_S)
        except subprocess.TimeoutExpired:
            return f"it had not ended after {RUN_S:g} s"
        return done.stderr.strip()[-2000:] if done.returncode else faults(bus)


def faults(bus: ServoBus) -> str:
    """What the assertions of the test bench say."""
    try:
        bus.torque_off_at_exit()
        bus.no_jump()
    except AssertionError as error:
        return str(error)
    return "" if bus.writes_to(bus.chain.servos[0].id, "Goal Position") else "it moved nothing"


def main(names: list[str]) -> int:
    """Run the clients named, or all; 1 where one failed."""
    clients = tomllib.loads((HERE / "clients.toml").read_text(encoding="utf-8"))
    if unknown := sorted(set(names) - set(clients)):
        sys.exit(f"there is no client {unknown[0]}; there are {', '.join(clients)}")
    table, failed = Table("client", "versions", "seconds", "result"), False
    for name in names or clients:
        begun = time.monotonic()
        wrong = run(name, clients[name])
        versions = " ".join(clients[name].get("bare", []) or clients[name]["packages"])
        table.add_row(name, versions, f"{time.monotonic() - begun:.1f}", wrong or "passed")
        failed = failed or bool(wrong)
    Console().print(table)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
