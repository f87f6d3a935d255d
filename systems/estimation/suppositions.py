"""What is taken for granted until samples speak against it: the load."""

import math
from types import SimpleNamespace

import numpy as np

from systems.estimation.events import LOAD_UNLIKE_BELIEF, Event
from systems.estimation.memory import Layout
from systems.estimation.tip_model import TipModel

_LOAD_CHI_SQUARED = 30.0  # of four: what nothing describes, as errors of gears, makes up to 13
_LEAST_LOAD = 0.15  # of what robots carry: gears with play may seem to be less than that
_SETTLED = 2  # looks: a sum that was read anew just now has been right once by chance, never twice


class Suppositions:
    """A belief that holds an estimate firmly, and is given up by what it would be without it.

    With information I on some unknowns x_o about zero the estimate is P b. Without it the covariance is

        P' = P + P_o (I^-1 - P_oo)^-1 P_o^T

    whose rows of these unknowns are (1 - P_oo I)^-1 P_o^T, and the estimate P' b. Where that is far from
    zero, for what it may be wrong by, the belief is wrong.
    """

    def __init__(self, model: TipModel) -> None:
        """Takes the model whose unknowns these are."""
        self._model = model
        # Information on a load that may be any; who believes in a larger spread already is left with that
        self._any_load = np.diag(np.minimum(model.changed_load**-2, np.diag(model.prior)[model.M]))
        self.layout = Layout(
            load=(1,),  # whether it has been held all along; else it was given up, or something has happened
            settled=(1,),  # looks in a row at samples that were linearised near the estimate
        )

    def start(self, memory: SimpleNamespace) -> None:
        """Writes what is supposed before the first sample."""
        memory.load[0] = 1.0

    def prior(self, memory: SimpleNamespace) -> np.ndarray:
        """What is known before any sample as far as it still holds, (n, n)."""
        model, prior = self._model, self._model.prior.copy()
        if not memory.load[0]:
            prior[model.M, model.M] = self._any_load
        return prior

    def look(
        self, memory: SimpleNamespace, P: np.ndarray, b: np.ndarray, is_settled: bool
    ) -> tuple[Event, np.ndarray] | None:
        """Gives up what samples speak against; says so, and by how much `prior` changes, (n, n).

        What samples say of the load that were linearised far off may be anything: they must have settled.

        Args:
            memory: of the layout; is renewed, and with it `prior`.
            P: covariance of the estimate, (n, n).
            b: of all samples, (n,): P b is the estimate.
            is_settled: whether the samples were linearised near the estimate.
        """
        before = self.prior(memory)
        memory.settled[0] = memory.settled[0] + 1.0 if is_settled else 0.0
        event = self._given_up(memory, P, b)
        return event and (event, self.prior(memory) - before)

    def _given_up(self, memory: SimpleNamespace, P: np.ndarray, b: np.ndarray) -> Event | None:
        model = self._model
        if memory.load[0] and memory.settled[0] >= _SETTLED:
            held = model.prior[model.M, model.M]
            x, covariance = _if_free(P, b, model.M, held - self._any_load)
            is_unlike = x @ np.linalg.solve(covariance + np.linalg.inv(held), x) > _LOAD_CHI_SQUARED
            if is_unlike and self._may_be_carried(x[0], math.sqrt(covariance[0, 0])):
                memory.load[0] = 0.0
                return Event(LOAD_UNLIKE_BELIEF, float(x[0] * model.sigma[model.M][0]), 0.0)
        return None

    def _may_be_carried(self, more: float, sigma: float) -> bool:
        """Whether robots carry so much more than believed, in units of the spread.

        What gears with play do beyond all models looks like a load, too: of a KR 16, twice what it can carry,
        or a little. A little is no reason to take back what is known of the drives.
        """
        model = self._model
        of_belief, spread = model.mean[model.M][0], model.sigma[model.M][0]
        return not model.has_gear_errors or (
            abs(spread * more) >= _LEAST_LOAD * model.most_carried
            and of_belief + spread * (more + sigma) >= 0.0
            and of_belief + spread * (more - sigma) <= model.most_carried
        )


def _if_free(P: np.ndarray, b: np.ndarray, of: slice, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What k unknowns would be if so much information, (k, k), did not hold them, (k,), and covariance."""
    rows = np.linalg.solve(np.eye(len(held)) - P[of, of] @ held, P[of])
    return rows @ b, rows[:, of]
