"""A view that is served, without a browser: what is sent, what stays, what ends."""

from __future__ import annotations

import gc
import io
import json
import re
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.python.ui.view.pages import Tab, until

import stiffmap as sm
from stiffmap.common.errors import FileError, MissingPartError, StiffmapError
from stiffmap.model.files.shipped import find
from stiffmap.ui.cli import main
from stiffmap.ui.view.data import Data, path_errors, residual_arrows, thinned
from stiffmap.ui.view.open import View, model_of
from stiffmap.ui.view.outputs import write_page
from stiffmap.ui.view.plane import plane_image
from stiffmap.ui.view.state import ViewState, permalink

pytest.importorskip("viser", reason="viser is not installed (pip install stiffmap[view])")
EXAMPLES = Path(__file__).parents[4] / "examples"


@pytest.fixture(scope="module")
def machine() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


@pytest.fixture
def view(machine: sm.Machine) -> Iterator[View]:
    with View(model_of(machine)) as v:
        assert v._viewer.worker.idle()
        yield v


def test_a_drag_is_drawn_as_solved(view: View, machine: sm.Machine) -> None:
    viewer = view._viewer
    viewer.drag(np.array([0.05, 0.1, 0.2]), np.array(viewer.scene.gizmo.wxyz))
    assert viewer.worker.idle()
    assert view.state.position == (0.05, 0.1, 0.2)
    found = viewer._plane
    assert found is not None and found.count == 101 and found.frame.centre[2] == 0.2
    p = found.frame.poses(101)
    want = 1e6 * np.linalg.norm(machine.solve(p, view.state.wrench).displacement[..., :3], axis=-1)
    np.testing.assert_allclose(found.shown, want, rtol=1e-12)
    np.testing.assert_array_equal(viewer.scene._image.image, plane_image(found, (want.min(), want.max())))
    viewer.probe.at(p[30, 70])
    assert viewer.controls.probe.value.endswith(f"{want[30, 70]:.5g} µm")
    np.testing.assert_allclose(viewer.scene.gizmo.position, view.state.position)


def test_the_same_plane_is_not_solved_again(view: View) -> None:
    viewer = view._viewer
    first = viewer._plane
    viewer.drag(np.array([0.1, 0.1, 0.0]), np.array(viewer.scene.gizmo.wxyz))
    assert viewer.worker.idle() and viewer._plane is first
    view.set(force=(0.0, 100.0, 0.0))
    assert viewer.worker.idle() and viewer._plane is not first


def test_a_hundred_drags_leave_nothing_behind(view: View) -> None:
    viewer, buffer = view._viewer, view._server._websock_server._broadcast_buffer
    wxyz = np.array(viewer.scene.gizmo.wxyz)

    def drags(count: int) -> tuple[int, int, int]:
        for i in range(count):
            viewer.drag(0.1 * np.array([np.sin(i), np.cos(i), np.sin(2 * i)]), wxyz)
            time.sleep(0.003)
        viewer.drag(np.array([0.1, 0.1, 0.1]), wxyz)
        assert viewer.worker.idle()
        time.sleep(0.2)
        gc.collect()
        states = sum(isinstance(o, ViewState) for o in gc.get_objects())
        return len(buffer.message_from_id), threading.active_count(), states

    before, after = drags(20), drags(100)
    assert after[0] <= before[0] + 5
    assert after[1] <= before[1] + 1
    assert after[2] <= before[2] + 3


def test_what_is_refused_is_shown_and_changes_nothing(view: View) -> None:
    viewer = view._viewer
    before = view.state
    assert not viewer.act(lambda m: m.put(position=(9.0, 0.0, 0.0)))
    assert viewer.worker.idle()
    assert view.state == before
    assert 'role="alert"' in viewer.controls.status.content and "cannot reach (9000, 0, 0) mm" in viewer.error
    assert viewer.act(lambda m: m.put(force=(1.0, 0.0, 0.0)))
    assert viewer.worker.idle()
    assert "alert" not in viewer.controls.status.content


def test_a_fault_of_ours_is_shown_and_the_view_goes_on(view: View, monkeypatch: pytest.MonkeyPatch) -> None:
    viewer = view._viewer
    monkeypatch.setattr(viewer.worker, "stages", [lambda: 1 / 0, *viewer.worker.stages[1:]])
    viewer.worker.ask()
    assert viewer.worker.idle() and "ZeroDivisionError" in viewer.error


