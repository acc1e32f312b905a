"""Format of Facemotion3d: the text of iFacialMocap, but with ``&`` between name and value and with ARKit's names."""

from __future__ import annotations

from functools import partial

from controller.formats.format import API, Format, base_only
from controller.formats.kinds.ifacialmocap_format import IFacialMocapDecoder, IFacialMocapEncoder

FORMAT = Format(
    api=API,
    kind="facemotion3d",
    title="Facemotion3d",
    transports=("udp",),
    port=49993,
    decoder=IFacialMocapDecoder,
    encoder=partial(IFacialMocapEncoder, separator="&", suffixed=False),
    carries=base_only,
    quantum=0.005,
    greeting=b"FACEMOTION3D_OtherStreaming",
    note="angles are not rounded",
)
