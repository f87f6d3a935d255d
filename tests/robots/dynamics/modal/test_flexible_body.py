"""Flexible bodies: a mesh converges to the analytic beam, files come back, broken ones are refused."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robots.dynamics.modal.flexible_body import FlexibleBody, beam_body
from robots.dynamics.modal.modal_beam import ModalBeam
from robots.dynamics.modal.sid_file import SidFileError, read_sid, sid_text

BEAM = beam_body(length=2.0, mass=3.0, bending_stiffness=500.0, elements=10, modes=3, damping=0.01)
FIELDS = tuple(FlexibleBody.__dataclass_fields__)


def read(folder: Path, text: str) -> FlexibleBody:
    path = folder / "beam.sid"
    path.write_text(text)
    return read_sid(path)


def test_the_mesh_has_the_frequencies_of_the_clamped_beam():
    """b^2 sqrt(E I / (m l^3)) with cos b cosh b = -1; the error falls as the fourth power of an element."""
    exact = np.array([1.875104, 4.694091, 7.854757]) ** 2 * np.sqrt(500.0 / (3.0 * 2.0**3))
    coarse, fine = (
        beam_body(2.0, 3.0, 500.0, elements, 3).frequencies()[2] - exact[2] for elements in (4, 8)
    )
    np.testing.assert_allclose(BEAM.frequencies(), exact, rtol=1e-3)
    assert 10.0 < coarse / fine < 20.0


def test_on_a_joint_it_has_the_zeros_of_the_modal_beam():
    modal = ModalBeam(2.0, 3.0, 500.0, load=1.35, num_modes=3)
    mesh = beam_body(2.0, 3.0, 500.0, elements=24, modes=3)
    found, expected = (np.sort_complex(each.values**2) for each in (mesh.zeros(-1, 1.35), modal.zeros(1.0)))
    np.testing.assert_allclose(found[[0, -1]], expected[[0, -1]], rtol=1e-3)
    assert not mesh.zeros(-1, 1.35).is_minimum_phase
    assert mesh.zeros(6, 1.35).is_minimum_phase  # a quarter of the way, below 0.309


def supported_body(num_modes: int) -> FlexibleBody:
    """A uniform beam of 1 m and 1 kg whose modes turn it at the joint, integrated over its nodes."""
    beam = ModalBeam(load=0.0, num_modes=num_modes, boundary="supported")
    M, K, x = beam.mass_matrix(), beam.stiffness_matrix(), np.linspace(0.0, 1.0, 11)
    shapes, turns = np.zeros((2, len(x), 3, num_modes))
    shapes[:, 1], turns[:, 2] = beam.displacement(x)[:, 1:], beam.slope(x)
    Cr = np.zeros((num_modes, 3))
    Cr[:, 2] = M[0, 1:]
    none, inertia = np.zeros_like(K[1:, 1:]), np.diag([0.0, M[0, 0], M[0, 0]])
    places, first = np.column_stack([x, 0.0 * x, 0.0 * x]), np.array([0.5, 0.0, 0.0])
    return FlexibleBody(1.0, places, shapes, first, inertia, 0.0 * Cr, Cr, M[1:, 1:], K[1:, 1:], none, turns)


@pytest.mark.parametrize(("node", "is_stable"), [(2, True), (-1, False)])
def test_the_torque_of_the_joint_also_acts_on_modes_that_turn_the_body_there(node: int, is_stable: bool):
    body, beam = supported_body(3), ModalBeam(num_modes=3, boundary="supported")
    zeros, expected = body.zeros(node, load=0.45), beam.zeros(float(body.places[node, 0]))
    np.testing.assert_allclose(np.sort(np.abs(zeros.values)), np.sort(np.abs(expected.values)), rtol=1e-6)
    assert zeros.is_minimum_phase == expected.is_minimum_phase == is_stable


def test_modes_that_move_the_node_at_the_joint_are_refused():
    shapes = BEAM.shapes.copy()
    shapes[0, 1, 2] = 0.1
    with pytest.raises(ValueError, match="modes move node 1, which the joint holds"):
        replace(BEAM, shapes=shapes).zeros()


def test_kinetic_energy_of_a_rigid_turn_is_that_of_the_body_and_its_load():
    mass, _, stiffness = BEAM.turned(load=0.5)
    assert mass[0, 0] == pytest.approx(3.0 * 2.0**2 / 3.0 + 0.5 * 2.0**2)
    assert not stiffness[0].any()
    assert np.linalg.eigvalsh(mass).min() > 0.0


def test_all_modes_of_a_mesh_carry_the_inertia_that_a_held_frame_does_not():
    """Parseval: the squares of C_r add up to the moment of inertia about the joint, of C_t to the mass."""
    full = beam_body(2.0, 3.0, 500.0, elements=20, modes=40)
    assert np.sum(full.Cr[:, 2] ** 2) == pytest.approx(3.0 * 2.0**2 / 3.0, rel=1e-4)
    assert np.sum(full.Ct[:, 1] ** 2) == pytest.approx(3.0, rel=0.03)  # but what moves the clamped node


def test_a_file_comes_back_as_it_was(tmp_path: Path):
    body = read(tmp_path, sid_text(BEAM))
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(body, name), getattr(BEAM, name))


def test_forms_of_other_programs_are_read(tmp_path: Path):
    """Remarks before the body, exponents of Fortran, unit matrices, half of a symmetric one."""
    plain = replace(BEAM, De=np.array([[2.0, 0.5, 0.0], [0.5, 3.0, 0.1], [0.0, 0.1, 4.0]]))
    text = sid_text(plain)
    unit = "Me\norder = 0\nnrow = 3\nncol = 3\nnq = 3\nnqn = 0\nstructure = 4\nend Me"
    start, end = text.index("Me\n"), text.index("end Me") + len("end Me")
    text = "11 3 Geo_Stiff= no\n" + text[:start] + unit + text[end:]
    before, damping = text.split("\nDe\n")
    half = damping.replace("structure = 3", "structure = 2").replace("m0 (2,1) = 0.5\n", "")
    text = before + "\nDe\n" + half.replace("m0 (3,2) = 0.1\n", "")
    text = text.replace("mass = 3.0", "MASS =  0.3D+01")
    body = read(tmp_path, text)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(body, name), getattr(plain, name))


TEXT = sid_text(BEAM)
BROKEN = {
    "cut off": (TEXT[: len(TEXT) // 2], "the file ends within '.*' of line"),
    "rows": (TEXT.replace("Ct\norder = 0\nnrow = 3", "Ct\norder = 0\nnrow = 4"), "ct: nrow must be 3, got 4"),
    "modes": (TEXT.replace("nelastq = 3", "nelastq = 2"), "must be 2, got 3"),
    "entry": (TEXT.replace("Cr\norder = 0\nnrow = 3\nncol = 3\nnq = 3\nnqn = 0\nstructure = 3\nm0 (1,3)",
                           "Cr\norder = 0\nnrow = 3\nncol = 3\nnq = 3\nnqn = 0\nstructure = 3\nm0 (1,4)"),
              r"cr: m0\(1, 4\) is outside of 3 x 3"),
    "number": (TEXT.replace("mass = 3.0", "mass = heavy"), "line 4: 'heavy' is not a number"),
    "missing": (TEXT.replace("\nKe\n", "\nKx\n").replace("end Ke", "end Kx"), "'modal' has no 'ke'"),
    "nested": (TEXT.replace("end refmod", "end frame"), "'end frame' does not end 'refmod'"),
    "empty": ("", "no flexible body is in the file: it would begin with a line 'part'"),
    "another kind": ("name: my robot\nparts:\n- {mass: 3}\n", "no flexible body is in the file"),
    "columns": (TEXT.replace("nrow = 3\nncol = 6", "nrow = 3\nncol = 5"), "oe: ncol must be 6, got 5"),
    "square": (re.sub(r"(?s)(Oe\n.*?)structure = 3", r"\1structure = 2", TEXT, count=1),
               "oe: structure 2 is for square matrices, got 3 x 6"),
    "structure": (TEXT.replace("structure = 3", "structure = 7"), "structure must be 0 to 4, got 7"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_what_is_broken_is_refused_with_file_and_line(tmp_path: Path, text: str, message: str):
    with pytest.raises(SidFileError, match=rf"beam\.sid, line \d+: .*{message}|beam\.sid, {message}"):
        read(tmp_path, text)


def test_impossible_meshes_and_nodes_are_refused():
    with pytest.raises(ValueError, match="modes must be between 1 and 4, got 5"):
        beam_body(1.0, 1.0, 1.0, elements=2, modes=5)
    with pytest.raises(ValueError, match="the node is on the axis of the joint"):
        BEAM.output(0)
