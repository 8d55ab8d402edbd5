"""Whether a named law has the right shape: asked of all smooth functions of what it acts on.

A law that stands for another one explains most of what that does, and leaves a function of the same
input: a sensor that bends its readings is nearly one with a limit, a drag nearly a viscous one.
"""

import numpy as np

from ..._machine import Linearisation, RigModel
from ..._search import (
    Fit,
    HeldOut,
    beside_taken,
    chance,
    taken_up,
    tangent_rows,
    to_project,
)
from ..._settings import SETTINGS
from ..evidence import Misshapen
from .learned import ports_of
from .term_fit import FOLLOWED_TO, RIDGE, pushed, worthwhile
from .term_port import AbstractPort

CHANCE = SETTINGS.steadiness.chance
READING_TOLERANCE = SETTINGS.verdict.reading_tolerance


def misshapen(model: RigModel, fit: Fit, alike: float) -> list[Misshapen]:
    """The effects of a fit beside which more than the share `alike` is left, the most first.

    Less of a sensor's law is left: what it reads is known as well as the machine's motion.
    Asked of smooth functions of the input of each, beside all numbers: of the fitted runs, whose
    gain is no chance, and confirmed by the held-out ones.
    """
    ports = {port.port: port for port in ports_of(model)}
    asked = [
        (i, ports[port]) for i, e in enumerate(fit.point.effects)
        if (port := model.laws[e.id].port) in ports and ports[port].own_functions(0)
    ]  # fmt: skip
    if not asked:
        return []
    bases = {split: model.bases(fit.point, split) for split in ("train", "held-out")}
    (held,) = model.residuals([fit.point], "held-out")
    there = tangent_rows(model, fit.point, fit.free, held, split="held-out")
    out = []
    for i, port in asked:
        effect = fit.point.effects[i]
        (without,) = model.residuals([fit.point.without(i)], "train")
        size = float(np.linalg.norm(without - fit.residual))
        labels, columns = _own_functions(model, port, effect.place, bases)
        if labels and 0 < size < np.inf:
            left, label = _left(model, fit, columns, held, there)
            least = min(alike, READING_TOLERANCE) if port.port == "sensor" else alike
            if left > least * size:
                out.append(Misshapen(effect.name, labels[label], left / size))
    return sorted(out, key=lambda x: -x.share)


def _own_functions(
    model: RigModel, port: AbstractPort, place: str, bases: dict[str, list[Linearisation]]
) -> tuple[list[str], dict[str, np.ndarray]]:
    """Functions of the inputs at a place: their names, and by split their changes (rows, k)."""
    parts = [
        i for i, name in enumerate(port.parts)
        if place in ("all", "sphere", name, name.partition("_")[0])
    ]  # fmt: skip
    inputs = {split: [port.inputs(base) for base in some] for split, some in bases.items()}
    scales = port.scales(np.concatenate(inputs["train"]))
    labels: list[str] = []
    out: dict[str, np.ndarray] = {}
    for split, some in bases.items():
        tables = []
        for base, raw in zip(some, inputs[split], strict=True):
            u = np.clip(raw / scales, -FOLLOWED_TO, FOLLOWED_TO)
            own = [x for x in port.columns(u) if x[0] in parts and x[1] in port.own_functions(x[0])]
            own += [
                (i, label, values) for i in parts for label, values in port.own_bends(i, u).items()
            ]
            outputs = [values[:, None] * (np.arange(len(port.parts)) == i) for i, _, values in own]
            table = np.empty((len(own), model.machine.rows[base.index].size))
            pushed(model, port, base, outputs, table)
            tables.append(table.T)
            labels = [f"{label} of {port.parts[i]}" for i, label, _ in own]
        out[split] = np.concatenate(tables)
    return labels, out


def _left(
    model: RigModel, fit: Fit, columns: dict[str, np.ndarray], held: np.ndarray, there: np.ndarray
) -> tuple[float, int]:
    """What `columns` explain of a fit's residual beside its numbers, and which of them the most.

    As the length of the change of the fitted rows: 0 where it may be chance, or where the held-out
    rows `held` with the tangents `there` do not confirm it.
    """
    J, u = to_project(model, fit.jacobian, fit.point.u)
    taken, C = taken_up(J, len(u)), columns["train"]
    scale = np.linalg.norm(C, axis=0)
    C, known = C / np.where(scale > 0, scale, 1.0), taken[: len(C)]
    beside = np.concatenate([C, np.zeros((len(taken) - len(C), C.shape[1]))])
    beside = beside - taken @ (known.T @ C)
    left = beside_taken(fit.residual, taken, u)
    spread = max(1.0, float(left @ left) / model.dof("train"))
    gram, right = beside.T @ beside, C.T @ left
    price = float(np.log(len(left))) * spread
    ridge = RIDGE["basis"] * np.eye(len(gram))
    use = np.flatnonzero(worthwhile(gram + ridge, right, np.zeros(len(right), bool), price))
    if not use.size:
        return 0.0, 0
    inner = np.ix_(use, use)
    sizes = np.linalg.solve((gram + ridge)[inner], right[use])
    gain = float(sizes @ right[use])
    if chance(gain / spread, len(use)) * len(right) ** len(use) > CHANCE:
        return 0.0, 0
    tall = np.concatenate([J, np.eye(len(u), J.shape[1])])
    tall_scale = np.maximum(np.linalg.norm(tall, axis=0), 1e-300)
    done = np.concatenate([C[:, use] @ sizes, np.zeros(len(u))])
    shift = np.linalg.lstsq(tall / tall_scale, done, rcond=None)[0] / tall_scale
    scaled = columns["held-out"] / np.where(scale > 0, scale, 1.0)
    after = held - scaled[:, use] @ sizes + to_project(model, there, fit.point.u)[0] @ shift
    if not HeldOut.of(held, after).confirms(gain, model.settings):
        return 0.0, 0
    most = int(np.argmax(np.abs(sizes) * np.sqrt(np.diag(gram)[use])))
    return float(np.linalg.norm(beside[:, use] @ sizes)), int(use[most])
