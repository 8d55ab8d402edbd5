"""Where a run starts: static equilibrium on whatever the wheels show to the sphere."""

import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree

from ...dynamics import (
    Coupled,
    Model,
    PortInputs,
    free_projector,
    initial_memory,
    port_forces,
    position_input,
)

ROUNDING = 1e-9  # of the load: a last step of Newton's method may still wobble within its rounding


def static_start(model: Model, angle, attitude):
    """Elastic state and law memories at static equilibrium with the wheels at `angle` (rad).

    The linear model is solved exactly; laws at contacts and mounts by Newton's method from there.
    Where the wheels leave the sphere free to move it stays.  Laws that balance nowhere (a user's,
    with a jump) leave NaN, and the run that starts there ends as non-finite.
    """
    rig = model.rig
    shape = position_input(rig, angle, attitude)
    rest = model.translation.rest()
    memory = initial_memory(rig)
    start, unravel = ravel_pytree((rest.approach, rest.mount, memory))
    free = free_projector(rig)

    def imbalance(unknown, laws=True):
        approach, mount, memory = unravel(unknown)
        state = model.translation.still(approach, mount, shape)
        motion = model.translation.motion(state, shape)
        zero = PortInputs.zeros(rig.size)
        contact, tension, _, rates = port_forces(rig, motion, jnp.zeros(rig.size), memory)
        inputs = zero._replace(shape=shape)
        if laws:
            inputs = inputs._replace(contact=contact, mount=tension)
        rate = model.translation.rate(state, inputs)
        momentum = rate.momentum
        if isinstance(model.translation, Coupled):  # of no force along free directions
            momentum = momentum - rig.wheels.contact.stiffness[0] * free @ approach
        return ravel_pytree((momentum, rate.wheel_momentum, rates))[0]

    if not (rig.at("contact") or rig.at("mount") or rig.at("separation")):
        jacobian = jax.jacfwd(imbalance)(start)
        solution = start - jnp.linalg.solve(jacobian, imbalance(start))
    else:
        import optimistix as optx  # a fifth of a second that a linear rig need not spend

        solved = optx.root_find(
            lambda y, _: imbalance(y),
            optx.Newton(rtol=1e-10, atol=1e-13),
            start,
            throw=False,
            max_steps=50,
        )
        both = jax.vmap(imbalance)(jnp.stack([solved.value, start]))
        left, load = jnp.max(jnp.abs(both), axis=1)
        balanced = (solved.result == optx.RESULTS.successful) | (left <= ROUNDING * load)
        solution = jnp.where(balanced, solved.value, jnp.nan)
    approach, mount, memory = unravel(solution)
    return model.translation.still(approach, mount, shape), memory
