from __future__ import annotations

import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import pytest
from html_reading import Page, decoded
from made_up_run import FakeNode, FakeRun, Unknown

import pipeline.report
from pipeline.data.gratings import OrientationError, OrientationMap, PeriodMap
from pipeline.data.metrics import Metrics
from pipeline.report.page import page


def test_every_element_is_closed_in_order(failed: FakeRun) -> None:
    assert Page(page(failed)).faults == []


def test_every_node_has_one_section_and_every_link_leads_to_one(failed: FakeRun) -> None:
    read = Page(page(failed))
    for name in failed.nodes:
        assert read.identifiers.count(f"node-{name}") == 1
    assert len(read.links()) > len(failed.nodes)
    assert {link.removeprefix("#") for link in read.links()} <= set(read.identifiers)


def test_nothing_is_loaded_from_elsewhere(run: FakeRun) -> None:
    text = page(run)
    assert all(source.startswith("data:image/") for source in Page(text).sources())
    assert not re.search(r"@import|url\(|https?:", text)


def test_every_picture_can_be_decoded(run: FakeRun) -> None:
    sources = Page(page(run)).sources()
    assert len(sources) > 15
    for source in sources:
        picture = cv2.imdecode(np.frombuffer(decoded(source), np.uint8), cv2.IMREAD_UNCHANGED)
        assert picture is not None
        assert picture.size > 0


def test_it_tells_how_to_run_it_again_and_what_it_stands_on(run: FakeRun) -> None:
    text = Page(page(run)).text
    facts = (
        "2026-03-01 12:31 UTC",
        "3 min 05 s",
        "0123456789ab",
        "numpy 2.0.0",
        "graph.photos.count=4",
        "1 from cache",
    )
    for said in (run.command, *facts):
        assert said in text


def test_figures_of_merit_carry_their_units(run: FakeRun) -> None:
    text = Page(page(run)).text
    assert "orientation error, mean 0.4 ° orientation_error_mean_deg" in text
    assert "masked share 12.5 % masked_share_percent" in text


def test_the_tiles_show_the_first_figure_of_each_node_that_has_some(run: FakeRun) -> None:
    shares = {"period_error_mean_percent": 0.3, "period_bias_percent": -0.1}
    run = run.with_node(FakeNode("period_error", type="Metrics", artifact="d"), Metrics(shares))
    again = replace(run.values["evaluate"], metrics={"orientation_error_mean_deg": 0.6, "offset_deg": 0.1})
    run = run.with_node(FakeNode("absolute_error", type="OrientationError", artifact="e"), again)
    figures = {
        "orientation_error_mean_deg": 0.4,
        "masked_share_percent": 12.5,
        "absolute_error.orientation_error_mean_deg": 0.6,
        "offset_deg": 0.1,
        "correlation_mean": 0.99,
        **shares,
    }
    tiles = re.findall(r'<div class="tile"><b>(.*?)</b><span>(.*?)</span>', page(replace(run, metrics=figures)))
    assert tiles == [
        ("0.4°", "orientation error, mean"),
        ("0.6°", "orientation error, mean (absolute_error)"),
        ("0.99 ", "correlation, mean"),
        ("0.3 %", "period error, mean"),
    ]


def test_what_another_node_judges_has_no_tile_and_few_are_filled_up(run: FakeRun) -> None:
    judged = replace(run.values["evaluate"], metrics={"defects": 10.0})
    nodes = [FakeNode("list", artifact="d"), FakeNode("judge", artifact="e", inputs={"found": ("list",)})]
    figures = {"missed": 2.0, "found_percent": 80.0, "defects": 10.0}
    values = {"list": judged, "judge": replace(judged, metrics=figures)}
    alone = replace(run, nodes={node.name: node for node in nodes}, values=values, metrics=figures | {"gap_um": 1.0})
    tiles = re.findall(r'<div class="tile"><b>(.*?)</b><span>(.*?)</span>', page(alone))
    assert [label for _, label in tiles] == ["missed", "found", "defects", "gap"]
    more = replace(alone, metrics=figures | {"gap_um": 1.0, "least_um": 2.0})
    assert len(re.findall('class="tile"', page(more))) == 4


