"""Heads: parts, groups, parameters, and the files that hold them.

In: a head's folder and values of parameters. Out: vertices and normals of its parts. Imports base to dcp.
"""

from surface.head.model.data import Contact, Group, HeadData, Jaw, Neck, PartData, Rule, Seam
from surface.head.model.file import load_data, save_data
from surface.head.model.own_groups import OwnGroup
from surface.head.model.parameters import NAMES
from surface.head.posing.crowd import Crowd
from surface.head.posing.head import Head
from surface.head.posing.part import HeadPart

__all__ = [
    "NAMES",
    "Contact",
    "Crowd",
    "Group",
    "Head",
    "HeadData",
    "HeadPart",
    "Jaw",
    "Neck",
    "OwnGroup",
    "PartData",
    "Rule",
    "Seam",
    "load_data",
    "save_data",
]
