"""Fabrication defects, drawn where they are asked for or at random places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.data.arrays import BoolArray
from pipeline.data.gratings import GratingSample
from pipeline.data.inspection import Defects
from pipeline.errors import InputError, nearest
from pipeline.limits import above_zero, refuse, zero_or_more
from pipeline.optics.regions import described

KINDS = ("missing", "turned", "period", "scratch")
_NEEDED = {
    "missing": {"kind", "x_mm", "y_mm"},
    "turned": {"kind", "x_mm", "y_mm", "turn_deg"},
    "period": {"kind", "x_mm", "y_mm", "period_factor"},
    "scratch": {"kind", "x_mm", "y_mm", "size_mm", "direction_deg"},
}
_POSSIBLE = {
    "missing": {"size_mm"},
    "turned": {"size_mm"},
    "period": {"size_mm"},
    "scratch": {"thickness_mm"},
}
_SCRATCH_MM = 0.06
_ATTEMPTS = 5000


@dataclass(frozen=True)
class _Wanted:
    """One defect: a disc, a scratch, or (without a size) the whole facet at its place."""

    kind: str
    x_mm: float
    y_mm: float
    size_mm: float | None = None
    turn_deg: float = 0.0
    period_factor: float = 1.0
    direction_deg: float = 0.0
    thickness_mm: float = _SCRATCH_MM


def defects(
    sample: GratingSample,
    *,
    listed: Sequence[Mapping[str, float | str]] = (),
    count: int = 0,
    kinds: Sequence[str] = ("missing", "turned", "period", "scratch"),
    size_mm: float = 0.3,
    turn_deg: float = 5.0,
    period_factor: float = 0.9,
    apart_mm: float = 0.5,
    seed: int = 0,
) -> Defects:
    """Plan defects of a sample: those that are listed, and others at random places of its gratings.

    Only gratings can be damaged: of a disc or scratch that reaches over the ground, what lies on gratings counts.

    Parameters
    ----------
    sample : GratingSample
        The product as it should be, of shape (M, N).
    listed : sequence of mappings
        Each with ``kind``, ``x_mm`` and ``y_mm`` (x right, y up, origin at the centre). ``missing``, ``turned`` (by
        ``turn_deg``, anticlockwise) and ``period`` (times ``period_factor``) take a disc of diameter ``size_mm``, or
        without one the whole facet at that place. A ``scratch`` is ``size_mm`` long and ``thickness_mm`` wide (0.06 by
        default), along ``direction_deg``, anticlockwise from +x.
    count : int
        Random defects besides, of the ``kinds`` in turn, all of ``size_mm``, ``turn_deg`` (of either sign) and
        ``period_factor``; scratches lie in random directions.
    kinds : sequence of str
        Of the random ones.
    size_mm, turn_deg, period_factor : float
        Of the random ones.
    apart_mm : float
        Least distance between the rims of random defects, and of their discs from the listed places.
    seed : int
        Of places, signs and directions.

    Returns
    -------
    Defects
        On the sample's grid; centre, area and width are those of what is really damaged.

    Raises
    ------
    InputError, InputErrors
        A defect with a wrong kind or size, one that touches no grating or lies under another, or no room for so many.
    """
    _check_defects(
        listed=listed,
        count=count,
        kinds=kinds,
        size_mm=size_mm,
        turn_deg=turn_deg,
        period_factor=period_factor,
        apart_mm=apart_mm,
        seed=seed,
    )
    wanted = [_Wanted(**one) for one in listed]  # type: ignore[arg-type]
    facets = _Facets(sample)
    labels = np.zeros(sample.orientation_rad.shape, np.int32)
    for index, one in enumerate(wanted):
        area = facets.damaged_by(one) & (labels == 0)
        if not area.any():
            raise InputError(
                f"a {one.kind} defect at ({one.x_mm:g}, {one.y_mm:g}) mm damages nothing",
                where=f"listed[{index}]",
                expected="a place on a grating that no earlier defect takes, and a size of a point or more",
            )
        labels[area] = index + 1
    random = np.random.default_rng(seed)
    listed_count = len(wanted)
    free_mm = ndimage.distance_transform_edt(labels == 0) * sample.pixel_mm if wanted and count else None
    for index in range(count):
        model = _random_defect(random, kinds[index % len(kinds)], size_mm, turn_deg, period_factor)
        one = _placed(random, model, facets, free_mm, wanted[listed_count:], size_mm, apart_mm)
        area = facets.damaged_by(one) & (labels == 0)
        wanted.append(one)
        labels[area] = len(wanted)
    regions = described(labels, len(wanted), sample.pixel_mm)
    grating = np.array([one.kind in {"turned", "period"} for one in wanted], bool)
    return Defects(
        kind=tuple(one.kind for one in wanted),
        centre_mm=regions.centre_mm,
        area_mm2=regions.area_mm2,
        width_mm=regions.width_mm,
        turn_rad=np.where(grating, np.deg2rad([one.turn_deg for one in wanted]), np.nan),
        period_ratio=np.where(grating, [one.period_factor for one in wanted], np.nan),
        significance=np.full(len(wanted), np.nan),
        labels=labels,
        pixel_mm=sample.pixel_mm,
    )


def _check_defects(
    *,
    listed: Sequence[Mapping[str, float | str]],
    count: int,
    kinds: Sequence[str],
    size_mm: float,
    turn_deg: float,
    period_factor: float,
    apart_mm: float,
    seed: int,
) -> None:
    """Refuse what is no defect, before anything runs."""
    problems = [problem for index, one in enumerate(listed) for problem in _wrong(one, f"listed[{index}]")]
    problems += [_unknown(kind, f"kinds[{index}]") for index, kind in enumerate(kinds) if kind not in KINDS]
    if count and not kinds:
        problems.append(InputError("kinds is empty", where="kinds", expected="one kind or more of " + ", ".join(KINDS)))
    refuse(
        problems,
        zero_or_more(count=count, apart_mm=apart_mm, seed=seed),
        above_zero(size_mm=size_mm, period_factor=period_factor),
        _no_turn(turn_deg, "turn_deg") if "turned" in kinds else [],
    )


def _wrong(one: Mapping[str, float | str], where: str) -> list[InputError]:
    """What is wrong with one listed defect."""
    kind = str(one.get("kind"))
    if kind not in KINDS:
        return [_unknown(kind, f"{where}.kind")]
    needed, names = _NEEDED[kind], set(one)
    allowed = needed | _POSSIBLE[kind]
    problems = [
        InputError(f"a {kind} defect has no {name}", where=where, expected=", ".join(sorted(needed)))
        for name in sorted(needed - names)
    ]
    problems += [
        InputError(
            f"a {kind} defect has a {name}",
            where=where,
            expected=", ".join(sorted(allowed)),
            hint=nearest(name, allowed),
        )
        for name in sorted(names - allowed)
    ]
    for name in sorted((names & allowed) - {"kind"}):
        value = one[name]
        if isinstance(value, str):
            problems.append(InputError(f"{name} is '{value}'", where=f"{where}.{name}", expected="a number"))
        elif name in {"size_mm", "thickness_mm", "period_factor"} and value <= 0:
            problems.append(InputError(f"{name} is {value:g}", where=f"{where}.{name}", expected="a number above 0"))
        elif name == "turn_deg":
            problems += _no_turn(value, f"{where}.{name}")
    return problems


def _no_turn(turn_deg: float, where: str) -> list[InputError]:
    if turn_deg % 180 == 0 or abs(turn_deg) > 90:
        return [InputError(f"turn_deg is {turn_deg:g}", where=where, expected="-90 to 90, and not 0")]
    return []


def _unknown(kind: str, where: str) -> InputError:
    return InputError(f"there is no defect '{kind}'", where=where, expected=", ".join(KINDS), hint=nearest(kind, KINDS))


class _Facets:
    """The sample's gratings, and which of their points a defect takes."""

    def __init__(self, sample: GratingSample) -> None:
        self.sample = sample
        rows, columns = sample.orientation_rad.shape
        self.x_mm = (np.arange(columns) - (columns - 1) / 2) * sample.pixel_mm
        self.y_mm = ((rows - 1) / 2 - np.arange(rows)) * sample.pixel_mm
        self.places = np.flatnonzero(sample.diffracts)

    def damaged_by(self, one: _Wanted) -> BoolArray:
        """Points with a grating that the defect takes."""
        if one.size_mm is None:
            return self._whole(one.x_mm, one.y_mm)
        reach = np.hypot(one.size_mm, one.thickness_mm) / 2
        rows = slice(*np.searchsorted(-self.y_mm, [-one.y_mm - reach, -one.y_mm + reach]))
        columns = slice(*np.searchsorted(self.x_mm, [one.x_mm - reach, one.x_mm + reach]))
        right, up = self.x_mm[columns] - one.x_mm, (self.y_mm[rows] - one.y_mm)[:, None]
        if one.kind == "scratch":
            direction = np.deg2rad(one.direction_deg)
            along = right * np.cos(direction) + up * np.sin(direction)
            across = up * np.cos(direction) - right * np.sin(direction)
            shape = (np.abs(along) <= one.size_mm / 2) & (np.abs(across) <= one.thickness_mm / 2)
        else:
            shape = right**2 + up**2 <= (one.size_mm / 2) ** 2
        damaged = np.zeros(self.sample.orientation_rad.shape, np.bool_)
        damaged[rows, columns] = shape & np.isfinite(self.sample.orientation_rad[rows, columns])
        return damaged

    def _whole(self, x_mm: float, y_mm: float) -> BoolArray:
        """The connected points of the orientation and period at a place."""
        row, column = int(np.argmin(np.abs(self.y_mm - y_mm))), int(np.argmin(np.abs(self.x_mm - x_mm)))
        same = (self.sample.orientation_rad == self.sample.orientation_rad[row, column]) & (
            self.sample.period_um == self.sample.period_um[row, column]
        )
        joined, _ = ndimage.label(same)
        return np.asarray(same & (joined == joined[row, column]))


