"""How a run shows itself in a notebook."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.runs import Run

MOST_PICTURES = 6
LARGEST_PICTURE = 400_000


def run_html(run: Run) -> str:
    """Figures of merit, nodes and a few pictures of a run, as one piece of HTML that needs nothing else."""
    figures = "".join(
        f"<tr><td>{escape(name)}</td><td style='text-align:right'>{figure:.5g}</td></tr>"
        for name, figure in run.metrics.items()
    )
    nodes = "".join(
        f"<tr><td>{escape(node.name)}</td><td>{escape(node.stage)}</td><td>{node.status}</td>"
        f"<td style='text-align:right'>{'' if node.seconds is None else f'{node.seconds:.2f} s'}</td></tr>"
        for node in run.nodes.values()
    )
    pictures = "".join(
        f"<figure style='display:inline-block;margin:4px'><img style='height:160px' alt='{escape(path.stem)}' "
        f"src='data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}'>"
        f"<figcaption>{escape(path.stem)}</figcaption></figure>"
        for path in _pictures(run.path / "outputs")
    )
    return (
        f"<div><h3>{escape(run.name)} <code>{escape(run.digest)}</code></h3>"
        f"<p><a href='{escape(str(run.report))}'>report</a></p>"
        f"<div>{pictures}</div><details open><summary>figures of merit</summary><table>{figures}</table></details>"
        f"<details><summary>stages</summary><table>{nodes}</table></details></div>"
    )


def _pictures(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    small = [path for path in sorted(folder.glob("*.png")) if path.stat().st_size <= LARGEST_PICTURE]
    return small[:MOST_PICTURES]
