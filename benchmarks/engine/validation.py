"""Does the compiled engine solve its equations? Small scenes against their closed forms.

    python -m benchmarks.engine.validation --out docs/engine

runs all scenes with the engine's own step (two minutes), writes `validation.json` and the figures,
and prints the table of the page as Markdown. The tests run the same scenes with tighter limits.
"""

import argparse
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.engine.small_scenes import (
    LEVEL,
    LIMIT_S,
    RATIO,
    YOUNG,
    G,
    R,
    Start,
    down,
    fan,
    finished,
    forces_at,
    material,
    mesh,
    moved,
    plane,
    scene,
    sled,
    spheres_in_line,
    still,
    trough,
    wall_stiffness,
)
from benchmarks.engine.validation_figures import draw_all
from benchmarks.engine.validation_scenes import (
    MU,
    SPEED,
    dropped,
    end_on,
    lack,
    on_slope,
    piles,
    returned,
)
from fidelity.dem.timestep import stable_timestep
from fidelity.engine import ContactLaw
from fidelity.engines.numba import MARGIN, NumbaEngine


@dataclass(frozen=True)
class Check:
    """One quantity."""

    quantity: str
    formula: str
    expected: float  # SI
    found: float
    unit: str

    @property
    def deviation(self) -> float:
        """Relative to what is expected, or absolute where that is zero."""
        return (self.found - self.expected) / (self.expected or 1.0)


def bounces() -> list[Check]:
    """Restitution, duration and depth of contacts."""
    checks = []
    laws: tuple[ContactLaw, ...] = ("linear", "hertz")
    for law in laws:
        found = float(returned(law, 0.5).mean())
        checks.append(Check(f"restitution of a sphere, {law}", "asked for", 0.5, found, ""))
        found = float(end_on(law, 0.5, 60.0).mean())
        checks.append(Check(f"of a clump's end at 60 degrees, {law}", "asked for", 0.5, found, ""))
    grain = spheres_in_line(1)
    damped = moved(dropped(grain, still(damping=0.2)), MARGIN).velocities[:, 2].mean() / SPEED
    formula = "sqrt((1 - d) / (1 + d))"
    checks.append(
        Check("restitution, numerical damping 0.2", formula, math.sqrt(0.8 / 1.2), damped, "")
    )
    modulus = YOUNG / (2 * (1 - RATIO**2))
    deepest = (15 / 16 * grain.mass * SPEED**2 / (modulus * math.sqrt(R))) ** 0.4
    rate = math.sqrt(wall_stiffness() / grain.mass)
    whole = 2 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
    for law, formula, depth, time in (
        ("linear", "pi sqrt(m / k)", SPEED / rate, math.pi / rate),
        ("hertz", "2.943 depth / v", deepest, whole * deepest / SPEED),
    ):
        setup = dropped(grain, still(contact_law=law))
        movement = moved(setup, MARGIN)
        flown = (setup.packing.positions[:, 2] - R) / SPEED
        flown = flown + (movement.positions[:, 2] - R) / movement.velocities[:, 2]
        lasted = movement.end_time - float(flown.mean())
        checks.append(Check(f"duration of a contact, {law}", formula, time, lasted, "s"))
        name = "v sqrt(m / k)" if law == "linear" else "(15 m v2 / (16 E* sqrt R))^(2/5)"
        found = movement.max_overlap * R
        checks.append(Check(f"depth of a contact, {law}", name, depth, found, "m"))
    return checks


def slides() -> list[Check]:
    """Sliding, sticking and rolling."""
    slope = math.radians(30)
    movement = on_slope(sled(), slope, 0.4)
    at = movement.end_time - movement.timestep / 2
    found = float(movement.velocities[0] @ down(slope)) / at
    wanted = G * (math.sin(slope) - MU * math.cos(slope))
    checks = [Check("block on 30 degrees", "g (sin a - mu cos a)", wanted, found, "m/s2")]
    stuck = math.atan(MU) - math.radians(1)
    movement = on_slope(sled(), stuck, 1.0)
    places = movement.snapshots["snapshot_positions"][:, 0]
    creep = float(np.linalg.norm(places[-1] - places[20]))
    checks.append(Check("creep 1 degree below the friction angle, 0.5 s", "0", 0.0, creep, "m"))
    slope, grain = math.radians(20), spheres_in_line(1)
    arm = R - 0.5 * grain.mass * G * math.cos(slope) / wall_stiffness()
    share = 1 / (1 + grain.inertia[1] / (grain.mass * arm**2))
    movement = on_slope(grain, slope, 0.5)
    found = float(movement.velocities[0] @ down(slope)) / (
        movement.end_time - movement.timestep / 2
    )
    formula = "g sin a / (1 + I / m arm2)"
    wanted = G * math.sin(slope) * share
    checks.append(Check("sphere rolling on 20 degrees", formula, wanted, found, "m/s2"))
    arm = R - 0.5 * grain.mass * G / wall_stiffness()
    share = 1 / (1 + grain.inertia[1] / (grain.mass * arm**2))
    movement = on_slope(grain, 0.0, 0.4, speed=0.5)
    found = float(movement.velocities[0, 0])
    formula = "v / (1 + I / m arm2)"
    checks.append(Check("sphere thrown flat, then rolling", formula, 0.5 * share, found, "m/s"))
    movement = on_slope(grain, 0.0, 1.0, rolling=0.05, speed=0.2, spin=0.2 / R)
    way = float(movement.positions[0, 0])
    wanted = 0.2**2 / (2 * 0.05 * G * R / arm * share)
    formula = "v2 (1 + I / m arm2) arm / (2 mu_r g R)"
    checks.append(Check("way until rolling friction stops it", formula, wanted, way, "m"))
    return checks


