"""A conversation with a face over its WebSocket API: it listens, is surprised, and watches its own jaw.

    omote run websocket                       # in one terminal
    python examples/1_python_client.py       # in another; ws://HOST:PORT and a token may follow

It needs the package websockets, and of omote only the module controller.client.
"""

# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import sys
import time
from itertools import islice

from controller.client import URL, Face, FaceError


def talk(face: Face) -> None:
    """Let the face listen, be surprised, and speak a syllable."""
    face.life(1.0, "listen")
    face.gaze(15, 0)
    time.sleep(1.0)
    face.expression("surprise", 0.9, seconds=1.5)
    for state in islice(face.states(10, "jawOpen"), 15):
        print(f"{state['time_s']:6.2f} s   jawOpen {state['parameters']['jawOpen']:.2f}")
    face.set(jawOpen=0.5)
    time.sleep(0.3)
    face.neutral()


def main() -> int:
    """Talk to the face at the address of the command line."""
    url, token = (*sys.argv[1:], "", "")[:2]
    try:
        with Face(url or URL, token=token or None) as face:
            talk(face)
    except FaceError as error:
        print(f"{error} ({error.hint})" if error.hint else error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
