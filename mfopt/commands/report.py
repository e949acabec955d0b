"""`mfopt report`: the HTML and PDF pages of a run directory."""

import math
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console

from fidelity.assemble import Assembled, assemble
from fidelity.bound import filling_time_bound, smallest_filling_time_bound
from fidelity.dosing import cup_motion, design, design_parts
from fidelity.dosing_level import DosingLevel
from fidelity.dosing_run import dosing_grain
from fidelity.settings import DosingSettings
from geometry.manufacturability import manufacturability
from mfopt.arrays import Array
from mfopt.commands.shared import Quiet, RunPath, console
from mfopt.files import full_disk_named
from mfopt.level import Level
from mfopt.store import open_run
from mfopt.study import read_study
from reports.design import Describe, DesignView, no_view


def report(path: RunPath, quiet: Quiet = False) -> None:
    """Write report.html and report.pdf of a finished, running or broken-off run."""
    study_file, parts = open_run(path).study_file, None
    if study_file.stat().st_size:  # a run of `mfopt.minimize` has an empty one
        study, _ = read_study(study_file)
        parts = assemble(study, where=str(study_file))
    with full_disk_named(path):
        write_reports(path, parts, console(quiet=quiet))


def write_reports(path: Path, parts: Assembled | None, on: Console) -> None:
    from reports.write import write_report

    describe: Describe = no_view
    if parts is not None and (dosing := parts.dosing) is not None:
        bound = _finite(smallest_filling_time_bound(dosing))
        describe = partial(_view, dosing, parts.confirm_on.top, bound)
    pages = {"html": path / "report.html", "pdf": path / "report.pdf"}
    write_report(open_run(path), describe=describe, **pages)
    for page in pages.values():
        on.print(f"wrote {page}")


def _view(dosing: DosingSettings, top: Level, bound_any_s: float | None, x: Array) -> DesignView:
    """What a report shows of a design besides its numbers."""
    machine, motion = design(dosing, x), cup_motion(dosing, x)
    grain = dosing_grain(dosing, top.dem) if isinstance(top, DosingLevel) else None
    no_grain = np.empty((0, 3))
    law = machine.motion
    points = {"P1": (law.x1, law.y1), "P2": (law.x2, law.y2)}
    return DesignView(
        label="",
        x=x,
        parts={name: (m.vertices, m.triangles) for name, m in design_parts(dosing, x).items()},
        motion_times=motion.times,
        cup_positions=motion.positions,
        cup_velocities=motion.velocities,
        motion_points={
            name: (t * machine.cycle, machine.stroke * (y - 0.5)) for name, (t, y) in points.items()
        },
        notes=tuple(manufacturability(machine.loft).sentences()),
        bound_s=_finite(filling_time_bound(machine)),
        bound_any_s=bound_any_s,
        grain_offsets=no_grain if grain is None else grain.offsets,
        grain_radii=no_grain[:, 0] if grain is None else grain.radii,
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
