"""Transient at constant speeds, from rest, 2 s, 1000 samples: RMS and peak of |dR|."""

import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from . import _c
from . import _problem as problem
from ._clock import Tool

BATCH, PLAIN = 2048, 64
SUBSTEPS = {120.0: 2, 8500.0: 27, 20000.0: 67}  # of C RK4: accuracy, then stability
LADDER = {  # loosest decades that reach 1e-4
    "RK45": {120.0: 1e-3},
    "LSODA": {120.0: 1e-5, 8500.0: 1e-4, 20000.0: 1e-4},
    "Radau": {120.0: 1e-3, 8500.0: 1e-3, 20000.0: 1e-3},
}


def tools(damping: float, skip) -> list[Tool]:
    """Everything that is installed."""
    rows = problem.designs(BATCH, damping)
    some = rows[:: BATCH // PLAIN].copy()
    expected, few = problem.reference(rows[::64]), problem.reference(some)
    found: list[Tool] = []
    library = _c.compiled("elastic")
    if library is None:
        skip("C (no compiler)")
    else:
        run = functools.partial(_c.elastic, library, "exact", rows, problem.SAMPLES, problem.STEP)
        found.append(
            Tool("c-exact", run, BATCH, lambda o: problem.error(o[::64], expected), 7, "SIMD")
        )
        n = SUBSTEPS[damping]
        run = functools.partial(
            _c.elastic, library, "runge_kutta", some, problem.SAMPLES, problem.STEP, n
        )
        note = f"scalar, step {1e6 * problem.STEP / n:.0f} us"
        found.append(Tool("c-rk4", run, PLAIN, lambda o: problem.error(o, few), 5, note))
    found += [*_ours(rows, some, expected, few), _plain_diffrax(damping, some, few)]
    for make in (_numba, _casadi, _scipy, _octave):
        found += make(damping, some, few, skip)
    return found


def _ours(rows, some, expected, few) -> list[Tool]:
    import diffrax as dfx
    import jax
    import jax.numpy as jnp

    from omnijax.simulation import simulate, speeds

    from . import _omnijax as ours

    found = []
    try:
        from omnijax.simulation._bulk.rig import bulk_figures, plan_bulk
    except ImportError:
        pass
    else:
        drive = jnp.asarray(problem.SPEEDS)

        def make(row):
            return ours.rig(row), drive, jnp.zeros(3)

        plan = plan_bulk(make, rows, problem.DURATION, problem.STEP, "paper")
        values = jnp.asarray(rows)

        def bulk():
            return np.stack([np.asarray(x) for x in bulk_figures(make, values, plan)], -1)

        name = "omnijax"
        note = "exact, float64"
        found.append(
            Tool(name, bulk, len(rows), lambda o: problem.error(o[::64], expected), 7, note)
        )
    ts = problem.STEP * jnp.arange(problem.SAMPLES + 1)

    @jax.jit
    def adaptive(rows):
        def one(row):
            run = simulate(
                ours.rig(row), speeds(problem.SPEEDS), ts, model="paper", solver="exponential",
                rtol=1e-5, adjoint=dfx.ForwardMode(),
            )  # fmt: skip
            return ours.figures(run.dR[1:])

        return jax.vmap(one)(rows)

    batch = jnp.asarray(some[::8])
    note = "diffrax, adaptive, every sample a step, whole model"
    found.append(
        Tool(
            "omnijax simulate",
            lambda: np.asarray(adaptive(batch)),
            len(batch),
            lambda o: problem.error(o, few[::8]),
            3,
            note,
        )
    )
    return found


def _plain_diffrax(damping, some, few) -> Tool:
    """vmap of an adaptive solve, as the manual has it."""
    import diffrax as dfx
    import jax
    import jax.numpy as jnp

    speeds = jnp.asarray(problem.SPEEDS)
    solver, rtol = (dfx.Tsit5(), 1e-4) if damping < 1000 else (dfx.Kvaerno5(), 1e-5)

    def field(t, y, d):
        eta, K, k, C = d
        width = 2 * jnp.pi * eta / problem.N
        q = problem.RB / problem.R * jnp.sin(width / 2)
        depth = problem.R * q * q / (1 + jnp.sqrt(1 - q * q))
        depth = depth + 2 * problem.RB * jnp.sin(width / 4) ** 2
        into = jnp.mod(speeds * t, 2 * jnp.pi / problem.N)
        rho = jnp.where(into < width, -depth * jnp.sin(2 * jnp.pi * into / width), 0.0)
        x, D, p, pi = y
        v, w = (p + C * rho) / problem.M, (pi - C * rho) / problem.MW
        tension = K * (x - D - rho) + C * (v - w)
        return jnp.stack([v, w, -tension - problem.KP * x, tension - problem.CM * w - k * D])

    def one(row):
        solution = dfx.diffeqsolve(
            dfx.ODETerm(field), solver, 0.0, problem.DURATION, 1e-4, jnp.zeros((4, 3)), row,
            saveat=dfx.SaveAt(ts=jnp.asarray(problem.TIMES)), max_steps=200_000, throw=False,
            stepsize_controller=dfx.PIDController(rtol=rtol, atol=rtol * 1e-5),
        )  # fmt: skip
        square = jnp.sum(solution.ys[:, 0] ** 2, axis=-1)
        return jnp.stack([jnp.sqrt(square.mean()), jnp.sqrt(square.max())])

    run, batch = jax.jit(jax.vmap(one)), jnp.asarray(some)
    note = f"vmap, {type(solver).__name__}, rtol {rtol:g}"
    return Tool(
        "diffrax",
        lambda: np.asarray(run(batch)),
        len(some),
        lambda o: problem.error(o, few),
        1,
        note,
    )


def _numba(damping, some, few, skip):
    try:
        import numba
    except ImportError:
        skip("numba (not installed)")
        return []
    M, MW, KP, CM = problem.M, problem.MW, problem.KP, problem.CM
    speeds, samples, n, pitch = (
        problem.SPEEDS,
        problem.SAMPLES,
        SUBSTEPS[damping],
        2 * np.pi / problem.N,
    )
    h = problem.STEP / n

    @numba.njit(fastmath=True)
    def run(rows, gaps):
        out = np.zeros((len(rows), 2))
        for b in range(len(rows)):
            K, k, C = rows[b, 1], rows[b, 2], rows[b, 3]
            width, depth = gaps[b]
            y, z, total, top = np.zeros((3, 4)), np.zeros(4), 0.0, 0.0
            slope, rho = np.zeros((4, 4)), np.zeros(3)
            for j in range(samples):
                for s in range(n):
                    for i in range(3):
                        for m in range(3):
                            angle = speeds[i] * ((j * n + s) * h + 0.5 * m * h)
                            into = angle - pitch * np.floor(angle / pitch)
                            wave = -depth * np.sin(2 * np.pi / width * into)
                            rho[m] = wave if into < width else 0.0
                        for stage in range(4):
                            r = rho[(stage + 1) // 2]
                            part = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                            for a in range(4):
                                z[a] = y[i, a] + part * h * slope[stage - 1, a]
                            v, w = (z[2] + C * r) / M, (z[3] - C * r) / MW
                            tension = K * (z[0] - z[1] - r) + C * (v - w)
                            slope[stage, 0], slope[stage, 1] = v, w
                            slope[stage, 2] = -tension - KP * z[0]
                            slope[stage, 3] = tension - CM * w - k * z[1]
                        for a in range(4):
                            rise = slope[0, a] + 2 * slope[1, a] + 2 * slope[2, a] + slope[3, a]
                            y[i, a] += h / 6 * rise
                q = y[0, 0] ** 2 + y[1, 0] ** 2 + y[2, 0] ** 2
                total += q
                top = max(top, q)
            out[b] = np.sqrt(total / samples), np.sqrt(top)
        return out

    gaps = np.array([problem.gap(eta) for eta in some[:, 0]])
    return [
        Tool("numba", lambda: run(some, gaps), len(some), lambda o: problem.error(o, few), 3, "RK4")
    ]


def _casadi(damping, some, few, skip):
    try:
        import casadi as ca
    except ImportError:
        skip("CasADi (not installed)")
        return []
    y, p, t = ca.SX.sym("y", 12), ca.SX.sym("p", 6), ca.SX.sym("t")  # p: eta, K, k, C, width, depth
    K, k, C, width, depth = (p[i] for i in range(1, 6))
    rates = []
    for i, speed in enumerate(problem.SPEEDS):
        pitch = 2 * np.pi / problem.N
        into = speed * t - pitch * ca.floor(speed * t / pitch)
        rho = ca.if_else(into < width, -depth * ca.sin(2 * np.pi * into / width), 0)
        x, D, m, pi = (y[4 * i + j] for j in range(4))
        v, w = (m + C * rho) / problem.M, (pi - C * rho) / problem.MW
        tension = K * (x - D - rho) + C * (v - w)
        rates += [v, w, -tension - problem.KP * x, tension - problem.CM * w - k * D]
    rtol = 1e-5 if damping < 1000 else 1e-4
    options = {"reltol": rtol, "abstol": rtol * 1e-6, "max_num_steps": 1_000_000}
    ode = {"x": y, "p": p, "t": t, "ode": ca.vertcat(*rates)}
    solver = ca.integrator("transient", "cvodes", ode, 0.0, list(problem.TIMES), options)
    row = some[24]

    def run():
        found = solver(x0=np.zeros(12), p=[*row, *problem.gap(row[0])])["xf"]
        return problem.figures(np.asarray(found)[0::4])

    note = f"CVODES, rtol {rtol:g}, one design"
    return [Tool("casadi", run, 1, lambda o: problem.error(o, few[24]), 3, note)]


def _scipy(damping, some, few, skip):
    from scipy.integrate import solve_ivp

    row = some[24]
    eta, K, k, C = row

    def field(t, y):
        x, D, p, pi = y.reshape(4, 3)
        rho = problem.shape(problem.SPEEDS * t, eta)
        v, w = (p + C * rho) / problem.M, (pi - C * rho) / problem.MW
        tension = K * (x - D - rho) + C * (v - w)
        rate = [v, w, -tension - problem.KP * x, tension - problem.CM * w - k * D]
        return np.concatenate(rate)

    def run(method, rtol):
        s = solve_ivp(
            field,
            (0, problem.DURATION),
            np.zeros(12),
            method,
            problem.TIMES,
            rtol=rtol,
            atol=rtol * 1e-5,
        )
        return problem.figures(s.y[:3])

    return [
        Tool(
            f"scipy {method}",
            functools.partial(run, method, by[damping]),
            1,
            lambda o: problem.error(o, few[24]),
            1,
            f"solve_ivp, rtol {by[damping]:g}, one design",
        )
        for method, by in LADDER.items()
        if damping in by
    ]


_OCTAVE = """
d = [{row}]; width = {width!r}; depth = {depth!r}; w = [0.1; 1.2; 0.3]; pitch = 2*pi/14;
function out = field(t, y, d, width, depth, w, pitch)
  y = reshape(y, 3, 4); into = mod(w*t, pitch);
  rho = -depth*sin(2*pi*into/width).*(into < width);
  v = (y(:,3) + d(4)*rho)/5; u = (y(:,4) - d(4)*rho)/0.25;
  tension = d(2)*(y(:,1) - y(:,2) - rho) + d(4)*(v - u);
  out = [v; u; -tension - 1e4*y(:,1); tension - 50*u - d(3)*y(:,2)];
end
o = odeset("RelTol", 1e-3, "AbsTol", 1e-8);
[t, y] = ode45(@(t, y) field(t, y, d, width, depth, w, pitch), (0:1000)*2e-3, zeros(12, 1), o);
n = sum(y(2:end, 1:3).^2, 2); printf("%.15g %.15g\\n", sqrt(mean(n)), sqrt(max(n)));
"""


def _octave(damping, some, few, skip):
    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is None or damping > 1000:
        skip("Octave ode45 " + ("(stiff: hours)" if octave else "(not installed)"))
        return []
    width, depth = (float(x) for x in problem.gap(some[24, 0]))
    text = _OCTAVE.format(row=", ".join(map(repr, map(float, some[24]))), width=width, depth=depth)
    script = Path(tempfile.mkdtemp(prefix="omnijax-bench-")) / "transient.m"
    script.write_text("1;\n" + text)

    def run():
        command = [octave, "--no-gui", "--norc", str(script)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return np.array(done.stdout.split(), float)

    note = "ode45, RelTol 1e-3, with its start, one design"
    return [Tool("octave", run, 1, lambda o: problem.error(o, few[24]), 1, note)]
