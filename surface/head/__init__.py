"""The head: parts, groups, parameters, and the file they are kept in."""

from surface.head.data import Contact, Group, HeadData, Jaw, Neck, PartData, Rule, Seam
from surface.head.file import load_data, save_data
from surface.head.head import Head
from surface.head.parameters import NAMES
from surface.head.part import HeadPart

__all__ = [
    "NAMES",
    "Contact",
    "Group",
    "Head",
    "HeadData",
    "HeadPart",
    "Jaw",
    "Neck",
    "PartData",
    "Rule",
    "Seam",
    "load_data",
    "save_data",
]
