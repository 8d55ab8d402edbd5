"""The report page: offline, safe against hostile names, numbers beside every figure."""

import base64
import hashlib
import re
from html.parser import HTMLParser

import matplotlib as mpl
import numpy as np
import pytest
from tiers import more

from omnijax.report import (
    COLOURS,
    Badge,
    Column,
    Fact,
    Figure,
    Page,
    Section,
    SpeedAxis,
    Table,
    figure,
    file_name,
    provenance,
    shown,
    style,
)

HOSTILE = '<script>alert("x")</script>"onload="alert(1)'


class Reader(HTMLParser):
    """Tags, attributes and the text of scripts of a page."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.scripts, self.inside = [], [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self.inside = tag == "script"

    def handle_endtag(self, tag):
        self.inside = False

    def handle_data(self, data):
        if self.inside:
            self.scripts.append(data)

    def values(self, attribute):
        return [attrs[attribute] for _, attrs in self.tags if attribute in attrs]


def drawn(label="amplitude / µm", axis=None, name="fig01"):
    omega = np.linspace(1.0, 60.0, 50)
    with style():
        fig, (top, bottom) = figure(2)
        top.plot(omega, np.sin(omega), label=label)
        top.legend()
        bottom.semilogy(omega, 1 / omega**3)
        bottom.set_ylabel(label)
    return Figure(fig, name, "What it shows.", {"omega / rad/s": omega, label: omega**2}, axis)


def page(label="amplitude / µm", axis=None):
    table = Table(
        [Column(label, text=True), Column("value", "µm"), Column("verdict", text=True)],
        [[label, -1.25e-7, Badge("holds", "good")], ["=1+1", 3, Badge("does not hold", "bad")]],
        name="claims",
        stacked=True,
    )
    sections = [Section("One", f"`{label}`", [drawn(label, axis)], [table]), Section("Two")]
    made = provenance(f"omnijax reproduce --out {label}", rig=f'name = "{label}"', seed=7)
    return Page(label, label, label, sections, made, [Fact(label, 2.5, "m")])


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    text = page(HOSTILE, SpeedAxis(HOSTILE, "Hz", 1.2)).write(folder).read_text("utf-8")
    return folder, text, Reader(text)


def test_hostile_name_stays_text(hostile):
    _, text, reader = hostile
    assert sum(tag == "script" for tag, _ in reader.tags) == 1
    assert "alert" not in "".join(reader.scripts)
    assert not [a for _, attrs in reader.tags for a in attrs if a.startswith("on")]
    assert "&lt;script&gt;alert" in text
    assert text.count("&lt;script&gt;") > 8


def test_script_runs_only_as_shipped(hostile):
    reader = hostile[2]
    digest = base64.b64encode(hashlib.sha256("".join(reader.scripts).encode()).digest()).decode()
    policy = next(a["content"] for t, a in reader.tags if a.get("http-equiv"))
    assert "default-src 'none'" in policy
    assert f"script-src 'sha256-{digest}'" in policy


def test_no_request_to_another_host(hostile):
    _, text, reader = hostile
    links = reader.values("href") + reader.values("src") + reader.values("xlink:href")
    assert links
    assert all(link.startswith(("#", "data:")) for link in links)
    assert not re.search(r"@import|url\((?!#)", text)
    addresses = set(re.findall(r"https?://[^\s\"'<>]+", text))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}


def test_ids_are_unique_and_references_meet_them(hostile):
    _, text, reader = hostile
    ids = reader.values("id")
    assert len(ids) == len(set(ids))
    wanted = set(re.findall(r"url\(#([^)]+)\)", text)) | {
        link[1:] for link in reader.values("xlink:href") if link.startswith("#")
    }
    assert wanted and wanted <= set(ids)


def test_axis_is_offered_in_four_units(hostile):
    reader = hostile[2]
    shown_units = [a["data-unit"] for t, a in reader.tags if t == "div" and "data-unit" in a]
    assert shown_units == ["rpm", "rad/s", "Hz", "orders"]
    hidden = [a["data-unit"] for t, a in reader.tags if "data-unit" in a and "hidden" in a]
    assert hidden == ["rpm", "rad/s", "orders"]


@pytest.mark.parametrize(
    ("unit", "last"), [("rpm", 600), ("orders", 50), *more(("rad/s", 60), ("Hz", 10))]
)
def test_ticks_are_round_in_the_chosen_unit(unit, last):
    from omnijax.report._svg import rendered

    axis = SpeedAxis("frequency", reference=1.2)
    by_unit = {d.unit: d.wide for d in rendered(drawn(axis=axis).fig, "f", axis).drawings}
    ticks = {
        float(t.replace("−", "-"))
        for t in re.findall(r">(−?[\d.]+)</text>", by_unit[unit].split("axes_2")[1])
    }
    assert last in ticks
    assert ("frequency<" if unit == "orders" else f"frequency ({unit})<") in by_unit[unit]


def test_files_lie_beside_and_inside(tmp_path):
    page().write(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"index.html", "fig01.png", "fig01.csv", "claims.csv"}
    assert (tmp_path / "fig01.png").read_bytes().startswith(b"\x89PNG")
    rows = (tmp_path / "fig01.csv").read_text("utf-8").splitlines()
    assert rows[0] == "omega / rad/s,amplitude / µm"
    assert len(rows) == 51
    table = (tmp_path / "claims.csv").read_text("utf-8").splitlines()
    assert table[1].endswith("-1.25e-07,holds")
    assert table[2].startswith("'=1+1")  # never a spreadsheet's formula


def test_style_leaves_the_process_alone(tmp_path):
    before = dict(mpl.rcParams)
    page().write(tmp_path)
    assert dict(mpl.rcParams) == before
    with style():
        assert mpl.rcParams["svg.fonttype"] == "none"
        assert mpl.rcParams["axes.prop_cycle"].by_key()["color"] == list(COLOURS)


def test_text_of_figures_is_text():
    from omnijax.report._svg import rendered

    (drawing,) = rendered(drawn("cost in $US$ per m²").fig, "f").drawings
    assert "cost in $US$ per m²" in drawing.wide
    assert "10⁻⁴" in drawing.wide  # a logarithmic axis without TeX


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.23456e-7, "1.235 × 10^−7"),
        (1.5e12, "1.5 × 10^12"),
        (-2.5, "−2.5"),
        (True, "yes"),
        (14, "14"),
        (None, "–"),
        (float("nan"), "nan"),
        ([0.1, 1.2], "0.1, 1.2"),
        ("name", "name"),
    ],
)
def test_numbers_read_well(value, text):
    assert shown(value) == text


def test_names_cannot_leave_the_folder():
    assert file_name("../../etc/pass wd<>") == "etc-pass-wd"
    assert file_name("//") == "unnamed"
