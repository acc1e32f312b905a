"""Opens a link with the line protocol, and starts a simulated robot host if the stage has one."""

from __future__ import annotations

import json
import subprocess
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from controller.base.errors import LinkError
from controller.base.paths import find_config
from controller.links.access import token_for
from controller.links.kind import LinkContext
from controller.links.line.kind import LineSettings
from controller.links.line.link import LineLink
from controller.links.line.server import LineServer
from drivers.base.children import command as module_command
from drivers.base.children import environment

_HOST = "controller.links.line.host"
_START_TIMEOUT_S = 20.0
_END_TIMEOUT_S = 3.0


def open_line(settings: LineSettings, context: LinkContext) -> LineLink | LineServer:
    """Open the serial port, or listen at the address.

    Raises LinkError: the simulated host does not start, or the address cannot be used. PortError: the port cannot be
    opened.
    """
    if settings.listen is not None:
        return _open_server(settings, context)
    port = settings.port or ""
    if settings.simulated is not None:
        script = find_config("scripts", settings.simulated, beside=context.beside)
        host = HostProcess(str(script), context.vocabularies)
        context.closers.callback(host.stop)
        port = host.path
    link = LineLink(port, settings.baud, context.sink, checksum=settings.checksum).start()
    context.closers.callback(link.stop)
    return link


def _open_server(settings: LineSettings, context: LinkContext) -> LineServer:
    token = token_for(f"line {settings.address}", settings.where[0], settings.token)
    server = LineServer(settings, context.sink, token)
    context.closers.callback(server.stop)
    return server.start()


class HostProcess:
    """A simulated robot host in a child process, which ends with this one.

    Parameters
    ----------
    script : a path, or a name in ``configs/scripts``. vocabularies : files of further expressions that it uses.

    Attributes
    ----------
    path : the port that it serves. counts : its report, after :meth:`stop`.

    Raises LinkError: it does not start.
    """

    def __init__(self, script: str, vocabularies: Sequence[Path] = ()) -> None:
        command = module_command(_HOST, "--script", script)
        command += [word for path in vocabularies for word in ("--vocabulary", str(path))]
        self.counts: dict[str, object] = {}
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment(_HOST)
        )
        timer = threading.Timer(_START_TIMEOUT_S, self._process.kill)
        timer.start()
        line = self._process.stdout.readline() if self._process.stdout is not None else ""
        timer.cancel()
        word, _, self.path = line.strip().partition(" ")
        if word == "ready":
            return
        self.stop()
        if word != "failed":
            raise LinkError(f"the simulated robot host for script {script!r} did not start")
        message, hint = json.loads(self.path)
        raise LinkError(message, hint=hint)

    def stop(self) -> None:
        """End the process and read its counts; may be called repeatedly."""
        try:
            output, _ = self._process.communicate(timeout=_END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            output, _ = self._process.communicate()
        except ValueError:
            return  # stopped before
        with suppress(ValueError):
            self.counts = json.loads(output)
