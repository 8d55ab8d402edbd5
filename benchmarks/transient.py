"""Transient at constant speeds, from rest, 2 s, 1000 samples: RMS and peak of |dR|."""

import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from . import _c
from . import _problem as problem
from ._clock import Tool, loosest

BATCH, PLAIN = 2048, 64
SUBSTEPS = (1, 2, 3, 4, 6, 8, 12, 16, 22, 27, 32, 40, 50, 58, 67, 80)  # a sample, of Runge-Kutta
DECADES = tuple(10.0**-k for k in range(2, 10))  # relative tolerances, loosest first
STIFF = 1000.0  # N s/m: explicit methods of general tools take hours above it


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
        run = functools.partial(
            _c.elastic, library, "runge_kutta", some, problem.SAMPLES, problem.STEP
        )
        note = "scalar, {} steps a sample"
        found.append(loosest("c-rk4", run, SUBSTEPS, PLAIN, by(few), rounds=5, note=note))
    found += [*_ours(rows, some, expected, few), _plain_diffrax(damping, some, few)]
    for make in (_numba, _casadi, _scipy, _octave):
        found += make(damping, some, few, skip)
    return found


def by(expected):
    """The error of figures against `expected`."""
    return functools.partial(problem.error, expected=expected)


def _ours(rows, some, expected, few) -> list[Tool]:
    import diffrax as dfx
    import jax
    import jax.numpy as jnp

    from omnijax.simulation import modal_figures, simulate, speeds

    from . import _omnijax as ours

    def bulk():
        return modal_figures(
            ours.design(0), rows, duration=problem.DURATION, step=problem.STEP, model="paper",
            total=problem.MANY,
        ).values  # fmt: skip

    def rms_error(values, expected):  # its samples count the start, where nothing moves
        count = problem.SAMPLES
        return problem.error(values[:, 0] * np.sqrt((count + 1) / count), expected[:, 0])

    def sweep_error(rows, figures):
        return rms_error(figures, problem.reference(rows))

    note = "exact, with refined peak, poles and statuses; error of the RMS"
    found = [
        Tool("omnijax", bulk, len(rows), lambda o: rms_error(o[::64], expected), 7, note),
        ours.sweep_tool(ours.rig(rows[0]), rows[0], problem.SPEEDS, "paper", sweep_error),
    ]
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
    solver = dfx.Tsit5() if damping < STIFF else dfx.Kvaerno5()

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

    def one(row, rtol):
        solution = dfx.diffeqsolve(
            dfx.ODETerm(field), solver, 0.0, problem.DURATION, 1e-4, jnp.zeros((4, 3)), row,
            saveat=dfx.SaveAt(ts=jnp.asarray(problem.TIMES)), max_steps=200_000, throw=False,
            stepsize_controller=dfx.PIDController(rtol=rtol, atol=rtol * 1e-5),
        )  # fmt: skip
        square = jnp.sum(solution.ys[:, 0] ** 2, axis=-1)
        return jnp.stack([jnp.sqrt(square.mean()), jnp.sqrt(square.max())])

    solve, batch = jax.jit(jax.vmap(one, (0, None))), jnp.asarray(some)
    note = f"vmap, {type(solver).__name__}, rtol {{:g}}"
    return loosest(
        "diffrax", lambda r: np.asarray(solve(batch, r)), DECADES, len(some), by(few), note=note
    )


def _numba(damping, some, few, skip):
    try:
        import numba
    except ImportError:
        skip("numba (not installed)")
        return []
    M, MW, KP, CM = problem.M, problem.MW, problem.KP, problem.CM
    speeds, samples, pitch = problem.SPEEDS, problem.SAMPLES, 2 * np.pi / problem.N
    step = problem.STEP

    @numba.njit(fastmath=True)
    def run(rows, gaps, n):
        out, h = np.zeros((len(rows), 2)), step / n
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
    note = "RK4, {} steps a sample"
    return [loosest("numba", lambda n: run(some, gaps, n), SUBSTEPS, len(some), by(few), note=note)]


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
    ode = {"x": y, "p": p, "t": t, "ode": ca.vertcat(*rates)}
    row = some[24]

    @functools.cache
    def solver(rtol):
        options = {"reltol": rtol, "abstol": rtol * 1e-6, "max_num_steps": 1_000_000}
        return ca.integrator("transient", "cvodes", ode, 0.0, list(problem.TIMES), options)

    def run(rtol):
        ends = solver(rtol)(x0=np.zeros(12), p=[*row, *problem.gap(row[0])])["xf"]
        return problem.figures(np.asarray(ends)[0::4])

    note = "CVODES, one design, rtol {:g}"
    return [loosest("casadi", run, DECADES, 1, by(few[24]), note=note)]


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

    methods = ("RK45", "LSODA", "Radau") if damping < STIFF else ("LSODA", "Radau")
    return [
        loosest(
            f"scipy {method}", functools.partial(run, method), DECADES, 1, by(few[24]),
            note="solve_ivp, one design, rtol {:g}",
        )
        for method in methods
    ]  # fmt: skip


_OCTAVE = """
d = [{row}]; width = {width!r}; depth = {depth!r}; w = [0.1; 1.2; 0.3]; pitch = 2*pi/14;
function out = field(t, y, d, width, depth, w, pitch)
  y = reshape(y, 3, 4); into = mod(w*t, pitch);
  rho = -depth*sin(2*pi*into/width).*(into < width);
  v = (y(:,3) + d(4)*rho)/5; u = (y(:,4) - d(4)*rho)/0.25;
  tension = d(2)*(y(:,1) - y(:,2) - rho) + d(4)*(v - u);
  out = [v; u; -tension - 1e4*y(:,1); tension - 50*u - d(3)*y(:,2)];
end
o = odeset("RelTol", {rtol!r}, "AbsTol", {rtol!r}*1e-5);
[t, y] = ode45(@(t, y) field(t, y, d, width, depth, w, pitch), (0:1000)*2e-3, zeros(12, 1), o);
n = sum(y(2:end, 1:3).^2, 2); printf("%.15g %.15g\\n", sqrt(mean(n)), sqrt(max(n)));
"""


def _octave(damping, some, few, skip):
    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is None or damping > STIFF:
        skip("Octave ode45 " + ("(stiff: hours)" if octave else "(not installed)"))
        return []
    width, depth = (float(x) for x in problem.gap(some[24, 0]))
    row = ", ".join(map(repr, map(float, some[24])))
    folder = Path(tempfile.mkdtemp(prefix="omnijax-bench-"))

    def run(rtol):
        script = folder / f"transient_{rtol:g}.m"
        script.write_text("1;\n" + _OCTAVE.format(row=row, width=width, depth=depth, rtol=rtol))
        command = [octave, "--no-gui", "--norc", str(script)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return np.array(done.stdout.split(), float)

    note = "ode45, with its start, one design, RelTol {:g}"
    return [loosest("octave", run, DECADES, 1, by(few[24]), note=note)]
