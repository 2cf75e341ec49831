"""Whatever is wrong is said before anything runs: what, where, what was expected, the nearest name."""

from __future__ import annotations

import os
import re
import shlex

import pytest
from toys import Toys

from pipeline.bench import Experiment
from pipeline.errors import InputError, InputErrors
from pipeline.graph.annotations import Annotation, check_setting
from pipeline.graph.compose import compose


def test_an_unknown_stage(toys: Toys) -> None:
    with pytest.raises(InputErrors, match=r"no stage 'toy.scael'[\s\S]*override graph.big.stage[\s\S]*'toy.scale'\?"):
        toys.load("graph.big.stage=toy.scael")


def test_an_unknown_setting_in_the_file_names_file_and_line(toys: Toys) -> None:
    toys.experiment.write_text(toys.experiment.read_text().replace("factor: 3", "facter: 3"))
    with pytest.raises(InputErrors, match=r"'facter'[\s\S]*toy.yaml, line 9: graph.big.facter[\s\S]*'factor'\?"):
        toys.load()


def test_an_unknown_setting_on_the_command_line(toys: Toys) -> None:
    with pytest.raises(InputErrors, match=r"'sise'[\s\S]*override graph.raw.sise=3[\s\S]*did you mean 'size'\?"):
        toys.load("graph.raw.sise=3")


def test_an_unknown_node(toys: Toys) -> None:
    with pytest.raises(InputErrors, match=r"no node 'rwa'[\s\S]*graph.big.maps[\s\S]*did you mean 'raw'\?"):
        toys.load("graph.big.maps=rwa")


def test_a_mistyped_node_of_an_override_names_the_override(toys: Toys) -> None:
    with pytest.raises(
        InputErrors, match=r"no node 'bgi'[\s\S]*override graph.bgi.factor=2[\s\S]*did you mean 'big'\?"
    ):
        toys.load("graph.bgi.factor=2")
    with pytest.raises(InputErrors, match=r"'maps' is not given[\s\S]*override graph.bgi.stage=toy.clip\s") as caught:
        toys.load("graph.bgi.stage=toy.clip")
    assert caught.value.errors[0].hint == "'bgi' is a new node; did you mean 'big'?"


@pytest.mark.parametrize("values", ["1,2", "range(1,4)", "choice(1,2)"])
def test_several_values_need_a_sweep_and_the_command_is_given(values: str) -> None:
    words = ["+experiment=polarization_logo", f"graph.fit.threshold={values}"]
    with pytest.raises(InputError, match=r"'graph.fit.threshold' has several values") as caught:
        compose(words)
    assert shlex.split(caught.value.hint) == ["python", "-m", "pipeline", "-m", *words]


def test_a_setting_that_has_to_be_given_says_how_and_what_its_comment_says() -> None:
    with pytest.raises(InputErrors, match=r"'folder' is not given") as caught:
        Experiment.load(["+experiment=polarization_logo", "rig=replay"])
    (error,) = caught.value.errors
    assert error.expected == "rig.folder=PATH"
    assert "docs/own-photos.md" in error.hint


def test_a_cycle(toys: Toys) -> None:
    with pytest.raises(InputErrors, match=r"in a circle: (big -> cut -> big|cut -> big -> cut)"):
        toys.load("graph.big.maps=cut")


def test_a_wrong_type_of_value(toys: Toys) -> None:
    toys.graph(
        """
        raw: {stage: toy.source}
        other: {stage: toy.turn, maps: raw}
        big: {stage: toy.scale, maps: other}
        """
    )
    with pytest.raises(
        InputErrors, match=r"'other' gives OrientationMap[\s\S]*expected: PeriodMap[\s\S]*raw would fit"
    ):
        toys.load()


def test_a_wrong_type_of_setting(toys: Toys) -> None:
    with pytest.raises(InputErrors, match=r"factor is 'big' \(str\)[\s\S]*expected: float"):
        toys.load("graph.big.factor=big")


def test_a_wrong_choice(toys: Toys) -> None:
    with pytest.raises(InputErrors, match=r"mode is 'upp'[\s\S]*one of 'up', 'down'[\s\S]*did you mean 'up'\?"):
        toys.load("graph.big.mode=upp")


def test_one_number_where_a_list_is_meant() -> None:
    with pytest.raises(InputError, match=r"most is 3[\s\S]*expected: list of float[\s\S]*did you mean \[3\]\?"):
        check_setting(3, Annotation("list", (Annotation("float"),)), "most")


def test_one_list_where_a_list_of_lists_is_meant() -> None:
    places = Annotation("list", (Annotation("list", (Annotation("float"),)),))
    with pytest.raises(InputError, match=r"lights_mm is \[100, 0, 300\][\s\S]*did you mean \[\[100, 0, 300\]\]\?"):
        check_setting([100, 0, 300], places, "lights_mm")
    with pytest.raises(InputError, match=r"lights_mm\[0\] is 'lamp'"):
        check_setting(["lamp", 0, 300], places, "lights_mm")


