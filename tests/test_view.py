"""Replay and explore pages: what they hold, and in a real browser what they do."""

import functools
import json
import re
import signal
import subprocess
import sys
import threading
import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import drawn_machine, machine
from seeds import drawn_anew
from tiers import tiered

from omnijax._text import quantity_text
from omnijax.cli.explore import start_speeds
from omnijax.laws import ContactCubic, ContactRelaxation, Creep, GatedSine, WheelRadius
from omnijax.rig import InputError, load_rig, set_parameter
from omnijax.simulation import simulate, speeds
from omnijax.vibration import contact_load, evaluate, natural_frequencies
from omnijax.view import write_replay
from omnijax.view._panel import Panel
from omnijax.view._scene import embedded_json

pytestmark = pytest.mark.long

HOSTILE = "<script>window.hacked=1</script>"


@functools.cache
def _run():
    rig = machine()
    ts = jnp.linspace(0.0, 0.4, 101)
    return rig, eqx.filter_jit(simulate)(rig, speeds([0.6, 1.2, 0.9]), ts)


@pytest.fixture
def replay_page(tmp_path):
    rig, run = _run()
    return write_replay(run, rig, tmp_path / "replay.html", f"Atlas {HOSTILE}")


def test_replay_is_one_offline_file(replay_page):
    text = replay_page.read_text()
    assert len(text) < 2e6
    assert HOSTILE not in text
    assert not re.search(r"""(src|href)\s*=\s*["']?(?!data:)\s*\w*:?//""", text)
    data = json.loads(re.search(r'type="application/json">(.*?)</script>', text, re.S).group(1))
    assert len(data["machine"]["wheels"]) == 3


def test_ten_seconds_stay_below_two_megabytes(tmp_path):
    rig, run = _run()
    repeated = {
        f: np.resize(getattr(run, f), (5001, *getattr(run, f).shape[1:])) for f in run.UNITS
    }
    long = eqx.tree_at(lambda r: [getattr(r, f) for f in repeated], run, list(repeated.values()))
    assert write_replay(long, rig, tmp_path / "long.html").stat().st_size < 2e6


def test_replay_needs_finite_samples(tmp_path):
    rig, run = _run()
    broken = eqx.tree_at(lambda r: r.dR, run, jnp.full_like(run.dR, jnp.inf))
    with pytest.raises(ValueError, match="0 finite samples"):
        write_replay(broken, rig, tmp_path / "x.html")


def test_json_cannot_leave_its_script_element():
    text = embedded_json({"name": "</script><script>x"})
    assert "<" not in text and json.loads(text)["name"].startswith("</script>")


def test_panel_answers_sliders():
    panel = Panel("a", load_rig("atlas"), [0.6, 1.2, 0.9], 0)
    before = panel.evaluate({})
    after = panel.evaluate({"wheel.roundness": 0.2})
    assert max(after["distance"]) < 0.5 * max(before["distance"])
    assert 14 in before["passing"]
    modes = [s for s in before["campbell"]["series"] if s["kind"] == "mode"]
    assert modes and modes[0]["values"][0] > 5
    figures = {f["label"]: f["value"].split() for f in before["figures"]}
    number, unit = figures["|ΔR| peak"]
    peak = max(before["distance"]) / (float(number) * {"mm": 1e3, "µm": 1.0}[unit])
    assert 0.8 < peak < 1.05  # two seconds of the long run come near its supremum
    rig, _ = panel.changed({"wheel.roundness": 0.2})
    assert np.all(np.asarray(rig.wheels.roundness) == 0.2)
    with pytest.raises(InputError, match="no slider"):
        panel.evaluate({"wheel.rondness": 0.2})
    with pytest.raises(InputError, match="must be a number"):
        panel.evaluate({"wheel.roundness": "x"})


