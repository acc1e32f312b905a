"""A robot's program that moves a face without ROS and without any package: lines of text over TCP.

The face follows something that passes by, tells what its jaw does meanwhile, and every line is answered:

    omote run talk.toml                       # in one terminal, with talk.toml as below
    python examples/3_without_ros.py          # in another; HOST:PORT and a token may follow

    [[links]]
    kind = "line"
    listen = "127.0.0.1:9404"

docs/line-protocol.md has every command. The same lines go over a serial port.
"""

# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import math
import socket
import sys
import time


class Refused(Exception):
    """The face did not do what a line says."""


class Face:
    """One conversation with a face."""

    def __init__(self, host: str, port: int, token: str = "") -> None:
        self._socket = socket.create_connection((host, port), timeout=5)
        self._answers = self._socket.makefile("r", encoding="ascii", newline="\n")
        if token:
            self.ask(f"AUTH {token}")

    def ask(self, line: str) -> str:
        """Send a line; what its answer says behind OK. Raises Refused, OSError."""
        self._socket.sendall(line.encode("ascii") + b"\n")
        answer = self._answers.readline()
        if not answer:
            raise ConnectionError("the face hung up")
        verdict, _, rest = answer.strip().partition(" ")
        if verdict != "OK":
            raise Refused(f"{line}: {rest}")
        return rest

    def close(self) -> None:
        """End the conversation."""
        self._socket.close()


def follow(face: Face, seconds: float) -> None:
    """Look after something that goes from one side to the other and back, with a mouth that opens in surprise."""
    face.ask("EXPR surprise 0.6")
    start_s = time.monotonic()
    while (now_s := time.monotonic() - start_s) < seconds:
        face.ask(f"GAZE {30 * math.sin(2 * now_s):.1f} 0")
        face.ask(f"SET jawOpen {0.3 + 0.2 * math.sin(5 * now_s):.2f}")
        print(f"{now_s:5.2f} s   {face.ask('GET jawOpen headYaw')}")
        time.sleep(0.1)
    face.ask("NEUTRAL")


def main() -> int:
    """Talk to the face at the address of the command line."""
    address, token = (*sys.argv[1:], "", "")[:2]
    host, _, port = (address or "127.0.0.1:9404").rpartition(":")
    try:
        face = Face(host, int(port), token)
        try:
            follow(face, 2.0)
        finally:
            face.close()
    except (OSError, Refused) as error:
        print(f"{host}:{port}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
