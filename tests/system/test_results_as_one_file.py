"""A results folder as one file: a series for ParaView, an animation for a browser, and the deformed layout."""

import json
from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from structures import arch_response, box, case_from, dropped_brick, moved_and_turned, rectangle, vault_response
from vtkmodules.vtkIOGeometry import vtkGLTFReader

import blockvis
import solver
from blockvis.cli import main
from solver import mechanics


def converted(folder, target, *options):
    assert main(["convert", str(folder), str(target), *options]) == 0
    return target


def at_the_end(response):
    """Bounds of all blocks at the last equilibrium."""
    corners = mechanics.moved_vertices(response.assembly, response.path[-1].pose)
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def series(file, step):
    reader = pv.HDFReader(file)
    reader.reader.UpdateInformation()
    times = reader.reader.GetOutputInformation(0).Get(reader.reader.GetExecutive().TIME_STEPS())
    reader.reader.SetStep(step)
    return times, reader.read()


def shows_each_increment(response, file):
    times, last = series(file, len(response.path) - 1)
    assert times == pytest.approx(list(response.settlement))
    assert set(last.keys()) == {"blocks", "joints", "contacts"}
    np.testing.assert_array_equal(last["blocks"]["falls"], response.mesh(-1)["falls"])
    np.testing.assert_allclose(last["blocks"].points, response.mesh(-1).points, atol=1e-12)
    assert last["joints"].n_cells == response.joints(-1).n_cells
    _, first = series(file, 0)
    np.testing.assert_allclose(first["blocks"].points, response.mesh(0).points, atol=1e-12)


def test_a_series_shows_each_increment_at_its_settlement(arch_folder, tmp_path):
    shows_each_increment(arch_response(), converted(arch_folder, tmp_path / "arch.vtkhdf"))


@pytest.mark.thorough
def test_a_series_is_named_where_no_other_file_is_written_or_read(arch_folder, tmp_path, capsys):
    assert main(["convert", str(arch_folder), str(tmp_path / "a.nothing")]) == 2
    assert main(["convert", str(converted(arch_folder, tmp_path / "a.vtkhdf")), str(tmp_path / "a.dxf")]) == 2
    with pytest.raises(SystemExit):
        main(["convert", "--help"])
    said, written = capsys.readouterr()[::-1]
    assert "'.nothing'; use one of .dxf" in said
    assert "; .vtkhdf is for results" in said
    assert "'.vtkhdf' is not read: it holds a path in time; give the results folder" in said
    assert "of results .vtkhdf for" in " ".join(written.split())


@pytest.mark.slow
def test_a_series_shows_each_increment_in_space(tmp_path):
    folder = blockvis.write(vault_response(), tmp_path / "out")
    shows_each_increment(vault_response(), converted(folder, tmp_path / "vault.vtkhdf"))


def played(file, time):
    """Bounds of an animation at a time [s], as VTK plays it."""
    reader = vtkGLTFReader()
    reader.SetFileName(str(file))
    reader.SetFrameRate(50)
    reader.UpdateInformation()
    reader.EnableAnimation(0)
    reader.UpdateInformation()
    reader.UpdateTimeStep(time)
    bounds = np.array(pv.wrap(reader.GetOutput()).combine().bounds)
    return reader.GetAnimationDuration(0), bounds.reshape(3, 2).T


def test_an_animation_moves_blocks_as_they_did(tmp_path):
    response = arch_response()
    stands = replace(response, increments=response.path[:3], collapse=None, stop=solver.Status.LIMIT_REACHED)
    file = converted(blockvis.write(stands, tmp_path / "out"), tmp_path / "arch.glb")
    length, last = played(file, 6.0)
    assert length == pytest.approx(6.5)
    np.testing.assert_allclose(last[:, :2], at_the_end(stands), atol=1e-3)


@pytest.mark.thorough
def test_an_animation_lets_blocks_fall(arch_folder, tmp_path):
    file = converted(arch_folder, tmp_path / "arch.glb")
    drawn = arch_response().assembly.vertices
    length, start = played(file, 0.0)
    np.testing.assert_allclose(start[:, :2], [drawn.min(axis=0), drawn.max(axis=0)], atol=1e-3)
    _, last = played(file, 6.0)
    np.testing.assert_allclose(last[:, :2], at_the_end(arch_response()), atol=1e-3)
    assert length > 7.0
    _, end = played(file, length)
    assert end[1, 1] < last[1, 1] - 0.1, "nothing has fallen"


@pytest.mark.slow
def test_an_animation_in_space_has_y_upwards(tmp_path):
    response = vault_response()
    file = converted(blockvis.write(response, tmp_path / "out"), tmp_path / "vault.glb")
    low, high = at_the_end(response)
    _, last = played(file, 6.0)
    np.testing.assert_allclose(last, [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]], atol=1e-3)


@pytest.mark.thorough
def test_what_never_stood_swings_out(tmp_path):
    """The crown of an arch that is too thin goes down."""
    thin = solver.settle(
        blockvis.generators.arch(thickness_ratio=0.05), solver.Settlement((1, 0)), friction_coefficient=2.0
    )
    assert len(thin.increments) == 1
    file = converted(blockvis.write(thin, tmp_path / "out"), tmp_path / "thin.glb")
    (_, before), (_, after) = played(file, 0.0), played(file, 1.2)
    assert after[1, 1] < before[1, 1] - 0.01


