"""A nonlinear program whose variables are the coefficients of splines and the duration of a motion.

At every point the motion is given by few numbers y, linear in the variables: the derivatives of the splines
by the share of the duration, and the duration. What is bounded and what it costs are functions of y, the same
at all points, if not within the same limits. So Jacobian and Hessian are those of one point, put together by
the matrix of the splines: differentiating the whole program would take far longer.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

TOLERANCE = 1e-5
SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")  # of IPOPT's words
_ACCEPTABLE = 1e-4


@dataclass(frozen=True)
class PointProgram:
    """Functions of y at one point; y has n numbers and the weight of the point in integrals is w.

    Attributes:
        bounded: of (y, z), r numbers.
        lower: their limits, shape (r,), or (points, r) where they are not the same at all points.
        upper: likewise.
        means: of (y, z), m numbers whose weighted sums over all points are at most 1.
        cost: of (y, w, z), whose sum over all points is minimised.
        places: of the first of y, the numbers z. The functions of these take the first of y less what it is
            there: such as derivatives of a curve at a place, of which they make a series. None for no z.
    """

    bounded: ca.Function
    lower: np.ndarray
    upper: np.ndarray
    means: ca.Function
    cost: ca.Function
    places: ca.Function | None = None


@dataclass(frozen=True)
class Solution:
    """What IPOPT found."""

    x: np.ndarray
    iterations: int
    status: str


def solve(
    program: PointProgram,
    matrix: ca.DM,
    offset: np.ndarray,
    weights: np.ndarray,
    start: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    iterations: int,
    squares: tuple[np.ndarray, np.ndarray] | None = None,
    linear: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
) -> Solution:
    """Minimises the cost within the bounds.

    Args:
        program: of one point.
        matrix: sparse, shape (points n, size): y of all points is matrix x + offset.
        offset: shape (points n,).
        weights: of the points, shape (points,).
        start: x to begin with, shape (size,).
        bounds: of x, shape (size,) each.
        iterations: at most.
        squares: A, shape (k, size), and b, shape (k,): the cost has half the sum of squares of A x + b.
        linear: A, shape (l, size), with lower and upper limits of A x, shape (l,).
    """
    size, count = matrix.shape[1], len(weights)
    n, r, m = program.bounded.size1_in(0), program.bounded.size1_out(0), program.means.size1_out(0)
    x, w = ca.MX.sym("x", size), ca.DM(weights).T
    y = ca.reshape(matrix @ x + ca.DM(offset), n, count)
    z = program.places.map(count)(y[0, :]) if program.places else ca.MX(0, count)
    parts = _parts(program, n, r, m)
    means = parts["means"].map(count)(y, z) @ w.T
    g = ca.vertcat(ca.vec(parts["bounded"].map(count)(y, z)), means)
    f = ca.sum2(parts["cost"].map(count)(y, w, z))
    gradient = matrix.T @ ca.vec(parts["steepness"].map(count)(y, w, z))
    nothing, of_f, of_g = (
        ca.MX.sym("p", 0),
        ca.MX.sym("lam_f"),
        ca.MX.sym("lam_g", g.shape[0] + (0 if linear is None else len(linear[0]))),
    )
    slopes = _blocks(parts["slope"].map(count)(y, z), n) @ matrix
    of_means = ca.reshape(parts["mean_slope"].map(count)(y, z), m, n * count)
    spread = ca.repmat(w, n, 1)
    jacobian = ca.vertcat(slopes, (of_means * ca.repmat(ca.vec(spread).T, m, 1)) @ matrix)
    multipliers = ca.reshape(of_g[: r * count], r, count)
    of_each = ca.repmat(of_g[r * count : r * count + m], 1, count)
    curvature = parts["curvature"].map(count)(y, w, z, multipliers, of_each, ca.repmat(of_f, 1, count))
    full = matrix.T @ _blocks(curvature, n) @ matrix
    if squares is not None:
        A = ca.DM(squares[0])
        rest = A @ x + ca.DM(squares[1])
        f, gradient = f + 0.5 * ca.sumsqr(rest), gradient + A.T @ rest
        full = full + of_f * (A.T @ A)
    hessian = ca.triu(full)
    A, *between = linear or (np.zeros((0, size)), np.zeros(0), np.zeros(0))
    # They have no part in the Hessian, which takes the multipliers of the rows before them.
    g, jacobian = ca.vertcat(g, ca.DM(A) @ x), ca.vertcat(jacobian, ca.sparsify(ca.DM(A)))
    options = {
        "print_time": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.max_iter": iterations,
        "ipopt.tol": TOLERANCE,
        "ipopt.acceptable_tol": _ACCEPTABLE,
        "ipopt.acceptable_iter": 5,
        "ipopt.mu_strategy": "adaptive",
        "grad_f": ca.Function("grad_f", [x, nothing], [f, gradient]),
        "jac_g": ca.Function("jac_g", [x, nothing], [g, jacobian]),
        "hess_lag": ca.Function("hess_lag", [x, nothing, of_f, of_g], [hessian]),
    }
    solver = ca.nlpsol("motion", "ipopt", {"x": x, "f": f, "g": g}, options)
    found = solver(
        x0=start,
        lbx=bounds[0],
        ubx=bounds[1],
        lbg=np.concatenate(
            [np.broadcast_to(program.lower, (count, r)).ravel(), np.full(m, -np.inf), between[0]]
        ),
        ubg=np.concatenate([np.broadcast_to(program.upper, (count, r)).ravel(), np.ones(m), between[1]]),
    )
    stats = solver.stats()
    return Solution(np.array(found["x"]).ravel(), int(stats["iter_count"]), str(stats["return_status"]))


def _parts(program: PointProgram, n: int, r: int, m: int) -> dict[str, ca.Function]:
    """At one point: the functions, their derivatives, and that of the Lagrangian twice."""
    y, w = ca.SX.sym("y", n), ca.SX.sym("w")
    z = ca.SX.sym("z", 0 if program.places is None else program.places.size1_out(0))
    of_rows, of_means, of_cost = ca.SX.sym("mu", r), ca.SX.sym("nu", m), ca.SX.sym("lam")
    bounded, means, cost = program.bounded(y, z), program.means(y, z), program.cost(y, w, z)
    lagrangian = ca.dot(of_rows, bounded) + w * ca.dot(of_means, means) + of_cost * cost

    def at_place(name: str, inputs: list[ca.SX], value: ca.SX) -> ca.Function:
        if program.places is not None:
            value = ca.substitute(value, y[0], 0.0)
        return ca.Function(name, inputs, [ca.densify(value)])

    return {
        "bounded": at_place("bounded", [y, z], bounded),
        "means": at_place("means", [y, z], means),
        "cost": at_place("cost", [y, w, z], cost),
        "steepness": at_place("steepness", [y, w, z], ca.gradient(cost, y)),
        "slope": at_place("slope", [y, z], ca.jacobian(bounded, y)),
        "mean_slope": at_place("mean_slope", [y, z], ca.jacobian(means, y)),
        "curvature": at_place(
            "curvature", [y, w, z, of_rows, of_means, of_cost], ca.hessian(lagrangian, y)[0]
        ),
    }


def _blocks(side_by_side: ca.MX, columns: int) -> ca.MX:
    """Matrices that stand side by side, along the diagonal."""
    return ca.diagcat(*ca.horzsplit(side_by_side, columns))
