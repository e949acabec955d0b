"""Diagnose real recordings and print what is said of them.

    MFOPT_RECORDINGS=FOLDER python -m benchmarks.concealed.real balls|pendulum --work DIR

The recordings are no part of this repository. A simulation without friction or drag is given, and
effects that it may lack; nothing says which of them is there. Each case is kept in DIR and not
diagnosed again.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.calibration.real import balls, pendulum
from benchmarks.calibration.real.kept import chosen, result
from benchmarks.calibration.real.text import CaseText

OF_ONE_BALL = {
    "linear": ("[0.0, 0.6]", "1/s", "linear drag over the mass"),
    "quadratic": ("[0.0, 0.06]", "1/m", "quadratic drag over the mass"),
}
OF_ALL_BALLS = {
    "drag": ("[0.0, 1.5]", "-", "coefficient of quadratic drag, by the area of each ball"),
    "viscous": ("[0.0, 0.3]", "kg/(m s)", "viscous drag, by the diameter of each ball"),
    "buoyancy": ("[0.0, 30.0]", "-", "lift over the weight of the displaced air"),
    **OF_ONE_BALL,
}
OF_A_PENDULUM = {
    "viscous": ("[0.0, 0.3]", "1/s", "viscous damping"),
    "dry": ("[0.0, 0.6]", "rad/s2", "dry friction"),
    "quadratic": ("[0.0, 0.3]", "-", "drag with the square of the rate"),
}
BESIDE_DRAG = {name: OF_ALL_BALLS[name] for name in ("viscous", "buoyancy")}
BALLS = ("Bowling Ball", "Golf Ball", "Tennis Ball", "Whiffle Ball 1")  # one by one
HELD_OUT = ("Blue Basketball", "Tennis Ball", "Yellow Whiffle Ball")  # of all together
RUNS_OF_ONE, RUNS_OF_ALL = 240, 1000


def of_balls(data: Path) -> list[CaseText]:
    """All balls together, and some alone.

    Together: the two drops of a ball are repeats, three balls are held out. Alone: the first drop
    is fitted, the second is held out, and no error of the camera is stated. The bowling ball also
    with a drag coefficient as its parameter, released from rest.
    """
    file = data / balls.FOLDER / balls.FILE
    made = [CaseText("all", _together(file), RUNS_OF_ALL)]
    for ball in BALLS:
        name = ball.lower().replace(" ", "-")
        drops = (balls.drop(ball, n, file, "", held_out=n == 2) for n in (1, 2))
        text = balls.before(name, ("speed",), 0.0) + effects(OF_ONE_BALL) + "".join(drops)
        made.append(CaseText(name, text, RUNS_OF_ONE))
    known = balls.measures(BALLS[0])
    drops = (balls.drop(BALLS[0], n, file, known, held_out=n == 2) for n in (1, 2))
    text = balls.before("bowling-ball-with-drag", ("drag",), 0.0) + effects(BESIDE_DRAG)
    return [*made, CaseText("bowling-ball-with-drag", text + "".join(drops), RUNS_OF_ONE)]


def _together(file: Path) -> str:
    text = balls.before("all", ("speed",)) + effects(OF_ALL_BALLS)
    for ball in balls.SIZES:
        rows = ", ".join(f'{{ ball = "{ball}", drop = {n} }}' for n in (1, 2))
        text += f"""
[[recording]]
name = "{ball}"
conditions = {{ height = 47.0, duration = 4.0{balls.measures(ball)} }}
files = ["{file}"]
rows = [{rows}]
held_out = {str(ball in HELD_OUT).lower()}
"""
    return text


def of_pendulum(data: Path) -> list[CaseText]:
    """A pendulum with a frequency that is to be fitted, and without friction."""
    ranges = {"frequency": pendulum.RANGES["frequency"]}
    text, files = pendulum.case(data, "pendulum", ranges, {}, effects(OF_A_PENDULUM))
    return [CaseText("pendulum", text, RUNS_OF_ALL, files)]


def effects(those: Mapping[str, tuple[str, str, str]]) -> str:
    """The table of effects: range, unit and meaning of each."""
    lines = (
        f'{name} = {{ range = {ends}, null = 0.0, unit = "{unit}", meaning = "{meaning}" }}\n'
        for name, (ends, unit, meaning) in those.items()
    )
    return "\n[effects]\n" + "".join(lines)


CASES = {"balls": of_balls, "pendulum": of_pendulum}


def main(arguments: Sequence[str] | None = None) -> int:
    """Diagnose all cases, or those that are named."""
    for case, work in chosen("diagnoses of real recordings", CASES, arguments):
        folder = work / case.name
        library = ("--library", str(folder / "library"))
        found = result(case, folder, "diagnose", "diagnosis.json", *library)
        print("\n".join([f"# {case.name}", *found["words"], ""]), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
