"""A verification as text: one line a node, then what may explain the differences, then the sum."""

from __future__ import annotations

from pipeline.review.verification import NodeVerdict, Verification, counts

_WIDTH = len("within tolerance")


def verification_text(done: Verification) -> str:
    """What the command prints."""
    names = max((len(name) for name in done.nodes), default=0)
    stages = max((len(node.stage) for node in done.nodes.values()), default=0)
    lines = []
    for node in done.nodes.values():
        first, *more = _said(node)
        lines.append(f"{node.verdict:>{_WIDTH}}  {node.name:<{names}}  {node.stage:<{stages}}  {first}".rstrip())
        lines += [f"{'':>{_WIDTH}}  {'':<{names}}  {line}" for line in more]
    lines += _environment(done)
    lines.append(f"{counts(done)}{_start(done)}")
    return "\n".join(lines)


def _said(node: NodeVerdict) -> list[str]:
    """What there is to say of a node; the first line goes beside its name."""
    differences = [str(difference) for difference in node.differences]
    more = [node.remark] if node.remark else []
    if not node.good:
        inputs = (
            f"its inputs differ: {', '.join(node.changed_inputs)}" if node.changed_inputs else "its inputs are as then"
        )
        more.append(f"{inputs}; on the run's own inputs: {node.alone}" if node.alone else inputs)
    elif node.alone:
        more.append(f"on the run's own inputs: {node.alone}")
    return [*differences, *more] or [""]


def _environment(done: Verification) -> list[str]:
    lines = []
    if done.versions:
        listed = (f"{name} {then or 'none'} -> {now or 'none'}" for name, (then, now) in done.versions.items())
        lines.append("versions, then -> now: " + ", ".join(listed))
    then, now = done.commits
    if then != now:
        lines.append(f"commit, then -> now: {then or 'unknown'} -> {now or 'unknown'}")
    for module, nodes in done.code.items():
        lines.append(f"code differs: {module.replace('.', '/')}.py, used by {', '.join(nodes)}")
    return lines


def _start(done: Verification) -> str:
    """Where deviations start."""
    if not done.culprits:
        return ""
    follow = [node for node in done.nodes.values() if not node.good and node.changed_inputs]
    alike = sum(node.alone in {"identical", "within tolerance"} for node in follow)
    rest = f"; {alike} of the {len(follow)} that follow come out as then on the run's own inputs" if follow else ""
    return f"; deviations start at: {', '.join(done.culprits)}{rest}"
