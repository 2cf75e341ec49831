from __future__ import annotations

import re
from itertools import pairwise

from made_up_run import FakeNode, FakeRun

from pipeline.report.graph_picture import BOX_HEIGHT, BOX_WIDTH, graph_svg

BOX = re.compile(r'<a href="#node-(\w+)"><g class="box (\w+)">.*?<rect x="([\d.]+)" y="([\d.]+)"', re.DOTALL)


def boxes(text: str) -> dict[str, tuple[float, float]]:
    return {name: (float(x), float(y)) for name, _, x, y in BOX.findall(text)}


def test_every_node_is_drawn_once_with_its_status(failed: FakeRun) -> None:
    found = [(name, status) for name, status, _, _ in BOX.findall(graph_svg(failed.nodes))]
    assert sorted(found) == sorted((node.name, node.status) for node in failed.nodes.values())


def test_values_go_from_left_to_right_and_boxes_do_not_overlap(run: FakeRun) -> None:
    place = boxes(graph_svg(run.nodes))
    for node in run.nodes.values():
        for sources in node.inputs.values():
            for source in sources:
                assert place[source][0] + BOX_WIDTH < place[node.name][0]
    spots = list(place.values())
    for i, (x, y) in enumerate(spots):
        assert all(abs(x - a) > BOX_WIDTH or abs(y - b) > BOX_HEIGHT for a, b in spots[i + 1 :])


def test_many_layers_go_down_a_page_and_do_not_overlap() -> None:
    names = [f"n{i}" for i in range(10)]
    nodes = {"n0": FakeNode("n0")} | {b: FakeNode(b, inputs={"x": (a, "n0")}) for a, b in pairwise(names)}
    text = graph_svg(nodes)
    place = boxes(text)
    for above, below in pairwise(names):
        assert place[above][1] + BOX_HEIGHT < place[below][1]
    width, height = map(int, re.findall(r'viewBox="0 0 (\d+) (\d+)"', text)[0])
    assert width < 752  # of a window 800 wide
    assert all(x + BOX_WIDTH < width and y + BOX_HEIGHT < height for x, y in place.values())


def test_an_edge_that_passes_a_layer_is_led_around_its_boxes(run: FakeRun) -> None:
    nodes = {
        "a": FakeNode("a"),
        "b": FakeNode("b", inputs={"x": ("a",)}),
        "c": FakeNode("c", inputs={"x": ("a",), "y": ("b",)}),
    }
    text = graph_svg(nodes)
    place = boxes(text)
    way = re.search(r'd="([^"]*)"><title>a to c', text)
    assert way
    level = re.search(r"L([\d.]+),([\d.]+)", way[1])
    assert level
    top = place["b"][1]
    assert not top <= float(level[2]) <= top + BOX_HEIGHT


def test_two_inputs_from_one_node_are_one_edge_with_both_names() -> None:
    nodes = {"a": FakeNode("a"), "b": FakeNode("b", inputs={"left": ("a",), "right": ("a",)})}
    text = graph_svg(nodes)
    assert text.count('class="edge"') == 1
    assert "a to b: left, right" in text


def test_a_run_without_nodes_has_an_empty_picture() -> None:
    assert graph_svg({}).startswith("<svg")
