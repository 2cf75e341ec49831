"""Limits of settings: what lies beyond them is refused by name and value, with what was expected, before anything runs.

A stage's ``_check_<name>`` or a device's ``check()`` hands what the functions here find to :func:`refuse`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from pipeline.errors import InputError, InputErrors


def different_shapes(**maps: tuple[int, ...]) -> InputError:
    """That maps, told by their shapes of rows and columns, do not lie on each other."""
    sizes = ", ".join(f"{name} {shape[1]} x {shape[0]} points" for name, shape in maps.items())
    return InputError(f"the maps differ in shape: {sizes}", expected="as many columns and rows in each")


def above_zero(**settings: float | None) -> list[InputError]:
    """Settings that are not above 0; None stands for one that is left out."""
    return _beyond(lambda value: value > 0, "a number above 0", settings)


def zero_or_more(**settings: float | None) -> list[InputError]:
    """Settings below 0; None stands for one that is left out."""
    return _beyond(lambda value: value >= 0, "0 or more", settings)


def at_least(least: float, reason: str, /, **settings: float | None) -> list[InputError]:
    """Settings below ``least``, which is there for a reason; None stands for one that is left out."""
    return _beyond(lambda value: value >= least, f"at least {least:g}, {reason}", settings)


def within(least: float, most: float, **settings: float | None) -> list[InputError]:
    """Settings outside a range, whose ends belong to it; None stands for one that is left out."""
    return _beyond(lambda value: least <= value <= most, f"{least:g} to {most:g}", settings)


def above_zero_up_to(most: float, **settings: float | None) -> list[InputError]:
    """Settings that are not above 0 or lie beyond ``most``; None stands for one that is left out."""
    return _beyond(lambda value: 0 < value <= most, f"above 0, at most {most:g}", settings)


def refuse(*found: Sequence[InputError]) -> None:
    """Raise everything that was found.

    Raises
    ------
    InputError, InputErrors
        One problem, or several.
    """
    problems = [problem for problems in found for problem in problems]
    if len(problems) == 1:
        raise problems[0]
    if problems:
        raise InputErrors(problems)


def found_by(devices: Mapping[str, object]) -> list[InputError]:
    """What the ``check()`` of each device finds, each problem under the name of its device."""
    problems: list[InputError] = []
    for name, device in devices.items():
        check: Callable[[], None] | None = getattr(device, "check", None)
        try:
            if check is not None:
                check()
        except InputError as error:
            problems.append(error.at(name))
        except InputErrors as several:
            problems += [error.at(name) for error in several.errors]
    return problems


def _beyond(allowed: Callable[[float], bool], expected: str, settings: Mapping[str, float | None]) -> list[InputError]:
    return [
        InputError(f"{name} is {value:g}", where=name, expected=expected)
        for name, value in settings.items()
        if value is not None and not allowed(value)
    ]
