"""Fits by least squares with a simulation for every value: L-BFGS-B.

What most calibrations of grains do today. It is here to compare with: it gives one set of
parameters, no intervals, and says nothing about what the recordings leave open.

Source: Byrd, Lu, Nocedal & Zhu 1995, doi:10.1137/0916069.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize

from calibration.campaign import (
    Evaluate,
    Predicted,
    finished,
    predicted,
    predictions_of_each,
    row_of,
)
from calibration.posterior import from_unit
from calibration.recordings.case import Case
from calibration.recordings.records import Noise
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.evaluation import Candidate, Evaluation

STEP = 0.05  # of each range, for the gradient: smaller ones drown in the noise of packings
SEED = 900_001  # of the packing of the first recording, the same for all parameters
