"""Three inverse models of a driven beam: their order, and the limits in which they are all right."""

from dataclasses import replace

import numpy as np

from experiments.zeros.driven_beam import MODELS, TIMES, DrivenBeam, deviation, wanted_path

PLANT = DrivenBeam()
STIFF_BEAM = replace(PLANT, beam=replace(PLANT.beam, bending_stiffness=4e8))


def largest(plant: DrivenBeam, model: str) -> float:
    return float(np.abs(deviation(plant, model)).max())


def test_the_more_the_model_knows_the_nearer_the_beam_is_to_its_path():
    """Reiner (2010), figure 3.20: the gear matters most, the beam more than halves what is left."""
    beam, gear, rigid = (largest(PLANT, model) for model in MODELS)
    assert beam < 0.5 * gear
    assert gear < 0.3 * rigid


def test_behind_a_stiff_beam_the_gear_is_all():
    beam, gear, rigid = (largest(STIFF_BEAM, model) for model in MODELS)
    assert max(beam, gear) < 1e-6  # m
    assert rigid > 5e-3


def test_of_a_stiff_plant_every_inverse_is_right():
    rigid = replace(STIFF_BEAM, gear=(3e9, 3e4))
    assert max(largest(rigid, model) for model in MODELS) < 1e-6  # m


def test_before_the_motion_nothing_moves_as_all_models_are_causal():
    for model in MODELS:
        assert np.abs(deviation(PLANT, model)[TIMES < 0.95]).max() < 1e-9
    assert np.abs(wanted_path()[[0, -1]]).max() == 0.0
