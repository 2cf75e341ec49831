"""Sealed JSON: what was changed since is noticed, wherever it was changed."""

from __future__ import annotations

import json

import pytest

from pipeline.storage.sealed import _HEAD, sealed, unsealed

CONTENT = {"metrics": {"mean_um": 1.25}, "nodes": [{"name": "raw", "text": 'µ \\ "quoted"'}], "none": None}


@pytest.mark.parametrize("content", [CONTENT, {}])
def test_it_comes_back_and_is_plain_json_to_others(content: dict[str, object]) -> None:
    text = sealed(json.dumps(content))
    assert unsealed(text.encode()) == content
    assert json.loads(text).items() >= content.items()


def test_no_flip_of_a_bit_gives_other_content() -> None:
    data = sealed(json.dumps(CONTENT)).encode()
    noticed = 0
    for place in range(len(data)):
        for bit in range(8):
            flipped = bytearray(data)
            flipped[place] ^= 1 << bit
            try:
                found = unsealed(bytes(flipped))
            except ValueError:
                noticed += 1
            else:
                assert {name: found[name] for name in CONTENT} == CONTENT
    assert noticed >= 8 * (len(data) - len(_HEAD))


def test_no_part_of_it_is_taken_for_the_whole() -> None:
    data = sealed(json.dumps(CONTENT)).encode()
    for length in range(len(data)):
        with pytest.raises(ValueError, match=r"it is not what was written|line 1 column"):
            unsealed(data[:length])


def test_what_was_never_sealed_is_read() -> None:
    assert unsealed(b'{"format": 1}') == {"format": 1}
    with pytest.raises(ValueError, match="it is no JSON object"):
        unsealed(b"[1]")
