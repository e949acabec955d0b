"""A small study that is run many times, each time disturbed in another way."""

import os
import re
import shutil
import subprocess
import sys
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mfopt.campaign.store import open_run

SIMULATOR = Path(__file__).with_name("simulator.py")
PYTHON = f"{sys.executable} -I -S {SIMULATOR}"

# The fine level has a shell around its simulator, as many have.
COMMANDS = f"""
[study]
name = "small"
seed = 3
[problem]
objective = "returned"
variable = [
    {{ name = "angle", lower = 10.0, upper = 60.0, start = 45.0, unit = "deg" }},
    {{ name = "width", lower = 0.02, upper = 0.2, unit = "m" }},
]
[[level]]
name = "coarse"
engine = "command"
command = ["{PYTHON.replace(" ", '", "')}"]
work = 1
[[level]]
name = "fine"
engine = "command"
command = ["sh", "-c", "{PYTHON}; exit $?"]
work = 10
[search]
method = "cma-es"
population_size = 5
seeds = 2
[[search.stage]]
level = "coarse"
generations = 2
[[search.stage]]
level = "fine"
generations = 1
[confirm]
seeds = 1
[run]
workers = 2
"""

TIME_LIMIT_S = 900.0  # of one mfopt; it takes a few seconds where nobody else needs the machine
GRACE_S = 20.0  # for the kernel and the keepers to end what was left

End = list[object]  # all that a run directory holds and that must repeat, bit for bit


@dataclass(frozen=True, slots=True)
class Ended:
    """How one mfopt ended."""

    returncode: int
    output: str
    errors: str


@dataclass(frozen=True, slots=True)
class Campaign:
    """A folder with one study, its run directory, and a folder for temporary files."""

    folder: Path
    environment: Mapping[str, str]

    @property
    def study(self) -> Path:
        return self.folder / "study.toml"

    @property
    def directory(self) -> Path:
        return self.folder / "run"

    @property
    def temporary(self) -> Path:
        return self.folder / "tmp"

    def start(self, **more: str) -> "subprocess.Popen[str]":
        """Start `mfopt run --resume`; `more` goes into its environment."""
        command = [sys.executable, "-m", "mfopt", "run", str(self.study), "--resume", "--quiet"]
        return subprocess.Popen(
            [*command, "--directory", str(self.directory)],
            env={**self.environment, **more},
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def run(self, **more: str) -> Ended:
        """Run it to its end, and end it at the time limit."""
        with self.start(**more) as process:
            try:
                output, errors = process.communicate(timeout=TIME_LIMIT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                output, errors = process.communicate()
                errors += f"\nno end within {TIME_LIMIT_S:g} s"
        return Ended(process.returncode, output, errors)

    def end(self) -> End:
        """What the run came to."""
        return end(self.directory)

    def journal(self) -> list[bytes]:
        """The whole lines of the journal, without a torn last one."""
        path = self.directory / "journal.jsonl"
        return path.read_bytes().split(b"\n")[:-1] if path.exists() else []

    def processes(self) -> dict[int, list[bytes]]:
        """Living processes that were started for this campaign, with their command lines."""
        mark = f"MFOPT_TEST_MARK={self.environment['MFOPT_TEST_MARK']}".encode()
        found = {}
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit() and int(entry.name) != os.getpid():
                try:
                    if mark in (entry / "environ").read_bytes().split(b"\0"):
                        found[int(entry.name)] = (entry / "cmdline").read_bytes().split(b"\0")
                except OSError:  # gone meanwhile
                    continue
        return found

    def leftovers(self) -> list[str]:
        """Temporary files and folders that nobody needs once mfopt has ended."""
        found = [p for p in self.temporary.iterdir() if not p.name.startswith("mfopt-cache")]
        if self.directory.exists():
            found += [p for p in self.directory.rglob(".*") if re.search(r"\.\d+$", p.name)]
        return sorted(str(path.relative_to(self.folder)) for path in found)


def end(run: Path) -> End:
    """All that must repeat, bit for bit: evaluations, but for CPU time, and insights."""
    its = open_run(run)
    evaluations = [
        (
            e.candidate.index, e.candidate.level, e.candidate.seed, e.candidate.purpose,
            e.candidate.x.tobytes(), e.objective, e.outcome.status, e.outcome.work,
            {name: array.tobytes() for name, array in sorted(e.outcome.raw.items())
             if not name.startswith("settling")},
        )
        for e in its.evaluations()
    ]  # fmt: skip
    return [*evaluations, *its.insights]


def new_campaign(folder: Path, study: str = COMMANDS) -> Campaign:
    """A campaign in a new folder, with a folder for temporary files of its own."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "tmp").mkdir(parents=True)
    campaign = Campaign(
        folder,
        {**os.environ, "TMPDIR": str(folder / "tmp"), "MFOPT_TEST_MARK": uuid.uuid4().hex},
    )
    campaign.study.write_text(study)
    return campaign


def complaint(ended: Ended, *, codes: tuple[int, ...]) -> str | None:
    """What is wrong with how mfopt ended, or None: a code of these, and one line if not 0."""
    said = ended.errors.strip()
    if "Traceback" in ended.errors + ended.output:
        return f"traceback: {said[-2000:]}"
    if ended.returncode not in codes:
        return f"exit code {ended.returncode}: {said[-500:]}"
    lines = said.splitlines()
    if ended.returncode and not (len(lines) == 1 and lines[0].startswith("error:")):
        return f"exit code {ended.returncode} without one line that says why: {said[-500:]!r}"
    return None


def difference(found: End, wanted: End) -> str | None:
    """What differs between two ends of the same study, or None."""
    if len(found) != len(wanted):
        return f"{len(found)} evaluations and insights, not {len(wanted)}"
    for one, other in zip(found, wanted, strict=True):
        if one != other:
            return f"differs: {str(one)[:300]}, not {str(other)[:300]}"
    return None


def resumes(campaign: Campaign, wanted: End) -> str | None:
    """Go on with a run that broke off; what is wrong with its end, or None."""
    wrong = complaint(campaign.run(), codes=(0,))
    if wrong is not None:
        return f"does not resume: {wrong}"
    wrong = difference(campaign.end(), wanted)
    if wrong is None and campaign.leftovers():
        wrong = f"left over: {', '.join(campaign.leftovers())}"
    if wrong is None and not (campaign.directory / "report.pdf").exists():
        wrong = "no report"
    return wrong
