from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from toys import toys

__all__ = ["measurements", "toys"]

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def measurements() -> Path:
    """Folder of real measurements; tests that need it are skipped where it is not at hand."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("no folder of real measurements beside the checkout")
    return folder


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print what was injected on purpose; the counts come with the tests' reports, also from other processes."""
    injected: Counter[str] = Counter()
    lost: Counter[str] = Counter()
    for reports in terminalreporter.stats.values():
        for report in reports:
            for name, value in getattr(report, "user_properties", ()):
                if name == "fault" and getattr(report, "when", "") == "call":
                    injected[value[0]] += value[1]
                    lost[value[0]] += value[2]
    if not injected:
        return
    terminalreporter.section("faults")
    width = max(map(len, injected))
    terminalreporter.write_line(f"{'kind':<{width}} | injected | lost")
    for kind in sorted(injected):
        terminalreporter.write_line(f"{kind:<{width}} | {injected[kind]:8} | {lost[kind]:4}")
