"""What each error does to a fit: the same runs, fitted as if one error did not exist."""

from collections.abc import Sequence

from calibration.campaign import Fitted, misfit_of
from calibration.likelihood import likelihood
from calibration.parts import without
from calibration.posterior import sample
from mfopt.records.calibration import LeftOut


def fits_without(fitted: Fitted, errors: Sequence[str], *, seed: int) -> tuple[LeftOut, ...]:
    """Fit again without each of these errors.

    Args:
        fitted: with all errors.
        errors: of `calibration.parts.ERRORS`.
        seed: of the sampler.

    Raises:
        ConfigError: if there is no such error.
    """
    parameters, box = fitted.posterior.parameters, fitted.posterior.box
    names = [p.name for p in parameters]
    made = []
    for error in dict.fromkeys(errors):
        likely = likelihood(fitted.observations, fitted.emulators, without(error))
        posterior = sample(likely, parameters, seed=seed, around=box)
        misfit, _ = misfit_of(likely, posterior)
        bounds = [(float(low), float(high)) for low, high in posterior.interval()]
        made.append(LeftOut(error, dict(zip(names, bounds, strict=True)), misfit))
    return tuple(made)
