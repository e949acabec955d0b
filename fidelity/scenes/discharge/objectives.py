"""Objectives of a discharge, and what an engineer asks of one."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from pydantic import Field

from mfopt.arrays import Array
from mfopt.records.objective import Criteria, Objective, Quantity, Raw, Series
from mfopt.settings import Settings

NO_FLOW = 1.0  # [-] error of a hopper from which nothing flows evenly
MOST_LEFT = 0.5  # share of the mass; a hopper that keeps more was not discharged


class Wanted(Settings):
    """What a study can say of the objectives, beside the name of one."""

    mass_flow_rate_kg_s: float | None = Field(default=None, gt=0.0, le=1e6)  # that is wanted
    mass_left_weight: float = Field(default=1.0, ge=0.0, le=1e9)  # of the share that stays behind


def criteria(wanted: Wanted) -> Criteria:
    """How discharges are judged; the error of the flow needs a wanted one."""
    objectives = {
        "discharge_time": Objective(
            "discharge_time", partial(_discharge_time, wanted), ("mass left",)
        )
    }
    if wanted.mass_flow_rate_kg_s is not None:
        objectives["flow_error"] = Objective(
            "flow_error", partial(_flow_error, wanted), ("mass left",)
        )
    return Criteria(
        objectives,
        (
            Quantity(
                "mass flow rate",
                "kg/s",
                mass_flow_rate,
                (1e3, "g/s"),
                lower_is_better=False,
                wanted=wanted.mass_flow_rate_kg_s,
            ),
            Quantity("discharge time", "s", discharge_time, (1e3, "ms")),
            Quantity("mass left", "-", mass_left, (1e2, "%"), can_vanish=True),
        ),
        "mass flow rate",
        (
            Series("discharged fraction", "-", _sampled("discharged_fraction"), (1e2, "%")),
            Series("level", "m", _sampled("level"), (1e3, "mm")),
            Series("level left", "m", _sampled("level_left"), (1e3, "mm")),
            Series("level right", "m", _sampled("level_right"), (1e3, "mm")),
        ),
        wanted.model_dump(mode="json"),
        {} if "flow_error" in objectives else {"flow_error": "mass_flow_rate_kg_s"},
    )


def _sampled(name: str) -> Callable[[Raw], tuple[Array, Array]]:
    """Reads a series that was sampled during the run."""

    def read(raw: Raw) -> tuple[Array, Array]:
        return raw["sample_times"], raw[name]

    return read


def mass_flow_rate(raw: Raw) -> float:
    """Slope of the mass over time [kg/s] while 20 to 80 % of it leaves; 0 for too few grains."""
    rate = float(raw["mass_flow_rate"])
    return rate if math.isfinite(rate) else 0.0


def discharge_time(raw: Raw) -> float:
    """Time [s] from the opening of the gate until the last grain passes that does.

    No value (nan) for a hopper that keeps more than half of the mass.
    """
    times = raw["passage_times"]
    return float(np.max(times)) if times.size and mass_left(raw) <= MOST_LEFT else math.nan


def mass_left(raw: Raw) -> float:
    """Share of the mass that stays in the hopper."""
    return float(raw["left"]) / float(raw["grains"])


def _flow_error(wanted: Wanted, raw: Raw) -> dict[str, float]:
    """Distance of the mass flow rate from the wanted one, over that; and the share left."""
    assert wanted.mass_flow_rate_kg_s is not None
    rate, target = mass_flow_rate(raw), wanted.mass_flow_rate_kg_s
    error = abs(rate - target) / target if rate > 0.0 else NO_FLOW
    return {"flow error": error, "mass left": wanted.mass_left_weight * mass_left(raw)}


def _discharge_time(wanted: Wanted, raw: Raw) -> dict[str, float]:
    """Time until the last grain passes [s]; and the share left.

    A hopper that was not discharged has the duration of the run, so a blocked one gains nothing.
    """
    time, left = discharge_time(raw), wanted.mass_left_weight * mass_left(raw)
    counted = time if math.isfinite(time) else float(raw["duration"])
    return {"discharge time": counted, "mass left": left}
