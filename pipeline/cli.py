"""The command line."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import cli_review
from pipeline.cli_line import Line, check_overrides, is_override, taken_apart
from pipeline.errors import InputError, InputErrors, PipelineError, nearest

if TYPE_CHECKING:
    from pipeline.bench import Experiment
    from pipeline.sweeps import Origin

USAGE = """\
optibench - a bench for optical-measurement experiments

  python -m pipeline +experiment=NAME [SETTING=VALUE ...]      run an experiment
  python -m pipeline -m +experiment=NAME SETTING=A,B,C ...     run it for every combination, as one graph
  python -m pipeline why +experiment=NAME [SETTING=VALUE ...]  what would run, and why; runs nothing
  python -m pipeline list [experiments|rigs|executors|stages|devices|runs]
  python -m pipeline show NAME                                 manual of a stage or device; YAML of an experiment or rig
  python -m pipeline verify RUN|BUNDLE                         recompute all of it and compare every value
  python -m pipeline diff RUN RUN                              which settings, code, versions and results differ
  python -m pipeline bundle RUN FILE.zip                       all of a run in one file, to hand on
  python -m pipeline [-m] run RUN|BUNDLE [SETTING=VALUE ...]   run it again, changed or not, or swept
  python -m pipeline export RUN NODE FOLDER                    write a node's photographs as a folder to replay
  python -m pipeline serve RUN [--port N]                      its report and files in a browser, on this machine only
  python -m pipeline debug RUN NODE                            run one stage again, under a debugger
  python -m pipeline clean [now]                               what no run needs any more; with now, remove it

options
  -m, --multirun     sweep: values may be lists a,b,c, range(1,5), choice(...), glob(fit.*)
  --config-dir DIR   a folder of your own experiments and rigs, laid out as configs/
  --json             print what differs as JSON (diff)
  --limit-gb N       let a bundle unpack to at most N GB (20)
  --port N           where serve listens (8470; 0 for any that is free)
  -q, --quiet        print nothing but the place of the report, and errors
  -h, --help         this text
  --version          the version

examples
  python -m pipeline +experiment=polarization_logo
  python -m pipeline +experiment=polarization_logo graph.photos.count=6
  python -m pipeline +experiment=polarization_logo rig=replay rig.folder=my_photos
  python -m pipeline -m +experiment=polarization_logo graph.photos.count=4,6,12
  python -m pipeline +experiment=polarization_logo until=fit force=fit
  python -m pipeline show fit.cosine