def test_links_restore_the_state_over_http(view: View) -> None:
    wanted = ViewState((0.1, 0.0, 0.05), force=(5.0, 0.0, 0.0), plane="x", quantity="worst")
    with urllib.request.urlopen(f"{view.url}/?state={permalink('orthoglide-revised', wanted)}") as answer:
        assert answer.status == 200 and b"<html" in answer.read()
    assert view.state == wanted
    assert view.link == f"{view.url}/?state={permalink('orthoglide-revised', wanted)}"
    urllib.request.urlopen(f"{view.url}/?state={permalink('hexapod', wanted)}").read()
    assert "the link is of the machine hexapod" in view._viewer.error
    urllib.request.urlopen(f"{view.url}/?state=abc").read()
    assert "the link is damaged" in view._viewer.error and view.state == wanted


def test_other_pages_are_refused(view: View) -> None:
    for headers in ({"Host": "evil.example"}, {"Origin": "http://evil.example"}):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(urllib.request.Request(view.url, headers=headers))
        assert refused.value.code == 403
        refused.value.close()


def test_beyond_this_computer_only_with_the_token(machine: sm.Machine) -> None:
    with View(model_of(machine), host="0.0.0.0") as v:
        port = v._server.get_port()
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(f"http://127.0.0.1:{port}/")
        refused.value.close()
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/?token={v._guard.token}") as answer:
            assert answer.status == 200 and "HttpOnly" in answer.headers["Set-Cookie"]


