"""Roles by place, for drawings whose blocks have no names."""

import numpy as np
import pytest

import blockvis
import solver
from blockvis import generators
from blockvis.cli import main

CASE = """[geometry]
file = "stones.{suffix}"
{roles}
[settlement]
direction = {direction}
increment = 1e-3
limit = 1e-3
[output]
animation = false
"""


def roles_of(tmp_path, roles, assembly, suffix="vtu", direction="[0, -1]"):
    """Roles of the blocks of a case, by their centroids."""
    blockvis.save_layout(assembly.with_roles(["free"] * assembly.n_blocks), tmp_path / f"stones.{suffix}")
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(suffix=suffix, roles=roles, direction=direction), encoding="utf-8")
    run = blockvis.run_case(path, tmp_path / "out", overwrite=True, outputs=())
    return run.response.assembly


def squares(*corners):
    return solver.Assembly.from_outlines([[[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]] for x, y in corners])


def test_roles_below_a_height_and_in_a_box(tmp_path):
    wall = squares((0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1))
    found = roles_of(
        tmp_path, "[roles]\nbelow = { y = 0.9 }\nbox = { x = [2.0, 3.0], y = [0, 1], role = 'moving' }", wall
    )
    expected = np.where(found.centroids[:, 1] > 1, "free", np.where(found.centroids[:, 0] > 2, "moving", "fixed"))
    assert found.roles.tolist() == expected.tolist()


def test_roles_of_what_touches_a_plane_and_of_several_places(tmp_path):
    wall = squares((0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1))
    roles = "[roles]\ntouching = [{ x = 0.0 }, { y = 0.0, x = 3.0, role = 'moving' }]"
    found = roles_of(tmp_path, roles, wall)
    x, y = found.centroids.T
    assert (found.roles == "fixed").tolist() == (x < 1).tolist()
    assert (found.roles == "moving").tolist() == ((x > 2) & (y < 1)).tolist()


@pytest.mark.slow
def test_springers_of_a_vault_are_found_in_space(tmp_path):
    vault = generators.build("barrel vault", {})
    low, high = vault.vertices.min(axis=0), vault.vertices.max(axis=0)
    sides = (
        f"[roles]\ntouching = [{{ z = {low[2]}, x = {low[0]} }}, {{ z = {low[2]}, x = {high[0]}, role = 'moving' }}]"
    )
    found = roles_of(tmp_path, sides, vault, "vtu", "[1, 0, 0]")
    for role in ("fixed", "moving"):
        expected = vault.centroids[vault.roles == role]
        given = found.centroids[found.roles == role]
        np.testing.assert_allclose(np.sort(given, axis=0), np.sort(expected, axis=0), atol=1e-9)


@pytest.mark.parametrize(
    ("roles", "words"),
    [
        ("below = { z = 0.1 }", "[roles] below: a drawing in the plane has no z; give its height y, or take"),
        ("below = { y = -5.0 }", "[roles] below holds no block; the drawing reaches over x 0 to 3, y 0 to 2 m"),
        ("below = { y = 50.0 }", "[roles] below holds every block"),
        ("below = { }", "[roles] below names no coordinate; write below = { z = 0.1 }"),
        ("box = { x = [1.0, 0.0] }", "[roles] box: x is [1.0, 0.0]; give two numbers, the smaller first"),
        ("touching = { x = 'left' }", "[roles] touching: x is 'left'; give a number, in m"),
        ("below = { y = 0.9, role = 'ground' }", "[roles.below] role is 'ground'"),
        ("beneath = { y = 0.9 }", "a role is free, fixed, moving, or by place: below, touching, box"),
        ("box = { x = [2.0, 3.0], y = [0, 1] }", 'role "moving" under [roles] or add [[supports]]: block 2'),
        ("below = { h = 0.9 }", "h is not a key here"),
    ],
)
def test_a_place_that_is_wrong_is_told_in_one_line(tmp_path, capsys, roles, words):
    blockvis.save_layout(squares((0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)), tmp_path / "stones.svg")
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(suffix="svg", roles=f"[roles]\n{roles}", direction="[0, -1]"), encoding="utf-8")
    assert main(["run", str(path), "-o", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert words in message
    assert [line for line in message.splitlines() if "note" not in line] == [message.splitlines()[-1]]
