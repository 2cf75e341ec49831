"""What somebody else says that recipes gave: believed in runs made from their bundle, and nowhere else.

A value is known by its digest and cannot be forged, but that a recipe gave this value is only a claim until it is
computed again. So the records of a bundle are not mixed with the store's own, where every later run would trust them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError
from pipeline.storage.files import write_text
from pipeline.storage.forms import read_json
from pipeline.storage.keys import digest
from pipeline.storage.record import Record, record_content, record_of
from pipeline.storage.store import Store

if TYPE_CHECKING:
    from pipeline.storage.mirror import Mirror


class StoreWithClaims(Store):
    """A store that also believes the records of one bundle.

    Parameters
    ----------
    root, mirror
        As of any store.
    claims : str
        Digest under which the records are kept.
    """

    def __init__(self, root: Path, mirror: Mirror | None, claims: str) -> None:
        super().__init__(root, mirror)
        self.claims = claims

    def record(self, key: str) -> Record | None:
        """The record that the bundle has of a recipe, or else the store's own."""
        return record_of(self._claimed.get(key), key) or super().record(key)

    @cached_property
    def _claimed(self) -> dict[str, Any]:
        try:
            found = read_json(_file(self.root, self.claims))
            return found if digest(found) == self.claims else {}
        except (OSError, ValueError, InputError):
            return {}

    def __reduce__(self) -> Any:
        return _of_this_process, (self.location, self.claims)


def store_with_claims(location: str | Path, claims: str) -> Store:
    """The store at a place, with the claims of that digest, or without any."""
    store = Store.at(location)
    return StoreWithClaims(store.root, store.mirror, claims) if claims else store


def keep_claims(root: Path, records: Iterable[Record]) -> str:
    """Keep records of somebody else's in a store and return the digest by which they are found again."""
    content = json.loads(json.dumps({record.key: record_content(record) for record in records}, sort_keys=True))
    name = digest(content)
    if not _file(root, name).is_file():
        write_text(_file(root, name), json.dumps(content))
    return name


@cache
def _of_this_process(location: str, claims: str) -> Store:
    return store_with_claims(location, claims)


def _file(root: Path, claims: str) -> Path:
    return root / "claims" / f"{claims}.json"
