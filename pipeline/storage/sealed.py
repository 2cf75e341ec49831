"""JSON that says whether it is what was written: a digest of all that follows stands at its head."""

from __future__ import annotations

import json
from typing import Any

from pipeline.storage.keys import DIGEST_CHARACTERS, digest_bytes

_KEY = "digest of what follows"
_HEAD = f'{{"{_KEY}": "'.encode()
_BODY = len(_HEAD) + DIGEST_CHARACTERS


def sealed(text: str) -> str:
    """A JSON object, given as text, with its seal."""
    body = '", ' + text[1:] if text != "{}" else '"}'
    return _HEAD.decode() + digest_bytes(body.encode()) + body


def unsealed(data: bytes) -> dict[str, Any]:
    """The object in a sealed text, without its seal; what has none is taken as it is.

    Raises
    ------
    ValueError
        It is no JSON object, or not what was sealed.
    """
    if data.startswith(_HEAD) and digest_bytes(data[_BODY:]).encode() != data[len(_HEAD) : _BODY]:
        raise ValueError("it is not what was written")
    content = json.loads(data)
    if not isinstance(content, dict):
        raise ValueError("it is no JSON object")
    content.pop(_KEY, None)
    return content