@pytest.mark.parametrize("suffix", [pytest.param(".dxf", marks=pytest.mark.thorough), ".obj"])
def test_the_deformed_layout_is_that_of_the_last_equilibrium(suffix, arch_folder, tmp_path, capsys):
    file = converted(arch_folder, tmp_path / f"deformed{suffix}")
    assert f"as they are at settlement {arch_response().path[-1].settlement:.6g} m" in capsys.readouterr().out
    layout = blockvis.read_layout(file)
    corners = np.concatenate(layout.outlines)
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], at_the_end(arch_response()), atol=1e-6)


def prop_taken_away(in_space):
    """A block on two supports, and one in the air between them that is taken away before the second settlement."""
    boxes = [(0, -1, 1, 0), (1, -1, 2, 0), (0, 0, 0.8, 0.5), (1.2, 0, 2, 0.9)]
    shapes = [box((x, 0, z), (xx, 1, zz)) if in_space else rectangle(x, z, xx, zz) for x, z, xx, zz in boxes]
    make = solver.Assembly.from_solids if in_space else solver.Assembly.from_outlines
    assembly = make(shapes, roles=["fixed", "moving", "free", "free"])
    down = solver.Settlement((0, 0, -1) if in_space else (0, -1), increment=0.01, limit=0.01)
    change = solver.PhaseChange(1, np.array([False, False, False, True]))
    return solver.Structure(assembly, friction_coefficient=0.6).settle([down, down], changes=[change])


@pytest.mark.parametrize("in_space", [False, True])
@pytest.mark.slow
def test_blocks_taken_away_are_left_out_of_layouts_and_vanish_from_animations(in_space, tmp_path, capsys):
    folder = blockvis.write(prop_taken_away(in_space), tmp_path / "out")
    deformed = converted(folder, tmp_path / "deformed.json")
    assert "3 blocks written" in capsys.readouterr().out
    last = max((folder / "increments").glob("blocks_*.vtu"))
    same = converted(last, tmp_path / "same.json")
    assert "left out: 1 block taken away or lost (array 'fallen')" in capsys.readouterr().err
    for file in (deformed, same):
        layout = blockvis.read_layout(file)
        assert layout.n_blocks == 3
        assert layout.points[:, -1].max() == pytest.approx(0.5, abs=1e-6)
    assert blockvis.read_layout(min((folder / "increments").glob("blocks_*.vtu"))).n_blocks == 4
    film = converted(folder, tmp_path / "out.glb")
    assert "4 blocks that move written" in (said := capsys.readouterr().out)
    assert "vanishing on the way: 1 block taken away" in said
    assert played(film, 2.9)[1][1, 1] == pytest.approx(0.9, abs=0.02)
    assert played(film, 3.1)[1][1, 1] == pytest.approx(0.5, abs=0.02)


@pytest.mark.thorough
def test_the_deformed_layout_is_told_in_the_unit_of_its_settlement(tmp_path, capsys):
    converted(blockvis.write(moved_and_turned(), tmp_path / "out"), tmp_path / "deformed.json")
    assert capsys.readouterr().out.endswith(", as they are at settlement 0.001 rad in phase 2\n")


@pytest.mark.slow
def test_an_animation_of_a_load_that_moves_begins_at_0_seconds(tmp_path):
    text = '[geometry]\nlayout = "arch"\nparameters = { voussoirs = 6 }\n[material]\nfriction_coefficient = 0.8\n'
    text += (
        '[analysis]\nkind = "limit load"\n[[loads]]\nkind = "live"\nforce = [0, -1000]\npositions = [-0.9, 0.9, 3]\n'
    )
    folder = blockvis.run_case(case_from(text, tmp_path), tmp_path / "out", outputs=()).folder
    data = converted(folder, tmp_path / "load.glb").read_bytes()
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    times = [tree["accessors"][sampler["input"]] for sampler in tree["animations"][0]["samplers"]]
    assert {tuple(one["min"]) for one in times} == {(0.0,)}


@pytest.mark.thorough
def test_a_block_called_as_the_scene_moves_alone(tmp_path):
    outlines = [rectangle(-1.0, -1.0, 1.0, 0.0), rectangle(-1.0, 0.0, 0.0, 1.0), rectangle(0.0, 0.0, 1.0, 1.0)]
    assembly = solver.Assembly.from_outlines(outlines, names=["ground", "a", "world"], roles=["moving", "free", "free"])
    aside = solver.Settlement((1, 0), increment=0.02, limit=0.04)
    response = solver.Structure(assembly, friction_coefficient=0.6).settle(aside)
    data = converted(blockvis.write(response, tmp_path / "out"), tmp_path / "moves.glb").read_bytes()
    nodes = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])["nodes"]
    assert [node["name"] for node in nodes if "mesh" in node] == list(assembly.names)
    assert not any("children" in node for node in nodes if "mesh" in node)


@pytest.mark.slow
def test_lost_blocks_are_left_out_of_the_deformed_layout(tmp_path, capsys):
    folder = blockvis.write(dropped_brick(0.05), tmp_path / "out")
    layout = blockvis.read_layout(converted(folder, tmp_path / "deformed.json"))
    assert "left out: 1 block lost" in capsys.readouterr().out
    assert "brick" not in layout.names


def test_options_of_layout_files_are_refused_for_results(arch_folder, tmp_path, capsys):
    assert main(["convert", str(arch_folder), str(tmp_path / "a.dxf"), "--unit", "mm"]) == 2
    assert "--unit is of layout files" in capsys.readouterr().err
    assert main(["convert", str(arch_folder), str(tmp_path / "a.compas.json")]) == 2
    assert "--dimension 3" in capsys.readouterr().err
    assert main(["convert", str(arch_folder), str(tmp_path / "a.compas.json"), "--dimension", "3"]) == 0
    assert blockvis.read_layout(tmp_path / "a.compas.json").n_blocks == arch_response().assembly.n_blocks
