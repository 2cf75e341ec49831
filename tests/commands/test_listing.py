"""What there is: surfaces and maps are listed and shown as experiments are."""

from __future__ import annotations

import pytest

from pipeline.commands.listing import LISTS, Places, manual
from pipeline.errors import InputError


def test_maps_are_listed_and_shown() -> None:
    listed = dict(LISTS["maps"](Places()))
    assert listed["vector"] == (
        "A design of vectors: python -m pipeline +experiment=edit_periods maps=vector graph.sample.file=design.svg"
    )
    assert "stage: simulate.vector_design" in manual("vector")


def test_surfaces_are_listed_and_shown() -> None:
    listed = dict(LISTS["surfaces"](Places()))
    assert listed["file"].startswith(
        "A height map of your own: python -m pipeline +experiment=height_field surface=file"
    )
    for name in listed:
        assert "\nstage: " in manual(name)
    with pytest.raises(InputError, match=r"surface or rig 'zenopeltis'[\s\S]*did you mean 'xenopeltis'"):
        manual("zenopeltis")
