"""Tables and figure of a search against its peers, from the result files.

python -m benchmarks.search.report --search NAME --in benchmarks/search/results
    [--out benchmarks/search/results] [--kind reported]
"""

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.search.results import Result, read_suite
from benchmarks.search.score import Ratio, Summary, compare, interval, share, times
from benchmarks.search.suites import SUITES, TARGETS, UNIMODAL


@dataclass(frozen=True, slots=True)
class Regime:
    """One row of the table: what is compared with what, and the factor asked for."""

    title: str
    suite: str
    peers: tuple[str, ...] | None  # None: all there are, our own searches left out
    at_least: float
    aim: str
    only: tuple[int, ...] | None = None  # targets; None: those of the suite
    unimodal: bool = False

    @property
    def targets(self) -> tuple[int, ...]:
        """Cells that count."""
        return TARGETS[self.suite] if self.only is None else self.only


REGIMES = (
    Regime("noise-free, one level: to pycma", "noise-free", ("pycma",), 2.0, "3"),
    Regime("noisy, one level: to the best of pycma, LRA", "noisy", ("pycma", "lra"), 1.5, "2.5"),
    Regime("ladder: to CMA-ES on the full level, 10 %, unimodal", "ladder", ("pycma",), 20.0, "60",
           only=(20,), unimodal=True),
    Regime("ladder: to the best peer", "ladder", None, 1.3, "2-3"),
    Regime("useless or misleading level: to CMA-ES on the full level", "bad", ("pycma",),
           1.0 / 1.2, "1"),
    Regime("useless or misleading level: to our own search on the full level", "bad",
           ("mfopt-target",), 1.0 / 1.2, "1"),
)  # fmt: skip

OWN = "mfopt"  # names of our own searches begin so
MOST_NAMED = 400  # lost cases in the table; beyond them a count


def report(directory: Path, search: str, kind: str) -> tuple[str, dict[str, Summary]]:
    """The tables as Markdown, and the summaries that the figure is drawn from."""
    rows, lost, summaries = [], [], {}
    for regime in REGIMES:
        results = read_suite(directory, kind, regime.suite)
        ours = results.get(search, [])
        others = _others(results, regime)
        if not ours or not others:
            rows.append(f"| {regime.title} | - | {regime.at_least:.2g} | {regime.aim} | not run |")
            continue
        summary = compare(ours, others, regime.targets, cases=_cases(regime))
        summaries[regime.title] = summary
        rows.append(_row(regime, summary, ours))
        alone = others if all(map(_own, others)) else {**_foreign(results), **others}
        lost += [f"\n### {regime.title}\n", *_by_peer(ours, alone, regime), *_lost(summary)]
    head = [
        f"# {search} against its peers, {kind} instances\n",
        "Ratio of expected running times, failures counted; above 1 ours is cheaper. The best "
        "peer is chosen anew on each case and target. Intervals: 95 %, bootstrap over instances.\n",
        "| regime | median ratio | at least | aim | cases x targets |",
        "|---|---|---|---|---|",
    ]
    return "\n".join([*head, *rows, *lost, *_cpu(directory, search, kind)]) + "\n", summaries


