"""BoTorch's multi-fidelity knowledge gradient, after its tutorial, with discrete levels.

Sources: Balandat et al., arXiv:1910.06403; Wu et al., arXiv:1903.04703.
"""

import numpy as np
import torch
from botorch import fit_gpytorch_mll
from botorch.acquisition import PosteriorMean
from botorch.acquisition.cost_aware import InverseCostWeightedUtility
from botorch.acquisition.fixed_feature import FixedFeatureAcquisitionFunction
from botorch.acquisition.knowledge_gradient import qMultiFidelityKnowledgeGradient
from botorch.acquisition.utils import project_to_target_fidelity
from botorch.models.cost import AffineFidelityCostModel
from botorch.models.gp_regression_fidelity import SingleTaskMultiFidelityGP
from botorch.models.transforms.outcome import Standardize
from botorch.optim import optimize_acqf, optimize_acqf_mixed
from gpytorch.mlls import ExactMarginalLogLikelihood

from benchmarks.search.case import Meter

FIRST = (26, 13, 5)  # first designs by level


def method(meter: Meter, seed: int) -> None:
    """First designs, then one at a time by knowledge gradient per cost."""
    case, rng = meter.case, np.random.default_rng(seed)
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    d = case.dimension
    # the affine cost model takes the fidelity of a level as its cost, the target's being 1
    fidelities = [cost / case.costs[-1] for cost in case.costs]
    cost_model = AffineFidelityCostModel(fidelity_weights={d: 1.0}, fixed_cost=0.0)
    utility = InverseCostWeightedUtility(cost_model=cost_model)
    bounds = torch.tensor([[0.0] * (d + 1), [1.0] * (d + 1)], dtype=torch.double)
    rows: list[list[float]] = []
    values: list[float] = []

    def run(z: np.ndarray, level: int) -> None:
        values.append(-meter(z, level))
        rows.append([*z, fidelities[level]])

    for level, count in enumerate((*FIRST[: case.target], FIRST[-1])):
        for number in range(count):
            run(case.z0 if number == 0 else rng.random(d), level)
    while True:
        x = torch.tensor(rows, dtype=torch.double)
        y = torch.tensor(values, dtype=torch.double)[:, None]
        model = SingleTaskMultiFidelityGP(
            x, y, data_fidelities=[d], outcome_transform=Standardize(m=1)
        )
        fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
        mean = FixedFeatureAcquisitionFunction(PosteriorMean(model), d + 1, [d], [1.0])
        best, best_value = optimize_acqf(
            mean, bounds[:, :-1], q=1, num_restarts=5, raw_samples=128, options={"maxiter": 50}
        )
        meter.recommend(best[0].numpy())
        acquisition = qMultiFidelityKnowledgeGradient(
            model, num_fantasies=32, current_value=best_value, cost_aware_utility=utility,
            project=lambda X: project_to_target_fidelity(X, target_fidelities={d: 1.0}, d=d + 1),
        )  # fmt: skip
        candidate, _ = optimize_acqf_mixed(
            acquisition, bounds, q=1, fixed_features_list=[{d: f} for f in fidelities],
            num_restarts=3, raw_samples=64, options={"batch_limit": 3, "maxiter": 50},
        )  # fmt: skip
        z = candidate[0, :-1].detach().numpy()
        run(z, int(np.argmin(np.abs(np.array(fidelities) - float(candidate[0, -1])))))