`optibench` does the same as `python -m pipeline`.
Exit status: 0 done, 1 a stage failed, 2 wrong input, 130 interrupted.
Of verify: 0 all identical or within tolerance, 1 something different or failed, 2 it cannot be verified.
"""


def main(arguments: Sequence[str]) -> int:
    """Carry out a command line and return its exit status."""
    if not arguments or {"-h", "--help", "help"} & set(arguments):
        print(USAGE, end="")
        return 0 if arguments else 2
    if "--version" in arguments:
        from pipeline.execution.provenance import own_version

        print(own_version())
        return 0
    try:
        line = taken_apart(arguments)
        command = line.words[0] if line.words[0] in COMMANDS else "run"
        rest = replace(line, words=line.words[1:]) if line.words[0] in COMMANDS else line
        if line.words[0] == "run" and rest.words and not is_override(rest.words[0]):
            return _rerun(rest)
        if command in TAKES_OVERRIDES:
            check_overrides(rest, COMMANDS)
        status = COMMANDS[command](rest)
        sys.stdout.flush()
        return status
    except (InputError, InputErrors) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except PipelineError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        # Whoever read the output has enough; nothing may be written to it any more, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        print("interrupted; what was finished is kept, and the same command goes on from there", file=sys.stderr)
        return 130


def _run(line: Line) -> int:
    from pipeline.bench import Experiment

    if line.multirun:
        return _sweep(line)
    start = time.perf_counter()
    try:
        experiment = Experiment.load(line.words, line.folders)
    except InputError:
        if _gives_a_study_several_values(line):
            return _sweep(line)
        raise
    if experiment.configuration.sweeps:
        return _sweep(line)
    return _carry_out(experiment, line, start)


def _gives_a_study_several_values(line: Line) -> bool:
    """Whether the experiment sweeps by itself, and words that one run would refuse say over what."""
    from pipeline.bench import Experiment
    from pipeline.graph.compose import is_sweep

    others = [word for word in line.words if not is_sweep(word)]
    with suppress(InputError, InputErrors):
        return len(others) < len(line.words) and Experiment.load(others, line.folders).configuration.sweeps
    return False


def _rerun(line: Line) -> int:
    from pipeline.graph.config import options
    from pipeline.review.rerun import rerun_of, reruns_of

    start = time.perf_counter()
    path = Path(line.words[0])
    rest = replace(line, words=line.words[1:])
    if not path.exists():
        known = options("experiment", line.folders)
        raise InputError(
            f"there is no run or bundle {path}",
            where="command line",
            expected="a folder such as runs/polarization_logo/3f2a91c0, or what `bundle` writes",
            hint=f"did you mean '+experiment={path}'?" if str(path) in known else "",
        )
    check_overrides(rest, COMMANDS)
    if line.multirun:
        with reruns_of(path, line.folders, cli_review.limits(line)) as origin:
            return _sweep(rest, origin)
    return _carry_out(rerun_of(path, rest.words, line.folders, cli_review.limits(line)), rest, start)


def _carry_out(experiment: Experiment, line: Line, start: float) -> int:
    from pipeline.bench import RunFailed
    from pipeline.execution.live import Counter, display

    for remark in experiment.graph.remarks:
        print(remark, file=sys.stderr)
    with display(quiet=line.quiet) as shown:
        counter = Counter(shown)
        run = experiment.run(counter, _to_stderr(line))
    if not line.quiet:
        for name, figure in run.metrics.items():
            print(f"{name:>36}  {figure:.6g}")
        print(f"{counter.summary()}, {time.perf_counter() - start:.1f} s")
    print(f"report: {run.report}")
    if run.failed:
        print(f"error: {RunFailed(run)}", file=sys.stderr)
        return 1
    return 0


def _sweep(line: Line, origin: Origin | None = None) -> int:
    from pipeline.bench import RunFailed
    from pipeline.execution.live import display
    from pipeline.sweeps import run_sweep

    with display(quiet=line.quiet, notes=False) as shown:
        done = run_sweep(line.words, line.folders, shown, _to_stderr(line), origin)
    if not line.quiet:
        print((done.folder / "table.txt").read_text())
        print(
            f"{len(done.points)} points name {done.stages_named} stages; {done.stages_run} run, "
            f"{done.stages_found} from the store, {done.seconds:.1f} s"
        )
        print(f"table:  {done.folder / 'table.csv'}")
    print(f"report: {done.folder / 'report.html'}")
    for point in done.points:
        if point.run.failed:
            print(f"error: {point.run.path}: {RunFailed(point.run)}", file=sys.stderr)
    return 1 if done.failed else 0


def _why(line: Line) -> int:
    from pipeline.bench import Experiment

    experiment = Experiment.load(line.words, line.folders)
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


def _list(line: Line) -> int:
    from pipeline.commands.listing import LISTS, Places

    runs = next((word.partition("=")[2] for word in line.words if word.startswith("paths.runs=")), "runs")
    wanted = [word for word in line.words if not word.startswith("paths.runs=")] or list(LISTS)
    for name in wanted:
        if name not in LISTS:
            raise InputError(f"there is no list of '{name}'", where="command line", hint=nearest(name, LISTS))
    for name in wanted:
        print(f"{name}:")
        for entry, text in LISTS[name](Places(line.folders, Path(runs))):
            print(f"  {entry:<32} {text}".rstrip())
    return 0


def _show(line: Line) -> int:
    from pipeline.commands.listing import Places, manual

    if len(line.words) != 1:
        raise InputError("show takes one name", where="command line", expected="python -m pipeline show fit.cosine")
    print(manual(line.words[0], Places(line.folders)))
    return 0


def _export(line: Line) -> int:
    from pipeline.commands.export import export_photos
    from pipeline.runs import open_run

    if len(line.words) != 3:
        raise InputError("export takes three words", where="command line", expected="export RUN NODE FOLDER")
    run, node, folder = line.words
    print(export_photos(open_run(Path(run)), node, Path(folder)))
    return 0


def _clean(line: Line) -> int:
    from pipeline.commands.clean import find_waste, remove
    from pipeline.storage.store import Store

    known = {"paths.runs": "runs", "paths.store": ""}
    for word in line.words:
        name, _, value = word.partition("=")
        if name not in known and word != "now":
            raise InputError(
                f"clean does not know '{word}'",
                where="command line",
                expected="clean [now] [paths.runs=DIR] [paths.store=DIR]",
                hint=nearest(word, ["now", *known]),
            )
        if name in known:
            known[name] = value
    runs = Path(known["paths.runs"])
    store = Store(Path(known["paths.store"] or runs / ".store"))
    if not store.root.is_dir():
        raise InputError(f"there is no store {store.root}", where="paths.store", expected="a folder with results")
    now = "now" in line.words
    waste = remove(runs, store) if now else find_waste(runs, store)
    if not line.quiet:
        for path, why in waste.paths.items():
            print(f"{waste.size[path] / 1e6:10.2f} MB  {path}  ({why})")
    for path in waste.captures:
        print(f"kept: {path}, photographs of a capture that failed half way; remove it by hand if nobody resumes it")
    word = "removed" if now else "could go, none removed"
    print(f"{len(waste.paths)} values and files {word}, {waste.bytes / 1e6:.1f} MB; {waste.kept_runs} runs keep theirs")
    if waste.paths and not now:
        print("python -m pipeline clean now  removes them")
    return 0


def _debug(line: Line) -> int:
    from pipeline.commands.debug import debug

    if len(line.words) != 2:
        raise InputError("debug takes a run and a node", where="command line", expected="debug RUN NODE")
    return debug(Path(line.words[0]), line.words[1])


def _serve(line: Line) -> int:
    from pipeline.commands.serve import PORT, ReportServer

    if len(line.words) != 1:
        raise InputError("serve takes one run", where="command line", expected="serve RUN [--port N]")
    port = PORT if line.port is None else line.port
    with suppress(KeyboardInterrupt), ReportServer(Path(line.words[0]), port) as server:
        print(f"{server.url}  until Ctrl-C; /outputs lists the files", flush=True)
        server.serve_forever()
    return 0


def _to_stderr(line: Line) -> Callable[[str], None]:
    """Where to say what is neither a result nor an error."""

    def say(text: str) -> None:
        if not line.quiet:
            print(text, file=sys.stderr, flush=True)

    return say


COMMANDS: dict[str, Callable[[Line], int]] = {
    "run": _run,
    "why": _why,
    "list": _list,
    "show": _show,
    "verify": cli_review.verify,
    "diff": cli_review.diff,
    "bundle": cli_review.bundle,
    "export": _export,
    "clean": _clean,
    "debug": _debug,
    "serve": _serve,
}

TAKES_OVERRIDES = ("run", "why")
