"""Study files at random through the code of `mfopt check`: each is taken or refused in one line.

Half of them are valid TOML: the shipped studies and one that names every key, with values, keys
and tables changed. The others are their text, damaged.

    python tests/faults/fuzz_studies.py --count 10000 --seed 1
"""

import argparse
import io
import json
import random
import resource
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

from rich.console import Console

from fidelity.assemble import assemble
from mfopt.commands.check import described
from mfopt.errors import MfoptError
from mfopt.study import read_study

EXAMPLES = Path(__file__).parents[2] / "examples"
SLOW_S = 10.0
LARGE_BYTES = 1e9

EVERYTHING = """
study = { name = "all", seed = 1 }
confirm = { seeds = 2, reference = ["yade", "numba"] }
run = { workers = 2, scheduler = "tcp://127.0.0.1:1" }
[problem]
scene = "dosing"
objective = "filling_time"
[problem.dosing]
cup = { length_mm = 130, width_mm = 100, radius_mm = 20, volume_ml = 1279 }
stroke_mm = 400
cycle_ms = 600
duration_ms = 1200
tube_end_z_mm = -560
portion_kg = 1.0
grain_length_mm = 7
grain_width_mm = 2
grain.young_modulus_pa = 1e8
grain.poisson_ratio = 0.2
grain.density_kg_m3 = 1592
grain.friction_angle_deg = 43
wall.young_modulus_pa = 2e11
wall.poisson_ratio = 0.33
wall.density_kg_m3 = 7800
wall.friction_angle_deg = 25
values = { l0 = 150, w0 = 115, z1 = -80, l3 = 95 }
free = { l1 = [80, 180], z1 = [-90, -70], s2 = [-30, 30], v = [0.2, 4], y1 = [0.1, 0.9] }
[[level]]
name = "reduced"
engine = "reduced"
grains = 1000
[[level]]
name = "soft"
engine = ["bullet", "numba"]
grains = 100
spheres_per_grain = 3
young_modulus_pa = 1e5
damping = 0.2
damp_gravity = true
timestep_factor = 0.5
chordal_error_mm = 1.0
time_limit_s = 100
[[level]]
name = "top"
engine = "yade"
grains = 300
precision = "longdouble"
[search]
budget = 5
population_size = 8
sigma = 0.3
seeds = 2
exchange = ["y1", "v"]
"""
PLANNED = """
[study]
name = "planned"
[problem]
objective = "returned"
objective_unit = "EUR"
[[problem.variable]]
name = "a"
lower = -1.0
upper = 1.0
start = 0.5
unit = "m"
[[problem.variable]]
name = "b"
lower = 0
upper = 1
[[level]]
name = "own"
engine = "command"
command = ["true", "x"]
work = 2.5
time_limit_s = 10
[search]
method = "cma-es"
reevaluate = "ranks"
[[search.stage]]
level = "own"
generations = 3
population_size = 5
sigma = 0.1
seeds = 2
objective = "returned"
"""

NUMBERS: tuple[Any, ...] = (
    0, 1, -1, 2, 3, 50, 10**6, 10**12, 2**31, 2**63, 2**64, 10**30, 10**308, 10**400, -(10**400),
    0.0, -0.0, 0.5, 1e-3, 1e-6, 1e-12, 1e6, 1e12, 1e100, 1e200, 1e300, 1.7e308, -1.7e308, 5e-324,
    1e-320, float("nan"), float("inf"), float("-inf"), 0.1 + 0.2, 1 - 1e-16,
)  # fmt: skip
TEXTS = (
    "", " ", "-", "a", "..", "../../evil", "/", "a/b", "[/]", "[bold]", "$\\foo$", "\0", "\x1b[31m",
    "\u200b", "\u202e", "\n", "%s", "{}", "nan", "1e5", "true", "numba", "yade", "bullet",
    "reduced", "command", "assisted", "cma-es", "dosing", "dispersion", "returned", "l1", "y1",
    "x" * 300, "ä" * 90, "\U0001f35a",
)  # fmt: skip
KEYS = (
    "name", "seed", "engine", "grains", "level", "free", "values", "budget", "stage", "cup", "work",
    "x", "", "a.b", "\0", "lower", "command", "time_limit_s", "z0", "z1", "r1", "v", "reference",
)  # fmt: skip

SIGNS = (b"[", b"]", b'"', b"'", b"=", b".", b"{", b"#", b"\\", b"\n", b",")
NESTING = (b"[", b"{a=", b"a.", b"[[", b"9")


@dataclass(slots=True)
class Found:
    """What became of the studies."""

    count: Counter[str] = field(default_factory=Counter)
    tracebacks: list[tuple[bytes, str]] = field(default_factory=list)
    slowest_s: float = 0.0
    slow: list[bytes] = field(default_factory=list)
    peak_bytes: float = 0.0

    @property
    def sound(self) -> bool:
        """Whether every study was taken or refused, soon and in little memory."""
        return not self.tracebacks and not self.slow and self.peak_bytes < LARGE_BYTES