def test_tiles_are_filled_up_from_what_judges_before_what_is_judged(run: FakeRun) -> None:
    """The periods of a surface stand first in the table; its peaks are what a run of peaks is for."""
    first, last = (
        {"periods": 2.0, "period_1_um": 1.5, "rms_1_um": 0.1},
        {"peaks": 81.0, "period_um": 1.52, "spread_nm": 1},
    )
    nodes = [FakeNode("periods", artifact="d"), FakeNode("fit", artifact="e", inputs={"periods": ("periods",)})]
    values = {n.name: replace(run.values["evaluate"], metrics=m) for n, m in zip(nodes, (first, last), strict=True)}
    text = page(replace(run, nodes={node.name: node for node in nodes}, values=values, metrics=first | last))
    tiles = re.findall(r'<div class="tile"><b>(.*?)</b><span>(.*?)</span>', text)
    assert [label for _, label in tiles] == ["periods", "peaks", "period", "spread"]


def test_the_graph_has_no_box_for_what_was_not_planned(failed: FakeRun) -> None:
    picture = page(failed).split('<svg class="graph"')[1].split("</svg>")[0]
    assert 'href="#node-broken"' in picture
    assert 'href="#node-none"' not in picture


def test_a_run_whose_values_are_gone_still_has_tiles(run: FakeRun) -> None:
    assert page(replace(run, values={})).count('<div class="tile">') == len(run.metrics)


def test_a_node_that_does_without_all_its_inputs_comes_from_nowhere(run: FakeRun) -> None:
    def above_figures(run: FakeRun) -> str:
        return page(run).split('id="node-photos"')[1].split("</h3>")[1].split("</p>")[0]

    assert 'From <a href="#node-sample">' in above_figures(run)
    assert "From" not in above_figures(run.with_node(replace(run.nodes["photos"], inputs={"sample": ()})))


def test_an_offset_that_was_removed_is_explained_and_one_that_was_not_is_too(run: FakeRun) -> None:
    degrees = np.rad2deg(run.values["evaluate"].offset_rad)
    text = Page(page(run)).text
    assert f"One offset of {degrees:.2f}° was removed" in text
    assert f"{-degrees:.2f}° have to be added" in text
    kept = replace(run.values["evaluate"], offset_rad=0.0)
    text = Page(page(run.with_node(run.nodes["evaluate"], kept))).text
    assert "No offset was removed" in text
    assert "have to be added" not in text


def test_written_settings_stand_out_from_defaults_and_devices_are_unfolded(run: FakeRun) -> None:
    text = page(run)
    assert '<tr class="written"><td><code>count</code></td><td>4</td>' in text
    assert '<tr class="default"><td><code>rig.camera.pixel_mm</code></td><td>0.1</td>' in text
    assert "<td><code>seed</code></td><td>null</td>" in text


def test_a_cached_stage_says_when_it_was_computed_and_what_it_took(run: FakeRun) -> None:
    assert "from cache, computed 2026-03-01 12:30 UTC on bench in 0.50 s" in Page(page(run)).text


def test_pictures_under_equal_lights_are_shown_beside_each_other_only(run: FakeRun) -> None:
    text = page(run)
    assert text.count('class="compared"') == 1
    assert "torch and rendering beside each other" in text
    assert 'class="sheet large"' not in text


def test_pictures_under_other_lights_keep_to_their_section(run: FakeRun) -> None:
    moved = replace(run.values["torch"], light_mm=run.values["torch"].light_mm + 1)
    text = page(run.with_node(run.nodes["torch"], moved))
    assert "beside each other" not in text
    assert text.count('class="sheet large"') == 2


def test_a_figure_that_another_node_already_shows_is_not_shown_again(run: FakeRun) -> None:
    again = replace(run.nodes["fit"], name="again")
    assert "Orientation, correlation, mask: as for fit ." in Page(page(run.with_node(again, run.values["fit"]))).text


def test_the_map_of_an_error_takes_its_millimetres_from_its_inputs(run: FakeRun) -> None:
    text = page(replace(run, nodes={n: run.nodes[n] for n in ("sample", "fit", "evaluate")}))
    assert "column (px)" not in text
    alone = replace(run.nodes["evaluate"], inputs={})
    assert "column (px)" in page(run.with_node(alone))


def test_a_failed_run_says_what_failed_and_what_waits_for_it(failed: FakeRun) -> None:
    text = Page(page(failed)).text
    assert "ValueError: no light" in text
    assert re.search(r"waits toy\.stage was not run: it waits for broken", text)
    assert "needs a simulated rig" in text
    assert "torn: the stored value has changed" in text
    assert "1 failed, 1 blocked, 1 absent" in text