@pytest.mark.full  # in the gate the panel; long runs: test_steady
@pytest.mark.brief
def test_what_the_sliders_show_is_what_simulate_gives():
    """Random positions on two drawn rigs with effects, against runs whose transients are over.

    A run begins 3 s before with angles such that all are 0 where the page's two seconds begin.
    The page draws 96 harmonics of a pitch.  20 s meet a supremum from below.
    """
    rng, begin, n = drawn_anew("sliders"), 3.0, 3
    metrics = ("peak", "rms", "elastic_rms", "sphere_acceleration_rms")

    @jax.jit
    def run_of(rig, turning, t):
        ts = jnp.concatenate([jnp.zeros(1), begin + t])
        run = simulate(rig, speeds(turning, initial_angle=-begin * turning), ts)
        run = jax.tree.map(lambda x: x[1:] if jnp.shape(x)[:1] == ts.shape else x, run)
        return run.dR, run.theta, evaluate(run, rig, metrics)

    for _ in range(2):
        rig = drawn_machine(rng, n, rollers=14, gravity=[0.0, 0.0, -9.81])
        rig = eqx.tree_at(lambda r: r.profiles, rig, (GatedSine(),) * n)
        rig = rig.add(ContactRelaxation(jnp.asarray(4e4), jnp.asarray(0.02)), "w2")
        rig = rig.add(Creep(jnp.asarray(0.02)), "w1").add(WheelRadius(jnp.asarray(0.01)), "w3")
        start = rng.permutation([1.0, 1.272, 1.618]) * rng.uniform(6, 9)
        panel, faster = Panel("a", rig, start.tolist(), 0), rng.uniform(0.7, 1.3)
        values = {f"speed.{name}": faster * w for name, w in zip(rig.names, start, strict=True)}
        numbers = [s for s in panel.sliders if s.path not in values]
        values |= {numbers[k].path: position(numbers[k], rng) for k in rng.permutation(7)[:4]}
        answer = panel.evaluate(values)
        for path, value in values.items():
            rig = rig if path.startswith("speed.") else set_parameter(rig, path, value)
        dR, theta, figures = run_of(rig, faster * start, jnp.arange(4001) / 200)
        shown, largest = len(answer["t"]), float(jnp.max(jnp.linalg.norm(dR, axis=1)))
        assert answer["t"][-1] == pytest.approx((shown - 1) / 200)
        np.testing.assert_allclose(answer["frames"]["dR"], dR[:shown], atol=5e-3 * largest)
        np.testing.assert_allclose(answer["frames"]["theta"], theta[:shown], atol=1e-4)
        for said, name in zip(answer["figures"], metrics, strict=True):
            low, high = (0.85, 1.001) if name == "peak" else (0.985, 1.015)
            ratio = float(figures[name]) / si(said["value"])
            assert low < ratio < high, (said, ratio)


def position(slider, rng):
    """A position of a slider beside where it stands: one that is not moved changes nothing."""
    if slider.whole:
        return int(slider.value) + int(rng.choice([-2, -1, 1, 2]))
    return slider.value * rng.uniform(0.6, 1.5)


