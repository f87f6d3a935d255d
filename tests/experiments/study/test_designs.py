"""Which points a study runs, and what its rows say about the factors."""

import json

import numpy as np
import pytest
from scipy import stats

from experiments.bench.scaling import busy_share
from experiments.study.analysis import main_effects, sobol_indices, study_json
from experiments.study.designs import design_points
from experiments.study.study_file import (
    Distribution,
    Full,
    LatinHypercube,
    Levels,
    Names,
    Range,
    Sobol,
    SobolIndices,
    Study,
)

NORMAL = Distribution("norm", {"loc": 2.0, "scale": 3.0})


def test_the_full_design_has_every_combination_once():
    factors = {"a": Levels([0.0, 7.0]), "b": Names(["x", "y", "z"]), "c": Range(0.0, 1.0, 3)}
    points = design_points(factors, Full(), seed=0)
    assert len({tuple(point.values()) for point in points}) == len(points) == 18


@pytest.mark.parametrize("design", [LatinHypercube(256), Sobol(256)])
def test_a_sampled_factor_has_one_value_in_each_equally_likely_class(design):
    points = design_points({"a": NORMAL, "b": Range(0.0, 1.0)}, design, seed=1)
    shares = stats.norm(2.0, 3.0).cdf([point["a"] for point in points])
    assert sorted((256 * np.asarray(shares)).astype(int)) == list(range(256))


def test_the_same_seed_gives_the_same_points_and_another_one_others():
    first, again, other = (design_points({"a": NORMAL}, LatinHypercube(8), seed) for seed in (3, 3, 4))
    assert first == again != other


@pytest.fixture(scope="module")
def ishigami() -> tuple[Study, dict[str, np.ndarray]]:
    """Ishigami and Homma's function, whose indices are known in closed form."""
    factors = {name: Range(-np.pi, np.pi) for name in "abc"}
    study = Study(factors=dict(factors), design=SobolIndices(2048))
    points = design_points(study.factors, study.design, seed=0)
    a, b, c = (np.array([float(point[name]) for point in points]) for name in "abc")
    value = np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)
    return study, {"point": np.arange(len(a)), "max_norm_mm": value, "a": a, "b": b, "c": c}


@pytest.mark.slow
def test_indices_of_sobol_are_those_of_the_closed_form(ishigami):
    study, rows = ishigami
    found = sobol_indices(study, rows, "max_norm_mm")
    assert found is not None
    # Four standard deviations of the estimate with 2048 samples.
    np.testing.assert_allclose(found.first, [0.3139, 0.4424, 0.0], atol=0.08)
    np.testing.assert_allclose(found.total, [0.5576, 0.4424, 0.2437], atol=0.08)
    assert ((found.total_interval[:, 0] < found.total) & (found.total < found.total_interval[:, 1])).all()


def test_a_failed_run_takes_its_sample_out_and_leaves_the_indices(ishigami):
    study, rows = ishigami
    holes = rows["max_norm_mm"].copy()
    holes[::97] = np.nan
    found = sobol_indices(study, rows | {"max_norm_mm": holes}, "max_norm_mm")
    assert found is not None
    np.testing.assert_allclose(found.first, [0.3139, 0.4424, 0.0], atol=0.1)


@pytest.mark.filterwarnings("error")
def test_shares_of_a_metric_that_does_not_vary_are_none_in_json():
    study = Study(laws=["pbvs"], metrics=["max_norm_mm"], design=SobolIndices(2),
                  factors={"a": Range(0.0, 1.0), "b": Range(0.0, 1.0)})  # fmt: skip
    point = np.arange(8)
    rows = {"row": point, "point": point, "law": np.full(8, "pbvs"), "failure": np.full(8, "")}
    found = study_json(study, rows | {"max_norm_mm": np.full(8, 3.0)}, [""] * 8)
    share = found["laws"]["pbvs"]["max_norm_mm"]["sobol"]["a"]
    assert share["first_interval"] == share["total_interval"] == [None, None]
    json.dumps(found, allow_nan=False)


def test_the_main_effect_is_the_mean_over_all_other_factors(ishigami):
    study, rows = ishigami
    effect = next(each for each in main_effects(study, rows, "max_norm_mm") if each.factor == "b")
    places = np.array(effect.values, dtype=float)
    assert np.all(np.diff(places) > 0.0)
    # b enters as 7 sin^2 b alone, here averaged over one of eight classes.
    width = np.pi / 4.0
    expected = 3.5 - 3.5 * np.cos(2.0 * places) * np.sin(width) / width
    np.testing.assert_allclose(effect.mean, expected, atol=0.5)


@pytest.mark.filterwarnings("error")
def test_a_factor_of_whole_numbers_has_a_class_for_each_that_comes_often():
    study = Study(
        laws=["pbvs"], design=LatinHypercube(64), factors={"a": Distribution("poisson", {"mu": 4.0})}
    )
    values = np.array([point["a"] for point in design_points(study.factors, study.design, 0)])
    (effect,) = main_effects(study, {"a": values, "max_norm_mm": 2.0 * values}, "max_norm_mm")
    assert len(np.unique(values)) > 8 >= len(effect.values) > 4
    assert np.isfinite(effect.mean).all()
    assert np.all(np.diff(effect.mean) > 0.0)


def test_a_scheduler_keeps_workers_busy_until_their_jobs_ask_more_of_it_than_it_has():
    assert busy_share(workers=10, job_time=1.0, handling=1e-3) > 0.95
    # 1000 workers with jobs of 0.5 s want 2000 jobs/s of a scheduler that gives 1000.
    assert busy_share(workers=1000, job_time=0.5, handling=1e-3) == pytest.approx(0.5, rel=0.05)
