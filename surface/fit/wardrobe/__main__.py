"""``python -m surface.fit.wardrobe HEAD OUT [NAME ...]``: make all garments for a head, or those named."""

from __future__ import annotations

import sys
from pathlib import Path

from surface.fit.wardrobe import beards
from surface.fit.wardrobe.beards import BEARDS
from surface.fit.wardrobe.bun import bun
from surface.fit.wardrobe.clothes import NECKS, garment
from surface.fit.wardrobe.curls import afro, crop
from surface.fit.wardrobe.long import long
from surface.fit.wardrobe.short import short, swept, thin
from surface.fit.wardrobe.skin import Skin
from surface.fit.wardrobe.write import beard_fields, cloth_fields, hair_fields, write_garment
from surface.head import Head

STYLES = {
    "hair-short": short, "hair-swept": swept, "hair-thin": thin, "hair-long": long, "hair-bun": bun, "hair-crop": crop,
    "hair-afro": afro,
}  # fmt: skip


def main(head: str, out: str, *names: str) -> None:
    """Write the garments called ``names`` (all without any) for the head in folder ``head`` to folder ``out``."""
    skin = Skin(Head.load(head))
    for name, make in STYLES.items():
        if not names or name in names:
            style = make(skin)
            path = Path(out) / f"{name}.npz"
            parts = {"hair": ("strand", style.patches)}
            if style.hanging:
                parts["tresses"] = "tress", list(style.hanging)
            if style.strays:
                parts["strays"] = "tress", list(style.strays)
            pictures = hair_fields(skin, style.hairline, style.fade, [*style.patches, *style.hanging])
            write_garment(path, skin, parts, pictures)
    for name, neck in NECKS.items():
        if not names or name in names:
            parts = {"clothes": ("cloth", garment(skin, neck))}
            write_garment(Path(out) / f"{name}.npz", skin, parts, cloth_fields(skin, neck))
    for name, beard in BEARDS.items():
        if not names or name in names:
            parts = {"beard": ("strand", beards.garment(skin, beard))}
            write_garment(Path(out) / f"{name}.npz", skin, parts, beard_fields(skin, beard))


if __name__ == "__main__":
    main(*sys.argv[1:])
