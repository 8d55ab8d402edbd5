"""Loops and choices over arrays whose last axis is the batch."""

from collections.abc import Sequence

from jax import lax
from jax.extend.core import ClosedJaxpr, Literal

from .._one_kernel import one_kernel
from .values import Call, Rule, Value


def _reached(closed: ClosedJaxpr, batched: Sequence[bool]) -> list[bool]:
    """Which outputs a batch reaches, at most."""
    jaxpr = closed.jaxpr
    touched = {v for v, b in zip(jaxpr.invars, batched, strict=True) if b}
    for equation in jaxpr.eqns:
        if any(not isinstance(a, Literal) and a in touched for a in equation.invars):
            touched.update(equation.outvars)
    return [not isinstance(a, Literal) and a in touched for a in jaxpr.outvars]


def _carried(closed: ClosedJaxpr, before: list[bool], carry: list[bool], after: list[bool]):
    """Which carried values a loop's body makes ones of the batch."""
    while True:
        out = _reached(closed, [*before, *carry, *after])[: len(carry)]
        more = [a or b for a, b in zip(carry, out, strict=True)]
        if more == carry:
            return carry
        carry = more


def _as(values: Sequence[Value], batched: Sequence[bool], size: int) -> list:
    return [v.as_batched(b, size) for v, b in zip(values, batched, strict=True)]


def _values(arrays: Sequence, batched: Sequence[bool]) -> list[Value]:
    return [Value(x, b) for x, b in zip(arrays, batched, strict=True)]


def _flags(values: Sequence[Value]) -> list[bool]:
    return [value.batched for value in values]


def _scan(call: Call) -> list[Value]:
    params, body, size = call.params, call.params["jaxpr"], call.size
    first, last = params["num_consts"], params["num_consts"] + params["num_carry"]
    fixed, begun, rows = call.inputs[:first], call.inputs[first:last], call.inputs[last:]
    carry = _carried(body, _flags(fixed), _flags(begun), _flags(rows))
    results = _reached(body, [*_flags(fixed), *carry, *_flags(rows)])[len(carry) :]

    def step(state, row):
        given = [*fixed, *_values(state, carry), *_values(row, _flags(rows))]
        outputs = call.evaluated(body, given, size)
        return _as(outputs[: len(carry)], carry, size), _as(outputs[len(carry) :], results, size)

    def along(begun, rows):
        return lax.scan(
            step, begun, rows, params["length"], params["reverse"], params["unroll"]
        )  # fmt: skip

    end, ys = one_kernel(along, _as(begun, carry, size), [v.array for v in rows])
    return [*_values(end, carry), *_values(ys, results)]


def _while(call: Call) -> list[Value] | None:
    params, size = call.params, call.size
    of_test, of_body = params["cond_nconsts"], params["cond_nconsts"] + params["body_nconsts"]
    test, body = params["cond_jaxpr"], params["body_jaxpr"]
    test_fixed, body_fixed = call.inputs[:of_test], call.inputs[of_test:of_body]
    begun = call.inputs[of_body:]
    carry = _carried(body, _flags(body_fixed), _flags(begun), [])
    if any(_reached(test, [*_flags(test_fixed), *carry])):
        return None  # designs end at different times

    def goes_on(state):
        return call.evaluated(test, [*test_fixed, *_values(state, carry)], size)[0].array

    def step(state):
        outputs = call.evaluated(body, [*body_fixed, *_values(state, carry)], size)
        return _as(outputs, carry, size)

    def looped(begun):
        return lax.while_loop(goes_on, step, begun)

    return _values(one_kernel(looped, _as(begun, carry, size)), carry)


def _cond(call: Call) -> list[Value] | None:
    index, *inputs = call.inputs
    if index.batched:
        return None
    branches = call.params["branches"]
    flags = [_reached(branch, _flags(inputs)) for branch in branches]
    batched = [any(column) for column in zip(*flags, strict=True)]

    def of(branch):
        def taken(*arrays):
            outputs = call.evaluated(branch, _values(arrays, _flags(inputs)), call.size)
            return _as(outputs, batched, call.size)

        return taken

    outputs = lax.switch(index.array, [of(b) for b in branches], *(v.array for v in inputs))
    return _values(outputs, batched)


def _called(call: Call) -> list[Value]:
    return call.evaluated(call.params["jaxpr"], call.inputs, call.size)


LOOPS: dict[str, Rule] = {"scan": _scan, "while": _while, "cond": _cond}
CALLS = {"jit": _called}