def fields() -> list[Check]:
    """Cohesion and drag."""
    grain = spheres_in_line(1)
    weight = grain.mass * G
    energy = weight / (0.5 * 2 * math.pi * R)
    physics = still(gravity=G, adhesion_energy=energy, restitution=0.3)
    start = Start((0.0, 0.0, 1e-6 - R))
    hung = moved(scene(grain, [start], plane(), physics=physics, duration=0.2), MARGIN)
    found = R + float(hung.positions[0, 2])
    formula = "(2 pi R w - m g) / k"
    checks = [Check("overlap of a hanging sphere", formula, weight / wall_stiffness(), found, "m")]
    for name, formula, drag, end in (
        ("linear", "g / k", still(gravity=G, linear_drag=20.0), G / 20),
        ("quadratic", "sqrt(g / k)", still(gravity=G, quadratic_drag=10.0), math.sqrt(G / 10)),
    ):
        fallen = moved(scene(grain, [Start((0.0, 0.0, 0.0))], physics=drag, duration=2.0), 1.0)
        speed = -float(fallen.velocities[0, 2])
        checks.append(Check(f"terminal velocity, {name} drag", formula, end, speed, "m/s"))
    return checks


def precession() -> Check:
    """Time of one turn of a clump's axis about its angular momentum."""
    grain, spin = spheres_in_line(5), np.array([40.0, 0.0, 90.0])
    momentum = grain.inertia * spin
    period = 2 * math.pi * grain.inertia[1] / float(np.linalg.norm(momentum))
    setup = scene(grain, [Start((0, 0, 0), LEVEL, spin=spin)], physics=still(), duration=period)
    step = MARGIN * stable_timestep(grain, material(), material(), setup.physics)
    movement = finished(NumbaEngine(fixed_timestep=step).move(setup, time_limit_s=LIMIT_S))
    # The axis' angle about the momentum, at the end, gives how far the turn is off.
    along = momentum / np.linalg.norm(momentum)
    w, x, y, z = movement.orientations[0]
    axis = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    across = np.cross(along, [1.0, 0.0, 0.0])
    angle = math.atan2(float(axis @ across), float(axis[0] - (axis @ along) * along[0]))
    turned = 1 + angle / (2 * math.pi)
    return Check("precession of a clump", "2 pi I / L", period, movement.end_time / turned, "s")


def walls() -> list[Check]:
    """Contacts with meshes."""
    overlap = 0.02 * R
    checks = []
    for triangles in (6, 20):
        force = forces_at(np.array([[0.0, 0.0, R - overlap]]), mesh(*fan(triangles, 0.1)))
        found = float(np.linalg.norm(force))
        name = f"force on a vertex of {triangles} coplanar triangles"
        checks.append(Check(name, "k d", wall_stiffness() * overlap, found, "N"))
    radius = 12 * R
    amplitude = 0.1
    sunk = spheres_in_line(1).mass * G / wall_stiffness()
    place = (radius - R + sunk) * np.array([-math.sin(amplitude), 0.0, -math.cos(amplitude)])
    times = np.arange(0.15, 0.4, 1e-3)
    setup = scene(
        spheres_in_line(1),
        [Start(place)],
        mesh(*trough(721, radius), friction=1.0),
        physics=still(gravity=G, restitution=0.3),
        duration=0.41,
        friction=1.0,
        snapshots=times,
    )
    movement = moved(setup, MARGIN)
    x = movement.snapshots["snapshot_positions"][:, 0, 0]
    at = movement.snapshots["snapshot_times"]
    near = slice(int(np.argmax(x)) - 25, int(np.argmax(x)) + 26)
    curve = np.polyfit(at[near] - 0.25, x[near], 2)
    found = 0.25 - curve[1] / (2 * curve[0])
    wanted = math.pi * math.sqrt(11 * R * 7 / 5 / G) * (1 + amplitude**2 / 16)
    formula = "pi sqrt(7 (r - R) / 5 g)"
    checks.append(Check("half swing in a trough of 721 facets", formula, wanted, float(found), "s"))
    return checks


def balance() -> list[Check]:
    """Energy from nowhere in a heap of clumps, as a share of what was turned over."""
    laws: tuple[ContactLaw, ...] = ("linear", "hertz")
    return [
        Check(f"energy from nowhere: {name}, {law}", "0", 0.0, 100 * lack(law, kind, MARGIN), "%")
        for law in laws
        for name, kind in piles().items()
    ]


GROUPS: tuple[Callable[[], list[Check]], ...] = (
    bounces,
    slides,
    fields,
    lambda: [precession()],
    walls,
    balance,
)


def table(checks: list[Check]) -> str:
    """The checks as a Markdown table."""
    lines = ["| quantity | closed form | value | engine | deviation |", "|---|---|---|---|---|"]
    for c in checks:
        off_by = f"{100 * c.deviation:+.3f} %" if c.expected else f"{c.found:.1e} {c.unit}"
        value, found = (f"{x:.5g} {c.unit}".strip() for x in (c.expected, c.found))
        lines.append(f"| {c.quantity} | {c.formula} | {value} | {found} | {off_by} |")
    return "\n".join(lines)


def main() -> None:
    """Run all, write the results and draw the figures."""
    parser = argparse.ArgumentParser(prog="validation", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    checks = [check for group in GROUPS for check in group()]
    (out / "figures").mkdir(parents=True, exist_ok=True)
    rows: list[Mapping[str, object]] = [
        {**asdict(check), "deviation": check.deviation} for check in checks
    ]
    (out / "validation.json").write_text(json.dumps(rows, indent=1) + "\n")
    draw_all(out / "figures")
    print(table(checks))


if __name__ == "__main__":
    main()
