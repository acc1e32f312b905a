"""What the fixtures give: simulated servos or a simulated board with a record of what happened, and assertions."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Generic, Self, TypeVar

from drivers.sim.boards.board import Board
from drivers.sim.serving.simulated import ServoView
from drivers.sim.serving.virtual import VirtualLink
from drivers.sim.servos.chain import Chain
from drivers.testing import boardchecks, servochecks
from drivers.testing.load import busiest
from drivers.testing.records import MAX_ENTRIES, BoardRecord, Output, Record, ServoRecord, Write, outputs
from drivers.testing.serving import Serving, stepped
from drivers.testing.servochecks import Limits, fail
from drivers.testing.steppedserial import SteppedSerial

AnyRecord = TypeVar("AnyRecord", bound=Record)


class Bench(ABC, Generic[AnyRecord]):
    """Simulated hardware on one wire, seen from a test. The record begins when it is made, and with `forget`.

    serving : where it is.
    """

    def __init__(self, serving: Serving) -> None:
        self._serving = serving
        self._begin()

    def _begin(self) -> None:
        serving = self._serving
        with serving.line.lock:
            self._record = self._make_record(serving.clock())
            serving.line.watcher = self._record
        serving.record_to(self._record)

    @abstractmethod
    def _make_record(self, start_s: float) -> AnyRecord: ...

    # ------------------------------------------------------------ port and time
    @property
    def port(self) -> str:
        """What a program opens: a path, or a URL of pyserial. Empty in stepped time."""
        return self._serving.port

    @property
    def time_s(self) -> float:
        """Seconds since the record began, the time of `writes`."""
        return self._serving.clock() - self._record.start_s

    def step(self, span_s: float) -> None:
        """Let time pass. Raises DriverError where it runs by itself (without ``stepped=True``)."""
        stepped(self._serving).step(span_s)

    def serial(self, timeout: float | None = None) -> SteppedSerial:
        """An open port with pyserial's methods, whose reads let time pass. Raises DriverError as `step` does."""
        return stepped(self._serving).serial(timeout)

    @property
    def link(self) -> VirtualLink:
        """What omote's own drivers take as ``port``, in stepped time. Raises DriverError as `step` does."""
        return stepped(self._serving).link

    def wait_until(self, condition: Callable[[], object], timeout_s: float = 10.0) -> None:
        """Wait until a condition holds; stepped time is stepped. Raises AssertionError after ``timeout_s``."""
        __tracebackhide__ = True
        end_s = self._serving.clock() + timeout_s
        pause = time.sleep if self.port else self.step
        while not condition():
            if self._serving.clock() > end_s:
                raise AssertionError(f"it did not happen within {timeout_s:g} s; {self._summary()}")
            pause(0.005)

    def close(self) -> None:
        """Take the port away; a fixture does this after the test."""
        self._serving.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ------------------------------------------------------------ faults
    def fault(self, *specs: str) -> None:
        """Set faults, as ``"mute:7"`` or ``"drop:*:p=0.01"``. Raises DriverError: one cannot be read; none is set."""
        self._serving.fault(specs)

    def clear(self, kind: str | None = None) -> None:
        """End the faults of a kind; None: all."""
        self._serving.clear(kind)

    @property
    def faults(self) -> list[str]:
        """The faults that are there now, as they were set."""
        with self._serving.line.lock:
            return [fault.spec for fault in self._serving.line.faults.active]

    # ------------------------------------------------------------ what happened
    @property
    def writes(self) -> list[Write]:
        """Everything that was written since the record began, in order; a copy."""
        self._serving.sync()
        with self._serving.line.lock:
            return list(self._record.writes)

    def writes_to(self, id: int, register: str = "") -> list[Write]:
        """Writes to one servo or channel, of one register where it is named."""
        return [write for write in self.writes if write.id == id and register in ("", write.register)]

    def forget(self) -> None:
        """Start the record again, from the present state."""
        self._serving.sync()
        self._begin()

    def bus_load_below(self, share: float, over_s: float = 0.2) -> None:
        """Assert that bytes took less than a share (0 to 1) of the wire's time, over any ``over_s`` seconds."""
        __tracebackhide__ = True
        record = self._up_to_date()
        baud = self._serving.line.line_baud or self._serving.baud
        worst = busiest(record.traffic, baud, over_s)
        fault = (
            f"{worst.share:.1%} in the {over_s:g} s from {worst.first_s - record.start_s:.3f} s on: "
            f"{worst.sent} bytes sent and {worst.received} received at {baud} baud"
        )
        fail(f"the bus was busier than {share:.0%}", [fault] if worst.share >= share else [])

    def _up_to_date(self) -> AnyRecord:
        """The record when all that was written has been carried out. Raises AssertionError where it is not complete."""
        __tracebackhide__ = True
        self._serving.sync()
        with self._serving.line.lock:
            self._serving.line.catch_up(self._serving.clock())
            self._record.notice(self._serving.clock())
        if self._record.left_out:
            raise AssertionError(
                f"the record is full ({MAX_ENTRIES} entries): call forget() between parts of a long test"
            )
        return self._record

    def _summary(self) -> str:
        writes = self.writes
        last = writes[-1] if writes else None
        what = f"the last write was {last.register} = {last.value} to {last.id} at {last.time_s:.3f} s" if last else ""
        return what or "nothing was written"


