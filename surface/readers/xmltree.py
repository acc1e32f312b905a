"""A small XML tree that knows the line of every element, for error messages."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np

from surface.base.arrays import Floats

from .named import Place


@dataclass
class Element:
    """One element: tag, attributes, text before and between its children, and children in order."""

    place: Place
    tag: str
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """All character data that is not a child's."""
        return "".join(self.parts)

    def all(self, tag: str) -> list[Element]:
        """Children of that tag."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> Element:
        """The first child of that tag; ``SurfaceFileError`` if there is none."""
        found = self.all(tag)
        if not found:
            raise self.place.error(f"has no <{tag}>")
        return found[0]

    def get(self, name: str) -> str:
        """An attribute; ``SurfaceFileError`` if it is missing."""
        if name not in self.attributes:
            raise self.place.error(f'has no attribute "{name}"')
        return self.attributes[name]

    def integer(self, name: str, low: int, high: int) -> int:
        """A whole number in an attribute, ``low`` to ``high``."""
        text = self.get(name)
        if not text.strip().isdecimal() or not low <= int(text) <= high:
            raise self.place.error(f'{name}="{text}" must be a whole number from {low} to {high}')
        return int(text)

    def numbers(self, count: int | None = None) -> Floats:
        """(k,) finite numbers of the text; ``SurfaceFileError`` for others, or for another count."""
        if self.attributes.get("format", "ascii").lower() != "ascii":
            raise self.place.error(f'format="{self.attributes["format"]}" is not read', hint="write it as ASCII")
        words = self.text.split()
        try:
            row = np.array([float(word) for word in words])
        except ValueError as error:
            raise self.place.error(f"holds what is not a number ({error})") from error
        if not np.isfinite(row).all():
            raise self.place.error(f"holds {words[int(np.argmin(np.isfinite(row)))]}; numbers must be finite")
        if count is not None and len(row) != count:
            raise self.place.error(f"holds {len(row)} numbers, needs {count}")
        return row


def parse(place: Place, text: str) -> Element:
    """The root element; ``SurfaceFileError`` with the line where the text is no XML."""
    parser = expat.ParserCreate()
    body = text.lstrip()  # G+Smo writes lines before the declaration, which XML forbids
    skipped = text[: len(text) - len(body)].count("\n")
    root = Element(place, "", {})
    stack = [root]

    def start(tag: str, attributes: dict[str, str]) -> None:
        here = place.at(f"line {parser.CurrentLineNumber + skipped} <{tag}>")
        stack.append(Element(here, tag, attributes))
        stack[-2].children.append(stack[-1])

    def refuse(name: str, *_: object) -> None:
        raise place.at(f"line {parser.CurrentLineNumber + skipped}").error(
            f"declares an entity ({name}), which is not read"
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: stack.pop()
    parser.CharacterDataHandler = lambda data: stack[-1].parts.append(data)
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(body.encode("utf-8"), True)
    except expat.ExpatError as error:
        why = expat.errors.messages[error.code]
        raise place.at(f"line {error.lineno + skipped}").error(f"is not XML: {why}") from error
    return root.children[0]
