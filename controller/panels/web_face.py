"""Makes the face that the web panel shows, in a process of its own: it takes seconds, which servos must not wait."""

from __future__ import annotations

import gzip
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from controller.base.files import replacing

_END_S = 5.0


@contextmanager
def face_file_in_background(
    stage: Path, look: Mapping[str, object], identity: Mapping[str, float] | None, vocabularies: Sequence[Path] = ()
) -> Iterator[Path]:
    """Start to make the face of a stage; gives the path at which the file will appear. The context ends the process.

    look, identity : options of the command line, which replace the stage's own. vocabularies : as of
        :func:`controller.stage.stage.load_stage`.
    """
    with tempfile.TemporaryDirectory(prefix="omote-web-", ignore_cleanup_errors=True) as folder:
        path = Path(folder) / "face.glb.gz"
        arguments = pickle.dumps((str(stage), dict(look), dict(identity or {}), str(path), list(vocabularies)))
        command = [sys.executable, "-m", "controller.panels.web_face"]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True)
        try:
            if process.stdin is not None:
                with suppress(OSError):  # it has ended, and has said why
                    process.stdin.write(arguments)
                    process.stdin.close()
            yield path
        finally:
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(_END_S)
            process.kill()
            process.wait()


def make_face(
    stage: str, look: Mapping[str, object], identity: Mapping[str, float], out: Path, vocabularies: Sequence[Path] = ()
) -> None:
    """Write the face of a stage as a compressed GLB file, completely or not at all.

    Raises ConfigError, SurfaceError: the stage or its head cannot be read.
    """
    # imported here: the process that only starts this one does not need them, and they are slow to import
    from controller.base.parameters import PARAMETERS
    from controller.stage.stage import load_stage, with_picture
    from surface.export.glb_web import web_glb

    found = with_picture(load_stage(stage, PARAMETERS, vocabularies), look)
    if identity:
        settings = found.settings.model_copy(update={"identity": dict(identity)})
        found = replace(found, settings=settings)
    packed = gzip.compress(web_glb(found.load_head()), 9, mtime=0)
    with replacing(out) as temporary:
        temporary.write_bytes(packed)


def main() -> None:
    """Read the arguments of :func:`make_face` from standard input and run it, with low priority."""
    arguments: Any = pickle.loads(sys.stdin.buffer.read())
    stage, look, identity, out, vocabularies = arguments
    os.nice(10)
    make_face(stage, look, identity, Path(out), vocabularies)


if __name__ == "__main__":
    main()