def draw(summaries: Mapping[str, Summary], path: Path) -> None:
    """One strip a regime: the ratio on each case and target with its interval.

    Triangles at the edge stand for ratios beyond it.
    """
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure, axes = plt.subplots(
        len(summaries), 1, figsize=(8, 1.2 + 1.8 * len(summaries)), squeeze=False
    )
    for axis, (title, summary) in zip(axes[:, 0], summaries.items(), strict=True):
        ratios = sorted(summary.ratios, key=lambda r: r.ratio)
        bottom, top = _shown_range(ratios)
        for place, r in enumerate(ratios):
            low, middle, high = np.clip([r.low, r.ratio, r.high], bottom, top)
            colour = "tab:red" if r.ratio < 1.0 else "tab:blue"
            mark = "^" if r.ratio > top else "v" if r.ratio < bottom else "."
            axis.plot([place, place], [low, high], color=colour, linewidth=0.8, alpha=0.5)
            axis.plot(place, middle, mark, color=colour, markersize=4, clip_on=False)
        axis.axhline(1.0, color="black", linewidth=0.8)
        axis.set_yscale("log")
        axis.set_ylim(bottom, top)
        axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
        axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.yaxis.set_minor_formatter(NullFormatter())
        axis.set_ylabel("cost ratio")
        axis.set_title(title, fontsize=9)
        axis.set_xticks([])
    axes[-1, 0].set_xlabel("cases and targets, sorted")
    figure.tight_layout()
    figure.align_ylabels()
    with plt.rc_context({"svg.hashsalt": "mfopt"}):  # the same figure is the same file
        figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def _shown_range(ratios: Sequence[Ratio]) -> tuple[float, float]:
    """Least and largest ratio shown: those that are finite, with room, within a factor of 1000."""
    known = [1.0, *(r.ratio for r in ratios if 0.0 < r.ratio < math.inf)]
    return max(0.6 * min(known), 1e-3), min(1.6 * max(known), 1e3)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write tables and figure."""
    parser = argparse.ArgumentParser(prog="report", description="a search against its peers")
    parser.add_argument("--search", required=True)
    parser.add_argument("--in", dest="directory", type=Path, required=True)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--kind", choices=("tuning", "reported"), default="reported")
    given = parser.parse_args(arguments)
    text, summaries = report(given.directory, given.search, given.kind)
    print(text)
    if given.out is not None:
        given.out.mkdir(parents=True, exist_ok=True)
        stem = f"{given.search}-{given.kind}"
        (given.out / f"{stem}.md").write_text(text)
        if summaries:
            draw(summaries, given.out / f"{stem}.svg")
    return 0


def _others(results: Mapping[str, list[Result]], regime: Regime) -> dict[str, list[Result]]:
    if regime.peers is None:
        return _foreign(results)
    return {name: results[name] for name in regime.peers if name in results}


def _foreign(results: Mapping[str, list[Result]]) -> dict[str, list[Result]]:
    return {name: rows for name, rows in results.items() if not _own(name)}


def _own(name: str) -> bool:
    return name.startswith(OWN)


def _cases(regime: Regime) -> list[str]:
    names = SUITES[regime.suite]
    if not regime.unimodal:
        return list(names)
    wanted = [f"/f{n}/" for n in UNIMODAL]
    return [n for n in names if n == "wing" or any(w in n for w in wanted)]


def _row(regime: Regime, s: Summary, ours: Sequence[Result]) -> str:
    instances = len({r.instance for r in ours})
    counted = f"{len(s.ratios)}, lost {len(s.lost)}, unreached {len(s.unreached)}"
    return (
        f"| {regime.title} | {times(s.centre)}{interval(s, instances)} "
        f"| {regime.at_least:.2g} | {regime.aim} | {counted}; {instances} instances |"
    )


def _by_peer(
    ours: Sequence[Result], others: Mapping[str, Sequence[Result]], regime: Regime
) -> list[str]:
    """Median ratio to each peer alone, on the cases and instances that both have."""
    lines = ["| peer alone | median ratio | lost | cases, instances |", "|---|---|---|---|"]
    for name, rows in others.items():
        s = compare(ours, {name: rows}, regime.targets, cases=_cases(regime))
        instances = max((r.instances for r in s.ratios), default=0)
        cases = len({r.case for r in s.ratios})
        lines.append(
            f"| {name} | {times(s.centre)}{interval(s, instances)} "
            f"| {len(s.lost)} of {len(s.ratios)} | {cases}, {instances} |"
        )
    return lines


def _lost(summary: Summary) -> list[str]:
    if not summary.ratios:
        return ["\nNo target was reached by anyone."]
    lines = ["\nLost:" if summary.lost else "\nNo case is lost."]
    if summary.lost:
        lines += [
            "",
            "| case | target | ratio | hits, ours and theirs | to |",
            "|---|---|---|---|---|",
        ]
    lines += [_lost_row(r) for r in summary.lost[:MOST_NAMED]]
    if summary.unreached:
        by_case: dict[str, list[str]] = {}
        for case, target in summary.unreached:
            by_case.setdefault(case, []).append(share(target))
        names = "; ".join(f"{case} at {', '.join(shares)}" for case, shares in by_case.items())
        lines.append(f"\nReached by nobody: {names}.")
    return lines


def _lost_row(r: Ratio) -> str:
    return (
        f"| {r.case} | {share(r.target)} | {times(r.ratio)}{interval(r, r.instances)} "
        f"| {r.hits[0]}, {r.hits[1]} of {r.instances} | {r.other} |"
    )


def _cpu(directory: Path, search: str, kind: str) -> list[str]:
    """The search's own processor time."""
    lines = ["\n## Own processor time\n", "| suite | median of a run | longest ask + tell |",
             "|---|---|---|"]  # fmt: skip
    for suite in SUITES:
        results = read_suite(directory, kind, suite).get(search, [])
        if results:
            median = float(np.median([r.cpu_s for r in results]))
            longest = max(r.slowest_s for r in results)
            lines.append(f"| {suite} | {median:.1f} s | {longest:.2f} s |")
    return lines


if __name__ == "__main__":
    sys.exit(main())
