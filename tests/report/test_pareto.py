from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from pipeline.report.pareto import pareto_front

COSTS = st.lists(st.tuples(*[st.integers(0, 9).map(float)] * 2), min_size=1, max_size=30)


def test_a_front_by_hand() -> None:
    points = [(1.0, 5.0), (2.0, 3.0), (2.0, 4.0), (3.0, 3.0), (4.0, 1.0), (1.0, 5.0)]
    assert pareto_front(points) == [True, True, False, False, True, True]


@given(COSTS)
def test_what_is_off_the_front_is_beaten_by_something_on_it_and_what_is_on_it_by_nothing(
    points: list[tuple[float, float]],
) -> None:
    """A sweep over the sorted points: on the front is what lies below all that is faster, or as fast."""
    least, front = math.inf, set()
    for x, y in sorted(points):
        if y < least:
            front.add((x, y))
            least = y
    assert {point for point, best in zip(points, pareto_front(points), strict=True) if best} == front
