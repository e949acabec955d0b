"""Cases of a flat-bottomed slot hopper: plastic balls, the discharged share over time.

The balls have their real number and size, since grains twice as large would pass the slot more
slowly. Restitution is that of another group; friction of the walls lies about what it measured.
"""

import csv
from pathlib import Path

from benchmarks.calibration.real.text import CaseText, head

FILE = "hopper_discharge_digitised/hopper_discharge_fraction.csv"
SERIES = "plastic_ball"
COUNT, DIAMETER_MM, DENSITY = 14_000, 6.0, 1592.0
RUNS = 24  # 14 000 balls: two to three minutes each
PARAMETERS = {
    "friction": "[parameters.friction]\nrange = [0.1, 0.8]\n",
    "rolling": '[parameters."rolling_resistance.coefficient"]\nrange = [0.0, 0.2]\n',
    "wall": "[parameters.wall_friction]\nrange = [0.2, 0.6]\nprior.normal = [0.4, 0.1]\n",
}
MEASURED = """clock_offset_s = 0.1       # the curve was read off a figure

[measurement.discharged_fraction]
noise = 0.005

[[recording]]
name = "balls"
files = ["balls.csv"]
"""
MODELS = {"sliding": ("friction", "wall"), "rolling": ("friction", "wall", "rolling")}


def cases(data: Path) -> list[CaseText]:
    """The cases: with sliding friction alone, and with rolling resistance too."""
    with (data / FILE).open() as lines:
        rows = [row for row in csv.DictReader(lines) if row["series"] == SERIES]
    curve = "".join(f"{row['t_s']},{row['discharged_pct']}\n" for row in rows)
    files = {"balls.csv": "time [s],discharged_fraction [%]\n" + curve}
    return [
        CaseText(f"hopper-{name}", whole(f"hopper-{name}", names), RUNS, files)
        for name, names in MODELS.items()
    ]


def whole(name: str, parameters: tuple[str, ...]) -> str:
    """The case file."""
    mass = COUNT * 3.141593 / 6.0 * (1e-3 * DIAMETER_MM) ** 3 * DENSITY
    rig = f"""scene = "discharge"

[rig.discharge]
length_mm = 200
depth_mm = 40
opening_mm = 40
duration_ms = 6500

[rig.grains]
portion_kg = {mass:.4f}
grain_length_mm = {DIAMETER_MM}
grain_width_mm = {DIAMETER_MM}

[rig.grains.grain]
density_kg_m3 = {DENSITY}
young_modulus_pa = 2e6     # softened, for longer time steps
poisson_ratio = 0.25
friction_angle_deg = 20    # replaced by the parameter

[rig.level]
spheres_per_grain = 1
restitution = 0.85
"""
    return head(name, rig, (PARAMETERS[p] for p in parameters), MEASURED)
