"""What tests of garments share: the skin of a head of smooth forms."""

from __future__ import annotations

import pytest

from surface.fit.wardrobe.skin import Skin
from tests.surface.fit.wardrobe.made_skin import whole_skin


@pytest.fixture(scope="session")
def skin() -> Skin:
    """From the trunk to the crown."""
    return whole_skin()