def si(text):
    """The SI value of a text with a unit."""
    number, unit = text.split(" ", 1)
    return float(number) * {"mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "mm/s²": 1e-3}.get(unit, 1.0)


def test_wheels_that_pass_equally_often_share_a_line():
    panel = Panel("a", load_rig("atlas"), [1.0, -1.0, 0.0], 0)
    series = panel.evaluate({})["campbell"]["series"]
    passing = [s for s in series if s["kind"] == "passing"]
    assert [s["label"] for s in passing] == ["w1, w2 1×", "w1, w2 2×", "w1, w2 3×"]  # w3 rests
    scale = np.array(panel.evaluate({})["campbell"]["scale"])
    hertz = 14 * 1.0 / (2 * np.pi) * scale / 100
    for k, line in enumerate(passing, 1):
        np.testing.assert_allclose(line["values"], k * hertz, rtol=1e-12)
        assert line["times"] == k
    faster = panel.evaluate({"speed.w2": 2.0})["campbell"]["series"]
    assert [s["wheels"] for s in faster if s["kind"] == "passing"] == [[0]] * 3 + [[1]] * 3


def test_panel_says_which_law_it_cannot_show():
    rig = machine().add(ContactCubic(jnp.asarray(1e12)), "all")
    with pytest.raises(InputError, match="contact-cubic"):
        Panel("a", rig, [1.0, 1.0, 1.0], 0).evaluate({})


def test_every_mode_is_in_the_diagram_and_every_contact_in_the_table():
    rig = set_parameter(load_rig("atlas"), "wheel.w2.mass", 0.3)  # a program of those above
    panel = Panel("a", rig, [0.6, 1.2, 0.9], 0)
    answer = panel.evaluate({})
    hertz = np.unique(np.round(np.asarray(natural_frequencies(rig)), 2))
    modes = [s["values"][0] for s in answer["campbell"]["series"] if s["kind"] == "mode"]
    np.testing.assert_allclose(modes, hertz[hertz > 0])
    low, high = answer["campbell"]["range"]
    assert low < min(modes) and max(modes) < high
    load = contact_load(rig, jnp.asarray([0.6, 1.2, 0.9]))
    for row, least, margin in zip(answer["contacts"], load.least, load.slip_margin, strict=True):
        assert row["normal"] == quantity_text(float(least), "N")
        assert row["status"] == ("lifts off" if least <= 0 else "slips" if margin <= 0 else "holds")
    loose = panel.evaluate({"closure.preload": panel.sliders[6].low})["contacts"]
    assert panel.sliders[6].path == "closure.preload"
    assert "holds" not in {row["status"] for row in loose}


def test_bars_stand_on_orders_that_matter():
    panel = Panel("a", load_rig("atlas"), [0.6, 1.2, 0.9], 0)
    answer = panel.evaluate({})
    bars = np.sum(answer["spectrum"], axis=0)
    loud = [order for order, bar in zip(answer["order"], bars, strict=True) if bar > 1e-6]
    assert answer["passing"][0] == 14 and set(loud) <= set(answer["passing"])
    assert np.max(bars[-1]) >= 0.01 * np.max(np.array(answer["spectrum"])) / 2
    still = panel.evaluate({"wheel.roundness": 0.0})
    assert np.max(still["spectrum"]) < 1e-6 and max(still["order"]) == 4 * 14


def test_start_speeds():
    rig = machine()
    own = np.array(start_speeds(None, None, rig)) * np.asarray(rig.wheels.radius)
    turning = np.linalg.lstsq(np.asarray(rig.wheels.spin_axis), own, rcond=None)[0]
    np.testing.assert_allclose(np.asarray(rig.wheels.spin_axis) @ turning, own, atol=1e-12)
    assert start_speeds("1.5", None, rig) == [1.5] * 3
    assert start_speeds("60 rpm,1,0", None, rig) == pytest.approx([2 * np.pi, 1, 0])
    with pytest.raises(InputError, match="`speed` has 2 values, but the rig has 3 wheels"):
        start_speeds("1,2", None, rig)
    with pytest.raises(InputError, match="`speed` must be a number in rad/s"):
        start_speeds("fast", None, rig)
    omega = np.array([0.2, -0.3, 0.4])
    own = np.array(start_speeds(None, "0.2,-0.3,0.4", rig)) * np.asarray(rig.wheels.radius)
    rim = np.asarray(rig.wheels.spin_axis) @ omega * float(rig.sphere.radius)
    np.testing.assert_allclose(own, rim, rtol=1e-12)
    with pytest.raises(InputError, match="one of --speed, --omega, but both"):
        start_speeds("1,2,3", "0,0,1", rig)


@pytest.mark.parametrize("width", tiered([1280, 400], (400).__eq__))
def test_replay_scrubs_in_a_browser(open_page, replay_page, width):
    page, seen = open_page(replay_page.as_uri(), width)
    page.locator("#scrub").fill("50")
    assert page.locator("#time").inner_text() == "0.200 s"
    first = page.locator("#value").inner_text()
    assert page.locator(".label.wheel").all_inner_texts() == ["w1", "w2", "w3"]
    assert page.locator("#wheels li").count() == 3
    assert page.locator("#plot .legend li").all_inner_texts() == ["x", "y", "z", "length |ΔR|"]
    page.locator("#scrub").fill("70")
    assert page.locator("#value").inner_text() != first
    page.locator("#play").click()
    page.wait_for_function("document.getElementById('time').textContent !== '0.280 s'")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("window.hacked") is None
    assert seen["errors"] == []
    assert all(url.startswith(("file:", "data:", "blob:")) for url in seen["requests"])


def test_explore_slider_moves_the_plot(open_page):
    pytest.importorskip("starlette", reason="the view3d extra is not installed")
    uvicorn = pytest.importorskip("uvicorn", reason="the view3d extra is not installed")
    from omnijax.view._explore import explore_app
    from omnijax.view._serve import LOOPBACK, _listen

    panel = Panel(HOSTILE, load_rig("atlas"), [1.0, 1.0, 1.0], 0)
    panel.evaluate({})
    listener = _listen("127.0.0.1", 0)
    port = listener.getsockname()[1]
    config = uvicorn.Config(explore_app([panel], LOOPBACK), log_level="error", lifespan="off")
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    try:
        page, seen = open_page(f"http://127.0.0.1:{port}/", 400)
        figures = page.locator(".figures")
        _until(lambda: "peak" in figures.inner_text())
        before = figures.inner_text()
        plot = "document.querySelectorAll('.plot canvas')[0].toDataURL()"
        picture = page.evaluate(plot)
        assert page.evaluate(COLOURS_SHOWN) == [True] * 3  # equal speeds: bars on each other
        assert page.locator(".label.wheel").all_inner_texts() == ["w1", "w2", "w3"]
        assert page.locator(".label.axis").all_inner_texts() == ["x", "y", "z (up)"]
        assert page.locator(".contacts tbody tr").count() == 3
        page.locator('input[data-path="wheel.roundness"]').fill("0.2")
        _until(lambda: figures.inner_text() != before)
        assert page.evaluate(plot) != picture
        field = page.locator('input[data-number="contact.stiffness"]')
        field.fill("1882")  # kN/m
        field.press("Enter")
        _until(lambda: _value(page, "contact.stiffness") == "1882")
        assert float(_slider(page, "contact.stiffness")) == pytest.approx(0.75, abs=0.001)
        page.locator("button.reset").click()
        assert _value(page, "wheel.roundness") == "0.4485"
        _until(lambda: figures.inner_text() == before)
        page.locator('input[data-path="wheel.roundness"]').fill("0.2")
        with page.expect_download() as download:
            page.locator("button.save").click()
        saved = download.value.path().read_text()
        assert "roundness = 0.2" in saved
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        assert page.evaluate("window.hacked") is None
        assert seen["errors"] == []
        here = f"http://127.0.0.1:{port}/"
        assert all(url.startswith((here, "blob:", "data:")) for url in seen["requests"])
    finally:
        server.should_exit = True
        thread.join(10)


def _value(page, path):
    return page.locator(f'input[data-number="{path}"]').input_value()


def _slider(page, path):
    return page.locator(f'input[data-path="{path}"]').input_value()


COLOURS_SHOWN = """() => {  // which wheels' colours fill pixels of the order spectrum
  const canvas = document.querySelectorAll(".plot canvas")[1];
  const bytes = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const colours = [[0, 114, 178], [213, 94, 0], [0, 158, 115]], shown = [0, 0, 0];
  for (let i = 0; i < bytes.length; i += 4)
    colours.forEach((colour, k) => {
      if (colour.every((c, j) => c === bytes[i + j])) shown[k] += 1;
    });
  return shown.map((pixels) => pixels > 100);
}"""


def _until(condition, seconds=180.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "the page did not come to it"
        time.sleep(0.1)


def test_explore_answers_only_hosts_of_this_machine():
    pytest.importorskip("httpx", reason="httpx is not installed")
    testclient = pytest.importorskip("starlette.testclient", reason="no view3d extra")
    from omnijax.view._explore import explore_app
    from omnijax.view._serve import LOOPBACK

    app = explore_app([Panel("a", load_rig("atlas"), [1.0, 1.0, 1.0], 0)], LOOPBACK)
    local = testclient.TestClient(app, base_url="http://127.0.0.1")
    assert local.get("/api/rigs").json()[0]["name"] == "a"
    assert testclient.TestClient(app, base_url="http://elsewhere.test").get("/").status_code == 400
    wrong = local.post("/api/evaluate", json={"rig": 3, "values": {}})
    assert wrong.status_code == 400 and "panel's number" in wrong.json()["error"]
    assert local.post("/api/evaluate", content=b"{", headers=JSON).status_code == 400


JSON = {"Content-Type": "application/json"}
REFUSED = {
    "another page": (b"{}", JSON | {"Origin": "http://evil.test"}, 403),
    "another page by its fetch": (b"{}", JSON | {"Sec-Fetch-Site": "cross-site"}, 403),
    "no page at all": (b"{}", JSON | {"Origin": "null"}, 403),
    "a form": (b"{}", {"Content-Type": "text/plain"}, 415),
    "no kind": (b"{}", {}, 415),
    "too large": (b"[" * 100_000, JSON, 413),
    "nested": (b"[" * 60_000, JSON, 400),
    "outside its slider": (
        b'{"rig": 0, "values": {"contact.stiffness": 1e300}}', JSON, 400),
    "half a roller": (b'{"rig": 0, "values": {"wheel.rollers": 7.5}}', JSON, 400),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_the_page_answers_only_itself(kind):
    testclient = pytest.importorskip("starlette.testclient")
    from omnijax import load_rig
    from omnijax.view._explore import explore_app
    from omnijax.view._panel import Panel

    app = explore_app([Panel("atlas", load_rig("atlas"), [0.6, 1.2, 0.9], 0)], ["127.0.0.1"])
    local = testclient.TestClient(app, base_url="http://127.0.0.1")
    body, headers, status = REFUSED[kind]
    assert local.post("/api/evaluate", content=body, headers=headers).status_code == status
    page = local.get("/")
    assert page.status_code == 200 and page.headers["x-frame-options"] == "DENY"
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy


@pytest.mark.parametrize("number", tiered([signal.SIGINT, signal.SIGTERM], signal.SIGINT.__eq__))
def test_one_signal_ends_the_page(number):
    """The server raised it once more, which counted as a second one: "ended at once"."""
    pytest.importorskip("uvicorn")
    code = "import signal, time; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += "from omnijax._interrupts import listening; from omnijax.view import serve\n"
    code += "with listening():\n    try:\n        serve({}, {}, port=0, browser=False)\n"
    code += "    finally:\n        time.sleep(0.3)\n"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        while "Ctrl-C ends it" not in process.stdout.readline():
            assert process.poll() is None
        time.sleep(1.0)
        process.send_signal(number)
        _, err = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in err and "again" not in err
