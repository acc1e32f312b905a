"""Opening the links of a stage."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.line.hostport import HostPort
from controller.links.line.opening import HostProcess
from controller.links.links import open_links, read_link
from drivers.base.errors import PortMissing


def test_a_simulated_host_drives_the_face_from_its_own_process(tmp_path: Path) -> None:
    script = tmp_path / "own.toml"
    script.write_text('steps = ["0 SET jawOpen 0.8"]')
    state = CommandState(P)
    with ExitStack() as closers:
        links = open_links([read_link({"port": "simulated", "script": str(script)})], LinkContext(state, closers))
        end = time.monotonic() + 60
        while state.status()["manual"] != 1:
            assert time.monotonic() < end
            time.sleep(0.01)
        assert links[0].report()["accepted"] == 2  # HELLO and SET
    assert not links[0].connected


def test_a_host_process_that_is_killed_does_not_hang_stop() -> None:
    host = HostProcess("tour")
    host._process.send_signal(signal.SIGKILL)
    host.stop()
    assert host.counts == {}


@pytest.mark.slow
def test_a_host_starts_from_a_folder_with_modules_of_the_same_names(root: Path, tmp_path: Path) -> None:
    """The program finds omote as an uninstalled one is found: by its path alone."""
    for name in ("controller", "drivers", "json", "signal"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the wrong one')\n")
    program = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from controller.links.line.opening import HostProcess\n"
        "host = HostProcess('tour'); host.stop(); print(host.counts['script'])"
    )
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, "-P", "-c", program, str(root)],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("tour\n", "")


def test_a_missing_port_closes_what_was_open() -> None:
    with HostPort() as port, ExitStack() as closers, pytest.raises(PortMissing):
        choices = [read_link({"port": port.path}), read_link({"port": "/dev/none"})]
        open_links(choices, LinkContext(CommandState(P), closers))