def test_a_file_is_reloaded_or_its_error_shown(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    text = find("five-bar").read_text(encoding="utf-8")
    file.write_text(text, encoding="utf-8")
    with View(model_of(sm.load_machine(file), file=file)) as v:
        file.write_text(text.replace("legs:", "lags:"), encoding="utf-8")
        assert until(lambda: "mine.yaml, line" in v._viewer.error)
        file.write_text(text.replace("name: five-bar", "name: seven-bar"), encoding="utf-8")
        assert until(lambda: v._viewer.model.machine.name == "seven-bar" and not v._viewer.error)
        assert v._viewer.worker.idle() and "seven-bar" in v._viewer.controls.status.content


@pytest.mark.parametrize("quantity", ["worst", "margin", "status", "frequency", "dynamic"])
def test_every_quantity_is_drawn(view: View, quantity: str) -> None:
    viewer = view._viewer
    controls = viewer.controls
    controls.cloud.value, controls.surface.value, controls.light.value = True, "ellipsoid", "x.foot"
    view.set(quantity=quantity, plane="free", normal=(1.0, 0.2, 0.3))
    assert viewer.worker.idle(60) and not viewer.error
    assert viewer._plane is not None and viewer._plane.quantity == quantity
    assert "natural frequencies" in viewer.controls._why.content
    assert viewer.scene.lit


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--at", "9000,0,0"], "cannot reach (9000, 0, 0) mm"),
        (["--plane", "w"], "--plane: expected 3 numbers"),
        (["--quantity", "taste"], "quantity: expected 'deflection'"),
        (["--set", "x.no/at.x=1"], "has no number 'x.no/at.x'"),
        (["--link", "abc"], "the link is damaged"),
        (["--tolerance", "-1"], "tolerance: expected a number greater than 0"),
        (["--path", "no.ngc"], "no such file"),
        (["--start", "1,2"], "start"),
    ],
)
def test_bad_options_end_in_one_message(
    options: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    unused = tmp_path / "unused.html"
    assert main(["view", "orthoglide-revised", "--html", str(unused), *options]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert not unused.exists()


def test_without_viser_there_is_one_clear_error(machine: sm.Machine, monkeypatch: pytest.MonkeyPatch,
                                                capsys: pytest.CaptureFixture[str]) -> None:  # fmt: skip
    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["view", "orthoglide-revised"]) == 2
    assert "a view needs viser, which is not installed: pip install 'stiffmap[view]'" in " ".join(
        capsys.readouterr().err.split()
    )
    with pytest.raises(MissingPartError, match=r"pip install 'stiffmap\[view\]'"):
        machine.view(browser=False)


def test_machine_view_opens_and_closes(machine: sm.Machine) -> None:
    v = machine.view((0.1, 0.0, 0.0), browser=False, force=(0.0, 0.0, -50.0), plane="y")
    assert v.state == ViewState((0.1, 0.0, 0.0), force=(0.0, 0.0, -50.0), plane="y")
    assert v.url.startswith("http://127.0.0.1:") and v.url in v._repr_html_()
    with pytest.raises(StiffmapError, match="plane: expected 'x'"):
        v.set(plane="w")
    v.close()
    v.close()
    assert repr(v) == "View, closed"
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(f"{v.url if v._viewer else 'http://127.0.0.1:9'}")


def test_the_command_serves_until_it_is_interrupted() -> None:
    import signal

    def from_a_terminal() -> None:  # a shell's background job ignores SIGINT, and so does what it starts
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    command = [sys.executable, "-m", "stiffmap", "view", "five-bar", "--no-browser", "--port", "0", "--json"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=from_a_terminal
    ) as running:
        assert running.stdout is not None and running.stderr is not None
        lines = ""
        while not lines.rstrip().endswith("}"):
            lines += running.stdout.readline()
        url = json.loads(lines)["url"]
        with urllib.request.urlopen(url) as answer:
            assert answer.status == 200
        running.send_signal(signal.SIGINT)
        try:
            assert running.wait(30) == 0
        finally:
            running.kill()
        assert running.stderr.read() == ""


def test_several_pages_show_the_same_and_a_closed_one_costs_nothing() -> None:
    machine = sm.load_machine("five-bar")
    with View(model_of(machine, force=(10.0, 0.0, 0.0))) as view:
        tabs = [Tab(view) for _ in range(3)]
        assert until(lambda: len(view._server.get_clients()) == 3)
        for k in range(100):
            view._viewer.drag(
                np.array([0.05 * np.sin(k), 0.42, 0.0]), np.array(view._viewer.scene.gizmo.wxyz)
            )
            time.sleep(0.01)
            if k == 50:
                tabs.pop().close()
        assert view._viewer.worker.idle(60)
        d = 1e6 * np.linalg.norm(machine.solve(view.state.position, view.state.wrench).displacement[:3])
        assert all(tab.shows(f"{d:.1f} µm") for tab in tabs)
        assert until(lambda: len(view._server.get_clients()) == 2)
        for tab in tabs:
            tab.close()


def test_rows_and_paths_are_drawn() -> None:
    machine = sm.load_machine("orthoglide-revised")
    experiment = sm.load_experiment(EXAMPLES / "experiments" / "A-servo")
    places, arrows = residual_arrows(machine, experiment)
    r = sm.residual(machine, experiment)
    assert len(places) == len(arrows) > 3
    assert np.abs(arrows).max() == pytest.approx(np.nanmax(np.abs(r.values[:, :3])))
    t = np.linspace(0, 1, 2001)[:, None]
    path = np.array([-0.1, 0, 0]) * (1 - t) + t * np.array([0.2, 0.1, 0])
    assert len(thinned(path)) <= 400
    model = model_of(machine, force=(0.0, 0.0, -300.0))
    wanted, cut, left, factor = path_errors(model.moment, path[::200], 0.1)
    off = machine.solve(wanted, model.state.wrench).displacement[:, :3]
    np.testing.assert_allclose(cut - wanted, factor * off, atol=1e-9)
    assert np.abs(left - wanted).max() < 0.05 * np.abs(cut - wanted).max()
    with View(model, data=Data(experiment, path)) as v:
        assert v._viewer.worker.idle(60) and not v._viewer.error
        assert {"/rows/before", "/path/cut"} <= set(v._viewer.scene._lines)


ARM = """<robot name="arm">
<link name="base"><visual><geometry><box size="0.1 0.1 0.3"/></geometry></visual></link>
<link name="upper"><visual><origin xyz="0.2 0 0.01" rpy="0.3 0 0"/>
<geometry><mesh filename="package://arm_description/meshes/up.stl" scale="0.001 0.001 0.001"/></geometry></visual></link>
<link name="tool"><visual><geometry><mesh filename="../meshes/tool.stl"/></geometry></visual></link><link name="finger"/>
<joint name="q 1" type="revolute"><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><parent link="base"/><child link="upper"/></joint>
<joint name="q2" type="revolute"><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><parent link="upper"/><child link="tool"/></joint>
<joint name="q3" type="revolute"><parent link="tool"/><child link="finger"/><mimic joint="q2"/></joint></robot>"""


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A URDF with its meshes, a block of 300 mm x 40 mm x 20 mm, in millimetres, and a tool of 50 mm in metres."""
    import trimesh

    pytest.importorskip("yourdfpy")
    file = tmp_path / "arm_description/urdf/arm.urdf"
    file.parent.mkdir(parents=True)
    (tmp_path / "arm_description/meshes").mkdir()
    trimesh.creation.box((300, 40, 20)).export(tmp_path / "arm_description/meshes/up.stl")
    trimesh.creation.box((0.05, 0.05, 0.05)).export(tmp_path / "arm_description/meshes/tool.stl")
    file.write_text(ARM)
    return file


def test_meshes_of_a_urdf_stand_on_the_joints(arm: Path) -> None:
    import trimesh

    machine = sm.import_urdf(arm, tip="tool")
    at = sm.forward_kinematics(machine, [0.5, -0.4])
    turn = Rotation.from_matrix(at.rotation).as_rotvec()
    with View(model_of(machine, at.position, rotation=turn, meshes=arm)) as v:
        assert v._viewer.worker.idle(60) and not v._viewer.error and not v._viewer.model.message
        assert "the machine is rigid" in v._viewer.controls.status.content
        handles = {h.name: h for h in v._viewer.scene._meshes._shown._joint_frames}
        drawn = [
            trimesh.load_mesh(io.BytesIO(m.glb_data), file_type="glb")
            for m in v._viewer.scene._meshes._shown._meshes
        ]
        names = sorted(handles, key=len)
        place = np.eye(4)
        for name in names[:2]:  # base to upper to tool
            step = np.eye(4)
            w, x, y, z = handles[name].wxyz
            step[:3, :3] = Rotation.from_quat((x, y, z, w)).as_matrix()
            step[:3, 3] = handles[name].position
            place = place @ step
    np.testing.assert_allclose(place[:3, 3], at.position, atol=1e-9)
    np.testing.assert_allclose(place[:3, :3], at.rotation, atol=1e-9)
    volumes, middles = [m.volume for m in drawn], [m.centroid for m in drawn]
    np.testing.assert_allclose(volumes, [0.1 * 0.1 * 0.3, 0.3 * 0.04 * 0.02, 0.05**3], rtol=1e-5)
    np.testing.assert_allclose(middles, [(0, 0, 0), (0.2, 0, 0.01), (0, 0, 0)], atol=1e-7)
    page = write_page(
        model_of(machine, at.position, rotation=turn, meshes=arm).moment, arm.with_suffix(".html")
    )
    bare = write_page(model_of(machine, at.position, rotation=turn).moment, arm.with_name("bare.html"))
    assert page.stat().st_size > bare.stat().st_size


def test_meshes_that_cannot_be_drawn_are_said(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine = sm.import_urdf(arm, tip="tool")
    (arm.parents[1] / "meshes/tool.stl").unlink()
    with View(model_of(machine, meshes=arm)) as v:
        assert v._viewer.model.message == "meshes that were not found: ../meshes/tool.stl"
    for text, message in {
        ARM.replace("q2", "z2").replace("q 1", "z1"): "no joint of arm is in it",
        re.sub(
            "<visual>.*?</visual>", "", ARM, flags=re.DOTALL
        ): "none of the meshes that it names can be read",
        "<robot": "not XML",
    }.items():
        arm.write_text(text)
        with pytest.raises(FileError, match=message):
            View(model_of(machine, meshes=arm))
    assert "Unable to resolve" not in capsys.readouterr().err


def test_the_force_is_pulled_by_its_tail(view: View) -> None:
    viewer = view._viewer
    tip, length = np.array(view.state.position), viewer.scene.arrow_length
    viewer.pull(tip - 2 * length * np.array([0.6, 0.0, 0.8]))
    np.testing.assert_allclose(view.state.force, 600 * np.array([0.6, 0.0, 0.8]))
    assert viewer.worker.idle()
    np.testing.assert_allclose(viewer.scene.force_handle.position, tip - length * np.array([0.6, 0.0, 0.8]))
    d = 1e6 * np.linalg.norm(viewer.model.machine.solve(tip, view.state.wrench).displacement[:3])
    assert f"{d:.1f} µm" in viewer.controls.status.content
