"""The page of a run's signals: its figure can be read."""

import itertools

import numpy as np

from omnijax.report import Provenance, signals_page


def test_no_label_of_an_ordinate_touches_the_next():
    time = np.linspace(0, 1, 50)
    curve = {"": (time, np.sin(time))}
    words = ["position", "measured less simulated", "commanded torque of the motor", "speed"]
    page = signals_page("run", [(word, "rad/s^2", curve) for word in words], Provenance("x"))
    figure = page.sections[0].figures[0].fig
    figure.canvas.draw()
    boxes = [ax.yaxis.label.get_window_extent() for ax in figure.axes]
    assert all(low.y1 < high.y0 for high, low in itertools.pairwise(boxes))
