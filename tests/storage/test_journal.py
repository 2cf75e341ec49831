"""What a capture has taken is recalled as it was taken, or taken again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.data.photographs import Photo
from pipeline.storage.journal import Journal
from pipeline.storage.store import data_types


def photo(number: int) -> Photo:
    return Photo(np.full((2, 3), number, np.float32), np.zeros((2, 3), bool), 0.5, {"iso": "100"})


@pytest.mark.parametrize(
    ("old", "new"), [('"100"', '"900"'), ("0x1.0000000000000p-1", "0x1.0000000000000p-2"), ("}", "")]
)
def test_a_photograph_whose_description_changed_is_taken_again(tmp_path: Path, old: str, new: str) -> None:
    for index in range(3):
        Journal(tmp_path, data_types()).step(index, lambda i=index: photo(i))
    (meta,) = tmp_path.glob("0001-*/meta.json")
    meta.write_text(meta.read_text().replace(old, new))
    taken = []
    journal = Journal(tmp_path, data_types())
    for index in range(3):
        found = journal.step(index, lambda i=index: taken.append(i) or photo(i))
        assert (found.image[0, 0], found.exposure_s, found.metadata) == (index, 0.5, {"iso": "100"})
    assert (taken, journal.recalled) == ([1], 2)


def test_nothing_is_left_of_a_photograph_that_failed(tmp_path: Path) -> None:
    journal = Journal(tmp_path, data_types())
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        journal.step(0, lambda: 1 / 0)
    assert list(tmp_path.rglob("*")) == []
