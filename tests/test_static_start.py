"""Where a run starts: in balance, or nowhere."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

import omnijax
from omnijax.laws import AbstractMount, Parameter
from omnijax.simulation import build_model
from omnijax.simulation._solve.static_start import static_start


class MountJump(AbstractMount):
    """A tension that jumps: no deflection balances loads within the jump."""

    force: Float[Array, ""]

    id: ClassVar[str] = "mount-jump"
    places: ClassVar[tuple[str, ...]] = ("wheel", "all")
    formula: ClassVar[str] = "mount tension += F where Δ > -1e-5 m"
    parameters: ClassVar[dict[str, Parameter]] = {"force": Parameter("N")}

    def __call__(self, signal, state=None):
        return jnp.where(signal.deflection > -1e-5, self.force, 0.0)


@pytest.mark.parametrize(("force", "balances"), [(5.0, True), (50.0, False)])
def test_a_law_that_balances_nowhere_starts_no_run(force, balances):
    rig = omnijax.load_rig("atlas").add(MountJump(jnp.asarray(force)), "all")
    still = jnp.array([1.0, 0.0, 0.0, 0.0])
    start, _ = static_start(build_model(rig, "coupled"), jnp.array([0.3, 0.2, 0.1]), still)
    numbers = np.concatenate(jax.tree.leaves(start))
    assert np.all(np.isfinite(numbers) if balances else np.isnan(start.approach))
