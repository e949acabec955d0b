"""Damaged run directories: refused with one line, or used without a changed result."""

import functools
import json
import random
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from typer.testing import CliRunner, Result

from faults.campaign import End, end
from faults.table import Trial, unforeseen
from mfopt.campaign.store import open_run
from mfopt.commands.app import app
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Generation

ODD: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    1e308,
    10**400,
    "",
    "x",
    "\x00",
    "../..",
    [],
    {},
    [[]],
    {"a": 1},
)
State = tuple[End, list[Generation], str | None]  # evaluations and insights, generations, end
Damage = Callable[[random.Random, Path], str]


@dataclass(frozen=True, slots=True)
class Base:
    """A finished run directory that is copied and damaged."""

    study: Path
    directory: Path


@functools.cache
def undamaged(directory: Path) -> tuple[State, dict[str, Any]]:
    """What a run directory holds, and what `mfopt status` says of it."""
    said = json.loads(_mfopt("status", directory, "--json").stdout)
    return _state(directory), _headline(said)


def trial(folder: Path, base: Base, seed: int, number: int) -> Trial:
    """Damage a copy once, then have its status told, its report written, and its run resumed."""
    choose = random.Random(f"store {seed} {number}")
    shutil.rmtree(folder, ignore_errors=True)
    run = folder / "run"
    shutil.copytree(base.directory, run)
    damage = choose.choice(DAMAGES)
    what = damage(choose, run)
    case = f"{damage.__name__.strip('_')} {what} (seed {seed}, number {number})"
    commands = (
        ("status", run, "--json"),
        ("report", run, "--quiet"),
        ("run", base.study, "--directory", run, "--resume", "--json"),
    )
    for command in commands:
        loss = _judged(base, run, _mfopt(*command), str(command[0]))
        if loss is not None:
            return Trial("damaged store", case, f"{command[0]}: {loss}")
    shutil.rmtree(folder, ignore_errors=True)
    return Trial("damaged store", case, None)


