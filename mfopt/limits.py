"""What a study may ask for at least and at most.

Nothing useful lies beyond these limits: there memory or time run out, or numbers overflow.
"""

from typing import Annotated

from pydantic import AfterValidator, Field, Strict

from mfopt.names import file_name, shown, word
from mfopt.records.outcome import LARGEST_WORK, SMALLEST_WORK
from mfopt.records.problem import LARGEST_BOUND
from mfopt.search.search import (
    MOST_BUDGET,
    MOST_GENERATIONS,
    MOST_SEED,
    MOST_SEEDS,
    MOST_WORKERS,
    POPULATION_SIZES,
    SIGMAS,
)

Name = Annotated[str, AfterValidator(shown)]
FileName = Annotated[str, AfterValidator(file_name)]
Word = Annotated[str, AfterValidator(word)]  # of a command, or a file

# Random draws start from it.
Seed = Annotated[int, Field(ge=0, le=MOST_SEED)]
SearchSeeds = Annotated[int, Field(ge=1, le=MOST_SEEDS)]
ConfirmSeeds = Annotated[int, Field(ge=0, le=10_000)]

Budget = Annotated[float, Field(ge=1.0, le=MOST_BUDGET)]  # [full runs]
Generations = Annotated[int, Field(ge=1, le=MOST_GENERATIONS)]
PopulationSize = Annotated[int, Field(ge=POPULATION_SIZES[0], le=POPULATION_SIZES[1])]
Sigma = Annotated[float, Field(ge=SIGMAS[0], le=SIGMAS[1])]  # [width of the bounds]
Workers = Annotated[int, Field(ge=1, le=MOST_WORKERS)]

MOST_VARIABLES = 500
MOST_LEVELS = 50
MOST_STAGES = 1000

Bound = Annotated[float, Field(ge=-LARGEST_BOUND, le=LARGEST_BOUND)]  # of a variable, in its unit
Work = Annotated[float, Field(ge=SMALLEST_WORK, le=LARGEST_WORK)]  # of a run, in any unit
TimeLimit = Annotated[float, Field(ge=0.1, le=1e8)]  # [s] up to three years

Grains = Annotated[int, Field(ge=1, le=1_000_000)]
SpheresPerGrain = Annotated[int, Field(ge=1, le=100)]
Millimetres = Annotated[float, Field(ge=0.1, le=10_000.0)]
Milliseconds = Annotated[float, Field(ge=10.0, le=60_000.0)]
Millilitres = Annotated[float, Field(ge=0.1, le=1e6)]
Kilograms = Annotated[float, Field(ge=1e-6, le=1000.0)]
Modulus = Annotated[float, Field(ge=1e3, le=1e13)]  # [Pa] foam to beyond diamond
PoissonRatio = Annotated[float, Field(ge=0.01, lt=0.5)]
Density = Annotated[float, Field(ge=1.0, le=30_000.0)]  # [kg/m3] aerogel to beyond osmium
SizeScatter = Annotated[float, Field(ge=0.0, le=0.5)]  # of the mean size
FrictionAngle = Annotated[float, Field(ge=0.0, le=89.0)]  # [deg]
TimestepFactor = Annotated[float, Field(ge=1e-3, le=2.0)]
ChordalError = Annotated[float, Field(ge=0.01, le=100.0)]  # [mm]
DesignValue = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]  # [mm], or [-] of the motion
Bounds = Annotated[tuple[DesignValue, DesignValue], Strict(False)]  # TOML gives a list
Damping = Annotated[float, Field(ge=0.0, le=0.95)]
Restitution = Annotated[float, Field(ge=0.01, le=1.0)]
Degrees = Annotated[float, Field(ge=0.0, le=89.0)]