class ServoBus(Bench[ServoRecord]):
    """Simulated servos on one wire."""

    @property
    def chain(self) -> Chain:
        """The servos themselves."""
        line = self._serving.line
        assert isinstance(line, Chain)
        return line

    def _make_record(self, start_s: float) -> ServoRecord:
        return ServoRecord(self.chain, start_s)

    def servo(self, id: int) -> ServoView:
        """State of one servo: ``position_ticks``, ``goal``, ``torque``, ``register(name)``. Raises KeyError."""
        return ServoView(self.chain, id, self._serving.clock)

    def never_beyond_limits(self, limits: Limits = None) -> None:
        """Assert that no goal was, and no shaft moved, beyond limits.

        limits : (low, high) in ticks of Present Position for all servos, or {id: (low, high)}. None: the limits in
            the servos' registers; then no write may have been refused for its value, either.
        """
        __tracebackhide__ = True
        record = self._up_to_date()
        with self.chain.lock:
            faults = servochecks.beyond_limits(record, limits, self._serving.clock())
        fail("servos moved, or got goals, beyond their limits:", faults)

    def torque_off_at_exit(self) -> None:
        """Assert that every motor is off; to be called when the program has ended."""
        __tracebackhide__ = True
        record = self._up_to_date()
        with self.chain.lock:
            faults = servochecks.still_on(record)
        fail("servos were left on:", faults)

    def no_jump(self, deg: float = 5.0, deg_s: float = 200.0) -> None:
        """Assert that no shaft went further than ``deg`` degrees faster than ``deg_s`` degrees/s, by its motor.

        A program that moves quickly on purpose needs a higher ``deg_s``; a shaft that is moved by hand does not count.
        """
        __tracebackhide__ = True
        record = self._up_to_date()
        with self.chain.lock:
            faults = servochecks.jumps(record, deg, deg_s, self._serving.clock())
        fail(f"servos jumped (more than {deg:g} degrees at more than {deg_s:g} degrees/s):", faults)


class ServoBoard(Bench[BoardRecord]):
    """A simulated board with hobby servos, or one that takes the omote line protocol."""

    @property
    def board(self) -> Board:
        """The board itself."""
        line = self._serving.line
        assert isinstance(line, Board)
        return line

    def _make_record(self, start_s: float) -> BoardRecord:
        return BoardRecord(self.board, start_s)

    @property
    def channels(self) -> dict[int, Output]:
        """Its outputs by number: ``target`` (None while off) and ``value``, pulses in microseconds."""
        self._serving.sync()
        with self.board.lock:
            return {output.id: output for output in outputs(self.board, self._serving.clock())}

    def never_beyond_limits(self, limits: tuple[float, float] | Mapping[int, tuple[float, float]]) -> None:
        """Assert that no target was beyond (low, high), for all channels or by channel; pulses in microseconds."""
        __tracebackhide__ = True
        record = self._up_to_date()
        fail("channels got targets beyond their limits:", boardchecks.beyond_limits(record, limits))

    def torque_off_at_exit(self) -> None:
        """Assert that no channel puts out pulses; to be called when the program has ended."""
        __tracebackhide__ = True
        record = self._up_to_date()
        with self.board.lock:
            faults = boardchecks.still_on(record, self._serving.clock())
        fail("channels were left on:", faults)

    def no_jump(self, most: float = 60.0) -> None:
        """Assert that no output changed by more than ``most`` (us) at once; 60 us are some 5 degrees.

        The first pulse of a channel does not count: where its servo was is not known.
        """
        __tracebackhide__ = True
        record = self._up_to_date()
        fail(f"channels jumped (by more than {most:g} at once):", boardchecks.jumps(record, most))
