"""Searches of a minimum without a gradient: CMA-ES, a genetic algorithm with a pattern search, NSGA-II.

Reiner (2010), sections 4.3 and A.7: a genetic algorithm, and a pattern search that goes on where it has come
near. Beside it CMA-ES (Hansen and Ostermeier, 2001), and for several objectives NSGA-II (Deb and others,
2002). All of them as pymoo (Blank and Deb, 2020) has them, which takes a second to import.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

POPULATION = 30
_STEP = 0.25  # of CMA-ES at first, as a share of the box
_CLOSE = 0.05  # of the pattern search at first, as a share of the box
_AROUND = 0.05  # standard deviation of the first individuals of NSGA-II about the one that is given
_NEAR_SHARE = 0.7  # of the evaluations are the genetic algorithm's, the others those of the pattern search

Cost = Callable[[np.ndarray], float]
Costs = Callable[[np.ndarray], np.ndarray]


class Box:
    """Between which limits is searched, and with how many evaluations of the cost."""

    def __init__(self, lower: np.ndarray, upper: np.ndarray, evaluations: int, seed: int) -> None:
        """Loads pymoo.

        Args:
            lower, upper: limits, shape (n,).
            evaluations: of the cost, at most.
            seed: of the search.

        Raises:
            ModuleNotFoundError: if pymoo is not installed.
        """
        import pymoo.optimize  # noqa: F401

        self._lower, self._upper, self._evaluations, self._seed = lower, upper, evaluations, seed

    def cma(self, cost: Cost, start: np.ndarray) -> np.ndarray:
        """CMA-ES from a start: the best that was found, (n,)."""
        from pymoo.algorithms.soo.nonconvex.cmaes import CMAES

        found = self._minimised(CMAES(x0=start, sigma=_STEP, restarts=0), cost, 1, self._evaluations)
        return np.asarray(found.X, dtype=float)

    def genetic(self, cost: Cost, start: np.ndarray) -> np.ndarray:
        """A genetic algorithm whose first individuals are spread over the box, the start one of them."""
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.algorithms.soo.nonconvex.pattern import PatternSearch

        rng = np.random.default_rng(self._seed)
        first: Any = rng.uniform(self._lower, self._upper, (POPULATION, len(start)))
        first[0] = start
        near = round(_NEAR_SHARE * self._evaluations)
        best = self._minimised(GA(pop_size=POPULATION, sampling=first), cost, 1, near).X
        pattern = PatternSearch(x0=best, init_delta=_CLOSE)
        found = self._minimised(pattern, cost, 1, self._evaluations - near)
        return np.asarray(found.X, dtype=float)

    def front(self, costs: Costs, best: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points of which none is better than another in all costs, from around one that is given.

        Returns:
            Costs, (k, objectives), in the order of the first one, and the points, (k, n).
        """
        from pymoo.algorithms.moo.nsga2 import NSGA2

        rng = np.random.default_rng(self._seed)
        around = best + _AROUND * rng.normal(size=(POPULATION, len(best)))
        around[0] = best
        first: Any = np.clip(around, self._lower, self._upper)
        algorithm = NSGA2(pop_size=POPULATION, sampling=first)
        found = self._minimised(algorithm, costs, len(costs(best)), self._evaluations)
        order = np.argsort(found.F[:, 0])
        return found.F[order], found.X[order]

    def _minimised(self, algorithm: Any, cost: Callable, objectives: int, evaluations: int) -> Any:
        from pymoo.core.problem import ElementwiseProblem
        from pymoo.optimize import minimize

        lower, upper = self._lower, self._upper

        class Problem(ElementwiseProblem):
            def __init__(self) -> None:
                super().__init__(n_var=len(lower), n_obj=objectives, xl=lower, xu=upper)

            def _evaluate(self, x: np.ndarray, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
                out["F"] = cost(x)

        return minimize(Problem(), algorithm, ("n_eval", evaluations), seed=self._seed)
