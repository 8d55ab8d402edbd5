"""Phases of unlike kinds side by side in one program, against kind by kind."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import machine
from seeds import drawn_anew
from test_modal import cone, hidden, maker, mixed, points_of

from omnijax.simulation._modal._long_run.moments import moments_of, rates_of
from omnijax.simulation._modal._long_run.phases import cycle_of, phases_of, response, spot_on, wide
from omnijax.simulation._modal._poles.poles import PolePairs
from omnijax.simulation._modal.system import How, designs_of

pytestmark = pytest.mark.long

LANES = 4
POLES = np.array([[-30.0, -2.0, -500.0], [400.0, 90.0, -40.0]])  # two complex pairs, a real one


def pairs(rng) -> PolePairs:
    """Poles alone, a little apart from design to design."""
    l0, l1 = (jnp.asarray(x[:, None] * rng.uniform(0.9, 1.1, (3, LANES))) for x in POLES)
    kind = jnp.broadcast_to(jnp.array([1.0, 1.0, 0.0])[:, None], (3, LANES))
    none = jnp.zeros((0, 3, LANES))
    return PolePairs(kind, l0, l1, none, none, none, none)


@pytest.mark.full  # in the gate the figures that they give: test_modal
@pytest.mark.parametrize("kind", [hidden, mixed])
def test_phases_side_by_side_are_those_kind_by_kind(kind):
    """Means over the periods and responses at drawn times, a wheel at rest among the designs."""
    rng = drawn_anew("wheels, operating points, poles and times")
    rig = kind(machine(cone(rng, 4 if kind is mixed else 3)))
    rows = points_of(rig, rng, count=LANES)
    design, layout = designs_of(
        jax.vmap(maker(rig))(jnp.asarray(rows)), How("coupled", force=True, series=6)
    )
    signals = jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), design.signals)
    m, share = wide(pairs(rng)), rng.uniform(size=(rig.size + 1, LANES))

    def of_each(layout):
        """What every phase gives, by the number of its first signal."""
        known = {}
        for phases in phases_of(layout):
            cycle = cycle_of(signals, layout, phases)
            columns = np.array([layout.kinds[i].column for i in phases.first(layout)])
            time = share[columns] * cycle.period
            now = response(m, cycle, spot_on(cycle, time, time))
            rates = moments_of(m, rates_of(cycle, columns[:, None] < rig.size))
            given = moments_of(m, cycle), rates, now, cycle.period
            for s, number in enumerate(phases.first(layout)):
                known[number] = jax.tree.map(lambda x, s=s: x[..., s, :], given)
        return known

    merged = layout._replace(short=True)
    assert len(phases_of(merged)) == 2 < len(phases_of(layout))
    several, one = (jax.jit(lambda x=x: of_each(x))() for x in (layout, merged))
    assert one.keys() == several.keys()
    for number, known in several.items():
        jax.tree.map(
            lambda x, y: np.testing.assert_allclose(x, y, rtol=0, atol=1e-11 * np.abs(y).max()),
            one[number],
            known,
        )