HOSTILE = "<script>alert('x')</script>\"><img src=https://example.invalid/x>"


def test_names_and_messages_cannot_inject_markup(run: FakeRun) -> None:
    hostile = FakeNode(
        HOSTILE,
        stage=HOSTILE,
        summary=HOSTILE,
        warnings=(HOSTILE,),
        notes=(HOSTILE,),
        reason=HOSTILE,
        error=HOSTILE,
        settings={HOSTILE: HOSTILE},
        inputs={HOSTILE: ("fit",)},
        type="Unknown",
        artifact="digest",
        host=HOSTILE,
    )
    run = run.with_node(hostile, replace(run.values["torch"], caption=HOSTILE))
    run = run.with_node(FakeNode("unknown", artifact="d"), Unknown(np.eye(3), np.ones((3, 3, 3)), HOSTILE))
    run = replace(run, name=HOSTILE, description=HOSTILE, command=HOSTILE, config_yaml=HOSTILE, host=HOSTILE)
    run = replace(run, metrics={HOSTILE: 1.0})
    read = Page(page(run))
    assert read.faults == []
    assert [tag for tag, _ in read.elements].count("script") == 4  # the page's own, the viewer's, and two pairs of maps
    assert all(source.startswith("data:image/") for source in read.sources())
    assert read.text.count("<script>alert") > 10


def test_a_correlation_that_is_not_known_is_not_drawn(run: FakeRun) -> None:
    unknown = replace(run.values["fit"], correlation=np.full_like(run.values["fit"].correlation, np.nan))
    assert "map of correlation" in page(run)
    assert "map of correlation" not in page(run.with_node(run.nodes["fit"], unknown))


@pytest.mark.parametrize("known", ["all", "none"])
def test_maps_without_a_single_number_are_shown(run: FakeRun, known: str) -> None:
    void = np.full((6, 9), np.nan, np.float32)
    kept = np.zeros((6, 9), bool) if known == "none" else np.ones((6, 9), bool)
    for name, value in {
        "fit": OrientationMap(void, void, void, kept),
        "period": PeriodMap(void, kept),
        "evaluate": OrientationError(void, float("nan"), {"orientation_error_mean_deg": float("nan")}),
        "photos": replace(run.values["photos"], images=void[None].repeat(4, 0), valid=kept, pixel_mm=None),
        "torch": replace(run.values["torch"], rgb=np.full((3, 6, 9, 3), np.nan, np.float32)),
    }.items():
        run = run.with_node(run.nodes[name], value)
    read = Page(page(run))
    assert read.faults == []
    assert not re.search(r'(?:x|y|d|width|height)="[^"]*nan', page(run))
    assert "not known" in read.text


def test_a_constant_map_and_a_single_photo_are_shown(run: FakeRun) -> None:
    run = run.with_node(run.nodes["period"], PeriodMap(np.full((5, 5), 1.2, np.float32), np.ones((5, 5), bool)))
    photos = run.values["photos"]
    one = replace(photos, images=photos.images[:1], polarizer_rad=photos.polarizer_rad[:1])
    assert Page(page(run.with_node(run.nodes["photos"], one))).faults == []


def test_an_unknown_type_is_shown_by_its_fields(run: FakeRun) -> None:
    value = Unknown(np.arange(12.0).reshape(3, 4), np.full((5, 6, 3), 0.5))
    text = Page(page(run.with_node(FakeNode("unknown", type="Unknown", artifact="d"), value))).text
    assert "float64, 3 × 4: 0 to 11, mean 5.5" in text
    assert "What the Unknown holds." in text
    assert "height (µm)" in text
    assert "step <1>" in text


def test_reports_written_at_once_by_several_threads_are_the_same(run: FakeRun) -> None:
    with ThreadPoolExecutor(4) as pool:
        assert len({*pool.map(page, [run] * 4)}) == 1


def test_the_report_is_written_whole(run: FakeRun) -> None:
    path = pipeline.report.write(run)
    assert path == run.path / "report.html"
    assert path.read_text(encoding="utf-8") == page(run)
    assert {p.name for p in run.path.iterdir()} == {"report.html", "outputs"}
    assert {p.suffix for p in (run.path / "outputs").iterdir()} == {".svg", ".json"}


def test_importing_the_report_imports_nothing_heavy() -> None:
    said = "import sys, pipeline.report; print(*sorted({'cv2', 'jinja2', 'numpy', 'OpenImageIO'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
