"""controller.formats.kinds.facemotion3d_format: what is not said by the tests of all formats."""

from __future__ import annotations

from controller.formats.format import FORMATS


def test_the_port_is_the_one_that_the_program_sends_to() -> None:
    """Facemotion3d's documentation: UDP, port 49993."""
    assert FORMATS.get("facemotion3d").port == 49993
