"""The angles of a folder of photographs without ``capture.yaml``, read from the names of the files.

The rule, in this order:

1. A number that a word tags is the angle: ``psi_015.tif``, ``pol-22.5.png``, ``angle45.exr``, ``IMG_0007_22.5deg.tif``.
   The words are psi, pol, polar, polarizer, polariser, angle and ang before the number, or deg, degree and degrees
   after it. Straight after a word ``-`` is a hyphen; a minus sign stands behind ``_`` or ``=``, as in ``psi_-15.tif``,
   or begins the name, as in ``-15deg.tif``.
2. Otherwise the names must be alike but for one number: ``scene_0.tif``, ``scene_45.tif``, ``scene_90.tif``. It counts
   as the angle only where the numbers stand evenly, at least 3 degrees apart and below 360, unlike a camera's counter.

Files whose names begin with ``mask``, ``dark`` or ``flat`` are those of ``capture.yaml``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from pipeline.devices.capture_yaml import CAPTURE_FILE, Capture, PhotoEntry
from pipeline.devices.decimal_angles import radians_of
from pipeline.errors import InputError, InputErrors, nearest

_LEAST_STEP_DEG = 3.0
_NUMBER = r"\d+(?:[.,]\d+)?"
_BEFORE = re.compile(
    rf"(?<![a-z])(?:psi|polari[sz]er|polar|pol|angle|ang)(?:[_=](?P<signed>-?{_NUMBER})|[- ]?(?P<plain>{_NUMBER}))",
    re.IGNORECASE,
)
_AFTER = re.compile(
    rf"(?<![\d.,])(?P<plain>(?:(?<=[_=])-|^-)?{_NUMBER}) ?(?:degrees|degree|deg|°)(?![a-z])", re.IGNORECASE
)
_ANY = re.compile(_NUMBER)


def capture_from_names(folder: Path, suffixes: Iterable[str]) -> Capture:
    """Take the photographs of a folder and their angles from the names of its files.

    Parameters
    ----------
    folder : Path
        The folder.
    suffixes : iterable of str
        Endings of the files that are photographs.

    Raises
    ------
    InputErrors
        There is no photograph, or the names do not say the angles without doubt.
    """
    endings = frozenset(suffixes)
    files = sorted(p for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))
    pictures = [p for p in files if p.suffix.lower() in endings]
    special = {word: tuple(p for p in pictures if p.name.lower().startswith(word)) for word in ("mask", "dark", "flat")}
    photos = [p for p in pictures if not any(p in group for group in special.values())]
    if not photos:
        other = [p.name for p in files]
        raise InputErrors(
            [
                InputError(
                    "the folder is empty" if not other else f"there is no photo among the {len(other)} files",
                    where=str(folder),
                    expected=f"photographs, with {CAPTURE_FILE} or with their angles in the names: psi_015.tif",
                    hint=nearest(CAPTURE_FILE, other) if any("capture" in name.lower() for name in other) else "",
                )
            ]
        )
    if len(special["mask"]) > 1:
        names = ", ".join(p.name for p in special["mask"])
        raise InputErrors([InputError(f"several masks: {names}", where=str(folder), expected="one")])
    angles = angles_from_names([p.name for p in photos], folder)
    entries = [PhotoEntry(p, radians_of(a), where=str(p)) for p, a in zip(photos, angles, strict=True)]
    return Capture(
        source=folder,
        photos=tuple(sorted(entries, key=lambda entry: entry.polarizer_rad or 0.0)),
        mask=next(iter(special["mask"]), None),
        dark=special["dark"],
        flat=special["flat"],
    )


def angles_from_names(names: list[str], folder: Path) -> list[str]:
    """Angle in degrees that each name carries, by the rule above, as a decimal.

    Raises
    ------
    InputErrors
        The names do not say the angles without doubt.
    """
    stems = [Path(name).stem for name in names]
    tagged = [_tagged(stem) for stem in stems]
    if all(len(found) == 1 for found in tagged):
        return [found[0] for found in tagged]
    if any(tagged):
        raise InputErrors(
            _problem(
                f"'{name}' has {len(found) or 'no'} number{'s' if len(found) > 1 else ''} that a word tags as an angle",
                folder,
            )
            for name, found in zip(names, tagged, strict=True)
            if len(found) != 1
        )
    return _untagged(names, stems, folder)


def _tagged(stem: str) -> list[str]:
    found = {m.span("signed") if m["signed"] else m.span("plain") for m in _BEFORE.finditer(stem)}
    found |= {m.span("plain") for m in _AFTER.finditer(stem)}
    ends = {end: max(start for start, e in found if e == end) for _, end in found}
    return [stem[start:end].replace(",", ".") for end, start in ends.items()]


def _untagged(names: list[str], stems: list[str], folder: Path) -> list[str]:
    frames = {_ANY.sub("#", stem) for stem in stems}
    numbers = [_ANY.findall(stem) for stem in stems]
    if len(frames) > 1:
        raise InputErrors([_problem(f"the names are not alike: {_some(names)}", folder)])
    differing = [column for column in zip(*numbers, strict=True) if len(set(column)) > 1]
    if len(differing) != 1:
        count = len(differing) or "no"
        raise InputErrors([_problem(f"the names differ in {count} numbers: {_some(names)}", folder)])
    angles = [text.replace(",", ".") for text in differing[0]]
    values = np.sort([float(text) for text in angles])
    steps = np.diff(values)
    if values[-1] >= 360 or steps.min() < _LEAST_STEP_DEG or not np.allclose(steps, steps[0]):
        raise InputErrors([_problem(f"the numbers look like a counter, not like angles: {_some(names)}", folder)])
    return angles


def _some(names: list[str]) -> str:
    return ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")


def _problem(what: str, folder: Path) -> InputError:
    return InputError(
        f"no {CAPTURE_FILE}, and {what}",
        where=str(folder),
        expected="one angle in each name, such as psi_015.tif or IMG_0007_22.5deg.tif",
        hint=f"name the files and their angles in {CAPTURE_FILE}: photos: [{{file: a.tif, polarizer_deg: 0}}, ...]",
    )
