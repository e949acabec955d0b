"""What each error does to a fit: the same runs, fitted as if one error did not exist."""

from collections.abc import Sequence

from calibration.campaign import Campaign, misfit_of
from calibration.likelihood import likelihood
from calibration.parts import without
from calibration.posterior import sample
from calibration.recordings.case import Case
from mfopt.records.calibration import LeftOut


def fits_without(its: Campaign, errors: Sequence[str], case: Case) -> tuple[LeftOut, ...]:
    """Fit again without each of these errors.

    Args:
        its: with all errors.
        errors: of `calibration.parts.ERRORS`.
        case: that was fitted.

    Raises:
        ConfigError: if there is no such error.
    """
    fitted, parameters = its.fitted, case.parameters
    names = [p.name for p in parameters]
    made = []
    for error in dict.fromkeys(errors):
        likely = likelihood(fitted.observations, fitted.emulators, without(error))
        posterior = sample(likely, parameters, seed=case.seed, around=fitted.posterior.box)
        misfit, _ = misfit_of(likely, fitted, case, its.fresh)
        bounds = [(float(low), float(high)) for low, high in posterior.interval()]
        made.append(LeftOut(error, dict(zip(names, bounds, strict=True)), misfit))
    return tuple(made)
