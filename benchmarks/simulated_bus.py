"""How quick and how true the simulated Dynamixel bus is: wire time against the formula, processor time, rates.

Run ``python benchmarks/simulated_bus.py``. Nothing is judged here: figures depend on the machine and its load.
"""

from __future__ import annotations

import os
import statistics
import time
from pathlib import Path

import serial
from dynamixel_sdk import GroupSyncRead, GroupSyncWrite, PacketHandler, PortHandler
from rich.console import Console
from rich.table import Table

from drivers.packets.packet import Instruction, encode_instruction
from drivers.sim import SimulatedBus
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo

console = Console()
POSITION = b"\x84\x00\x04\x00"
CASES = ((9, 1_000_000, 0), (24, 57_600, 0), (24, 1_000_000, 0), (24, 1_000_000, 250), (24, 4_000_000, 0))


def wire_times(rounds: int = 100) -> Table:
    """Sync reads by a client that only waits for bytes, against bytes x 10 / baud + return delays."""
    table = Table("servos", "baud", "return delay", "formula ms", "shortest ms", "median ms", "bridge cost us")
    for count, baud, delay in CASES:
        ids = bytes(range(1, count + 1))
        formula = (14 + count + 15 * count) * 10 / baud + count * delay * 2e-6
        with (
            SimulatedBus(ids, baud=baud, wire=True, process=True) as bus,
            serial.Serial(bus.path, baud, timeout=1) as port,
        ):
            port.write(encode_instruction(0xFE, Instruction.WRITE, b"\x09\x00" + bytes((delay,))))
            time.sleep(0.1)
            took = sorted(exchange_s(port, ids) for _ in range(rounds))
        shortest, median = took[0], statistics.median(took)
        table.add_row(
            str(count),
            str(baud),
            f"{delay * 2} us",
            *(f"{value * 1e3:.2f}" for value in (formula, shortest, median)),
            f"{(shortest - formula) * 1e6:.0f} to {(median - formula) * 1e6:.0f}",
        )
    return table


def exchange_s(port: serial.Serial, ids: bytes) -> float:
    """Seconds one sync read of four bytes takes."""
    request = encode_instruction(0xFE, Instruction.SYNC_READ, POSITION + ids)
    began = time.perf_counter()
    port.write(request)
    port.read(15 * len(ids))
    return time.perf_counter() - began


def answer_times(rounds: int = 400) -> Table:
    """What 24 servos cost without a port: the shortest of many rounds."""
    ids = bytes(range(1, 25))
    chain = Chain([SimulatedServo(i) for i in ids])
    goals = b"".join(bytes((i, 0, 9, 0, 0)) for i in ids)
    cases = {
        "sync write": encode_instruction(0xFE, Instruction.SYNC_WRITE, b"\x74\0\4\0" + goals),
        "sync read": encode_instruction(0xFE, Instruction.SYNC_READ, POSITION + ids),
        "fast sync read": encode_instruction(0xFE, Instruction.FAST_SYNC_READ, POSITION + ids),
    }
    table = Table("24 servos, in memory", "shortest us", "median us")
    now_s = 0.0
    for name, frame in cases.items():
        took = []
        for _ in range(rounds):
            now_s += 0.01
            began = time.perf_counter()
            chain.feed(frame, now_s)
            took.append(time.perf_counter() - began)
        table.add_row(name, f"{min(took) * 1e6:.0f}", f"{statistics.median(took) * 1e6:.0f}")
    return table


def sdk_rates(seconds: float = 2.0) -> Table:
    """dynamixel-sdk writing and reading 24 servos as fast as it can, and the bus at 50 Hz and at rest."""
    table = Table("child process, 24 servos", "rate Hz", "bus processor share")
    with SimulatedBus(range(1, 25), process=True) as bus:
        port, packets = PortHandler(bus.path), PacketHandler(2.0)
        port.setBaudRate(bus.baud)
        write, read = GroupSyncWrite(port, packets, 116, 4), GroupSyncRead(port, packets, 132, 4)
        for device in range(1, 25):
            write.addParam(device, [0, 9, 0, 0])
            read.addParam(device)
        for name, pause in (("as fast as it can", 0.0), ("50 Hz", 0.02), ("at rest", seconds)):
            cycles, used, began = 0, process_time(bus), time.perf_counter()
            while time.perf_counter() - began < seconds:
                if pause < seconds:
                    write.txPacket()
                    read.txRxPacket()
                    cycles += 1
                time.sleep(pause)
            took = time.perf_counter() - began
            table.add_row(name, f"{cycles / took:.0f}", f"{(process_time(bus) - used) / took:.1%}")
        port.closePort()
    return table


def process_time(bus: SimulatedBus) -> float:
    """Processor seconds of the bus's child process so far."""
    fields = Path(f"/proc/{bus._child.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    for measure in (answer_times, wire_times, sdk_rates):
        console.print(measure())
