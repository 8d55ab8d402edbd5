"""A term on one port: weights of a smooth basis, and a small network that may join it."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from ..._settings import SETTINGS
from .term_port import AbstractPort

HIDDEN = SETTINGS.answer_learned.hidden


@dataclasses.dataclass(frozen=True)
class Term:
    """Weights of the smooth basis, and a network beside it (or None): forces from scaled inputs."""

    port: AbstractPort
    scales: np.ndarray
    weights: np.ndarray
    network: eqx.nn.MLP | None = None
    size: float = 1.0  # of the network's output

    def force(self, u: np.ndarray) -> np.ndarray:
        """Outputs (t, parts) at scaled inputs (t, k)."""
        out = np.zeros((len(u), len(self.port.parts)))
        for (i, _, x), w in zip(self.port.columns(u), self.weights, strict=True):
            out[:, i] += w * x
        if self.network is not None:
            out += self.size * np.asarray(_network(self.network, u))
        return out

    def tangents(self, u: np.ndarray) -> list[np.ndarray]:
        """Outputs (t, parts) per unit of every weight."""
        out = []
        for i, _, x in self.port.columns(u):
            out.append(np.zeros((len(u), len(self.port.parts))))
            out[-1][:, i] = x
        if self.network is not None:
            J = np.array(
                np.moveaxis(np.asarray(_network_tangents(self.network, u)), 2, 0), order="C"
            )
            J *= self.size
            out += list(J)
        return out

    def moved(self, step: np.ndarray) -> "Term":
        """The term with its weights changed."""
        k = len(self.weights)
        network = self.network
        if network is not None:
            arrays, rest = eqx.partition(network, eqx.is_array)
            flat, unravel = ravel_pytree(arrays)
            network = eqx.combine(unravel(flat + jnp.asarray(step[k:])), rest)
        return dataclasses.replace(self, weights=self.weights + step[:k], network=network)


@eqx.filter_jit
def _network(network, u):
    return jax.vmap(network)(jnp.asarray(u))


@eqx.filter_jit
def _network_tangents(network, u):
    arrays, rest = eqx.partition(network, eqx.is_array)
    flat, unravel = ravel_pytree(arrays)
    return jax.vmap(jax.jacrev(lambda p, x: eqx.combine(unravel(p), rest)(x)), (None, 0))(
        flat, jnp.asarray(u)
    )


def with_network(term: Term, inputs: np.ndarray) -> Term:
    """The term with a small network beside it that puts out nothing yet."""
    network = eqx.nn.MLP(
        inputs.shape[1], len(term.port.parts), HIDDEN, 1, jnp.tanh, key=jax.random.key(0)
    )
    network = eqx.tree_at(lambda n: n.layers[-1].weight, network, replace_fn=lambda w: 0 * w)
    network = eqx.tree_at(lambda n: n.layers[-1].bias, network, replace_fn=lambda b: 0 * b)
    size = float(np.sqrt(np.mean(term.force(inputs) ** 2))) or 1.0
    return dataclasses.replace(term, network=network, size=size)
