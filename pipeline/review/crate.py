"""What a bundle says of itself to others: the metadata of an RO-Crate 1.1."""

from __future__ import annotations

import json
from collections.abc import Collection
from typing import Any

from pipeline.execution.provenance import DISTRIBUTION
from pipeline.runs import Run

METADATA = "ro-crate-metadata.json"
VERSION = "1.1"

_FILES = {
    "README.txt": ("What this is, and the commands to verify and to rerun it", "text/plain"),
    "config.yaml": ("Configuration of the run, resolved", "application/yaml"),
    "manifest.json": ("What every node is, gave and took", "application/json"),
    "environment.json": ("Python, platform, versions of all that was installed, and the commit", "application/json"),
    "report.html": ("Report of the run", "text/html"),
}
_FOLDERS = {
    "outputs/": "What a person opens: pictures, maps and tables",
    "store/": "Values by the digests of their content, and the records of what they were made of",
    "source/": "Source code of all stages and of what they import, for reading",
}


def crate_metadata(run: Run, names: Collection[str], command: str) -> bytes:
    """The text of ``ro-crate-metadata.json``.

    Parameters
    ----------
    run : Run
        The run.
    names : collection of str
        Names of the files in the bundle.
    command : str
        The command that made the run, wherever.
    """
    from rocrate.model.contextentity import ContextEntity
    from rocrate.rocrate import ROCrate

    crate = ROCrate(version=VERSION)
    crate.name = f"Run {run.digest} of the experiment {run.name}"
    crate.description = run.description or f"Configuration, values, records and report of a run of {run.name}"
    crate.root_dataset["datePublished"] = run.finished
    for name, (title, form) in _FILES.items():
        if name in names:
            crate.add_file(dest_path=name, properties={"name": title, "encodingFormat": form})
    for name, title in _FOLDERS.items():
        if any(file.startswith(name) for file in names):
            crate.add_dataset(dest_path=name, properties={"name": title})
    results = [
        crate.add_dataset(dest_path=place, properties=properties) for place, properties in sorted(_values(run).items())
    ]
    software = {"name": DISTRIBUTION, "softwareVersion": run.versions.get(DISTRIBUTION, ""), "version": run.commit}
    bench = crate.add(ContextEntity(crate, "#bench", {"@type": "SoftwareApplication", **software}))
    action = {
        "@type": "CreateAction",
        "name": command,
        "endTime": run.finished,
        "instrument": {"@id": bench.id},
        "object": {"@id": "config.yaml"},
        "result": [{"@id": result.id} for result in results],
    }
    crate.root_dataset["mentions"] = [crate.add(ContextEntity(crate, "#run", action))]
    return json.dumps(crate.metadata.generate(), indent=1, sort_keys=True).encode()


def _values(run: Run) -> dict[str, dict[str, Any]]:
    """Folder of each value in the bundle, with what is said of it."""
    found: dict[str, dict[str, Any]] = {}
    for node in run.nodes.values():
        if node.artifact:
            place = f"store/objects/{node.artifact[:2]}/{node.artifact}/"
            title = f"{node.name}: {node.type} from {node.stage}"
            before = found.get(place)
            found[place] = {"name": f"{before['name']}; {title}" if before else title, "identifier": node.artifact}
    return found