def _random_defect(
    random: np.random.Generator, kind: str, size_mm: float, turn_deg: float, period_factor: float
) -> _Wanted:
    """A defect that has no place yet."""
    sign, direction = float(random.choice([-1.0, 1.0])), float(random.uniform(0, 180))
    if kind == "turned":
        return _Wanted(kind, 0, 0, size_mm, turn_deg=sign * turn_deg)
    if kind == "period":
        return _Wanted(kind, 0, 0, size_mm, period_factor=period_factor)
    return _Wanted(kind, 0, 0, size_mm, direction_deg=direction)


def _placed(
    random: np.random.Generator,
    one: _Wanted,
    facets: _Facets,
    free_mm: NDArray[np.float64] | None,
    others: Sequence[_Wanted],
    size_mm: float,
    apart_mm: float,
) -> _Wanted:
    """The defect with its centre on a grating, away from the listed ones and from all others of its size."""
    for _ in range(_ATTEMPTS if len(facets.places) else 0):
        place = int(facets.places[random.integers(len(facets.places))])
        row, column = divmod(place, len(facets.x_mm))
        x_mm, y_mm = float(facets.x_mm[column]), float(facets.y_mm[row])
        if free_mm is not None and free_mm[row, column] < size_mm / 2 + apart_mm:
            continue
        if any(np.hypot(x_mm - other.x_mm, y_mm - other.y_mm) < size_mm + apart_mm for other in others):
            continue
        return replace(one, x_mm=x_mm, y_mm=y_mm)
    raise InputError(
        f"no room for another defect of {size_mm:g} mm", expected="fewer or smaller defects, or a smaller apart_mm"
    )
