"""What simulated servos cost by number: 10,000 in one process, per servo and per bus.

Run ``python benchmarks/many_servos.py [SERVOS]``. Nothing is judged here: figures depend on the machine and its load.
Each bus has 24 servos (a head) or 250 (all ids of a wire). The cycle is what a driver does: one sync write of goals and
one fast sync read of positions. First without ports, in one thread; then 40 buses on pseudo-terminals in this process,
with a client in another, which does all of them in turn.
"""

from __future__ import annotations

import gc
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack

from rich.console import Console
from rich.table import Table

from drivers.packets.packet import Instruction, encode_instruction
from drivers.sim import SimulatedBus
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo

console = Console()
SIZES = (24, 250)
MODEL = "xl330-m288"
POSITION = b"\x84\x00\x04\x00"
GOAL = b"\x74\x00\x04\x00"
ROUNDS = 3
PORTS = 40
CLIENT = """
import os, select, sys, time
paths, request, size, rounds = sys.argv[1].split(","), bytes.fromhex(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
ports = [os.open(path, os.O_RDWR | os.O_NOCTTY) for path in paths]
begun = time.perf_counter()
for _ in range(rounds):
    for port in ports:
        os.write(port, request)
        have = 0
        while have < size and select.select([port], [], [], 20)[0]:
            have += len(os.read(port, 65536))
        assert have == size, have
print(time.perf_counter() - begun)
"""


def buses(servos: int, size: int) -> list[Chain]:
    """Chains of `size` servos, and one with the rest."""
    full, rest = divmod(servos, size)
    sizes = [size] * full + ([rest] if rest else [])
    return [Chain([SimulatedServo(number + 1, MODEL) for number in range(each)]) for each in sizes]


def cycle(size: int, position: int) -> tuple[bytes, bytes]:
    """A sync write of goals and a fast sync read of positions, of Protocol 2.0."""
    goals = b"".join(bytes((number + 1, *position.to_bytes(4, "little"))) for number in range(size))
    ids = bytes(range(1, size + 1))
    return (
        encode_instruction(0xFE, Instruction.SYNC_WRITE, GOAL + goals),
        encode_instruction(0xFE, Instruction.FAST_SYNC_READ, POSITION + ids),
    )


def memory_mb() -> float:
    """Memory of this process, MB."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 1e6


def without_ports(servos: int) -> Table:
    """Processor time and memory of servos that nothing but this thread asks."""
    table = Table(f"{servos} servos", "buses", "made s", "kB a servo", "write us", "read us", "us a servo", "ms a bus")
    for size in SIZES:
        gc.collect()
        before_mb, begun = memory_mb(), time.process_time()
        chains = buses(servos, size)
        made_s, used_mb = time.process_time() - begun, memory_mb() - before_mb
        for chain in chains:
            chain.feed(encode_instruction(0xFE, Instruction.WRITE, b"\x40\0\1"), 0.0)
        write_s, read_s = min(times(chains, size))
        both_us = (write_s + read_s) * 1e6
        table.add_row(
            f"{size} a bus", str(len(chains)), f"{made_s:.2f}", f"{used_mb * 1e3 / servos:.1f}",
            f"{write_s * 1e6 / servos:.1f}", f"{read_s * 1e6 / servos:.1f}",
            f"{both_us / servos:.1f}", f"{both_us / len(chains) / 1e3:.2f}",
        )  # fmt: skip
        del chains
    return table


def times(chains: list[Chain], size: int) -> Iterator[tuple[float, float]]:
    """Processor seconds of a write and of a read of all servos, each of some rounds in which they move."""
    for k in range(ROUNDS):
        write, read = cycle(size, 2048 + 100 * k)
        begun = time.process_time()
        for chain in chains:
            chain.feed(write, 0.02 * k)
        written = time.process_time()
        for chain in chains:
            chain.feed(read, 0.02 * k + 0.01)
        yield written - begun, time.process_time() - written


def on_ports(size: int = SIZES[1], count: int = PORTS) -> Table:
    """Buses on pseudo-terminals in threads of this process; a client in another process asks one after the other."""
    table = Table("on pseudo-terminals", "servos", "ms a bus", "us a servo", "processor share of the buses")
    with ExitStack() as stack:
        running = [stack.enter_context(SimulatedBus(range(1, size + 1))) for _ in range(count)]
        paths = ",".join(bus.path for bus in running)
        replies = running[0].chain.feed(cycle(size, 2048)[1], time.monotonic())
        answer = sum(len(reply.data) for reply in replies)
        used, begun = time.process_time(), time.perf_counter()
        words = [sys.executable, "-c", CLIENT, paths, b"".join(cycle(size, 2100)).hex(), str(answer), str(ROUNDS)]
        took = float(subprocess.run(words, check=True, capture_output=True, text=True).stdout) / ROUNDS
        share = (time.process_time() - used) / (time.perf_counter() - begun)
    a_bus, a_servo = took / count, took / count / size
    table.add_row(f"{count} buses", str(count * size), f"{a_bus * 1e3:.2f}", f"{a_servo * 1e6:.1f}", f"{share:.0%}")
    return table


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    console.print(without_ports(number))
    console.print(on_ports())
