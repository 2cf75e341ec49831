"""Motions of photographs by their edges, and why those of some photographs cannot be told."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.data.arrays import BoolArray
from pipeline.optics.coarse_registration import Start, coarse_motion, coarse_turn, edge_images
from pipeline.optics.edge_patches import edge_coefficients
from pipeline.optics.motion_choice import Choice, chosen_motions
from pipeline.optics.registration import Motions, still, too_small, unknown
from pipeline.optics.registration_evidence import Agreement, judged
from pipeline.optics.rigid import RigidMotion
from pipeline.parallel import over_rows

_log = logging.getLogger(__name__)

Float32Array = NDArray[np.float32]

_AMBIGUOUS_SHARE = 0.25
"""One photograph may be too dark to tell; where many cannot, edges change with the polariser."""

_NEAR_START_PX = 3.0
"""Starts are right to a pixel or two."""

_FAR = 1 / 8
"""Of the picture's shorter side: photographs farther off are first moved by whole pixels, or the margin that they need
would leave the others few patches."""

_COMMON = 0.25
"""Least share of the picture that photographs have in common with one that is far off."""


def edge_motions(
    images: Float32Array,
    valid: BoolArray,
    motion: Literal["auto", "shift", "rigid"],
    *,
    largest_px: float,
    largest_rad: float,
    least_px: float,
) -> tuple[Motions, dict[int, str]]:
    """Motions of K photographs, shape (K, M, N), against the first, and why some of them cannot be right.

    Photographs whose motion cannot be told are left out of what the others are compared with.
    """
    count = len(images)
    if too_small(valid.shape):
        return still(count), {}
    edges, coefficients = edges_of(images), np.empty(images.shape, np.float32)
    shifted, turned, agreed = [Start()] * count, [Start()] * count, [Agreement()] * count

    def find_coefficients(start: int, stop: int) -> None:
        for k in range(start, stop):
            coefficients[k] = edge_coefficients(images[k])

    def find_start(start: int, stop: int) -> None:
        for k in range(max(start, 1), stop):
            turn = 0.0
            shifted[k] = turned[k] = coarse_motion(edges[0][-1], edges[k][-1], largest_px=largest_px)
            if motion != "shift":
                turn = coarse_turn(edges[0], edges[k], largest_px=largest_px, largest_rad=largest_rad)
                if turn:
                    turned[k] = coarse_motion(edges[0][-1], edges[k][-1], largest_px=largest_px, turn_rad=turn)
            agreed[k] = judged(edges[0], edges[k], largest_px=largest_px, largest_rad=largest_rad, turn_rad=turn)

    over_rows(find_coefficients, count, tile=1)
    over_rows(find_start, count, tile=1)
    doubts = _contradicted(agreed, shifted, turned) | strangers(agreed, largest_px)
    offset = _far_offsets(turned, valid.shape, doubts)
    valid = _brought_near(coefficients, valid, offset, doubts)
    shifted, turned = _without(shifted, offset), _without(turned, offset)
    together = [k for k in range(count) if k not in doubts and not (shifted[k].ambiguous and turned[k].ambiguous)]
    choice = _chosen(coefficients, shifted, turned, valid, together, motion=motion, least_px=least_px)
    motions = choice.motions
    starts = turned if motions.turn_rad.any() else shifted
    _log.log(logging.WARNING if choice.doubtful else logging.INFO, "%s", choice.reason)
    if not motions.settled:
        _log.warning(
            "The photographs did not settle (the last step was %.3f px): they may have moved in another way, or their "
            "edges change with the polariser.",
            motions.last_step_px,
        )
    doubts = _astray(motions, starts, together) | _ambiguities(starts) | doubts
    return replace(motions, shift_px=motions.shift_px + offset), doubts


def edges_of(images: Float32Array) -> list[list[Float32Array]]:
    """The :func:`edge_images` of K photographs."""
    edges: list[list[Float32Array]] = [[]] * len(images)

    def find(start: int, stop: int) -> None:
        for k in range(start, stop):
            edges[k] = edge_images(images[k])

    over_rows(find, len(images), tile=1)
    return edges


def strangers(agreed: list[Agreement], largest_px: float) -> dict[int, str]:
    """Photographs that show something else than the first one, or the same too far off, and which it is."""
    doubts: dict[int, str] = {}
    for k, found in enumerate(agreed):
        if found.by_chance:
            doubts[k] = "its edges agree with the first photo's no better than those of an unrelated photo"
        elif (away := float(np.hypot(*found.motion.shift_px))) > largest_px + _NEAR_START_PX + found.step_px:
            doubts[k] = f"a shift of about {away:.0f} px is not believed"
    return doubts


def _contradicted(agreed: list[Agreement], *starts: list[Start]) -> dict[int, str]:
    """Photographs that a comparison by sharpness and one by fine detail put in different places."""
    doubts: dict[int, str] = {}
    for k, found in enumerate(agreed):
        begun = [kind[k] for kind in starts if not kind[k].ambiguous]
        away = [np.hypot(*np.subtract(start.motion.shift_px, found.motion.shift_px)) for start in begun]
        if away and min(away) > _NEAR_START_PX + found.step_px:
            doubts[k] = f"two ways of comparing its edges with the first photo's lead {min(away):.0f} px apart"
    return doubts


def _far_offsets(starts: list[Start], shape: tuple[int, ...], doubts: dict[int, str]) -> NDArray[np.int_]:
    """Whole pixels (K, 2) by which photographs are far off; 0 where they are near, or not used."""
    offset = np.rint([start.motion.shift_px for start in starts]).astype(np.int_)
    near = np.hypot(*offset.T) <= _FAR * min(shape)
    offset[near | np.isin(np.arange(len(starts)), list(doubts))] = 0
    return offset


def _brought_near(
    coefficients: Float32Array, valid: BoolArray, offset: NDArray[np.int_], doubts: dict[int, str]
) -> BoolArray:
    """Move what is far off back, in place; gives the pixels that all show, and doubts those that show too few."""
    common = valid
    for k in np.argsort(np.hypot(*offset.T)):
        if not offset[k].any():
            continue
        places = [np.arange(side) + off for side, off in zip(valid.shape, offset[k], strict=True)]
        there = [(place >= 0) & (place < side) for side, place in zip(valid.shape, places, strict=True)]
        at = np.ix_(*(np.clip(place, 0, side - 1) for side, place in zip(valid.shape, places, strict=True)))
        shared = common & np.outer(*there) & valid[at]
        if shared.sum() < _COMMON * valid.sum():
            doubts[int(k)] = f"a shift of about {np.hypot(*offset[k]):.0f} px leaves too little in common"
        else:
            coefficients[k], common = coefficients[k][at], shared
    return common


def _without(starts: list[Start], offset: NDArray[np.int_]) -> list[Start]:
    """Starts of photographs that were moved back by so many pixels."""
    near = []
    for start, (down, right) in zip(starts, offset, strict=True):
        row, column = start.motion.shift_px
        near.append(replace(start, motion=replace(start.motion, shift_px=(row - float(down), column - float(right)))))
    return near


def _chosen(
    coefficients: Float32Array,
    shifted: list[Start],
    turned: list[Start],
    valid: BoolArray,
    together: list[int],
    *,
    motion: Literal["auto", "shift", "rigid"],
    least_px: float,
) -> Choice:
    """Motions of the photographs that go together; nothing is known of the others."""
    count = len(coefficients)
    if len(together) < 2:
        return Choice(still(count), "No photo can be compared with the first.")
    some = coefficients if len(together) == count else coefficients[together]
    by_shift, by_turn = (unknown([_begun(starts[k]) for k in together]) for starts in (shifted, turned))
    choice = chosen_motions(some, by_shift, by_turn, valid, motion=motion, least_px=least_px)
    return replace(choice, motions=choice.motions.among(together, count))


def _begun(start: Start) -> RigidMotion:
    """The motion to start from; none where it is ambiguous."""
    return RigidMotion() if start.ambiguous else start.motion


def _astray(motions: Motions, starts: list[Start], together: list[int]) -> dict[int, str]:
    """Photographs that the patches lead away from where all edges agree best."""
    doubts: dict[int, str] = {}
    for k in together[1:]:
        away = float(np.hypot(*(motions.shift_px[k] - starts[k].motion.shift_px)))
        if away > _NEAR_START_PX:
            doubts[k] = f"patches around its edges lead {away:.1f} px away from where all edges agree best"
    return doubts


def _ambiguities(starts: list[Start]) -> dict[int, str]:
    """Photographs whose edges agree as well elsewhere; all of them, where that is so of many."""
    ambiguous = sum(start.ambiguous for start in starts)
    doubts: dict[int, str] = {}
    for k, start in enumerate(starts):
        if start.ambiguous:
            doubts[k] = "its edges agree as well with the first photo's many pixels away"
        elif ambiguous > _AMBIGUOUS_SHARE * len(starts):
            doubts[k] = f"in {ambiguous} of the photos the edges agree as well many pixels away"
    return doubts
