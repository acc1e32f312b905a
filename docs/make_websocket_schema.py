"""Writes docs/websocket.schema.json from the messages' models: ``python -m docs.make_websocket_schema``."""

from __future__ import annotations

import json
from pathlib import Path

from controller.links.websocket.messages import schema


def main() -> None:
    """Write the file."""
    path = Path(__file__).parent / "websocket.schema.json"
    path.write_text(json.dumps(schema(), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
