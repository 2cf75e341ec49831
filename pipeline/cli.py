"""The command line."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

from pipeline.errors import InputError, InputErrors, PipelineError, nearest

USAGE = """\
optibench - a bench for optical-measurement experiments

  python -m pipeline +experiment=NAME [SETTING=VALUE ...]      run an experiment
  python -m pipeline why +experiment=NAME [SETTING=VALUE ...]  what would run, and why; runs nothing
  python -m pipeline list [experiments|stages|devices|rigs|runs]
  python -m pipeline show STAGE_OR_DEVICE                      its manual, inputs and settings
  python -m pipeline export RUN NODE FOLDER                    write a node's photographs as a folder to replay

options
  -q, --quiet    print nothing but the place of the report, and errors
  -h, --help     this text

examples
  python -m pipeline +experiment=polarization_logo
  python -m pipeline +experiment=polarization_logo graph.photos.count=6
  python -m pipeline +experiment=polarization_logo rig=replay rig.folder=my_photos
  python -m pipeline show fit.cosine

`optibench` does the same as `python -m pipeline`. Exit status: 0 done, 1 a stage failed, 2 wrong input.
"""

COMMANDS = ("run", "why", "list", "show", "export")


def main(arguments: Sequence[str]) -> int:
    """Carry out a command line and return its exit status: 0 done, 1 a stage failed, 2 wrong input."""
    words = [word for word in arguments if word not in {"-q", "--quiet"}]
    quiet = len(words) != len(arguments)
    if not words or words[0] in {"-h", "--help", "help"}:
        print(USAGE, end="")
        return 0 if words else 2
    try:
        command = words[0] if words[0] in COMMANDS else "run"
        rest = words[1:] if words[0] in COMMANDS else words
        _check_words(command, rest)
        return {"run": _run, "why": _why, "list": _list, "show": _show, "export": _export}[command](rest, quiet=quiet)
    except (InputError, InputErrors) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except PipelineError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; what was finished is kept, and the same command goes on from there", file=sys.stderr)
        return 130


def _check_words(command: str, words: Sequence[str]) -> None:
    for word in words:
        if word.startswith("-"):
            raise InputError(
                f"there is no option '{word}'", where="command line", hint=nearest(word, ["--quiet", "--help"])
            )
        if command in {"run", "why"} and "=" not in word and not word.startswith("~"):
            raise InputError(
                f"'{word}' is neither a command nor SETTING=VALUE",
                where="command line",
                expected="see python -m pipeline --help",
                hint=nearest(word, COMMANDS),
            )


def _run(words: Sequence[str], *, quiet: bool) -> int:
    from pipeline.bench import Experiment, RunFailed
    from pipeline.live import Counter, display

    start = time.perf_counter()
    experiment = Experiment.load(words)
    for remark in experiment.graph.remarks:
        print(remark, file=sys.stderr)
    with display(quiet=quiet) as shown:
        counter = Counter(shown)
        run = experiment.run(counter)
    if not quiet:
        for name, figure in run.metrics.items():
            print(f"{name:>36}  {figure:.6g}")
        print(f"{counter.summary()}, {time.perf_counter() - start:.1f} s")
    print(f"report: {run.report}")
    if run.failed:
        print(f"error: {RunFailed(run)}", file=sys.stderr)
        return 1
    return 0


def _why(words: Sequence[str], *, quiet: bool) -> int:
    from pipeline.bench import Experiment

    experiment = Experiment.load(words)
    plan = experiment.plan()
    for remark in experiment.graph.remarks:
        print(remark)
    width = max(len(name) for name in (*plan.steps, *experiment.graph.absent))
    for name, step in plan.steps.items():
        word = {"cached": "keep", "run": "RUN", "depends": "run?"}[step.state]
        print(f"{word:>6}  {name:<{width}}  {step.task.node.entry.name:<28} {step.reason}")
    for name, reason in experiment.graph.absent.items():
        print(f"absent  {name:<{width}}  {'':<28} {reason}")
    would = sum(step.state == "run" for step in plan.steps.values())
    depends = sum(step.state == "depends" for step in plan.steps.values())
    print(f"{would} would run, {depends} depend on these, {len(plan.steps) - would - depends} are in the store")
    return 0


def _list(words: Sequence[str], *, quiet: bool) -> int:
    from pipeline.listing import LISTS

    wanted = list(words) or ["experiments", "rigs", "stages", "devices", "runs"]
    for name in wanted:
        if name not in LISTS:
            raise InputError(f"there is no list of '{name}'", where="command line", hint=nearest(name, LISTS))
    for name in wanted:
        print(f"{name}:")
        for entry, line in LISTS[name]():
            print(f"  {entry:<32} {line}".rstrip())
    return 0


def _show(words: Sequence[str], *, quiet: bool) -> int:
    from pipeline.listing import manual

    if len(words) != 1:
        raise InputError("show takes one name", where="command line", expected="python -m pipeline show fit.cosine")
    print(manual(words[0]))
    return 0


def _export(words: Sequence[str], *, quiet: bool) -> int:
    from pipeline.export import export_photos
    from pipeline.runs import open_run

    if len(words) != 3:
        raise InputError("export takes three words", where="command line", expected="export RUN NODE FOLDER")
    run, node, folder = words
    print(export_photos(open_run(Path(run)), node, Path(folder)))
    return 0
