"""`mfopt report`: the HTML and PDF pages of a run directory."""

import math
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console

from fidelity.scenes.dosing.bound import filling_time_bound, smallest_filling_time_bound
from fidelity.scenes.dosing.design import cup_motion, design, design_parts
from fidelity.scenes.dosing.run import dosing_grain
from fidelity.scenes.dosing.settings import DemSettings, DosingSettings
from geometry.manufacturability import manufacturability
from mfopt.arrays import Array
from mfopt.campaign.store import open_run
from mfopt.commands.shared import Quiet, RunPath, console
from mfopt.files.whole import full_disk_named
from mfopt.study.assemble import drawn
from mfopt.study.file import Study, read_study
from reports.design import Describe, DesignView, no_view


def report(path: RunPath, quiet: Quiet = False) -> None:
    """Write report.html and report.pdf of a finished, running or broken-off run."""
    its, study = open_run(path), None
    if its.study():  # a run of `mfopt.minimize` has an empty one
        study, _ = read_study(its.study_file)
    with full_disk_named(path):
        write_reports(path, study, console(quiet=quiet))


def write_reports(path: Path, study: Study | None, on: Console) -> None:
    """Write the reports of a run of a study, or of one of `mfopt.minimize`."""
    from reports.write import write_report

    describe: Describe = no_view
    seen = None if study is None else drawn(study, where=str(path / "study.toml"))
    if seen is not None:
        bound = _finite(smallest_filling_time_bound(seen[0]))
        describe = partial(_view, *seen, bound)
    pages = {"html": path / "report.html", "pdf": path / "report.pdf"}
    write_report(open_run(path), describe=describe, **pages)
    for page in pages.values():
        on.print(f"wrote {page}")


def _view(
    dosing: DosingSettings, dem: DemSettings | None, bound_any_s: float | None, x: Array
) -> DesignView:
    """What a report shows of a design besides its numbers."""
    machine, motion = design(dosing, x), cup_motion(dosing, x)
    grain = None if dem is None else dosing_grain(dosing, dem)
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