def fuzz(count: int, seed: int) -> Found:
    """Put `count` random studies through what `mfopt check` does, in this process."""
    found = Found()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        for content in studies(count, seed):
            path.write_bytes(content)
            began = time.monotonic()
            found.count[_checked(path, content, found)] += 1
            took = time.monotonic() - began
            found.slowest_s = max(found.slowest_s, took)
            if took > SLOW_S:
                found.slow.append(content)
    found.peak_bytes = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return found


def _checked(path: Path, content: bytes, found: Found) -> str:
    screen = Console(file=io.StringIO(), markup=False, width=80)
    try:
        study, _ = read_study(path)
        for part in described(study, assemble(study, where=str(path))):
            screen.print(part)
    except MfoptError:
        return "refused"
    except Exception as error:
        found.tracebacks.append((content, f"{type(error).__name__}: {error}"))
        return "traceback"
    return "accepted"


def studies(count: int, seed: int) -> Iterator[bytes]:
    """Random study files: changed and damaged ones in turn."""
    rng = random.Random(seed)
    texts = [path.read_text(encoding="utf-8") for path in sorted(EXAMPLES.glob("*.toml"))]
    texts += [EVERYTHING, PLANNED]
    for number in range(count):
        text = rng.choice(texts)
        if number % 2:
            yield _damaged(text.encode(), rng)
        else:
            yield _toml(_changed(tomllib.loads(text), rng)).encode("utf-8", "surrogatepass")


def _changed(study: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        place = rng.choice(list(_places(study)))
        _change(*place, rng)
    return study


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every container with every key or index into it, at any depth."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in list(items):
        yield value, key
        if isinstance(inner, dict | list):
            yield from _places(inner)


def _change(container: Any, key: Any, rng: random.Random) -> None:
    value = container[key]
    match rng.randrange(8):
        case 0:
            del container[key]
        case 1 if isinstance(container, dict):
            container[rng.choice(KEYS)] = container.pop(key)
        case 2 if isinstance(container, list):
            container.insert(key, value)
        case 3 if isinstance(container, dict):
            container[rng.choice(KEYS)] = _value(rng, 2)
        case 4 if isinstance(value, int | float) and not isinstance(value, bool):
            container[key] = value * 10.0 ** rng.randint(-12, 12) * rng.choice((1, 1, -1))
        case 5 if isinstance(value, dict | list):
            for other in list(value)[1:] if isinstance(value, dict) else value[1:]:
                value.pop(other if isinstance(value, dict) else -1)
        case 6 if isinstance(value, str):
            container[key] = value + rng.choice(TEXTS)
        case _:
            container[key] = _value(rng, 3)


def _value(rng: random.Random, depth: int) -> Any:
    match rng.randrange(7 if depth else 5):
        case 0 | 1:
            return rng.choice(NUMBERS)
        case 2:
            return rng.choice(TEXTS)
        case 3:
            return rng.random() < 0.5
        case 4:
            return rng.choice((date(2020, 1, 1), datetime(2020, 1, 1) + timedelta(days=1)))
        case 5:
            many = rng.choice((0, 1, 2, 3, 60, 2000)) if depth > 2 else rng.randrange(3)
            return [_value(rng, depth - 1) for _ in range(many)]
        case _:
            return {rng.choice(KEYS): _value(rng, depth - 1) for _ in range(rng.randrange(3))}


def _toml(value: Any) -> str:
    """A study as TOML, its tables inline."""
    return "".join(f"{_text(key)} = {_inline(inner)}\n" for key, inner in value.items())


def _inline(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case dict():
            inner = (f"{_text(key)} = {_inline(inner)}" for key, inner in value.items())
            return "{" + ", ".join(inner) + "}"
        case list() | tuple():
            return "[" + ", ".join(map(_inline, value)) + "]"
        case str():
            return _text(value)
        case date():
            return value.isoformat()
        case _:
            return repr(value)


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _damaged(content: bytes, rng: random.Random) -> bytes:
    text = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        at = rng.randrange(len(text) + 1)
        match rng.randrange(7):
            case 0:
                text[at:at] = bytes([rng.randrange(256)])
            case 1:
                del text[at : at + rng.choice((1, 1, 5, 50))]
            case 2:
                text[at:at] = rng.choice(SIGNS)
            case 3:
                begin = rng.randrange(len(text) + 1)
                text[at:at] = text[begin : begin + rng.choice((5, 50, 500))]
            case 4:
                text[at:at] = str(rng.choice(NUMBERS)).encode()
            case 5:
                text[at:at] = rng.choice(NESTING) * rng.choice((3, 300, 3000))
            case _:
                text[at:at] = rng.choice(TEXTS).encode("utf-8")
    return bytes(text) if rng.random() > 0.02 else b"\xef\xbb\xbf" + content


def main() -> None:
    """Print how many were tried, taken and refused; fail if one ended otherwise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    found = fuzz(given.count, given.seed)
    print(f"{given.count} studies: {dict(found.count)}; slowest {found.slowest_s:.2f} s; "
          f"peak {found.peak_bytes / 1e6:.0f} MB")  # fmt: skip
    for content, why in found.tracebacks[:20]:
        print(why, content[:3000], sep="\n")
    raise SystemExit(0 if found.sound else 1)


if __name__ == "__main__":
    main()
