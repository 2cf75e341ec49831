"""One stage of a run again, alone and under a debugger, on the inputs that it had."""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipeline.bench import Experiment
from pipeline.errors import InputError, nearest
from pipeline.execution.again import call_again
from pipeline.graph.compose import recomposed
from pipeline.runs import MANIFEST, open_run


def debug(path: Path, name: str, debugger: Callable[[Any], None] | None = None) -> int:
    """Call a node's stage as the run did; where it fails, stop in the frame that failed.

    Parameters
    ----------
    path : Path
        Folder of the run.
    name : str
        The node.
    debugger : callable, optional
        Is given the traceback; by default Python's own debugger.

    Returns
    -------
    int
        Exit status: 0 if the stage did not fail this time, 1 if it did.

    Raises
    ------
    InputError
        There is no such run or node, or its inputs are not in the store.
    """
    run = open_run(path)
    node_run = run.node(name)
    if not node_run.stage:
        raise InputError(f"node '{name}' of {path} is absent: {node_run.reason}", hint=nearest(name, run.nodes))
    experiment = Experiment.of(recomposed(run.name, run.config_yaml, path / "config.yaml"))
    node = experiment.graph.nodes[name]
    missing = [upstream for upstream in node.upstream() if not run.has(upstream)]
    if missing:
        raise InputError(
            f"'{name}' has no inputs yet: {', '.join(missing)} did not give a value",
            where=str(path / MANIFEST),
            hint=f"python -m pipeline debug {path} {missing[0]}",
        )
    artifacts = {upstream: run.node(upstream).artifact for upstream in node.upstream()}
    call = call_again(node, artifacts, run.store)
    print(f"{name}: {node.entry.name} of {path}")
    print(json.dumps(dict(node_run.settings), indent=1))
    try:
        value = call()
    except Exception as error:
        traceback.print_exc()
        (debugger or _post_mortem)(error.__traceback__)
        return 1
    print(f"the stage did not fail this time; it gave {type(value).__name__}")
    return 0


def _post_mortem(trace: Any) -> None:
    import pdb

    pdb.post_mortem(trace)
