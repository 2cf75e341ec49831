"""Parts of a graph: until a node, from a node on, some nodes anew."""

from __future__ import annotations

import pytest
from toys import Toys

from pipeline.errors import InputError


def test_until_runs_no_more_than_a_node_needs(toys: Toys) -> None:
    run = toys.run("until=big")
    assert {n.name: n.status for n in run.nodes.values()} == {
        "raw": "ran",
        "big": "ran",
        "cut": "absent",
        "means": "absent",
    }
    assert run.nodes["cut"].reason == "not needed for big (until)"
    assert toys.ran() == ["cut", "means"]


def test_a_part_does_not_take_the_place_of_the_whole(toys: Toys) -> None:
    whole = toys.run()
    assert toys.run("until=big").path != whole.path


def test_force_computes_a_node_and_equal_content_stops_there(toys: Toys) -> None:
    toys.run()
    assert toys.reasons("force=big")["big"] == "run: asked for: force=big"
    assert toys.ran("force=big") == ["big"]
    assert toys.ran("force=[raw,cut]") == ["cut", "raw"]


def test_from_computes_a_node_and_all_that_follows(toys: Toys) -> None:
    toys.run()
    assert toys.ran("from=big") == ["big", "cut", "means"]
    assert toys.ran() == []


def test_a_stage_that_is_not_pure_is_found_out(toys: Toys) -> None:
    pure = "np.minimum(maps.period_um, np.float32(most))"
    toys.stages.write_text(toys.stages.read_text().replace(pure, "maps.period_um + np.float32(time.time() % 9)"))
    toys.run()
    again = toys.run("force=cut")
    assert any("does not always give the same value" in text for text in again.nodes["cut"].warnings)


@pytest.mark.parametrize("word", ["until", "from", "force"])
def test_unknown_nodes_are_refused(toys: Toys, word: str) -> None:
    with pytest.raises(InputError, match=r"no node 'bgi'[\s\S]*did you mean 'big'\?"):
        toys.run(f"{word}=bgi")


def test_captures_are_not_forced(toys: Toys) -> None:
    toys.graph(
        """\
        photo: {stage: toy.photo, camera: {device: lab.Webcam, light: {device: lab.Lamp}}}
        big: {stage: toy.scale, maps: photo}
        """
    )
    with pytest.raises(InputError, match=r"'photo' was captured[\s\S]*recapture=true"):
        toys.run("force=photo")
