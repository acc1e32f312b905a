"""Reading and writing registers of servos by name, with retries and every reply checked, in any protocol."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import ClassVar, Generic, TypeVar

from drivers.base.bus import ServoInfo, ServoSpec
from drivers.base.errors import BusError, CorruptReply, DriverError, NoReply, PortLost, ServoRefused, merge_errors
from drivers.servos.exchange import Exchange, Exchanges, R
from drivers.servos.layout import NAMES, item_of
from drivers.servos.port import Port
from drivers.tables.tables import ControlTable, Item, model_name

MAX_TRIES = 4
T = TypeVar("T")
E = TypeVar("E", bound=DriverError)


class Registers(ABC, Generic[R]):
    """Registers by servo id and short name (see ``layout.NAMES``); a protocol implements the hooks.

    tables : control table by id.
    names : names of servos by id, for messages.
    greeting : what error messages call the request of :meth:`hello`.
    """

    greeting: ClassVar[str]

    def __init__(self, packets: Exchanges[R], port: Port, servos: Iterable[ServoSpec]) -> None:
        self.packets, self.port = packets, port
        self.names = {servo.id: servo.name for servo in servos}
        self.tables: dict[int, ControlTable] = {}

    # ------------------------------------------------------------------ hooks

    @abstractmethod
    def refusal(self, reply: R) -> str:
        """Return why a servo refused an instruction; empty where it did not."""

    def span(self, table: ControlTable, item: Item) -> tuple[int, int, str]:
        """Return (address, size, manner) of the read that contains a register, see ``Exchanges.read_group``."""
        return item.address, item.size, "sync"

    def title(self, item: Item, name: str) -> str:
        """The name of a register in messages."""
        return item.name

    def is_damaged(self, reply: R) -> bool:
        """Whether a servo reports that the request reached it damaged, so that it must be sent again."""
        return False

    @abstractmethod
    def hardware_error(self, servo: int) -> int:
        """Return the hardware error bits of a servo from which a register was just read."""

    def note(self, servo: int, reply: R) -> None:
        """Store what a reply tells beside its data, such as error flags; does nothing by default."""

    # ------------------------------------------------------------------ registers of a model

    def label(self, servo: int) -> str:
        """The name of a servo in messages: ``"jaw" (id 3)``."""
        return f'"{self.names[servo]}" (id {servo})' if servo in self.names else f"id {servo}"

    def item(self, servo: int, name: str) -> Item | None:
        """Return the register of a servo; None where its model does not have it."""
        return item_of(self.tables[servo], name)

    def having(self, ids: Iterable[int], name: str) -> list[int]:
        """Return the ids of servos whose model has a register."""
        return [servo for servo in ids if self.item(servo, name) is not None]

    def register_name(self, servo: int, name: str) -> str:
        """The name of a servo's register in messages."""
        return self.title(self._known(servo, name), name)

    # ------------------------------------------------------------------ one servo

    def hello(self, servo: int, tries: int = MAX_TRIES) -> R:
        """Greet a servo and return its reply; raises NoReply or CorruptReply."""
        return self._with_retries(servo, self.greeting, partial(self.packets.hello, self.port, servo), tries)

    def get(self, servo: int, name: str, tries: int = MAX_TRIES) -> int:
        """Read one register; raises NoReply, CorruptReply or ServoRefused."""
        item = self._known(servo, name)
        at, size, _ = self.span(self.tables[servo], item)
        ask = partial(self.packets.read, self.port, servo, at, size)
        reply = self._with_retries(servo, f"reading {self.title(item, name)}", ask, tries)
        return item.decode(reply.params[item.address - at :])

    def put(self, servo: int, name: str, value: int, tries: int = MAX_TRIES) -> None:
        """Write one register and wait for the servo's status; raises as :meth:`get` does."""
        item = self._known(servo, name)
        ask = partial(self.packets.write, self.port, servo, item.address, item.encode(value))
        self._with_retries(servo, f"writing {self.title(item, name)} = {value}", ask, tries)

    def put_unanswered(self, servo: int, name: str, value: int) -> None:
        """Write one register with a sync write to one servo.

        No servo answers a sync write; a reply that nobody reads would collide with the next request.
        """
        self.put_all({servo: value}, name)

    def info(self, servo: int, number: int, firmware: int, find_table: Callable[[], ControlTable]) -> ServoInfo:
        """Read the description of a servo; without measurements where its model is unknown or it stops answering.

        `find_table` returns its control table or raises DriverError. Raises PortLost.
        """
        try:
            table = self.tables[servo] = find_table()
            volts = self.get(servo, "voltage") * self._known(servo, "voltage").scale
            celsius = self.get(servo, "temperature")
            hardware, torque = self.hardware_error(servo), self.get(servo, "torque") == 1
        except PortLost:
            raise
        except DriverError:
            return ServoInfo(servo, number, model_name(number), firmware)
        return ServoInfo(servo, number, table.model, firmware, round(volts, 2), float(celsius), hardware, torque)

    # ------------------------------------------------------------------ many servos

    def get_all(self, ids: Sequence[int], name: str) -> dict[int, int]:
        """Read one register of many servos: by group reads where possible, then separately where a reply is missing.

        Returns values by id; servos whose model lacks the register are left out.

        Raises NoReply or CorruptReply where servos did not answer; ``servo_ids`` are all of these.
        """
        values: dict[int, int] = {}
        for (at, size, manner), group in self._spans(ids, name).items():
            got = self.packets.read_group(self.port, group, at, size, manner)
            for servo, reply in got.replies.items():
                if len(reply.params) == size:
                    self.note(servo, reply)
                    item = self._known(servo, name)
                    values[servo] = item.decode(reply.params[item.address - at :])
        missing = [servo for servo in self.having(ids, name) if servo not in values]
        return values | self.each(missing, lambda servo: self.get(servo, name))

    def put_all(self, values: Mapping[int, int], name: str) -> None:
        """Write one register of many servos with one packet per address, which no servo answers."""
        for frame in self.frames(values, name):
            self.packets.send_only(self.port, frame)

    def frames(self, values: Mapping[int, int], name: str) -> list[bytes]:
        """Return the sync write packets of :meth:`put_all`."""
        groups: dict[tuple[int, int], bytes] = {}
        for servo in self.having(values, name):
            item = self._known(servo, name)
            row = bytes((servo,)) + item.encode(values[servo])
            groups[item.address, item.size] = groups.get((item.address, item.size), b"") + row
        return [frame for key, rows in groups.items() for frame in self.packets.group_frames(*key, rows)]

    def set_all(self, values: Mapping[int, int], name: str) -> None:
        """Write one register of many servos, read it back, and write again where it differs; raises as :meth:`get`."""
        self.put_all(values, name)
        has = self.get_all(list(values), name)
        self.each(
            [servo for servo, value in has.items() if value != values[servo]],
            lambda servo: self.put(servo, name, values[servo]),
        )

    def each(self, ids: Iterable[int], do: Callable[[int], T]) -> dict[int, T]:
        """Call ``do`` for every servo, also after a failure; return the results by id.

        Raises BusError after that if any failed: of the class of the first failure, naming every id that failed.
        """
        done: dict[int, T] = {}
        failed: dict[int, BusError] = {}
        for servo in ids:
            try:
                done[servo] = do(servo)
            except BusError as error:
                failed[servo] = error
        if failed:
            raise merge_errors(failed)
        return done

    # ------------------------------------------------------------------ checking replies

    def error(self, kind: type[E], message: str, hint: str, *ids: int) -> E:
        """Return an error that names this port and servos."""
        return kind(message, hint=hint, port=self.port.port_name, servo_ids=ids)

    def _spans(self, ids: Iterable[int], name: str) -> dict[tuple[int, int, str], list[int]]:
        groups: dict[tuple[int, int, str], list[int]] = {}
        for servo in self.having(ids, name):
            span = self.span(self.tables[servo], self._known(servo, name))
            if span[2]:
                groups.setdefault(span, []).append(servo)
        return groups

    def _known(self, servo: int, name: str) -> Item:
        item = self.item(servo, name)
        if item is None:
            raise ServoRefused(f"{self.tables[servo].model} has no {NAMES[name][0]}", servo_ids=(servo,))
        return item

    def _with_retries(self, servo: int, doing: str, ask: Callable[[], Exchange[R]], tries: int) -> R:
        corrupt = False
        for _ in range(tries):
            got = ask()
            reply = got.replies.get(servo)
            if reply is not None and not self.is_damaged(reply):
                self.note(servo, reply)
                return self._unless_refused(servo, doing, reply)
            corrupt |= got.corrupt or reply is not None
        raise self._no_reply(servo, doing, corrupt)

    def _unless_refused(self, servo: int, doing: str, reply: R) -> R:
        reason = self.refusal(reply)
        if not reason:
            return reply
        message = f"servo {self.label(servo)} on {self.port.port_name} refused {doing}: {reason}"
        raise self.error(ServoRefused, message, "`omote scan` shows its state", servo)

    def _no_reply(self, servo: int, doing: str, corrupt: bool) -> BusError:
        where = f"servo {self.label(servo)} on {self.port.port_name} at {self.port.baudrate} baud"
        if corrupt:
            hint = "two servos may have this id, or the baud rate is wrong: connect one alone, try `omote scan`"
            return self.error(CorruptReply, f"{where} gave a damaged answer to {doing}", hint, servo)
        hint = "check its power and cable; `omote scan` looks at every id and baud rate"
        return self.error(NoReply, f"{where} did not answer {doing}", hint, servo)
