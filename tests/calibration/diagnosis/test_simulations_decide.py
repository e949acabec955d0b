"""Simulations of what is named have the last word over emulators."""

import numpy as np
from toy_diagnosis import SIZES, joint_of, recorded, series

from calibration.diagnosis.alike import alike
from calibration.diagnosis.compare import Compared, compare
from calibration.diagnosis.confirm import Confirmed, beside_mates, checked, fits_of_mates
from calibration.diagnosis.joint import Joint
from calibration.diagnosis.linear import around
from calibration.diagnosis.nulls import mismatch_in
from calibration.diagnosis.verdict import Verdict, judged
from mfopt.arrays import Array
from surrogates.series import SeriesEmulator

Z, SPEEDS = (0.4, 0.6), (1.0, 1.6)
Learned = list[SeriesEmulator]


def found(learned: Learned, name: str, size: float) -> tuple[Joint, Compared, Verdict]:
    joint, suspects, _ = joint_of(recorded(Z, {name: size}, 3), learned)
    compared = compare(joint, suspects, 2, 1)
    near = around(joint, suspects, compared.nothing.best)
    test = mismatch_in(joint, near, compared, 1)
    return joint, compared, judged(joint, ["slow", "fast"], compared, test, (), 1)


def rows(name: str, size: float) -> list[Array]:
    return [series(np.array(Z), {name: size}, speed) for speed in SPEEDS]


def beside(its: list[Array]) -> list[Confirmed]:
    one = np.ones(48)
    return [Confirmed("r", False, row, row, one, (1.0, 1.0)) for row in its]


def test_a_name_stays_where_its_simulations_fit(learned: Learned) -> None:
    joint, compared, verdict = found(learned, "kick", 0.15)
    assert verdict.kind == "named"
    assert checked(verdict, joint, compared, beside(rows("kick", 0.15))) == verdict


def test_simulations_that_do_not_fit_veto_a_name(learned: Learned) -> None:
    joint, compared, verdict = found(learned, "kick", 0.15)
    vetoed = checked(verdict, joint, compared, beside(rows("kick", 0.0)))
    assert (vetoed.kind, vetoed.effects) == ("unknown", ())
    assert "do not fit" in vetoed.why


def test_a_mate_whose_simulations_fit_as_well_is_named_too(learned: Learned) -> None:
    joint, compared, _ = found(learned, "bend", 0.1)
    named = Verdict("named", ("bend",), 0.9, 0.5, (), "")
    suspects = [w.which.suspects[0] for w in compared.weighed if len(w.which.suspects) == 1]
    classes = alike(around(joint, list(dict.fromkeys(suspects)), compared.nothing.best))
    mates = fits_of_mates(named, compared, classes)
    assert "twin" in [w.which.name for w in mates]
    those = [next(w for w in compared.explained if w.which.name == "bend"), *mates]
    same = [[row] * len(those) for row in rows("bend", 0.1)]
    assert beside_mates(named, joint, those, same).kind == "set"
    far = [
        [row, *[other] * len(mates)]
        for row, other in zip(rows("bend", 0.1), rows("kick", SIZES["kick"]), strict=True)
    ]
    assert beside_mates(named, joint, those, far) == named
