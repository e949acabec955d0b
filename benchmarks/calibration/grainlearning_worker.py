"""One generation of GrainLearning's filter, in an environment of its own: it needs numpy < 2.

Input (JSON): recorded series `recorded` (c, t), parameters `z` (n, d) in the unit cube, `simulated`
(n, c, t), the largest uncertainty `sigma`, `seed`, and `last`, whether no more are drawn; without
`z`, the first `count` are drawn. Output: weighted `mean` (d,), `sigma`, and `next` (n, d).
"""

import json
import sys

import numpy as np
from grainlearning.dynamic_systems import DynamicSystem
from grainlearning.iterative_bayesian_filter import IterativeBayesianFilter


def main() -> None:
    """Infer, and draw the next parameters."""
    task = json.load(sys.stdin)
    dimension, known = task["dimension"], task.get("z")
    np.random.seed(task["seed"])  # noqa: NPY002  GrainLearning draws from numpy's own stream
    system = DynamicSystem(
        obs_data=np.array(task["recorded"]),
        num_samples=len(known) if known else task["count"],
        param_min=[0.0] * dimension,
        param_max=[1.0] * dimension,
        sigma_max=task["sigma"],
    )
    its = IterativeBayesianFilter.from_dict(
        {"Bayes_filter": {"scale_cov_with_max": True}, "sampling": {"random_state": task["seed"]}}
    )
    if not known:
        its.initialize(system)
        print(json.dumps({"next": system.param_data.tolist()}))
        return
    system.set_param_data(known)
    system.set_sim_data(task["simulated"])
    its.run_inference(system)
    mean, sigma = system.estimated_params[-1].tolist(), float(np.squeeze(system.sigma_max))
    drawn = [] if task["last"] else _drawn(its, system)
    print(json.dumps({"mean": mean, "sigma": sigma, "next": drawn}))


def _drawn(its: IterativeBayesianFilter, system: DynamicSystem) -> list[list[float]]:
    its.run_sampling(system)
    return [list(map(float, z)) for z in its.param_data_list[-1]]


main()
