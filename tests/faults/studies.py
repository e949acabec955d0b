"""Fuzzed study files through `mfopt check`: refused with one line, soon, and in little memory."""

import math
import random
import resource
import time
from collections.abc import Iterable, Iterator
from datetime import date
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from faults.table import Trial, unforeseen
from mfopt.commands.app import app

LONGEST_S = 10.0  # [s] of one check
MOST_MEMORY = 1e9  # [bytes] that the process may come to hold beyond what it holds at first

ODD: tuple[Any, ...] = (
    date(2020, 1, 1), "nan", "1e5", "numba", "yade", "reduced", "command", "assisted", "returned",
    True, False, 0, -1, 1, 3, 2**31, 2**63, 10**18, 10**400, 0.0, -0.0, 0.5, 1e-320, 5e-324, 1e-9,
    1e12, 1e308, -1e308, math.inf, -math.inf, math.nan, "", " ", "x", "../../evil", "/", ".", "a/b",
    "$\\foo$", "[/]", "[bold]", "\u0000", "\ud7ff", "名前", "é" * 300, "x" * 100_000, "\n", "%s{}",
    [], {}, [[]], [{}], [1, 2], ["a", "b"], {"a": {}}, [1, "a", []], [0.1] * 1000,
)  # fmt: skip
KEYS = ("", "é", "a.b", "name", "seed", "engine", "grains", "level", "free", "values", "work", "z1")


def trials(
    folder: Path, studies: list[dict[str, Any]], seed: int, numbers: Iterable[int]
) -> Iterator[Trial]:
    """Check fuzzed studies, every second one valid TOML, all in this process."""
    folder.mkdir(parents=True, exist_ok=True)
    at_first = _memory()
    for number in numbers:
        choose = random.Random(f"study {seed} {number}")
        content = toml(_changed(choose, choose.choice(studies))).encode()
        if number % 2:
            content = _damaged(choose, content)
        path = folder / f"{number}.toml"
        path.write_bytes(content)
        loss = _checked(path)
        if loss is None and _memory() - at_first > MOST_MEMORY:
            loss = f"{(_memory() - at_first) / 1e9:.1f} GB more than at first"
            at_first = _memory()
        if loss is None:
            path.unlink()
        yield Trial("fuzzed study", f"{path.name} (seed {seed}, number {number})", loss)


def _checked(path: Path) -> str | None:
    began = time.monotonic()
    done = CliRunner().invoke(app, ["check", str(path)])
    took_s = time.monotonic() - began
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return unforeseen(done.exception)
    if "Traceback" in done.output or "bug of mfopt" in done.output:
        return f"traceback: {done.output[-600:]}"
    if done.exit_code not in (0, 2) or (done.exit_code and "error: " not in done.stderr):
        return f"exit code {done.exit_code}: {done.output[-500:]}"
    return f"{took_s:.0f} s" if took_s > LONGEST_S else None


def _memory() -> float:
    """The most memory that this process has held [bytes]."""
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _changed(choose: random.Random, study: dict[str, Any]) -> dict[str, Any]:
    """The study with one to three values changed, keys left out, added or renamed."""
    changed: dict[str, Any] = _copy(study)
    for _ in range(choose.choice([1, 1, 1, 2, 3])):
        _change(choose, changed)
    return changed


def _change(choose: random.Random, study: dict[str, Any]) -> None:
    where: Any = study
    while True:
        keys = list(where) if isinstance(where, dict) else list(range(len(where)))
        if not keys:
            return
        key = choose.choice(keys)
        deeper = where[key]
        if not (isinstance(deeper, dict | list) and deeper) or choose.random() < 0.15:
            break
        where = deeper
    how = choose.choice(["odd", "odd", "odd", "scaled", "left out", "twice"])
    if how == "odd":
        where[key] = _copy(choose.choice(ODD))
    elif how == "scaled" and isinstance(where[key], int | float):
        where[key] *= choose.choice([-1, 0.1, 10, 1000, 1e6, 1e-6])
    elif how == "left out":
        del where[key]
    elif isinstance(where, dict):
        name = choose.choice([*KEYS, f"{key}s", str(key)[:-1]])
        where[name] = _copy(where[key])
    else:
        where.append(_copy(where[key]))


def _copy(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _copy(inner) for key, inner in value.items()}
    return [_copy(inner) for inner in value] if isinstance(value, list) else value


def _damaged(choose: random.Random, content: bytes) -> bytes:
    """The text with bytes changed, left out, put in, twice, or cut off."""
    text = bytearray(content)
    for _ in range(choose.choice([1, 1, 2, 5, 50])):
        at, length = choose.randrange(len(text) + 1), choose.choice([1, 1, 5, 100])
        how = choose.choice(["bytes", "text", "out", "twice", "cut", "deep", "mark"])
        if how == "bytes":
            text[at : at + length] = choose.randbytes(length)
        elif how == "text":
            text[at:at] = choose.choice([b"[", b"]", b'"', b"=", b"\n", b".", b"'''", b"9" * 5000])
        elif how == "out":
            del text[at : at + length]
        elif how == "twice":
            text[at:at] = text[at : at + 10 * length]
        elif how == "cut":
            del text[max(at, len(text) // 2) :]
        elif how == "deep":
            text[at:at] = choose.choice([b"[", b"a.", b"{a="]) * 5000
        else:
            text[:0] = b"\xef\xbb\xbf"
    return bytes(text)


def toml(study: dict[str, Any]) -> str:
    """A study as TOML: its tables, with all below them inline."""
    return "".join(f"{_text(key)} = {_value(value)}\n" for key, value in study.items())


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{_text(k)} = {_value(v)}' for k, v in value.items())}}}"
    return str(value) if isinstance(value, date) else repr(value)


def _text(text: str) -> str:
    kept = {'"', "\\"}
    return '"' + "".join(
        c if c.isprintable() and c not in kept else f"\\U{ord(c):08x}" for c in text
    ) + '"'  # fmt: skip
