"""Write the tables of docs/links.md from the registry of formats: ``python docs/make_links_matrix.py``.

One table lists the formats, the other says for every pair of them what of a face goes through. A test compares the page
with what this program writes, and sends faces through every pair.
"""
# ruff: noqa: T201 (a program that prints for people)

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from controller.base.parameters import PARAMETERS, Flags, Parameters
from controller.formats.format import FORMATS, Format

PAGE = Path(__file__).resolve().parent / "links.md"
BEGIN, END = "<!-- {}: written by docs/make_links_matrix.py -->", "<!-- end -->"


@cache
def with_own() -> Parameters:
    """The parameters, and behind them one of somebody's own."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "own.toml"
        path.write_text('[parameters.ownGlow]\nprofile = "mouth"\nregion = "nose"\n', encoding="ascii")
        return PARAMETERS.with_files([path])


def own() -> list[Format]:
    """The formats that omote brings, by kind."""
    return [FORMATS.get(kind) for kind in FORMATS.kinds() if not FORMATS.package_of(kind)]


def formats_table() -> str:
    """The formats: what they are, how they travel, what they carry."""
    rows = ["| kind | what it is | travels by | port | parameters | rounded to | |", "|---" * 7 + "|"]
    for form in own():
        count = amount(form.carries(PARAMETERS), form.about(PARAMETERS), more=names_any(form))
        port, exact = str(form.port or ""), f"{2 * form.quantum:g}" if form.quantum else "not"
        travels = ", ".join(form.transports)
        rows.append(f"| `{form.kind}` | {form.title} | {travels} | {port} | {count} | {exact} | {form.note} |")
    return "\n".join(rows)


def matrix_table() -> str:
    """How many parameters go through every pair, and how far values are rounded on the way."""
    forms = own()
    rows = [f"| from \\ to | {' | '.join(f'`{form.kind}`' for form in forms)} |", "|---" * (len(forms) + 1) + "|"]
    rows += [f"| `{one.kind}` | {' | '.join(pair(one, other) for other in forms)} |" for one in forms]
    return "\n".join(rows)


def pair(one: Format, other: Format) -> str:
    """One cell."""
    exact = one.carries(PARAMETERS) & other.carries(PARAMETERS)
    known = [form.carries(PARAMETERS) | form.about(PARAMETERS) for form in (one, other)]
    more = names_any(one) and names_any(other)
    count, rounded = amount(exact, known[0] & known[1] & ~exact, more=more), max(one.quantum, other.quantum)
    return f"{count}, ±{rounded:g}" if rounded and exact.any() else count


def names_any(form: Format) -> bool:
    """Whether a format has a name for parameters of somebody's own."""
    return bool(form.carries(with_own())[-1])


def amount(exact: Flags, about: Flags, *, more: bool) -> str:
    """How many parameters go through, a plus where all of somebody's own do, too, and how many in effect only."""
    counts = [f"{exact.sum()}{'+' if more else ''}"] if exact.any() else []
    return " + ".join([*counts, *([f"~{about.sum()}"] if about.any() else [])]) or "0"


def with_tables(text: str) -> str:
    """The page with its tables as they are now."""
    for name, table in (("formats", formats_table()), ("matrix", matrix_table())):
        begin = BEGIN.format(name)
        before, found, rest = text.partition(begin)
        if not found:
            raise ValueError(f"{PAGE}: there is no line {begin}")
        text = f"{before}{begin}\n\n{table}\n\n{END}{rest.partition(END)[2]}"
    return text


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"wrote {PAGE}", file=sys.stderr)