def test_the_same_error_is_said_once() -> None:
    one, same, other = InputError("a"), InputError("a"), InputError("b")
    assert str(InputErrors([one, same, other])) == "a\nerror: b"


def test_a_missing_setting(toys: Toys) -> None:
    toys.stages.write_text(toys.stages.read_text().replace("factor: float = 2.0", "factor: float"))
    toys.experiment.write_text(toys.experiment.read_text().replace("    factor: 3\n", ""))
    with pytest.raises(InputErrors, match=r"toy.scale needs the setting 'factor'[\s\S]*toy.yaml, line 6"):
        toys.load()


def test_a_missing_input(toys: Toys) -> None:
    toys.experiment.write_text(toys.experiment.read_text().replace("    maps: raw\n", ""))
    with pytest.raises(InputErrors, match="input 'maps' is not given"):
        toys.load()


def test_several_errors_are_told_at_once(toys: Toys) -> None:
    with pytest.raises(InputErrors, match="'sise'") as caught:
        toys.load("graph.raw.sise=3", "graph.big.mode=upp", "graph.cut.maps=nothing")
    assert len(caught.value.errors) == 3


@pytest.mark.parametrize(
    "name", ["os.system", "builtins.eval", "pipeline.stages.toy.source", "toy.maps.np.load", "toy._x"]
)
def test_nothing_but_stages_can_be_named(toys: Toys, name: str) -> None:
    with pytest.raises(InputErrors, match=re.escape(f"there is no stage '{name}'")):
        toys.load(f"graph.raw.stage={name}")


def test_a_target_in_yaml_is_only_an_unknown_setting(toys: Toys) -> None:
    toys.graph("raw: {stage: toy.source, _target_: os.system, command: 'touch broken'}")
    with pytest.raises(InputErrors, match="has no setting or input '_target_'"):
        toys.load()


def test_an_unknown_experiment() -> None:
    with pytest.raises(InputError, match=r"no experiment 'polarisation_logo'[\s\S]*'polarization_logo'\?"):
        compose(["+experiment=polarisation_logo"])


def test_no_experiment() -> None:
    with pytest.raises(InputError, match=r"no experiment is named[\s\S]*\+experiment=NAME"):
        compose(["graph.fit.prenormalize=false"])


def test_an_unknown_rig() -> None:
    with pytest.raises(InputError, match=r"no rig 'replya'[\s\S]*did you mean 'replay'\?"):
        compose(["+experiment=polarization_logo", "rig=replya"])


def test_a_store_on_a_read_only_disk(toys: Toys) -> None:
    blocked = toys.folder / "file"
    blocked.write_text("not a folder")
    with pytest.raises(InputError, match=r"store .*file/store cannot be written to[\s\S]*paths.store"):
        toys.run(f"paths.store={blocked / 'store'}")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_store_in_a_folder_without_permission(toys: Toys) -> None:
    closed = toys.folder / "closed"
    closed.mkdir(mode=0o500)
    with pytest.raises(InputError, match="cannot be written to: Permission denied"):
        toys.run(f"paths.store={closed / 'store'}")


def test_a_missing_folder_names_the_nearest(toys: Toys) -> None:
    (toys.folder / "photos").mkdir()
    with pytest.raises(InputErrors, match=r"no file or folder .*photo\n[\s\S]*graph.raw.folder[\s\S]*'photos'\?"):
        toys.run(f"graph.raw.folder={toys.folder / 'photo'}")


def test_yaml_that_is_no_yaml(toys: Toys) -> None:
    toys.experiment.write_text("graph: {raw: [}\n")
    with pytest.raises(InputError, match=r"cannot be read[\s\S]*toy.yaml"):
        toys.load()


def test_an_unknown_executor(toys: Toys) -> None:
    with pytest.raises(InputError, match="no executor 'thread'"):
        toys.load("executor=thread")


def test_swapping_a_stage_drops_its_old_settings_with_a_line(toys: Toys) -> None:
    experiment = toys.load("graph.big.stage=toy.clip")
    assert experiment.graph.nodes["big"].inputs == {"maps": ("raw",)}
    assert experiment.graph.remarks == ("big: toy.clip has no factor; left out",)
    with pytest.raises(InputErrors, match=r"toy\.clip has no setting or input 'factor'"):
        toys.load("graph.big.stage=toy.clip", "graph.big.factor=2")


def test_absent_nodes_take_along_what_cannot_do_without(toys: Toys) -> None:
    toys.graph(
        """
        truth: {stage: toy.source, when: false}
        raw: {stage: toy.source}
        means: {stage: toy.mean, maps: [raw], truth: truth}
        compared: {stage: toy.compare, maps: raw, truth: truth}
        """
    )
    graph = toys.load().graph
    assert set(graph.nodes) == {"raw", "means"}
    assert graph.nodes["means"].inputs["truth"] is None
    assert graph.absent["compared"] == "needs 'truth', which is absent"
    assert set(toys.load("graph.truth.when=true").graph.nodes) == {"truth", "raw", "means", "compared"}
