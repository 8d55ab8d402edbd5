"""`docs/add_a_law.md`, carried out as it stands: its blocks, its claims and its table of ports."""

import inspect
import re
from pathlib import Path

import jax.numpy as jnp
import numpy as np

import omnijax
from omnijax import laws
from omnijax.cli import run
from omnijax.dynamics import mount_signals, mount_tensions
from omnijax.rig import acting, bundled_rigs, get_parameter, set_parameter

PAGE = (Path(__file__).parents[1] / "docs" / "add_a_law.md").read_text(encoding="utf-8")
(LAW,), (EFFECT,) = (re.findall(rf"```{x}\n(.*?)```", PAGE, re.S) for x in ("python", "toml"))
FILE, NAME = "my_law.py", "effect.mount-quadratic-damper.w1.d"


def test_the_blocks_of_the_page_run_in_its_order(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMNIJAX_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("OMNIJAX_TRUSTED_LAWS", "")
    monkeypatch.setattr("omnijax.rig._user_laws._LOADED", {})
    for name in (FILE, NAME):
        assert f"`{name}`" in PAGE
    Path(FILE).write_text(LAW)
    atlas = bundled_rigs()["atlas"].read_text(encoding="utf-8")
    Path("rig.toml").write_text(atlas + EFFECT, encoding="utf-8")
    assert run(["check", "rig.toml"]) == 0
    assert f"a law in {FILE}, whose declaration is" in capsys.readouterr().out
    short = ["simulate", "rig.toml", "--speed", "1,1.2,0.3", "--duration", "0.1"]
    assert run(short) == 2 and "--trust-laws" in capsys.readouterr().err
    (law,) = omnijax.load_laws(FILE).values()
    rig = omnijax.load_rig("rig.toml")
    assert float(get_parameter(rig, NAME)) == 4e5
    rig = set_parameter(rig, NAME, 3.0)
    alike = omnijax.load_rig("atlas").add(law(jnp.asarray(3.0)), "w1")
    rate = np.array([-0.5, 0.2, 0.3])
    for one in (rig, alike):
        signals = mount_signals(one, np.array([1e-3, 2e-3, 3e-3]), jnp.asarray(rate))
        added, _ = mount_tensions(acting(one.at("mount"), 3), signals, (None,))
        np.testing.assert_allclose(added, [-3 * 0.5**2, 0, 0], rtol=1e-12)


def test_the_table_of_ports_is_that_of_the_library():
    rows = re.findall(r"^\| `(Abstract\w+)` \| (.*?) \| ", PAGE, re.M)
    named = {getattr(laws, name).port for name, _ in rows}
    assert named == set(laws.PORTS) and len(rows) == len(laws.PORTS)
    signals = [re.match(r"`(\w+Signal)`: (.*)", given) for _, given in rows]
    assert len([s for s in signals if s]) >= 6
    for signal in filter(None, signals):
        fields = re.findall(r"`(\w+)`", signal[2])
        assert tuple(fields) == getattr(laws, signal[1])._fields, signal[1]
    for name in re.findall(r"`([A-Z]\w+)`", PAGE):
        assert hasattr(laws, name) or name in LAW or name in ("CASE",), name


def test_what_the_page_says_of_a_parameter_are_words_of_it():
    words = [
        w for w in inspect.signature(laws.Parameter).parameters if re.search(f"`{w}[`=]", PAGE)
    ]
    assert words == ["low", "high", "linear"] and hasattr(laws, "ANY_LENGTH")