def _mfopt(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


def _judged(base: Base, run: Path, done: Result, command: str) -> str | None:
    """What is wrong with how a command dealt with the damage, or None."""
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return unforeseen(done.exception)
    if "Traceback" in done.output or "bug of mfopt" in done.output:
        return f"traceback: {done.output[-600:]}"
    errors = done.stderr.strip().splitlines()
    if done.exit_code not in (0, 1, 2):
        return f"exit code {done.exit_code}"
    if done.exit_code:
        said = [line for line in errors if line.startswith("error: ")]
        return None if len(said) == 1 else f"exit code {done.exit_code}, no line: {errors}"
    return None if _named(run, done.stderr) else _silent_change(base, run, done, command)


def _named(run: Path, text: str) -> bool:
    """Whether a message says what of the run directory does not fit."""
    names = ("journal", "outcomes", "run.json", "study.toml", "report.html", "report.pdf")
    return bool(re.search(r"evaluation \d|line \d|" + "|".join(map(re.escape, names)), text))


def _silent_change(base: Base, run: Path, done: Result, command: str) -> str | None:
    """What a command that said nothing changed or used that is not as it was."""
    wanted, headline = undamaged(base.directory)
    try:
        found = _state(run)
    except ConfigError as error:
        return f"exit code 0, but the run cannot be opened: {error}"
    if command != "run" and found[2] is None:
        return None  # it says that the run has broken off: whole lines are gone from its end
    for name, one, other in zip(
        ("evaluations or insights", "generations", "end"), found, wanted, strict=True
    ):
        if one != other:
            return f"{name} changed without a word"
    if command != "report" and _headline(json.loads(done.stdout)) != headline:
        return f"other result without a word: {done.stdout}"
    return None


def _state(run: Path) -> State:
    its = open_run(run)
    return end(run), its.generations, its.end


def _headline(said: dict[str, Any]) -> dict[str, Any]:
    """What a run says of itself, but for the CPU time, which a run made again changes."""
    return {
        key: _headline(value) if isinstance(value, dict) else value
        for key, value in said.items()
        if not key.startswith("cpu")
    }


def _files(run: Path) -> list[Path]:
    """What a run needs; its reports are written anew."""
    return sorted(
        p for p in run.rglob("*") if p.is_file() and not p.name.startswith(("report.", "lock"))
    )


def _one(choose: random.Random, run: Path) -> Path:
    """A file: one of the few of the run itself, or one of the many with arrays."""
    files = _files(run)
    own = [path for path in files if path.parent == run]
    return choose.choice(choose.choice([own, files]))


def _flip_bit(choose: random.Random, run: Path) -> str:
    path = _one(choose, run)
    content = bytearray(path.read_bytes())
    at = choose.randrange(len(content))
    content[at] ^= 1 << choose.randrange(8)
    path.write_bytes(content)
    return f"{at} of {path.relative_to(run)}"


def _change_digit(choose: random.Random, run: Path) -> str:
    path = _one(choose, run)
    content = bytearray(path.read_bytes())
    digits = [at for at, byte in enumerate(content) if chr(byte).isdigit()]
    at = choose.choice(digits or [0])
    content[at] = ord(choose.choice("0123456789".replace(chr(content[at]), "")))
    path.write_bytes(content)
    return f"{at} of {path.relative_to(run)}"


def _scramble(choose: random.Random, run: Path) -> str:
    path = _one(choose, run)
    content = bytearray(path.read_bytes())
    at = choose.randrange(len(content))
    content[at : at + 64] = choose.randbytes(64)
    path.write_bytes(content)
    return f"64 bytes at {at} of {path.relative_to(run)}"


def _cut(choose: random.Random, run: Path) -> str:
    path = _one(choose, run)
    size = choose.choice([0, choose.randrange(path.stat().st_size)])
    path.write_bytes(path.read_bytes()[:size])
    return f"{path.relative_to(run)} to {size} bytes"


def _append(choose: random.Random, run: Path) -> str:
    path = _one(choose, run)
    more = choose.choice([b"\n", b"\x00" * 4096, b"{}\n", b"[1]\n", b'{"kind": "end"}\n', b"x"])
    path.write_bytes(path.read_bytes() + more)
    return f"{more[:20]!r} to {path.relative_to(run)}"


def _exchange_files(choose: random.Random, run: Path) -> str:
    one, other = choose.sample(_files(run), 2)
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    if choose.random() < 0.5:
        other.write_bytes(first)
    return f"{one.relative_to(run)} and {other.relative_to(run)}"


def _replace_file(choose: random.Random, run: Path) -> str:
    path = choose.choice([_one(choose, run), run / "report.html", run / "outcomes"])
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    how = choose.choice(["nothing", "directory", "loop", "dangling link", "no right to read"])
    if how == "directory":
        path.mkdir()
        (path / "inside").touch()
    elif how == "loop":
        path.symlink_to(path.name)
    elif how == "dangling link":
        path.symlink_to("not-there")
    elif how == "no right to read":
        path.touch(mode=0)
    return f"{path.relative_to(run)} by {how}"


def _lines(choose: random.Random, run: Path) -> str:
    """Journal lines twice, gone, or in another order."""
    path = run / "journal.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    at, to = choose.randrange(len(lines)), choose.randrange(len(lines))
    how = choose.choice(["twice", "gone", "exchanged", "moved", "all after gone"])
    if how == "twice":
        lines.insert(to, lines[at])
    elif how == "gone":
        del lines[at]
    elif how == "exchanged":
        lines[at], lines[to] = lines[to], lines[at]
    elif how == "moved":
        lines.insert(to, lines.pop(at))
    else:
        del lines[at:]
    path.write_bytes(b"".join(lines))
    return f"of the journal: {at} {how} ({to})"


def _odd_value(choose: random.Random, run: Path) -> str:
    """A journal line or the header with a value of another type, or without a key."""
    header = choose.random() < 0.3
    path = run / ("run.json" if header else "journal.jsonl")
    lines = [path.read_text()] if header else path.read_text().splitlines()
    at = choose.randrange(len(lines))
    value = json.loads(lines[at])
    where, key = value, choose.choice(list(value))
    while isinstance(where[key], dict) and where[key] and choose.random() < 0.7:
        where, key = where[key], choose.choice(list(where[key]))
    odd = choose.choice(ODD)
    if choose.random() < 0.2:
        del where[key]
        odd = "left out"
    else:
        where[key] = odd
    if choose.random() < 0.1:
        value = odd = choose.choice([None, 3, "line", [], [value], {}])
    lines[at] = json.dumps(value)
    path.write_text("\n".join(lines) + "\n")
    return f"{path.name}, line {at + 1}: {key} = {str(odd)[:30]!r}"


DAMAGES: tuple[Damage, ...] = (
    _flip_bit, _change_digit, _scramble, _cut, _append, _exchange_files, _replace_file, _lines,
    _odd_value,
)  # fmt: skip
