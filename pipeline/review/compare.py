"""Two values of one node, field by field: identical, or by how much they differ."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np

CYCLES: Mapping[str, float] = {
    "orientation_rad": math.pi,
    "film_axis_rad": math.pi,
    "error_rad": math.pi,
    "offset_rad": math.pi,
    "offset_deg": 180.0,
    "phase_rad": 2 * math.pi,
}
"""Fields that come round to the same after so much: an orientation of 0 is one of pi."""

_CHUNK = 1 << 20


@dataclass(frozen=True)
class Difference:
    """How one field of a value differs.

    Attributes
    ----------
    field : str
        Dotted path of the field; empty for the value itself.
    change : str
        What changed, in words, where that can be said: other types, shapes, texts, the two figures.
    largest : float or None
        Largest absolute difference between elements that are numbers in both; None where nothing can be subtracted.
    relative : float or None
        Largest difference relative to the larger of the two; None where largest is, and for angles.
    share : float
        Share of the elements that differ.
    only_nan : int
        Elements that are NaN in one of the two only.
    tolerance : float or None
        Largest absolute difference that the stage allows; None where it allows none.
    """

    field: str
    change: str = ""
    largest: float | None = None
    relative: float | None = None
    share: float = 1.0
    only_nan: int = 0
    tolerance: float | None = None

    @property
    def tolerated(self) -> bool:
        """Whether the stage allows it."""
        if self.tolerance is None or self.largest is None or self.only_nan:
            return False
        return self.largest <= self.tolerance

    def __str__(self) -> str:
        parts = [self.change] if self.change else [f"{_percent(self.share)} of the elements differ"]
        if self.largest is not None:
            allowed = "" if self.tolerance is None else f" of {self.tolerance:g} allowed"
            relative = "" if self.relative is None else f" (relative {self.relative:.3g})"
            parts.append(f"by up to {self.largest:.3g}{allowed}{relative}")
        if self.only_nan:
            parts.append(f"{self.only_nan} are NaN in one only")
        return f"{self.field}: {', '.join(parts)}" if self.field else ", ".join(parts)


def compare(then: Any, now: Any, tolerance: Mapping[str, float] | None = None) -> tuple[Difference, ...]:
    """How two values differ, field by field; nothing exactly when they have the same digest.

    Parameters
    ----------
    then, now : values of :mod:`pipeline.data`
        The values; arrays may be memory-mapped, and are read piece by piece.
    tolerance : mapping of str to float, optional
        Largest absolute difference allowed per field; a name counts for all that is inside it.
    """
    return tuple(_differences("", then, now, tolerance or {}))


def checked_tolerance(stated: Any, stage: str) -> Mapping[str, float]:
    """The tolerance that stands beside a stage, as ``_tolerance_<stage>``; nothing is tolerated where none does.

    Raises
    ------
    InputError
        It is no mapping of fields to differences from 0.
    """
    if stated is None:
        return {}
    numbers = isinstance(stated, Mapping) and all(
        isinstance(name, str) and isinstance(most, int | float) and not isinstance(most, bool) and most >= 0
        for name, most in stated.items()
    )
    if not numbers:
        raise InputError(
            f"the tolerance of {stage} is {stated!r}",
            expected="a dict from fields to their largest absolute difference: {'orientation_rad': 1e-5}",
        )
    return dict(stated)


def _differences(path: str, then: Any, now: Any, tolerance: Mapping[str, float]) -> Iterator[Difference]:
    import numpy as np

    then, now = (value.item() if isinstance(value, np.generic) else value for value in (then, now))
    if isinstance(then, np.ndarray) and isinstance(now, np.ndarray):
        yield from _of_arrays(path, then, now, tolerance)
    elif is_dataclass(then) and type(then) is type(now):
        for field in fields(then):
            yield from _differences(
                _join(path, field.name), getattr(then, field.name), getattr(now, field.name), tolerance
            )
    elif isinstance(then, Mapping) and isinstance(now, Mapping):
        for name in dict.fromkeys([*then, *now]):
            inner = _join(path, name if name.isprintable() else repr(name))
            if name in then and name in now:
                yield from _differences(inner, then[name], now[name], tolerance)
            else:
                yield Difference(inner, "only the first has it" if name in then else "only the second has it")
    elif isinstance(then, list | tuple) and isinstance(now, list | tuple):
        if len(then) != len(now):
            yield Difference(path, f"{len(then)} items -> {len(now)}")
        for index, pair in enumerate(zip(then, now, strict=False)):
            yield from _differences(_join(path, str(index)), *pair, tolerance)
    elif type(then) is not type(now):
        yield Difference(path, f"{_short(then)} -> {_short(now)}")
    elif isinstance(then, int | float) and not isinstance(then, bool):
        yield from _of_numbers(path, then, now, tolerance)
    elif then != now:
        yield Difference(path, f"{_short(then)} -> {_short(now)}")


def _of_numbers(path: str, then: float, now: float, tolerance: Mapping[str, float]) -> Iterator[Difference]:
    if then == now and math.copysign(1, then) == math.copysign(1, now):
        return
    if isinstance(then, float) and struct.pack(">d", then) == struct.pack(">d", now):
        return
    if math.isnan(then) or math.isnan(now):
        if not (math.isnan(then) and math.isnan(now)):
            yield Difference(path, f"{then:.9g} -> {now:.9g}", tolerance=_allowed(path, tolerance))
        return
    cycle = _cycle(path)
    apart = 0.0 if then == now else float(abs(then - now))
    largest = abs(math.remainder(apart, cycle)) if cycle and math.isfinite(apart) else apart
    yield Difference(
        path,
        f"{then:.9g} -> {now:.9g}",
        largest,
        None if cycle else largest / max(abs(then), abs(now)) if largest and math.isfinite(largest) else largest,
        tolerance=_allowed(path, tolerance),
    )


def _of_arrays(path: str, then: np.ndarray, now: np.ndarray, tolerance: Mapping[str, float]) -> Iterator[Difference]:
    if then.shape != now.shape:
        yield Difference(path, f"shape {then.shape} -> {now.shape}")
        return
    if then.dtype != now.dtype:
        yield Difference(path, f"type {then.dtype} -> {now.dtype}")
        return
    tally = _Tally(_cycle(path))
    a, b = then.reshape(-1), now.reshape(-1)
    for start in range(0, a.size, _CHUNK):
        tally.add(a[start : start + _CHUNK], b[start : start + _CHUNK])
    if not tally.unequal_bytes:
        return
    yield Difference(
        path,
        "" if tally.different else "only the signs of zeros or the bits of NaNs differ",
        None if then.dtype.kind in "bUS" else tally.largest,
        None if then.dtype.kind in "bUS" or tally.cycle else tally.relative,
        tally.different / a.size,
        tally.only_nan,
        _allowed(path, tolerance),
    )


@dataclass
class _Tally:
    """What was found so far in the pieces of two arrays."""

    cycle: float | None
    unequal_bytes: bool = False
    different: int = 0
    only_nan: int = 0
    largest: float = 0.0
    relative: float = 0.0

    def add(self, then: np.ndarray, now: np.ndarray) -> None:
        import numpy as np

        if then.tobytes() == now.tobytes():
            return
        self.unequal_bytes = True
        if then.dtype.kind in "bUS":
            self.different += int(np.count_nonzero(then != now))
            return
        nan = np.isnan(then), np.isnan(now)
        self.only_nan += int(np.count_nonzero(nan[0] != nan[1]))
        differ = (then != now) & ~(nan[0] & nan[1])
        self.different += int(np.count_nonzero(differ))
        differ &= ~(nan[0] | nan[1])
        if not differ.any():
            return
        wide = np.complex128 if then.dtype.kind == "c" else np.longdouble if then.dtype.kind in "iu" else np.float64
        a, b = then[differ].astype(wide), now[differ].astype(wide)
        with np.errstate(invalid="ignore", over="ignore"):
            apart = np.abs(a - b)
            if self.cycle:
                apart = np.abs(apart - self.cycle * np.round(apart / self.cycle))
            scaled = apart / np.maximum(np.abs(a), np.abs(b))
        self.largest = max(self.largest, float(np.max(np.where(np.isnan(apart), np.inf, apart))))
        self.relative = max(self.relative, float(np.max(np.where(np.isnan(scaled), 1.0, scaled))))


def _cycle(path: str) -> float | None:
    names = [part for part in path.split(".") if not part.isdigit()]
    return CYCLES.get(names[-1]) if names else None


def _allowed(path: str, tolerance: Mapping[str, float]) -> float | None:
    while path:
        if path in tolerance:
            return float(tolerance[path])
        path = path.rpartition(".")[0]
    return None


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


def _short(value: object) -> str:
    text = type(value).__name__ if is_dataclass(value) or hasattr(value, "dtype") else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
