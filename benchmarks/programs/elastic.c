/* One contact's elastic model (paper variant) at constant wheel speed, three contacts a design.
 *
 *   p' = -K (x - D - r) - C (x' - D') - K' x     x' = (p + C r)/M
 *   q' =  K (x - D - r) + C (x' - D') - c D' - k D     D' = (q - C r)/m
 *
 * design: eta, K, k, C.   figures: RMS and peak of |dR| over the samples.
 * runge_kutta: classical, scalar.   exact: modes, several designs side by side.   */
#include <math.h>
#ifdef __AVX512F__
#define LANES 8
#else
#define LANES 4 /* eight take three times as long where vectors have 256 bits */
#endif
typedef double vec __attribute__((vector_size(8 * LANES)));
static const double R = 1.22, RB = 0.0758, M = 5, MW = 0.25, KP = 1e4, CM = 50, N = 14;
static const double W[3] = {0.1, 1.2, 0.3};

static void gap(double eta, double *width, double *depth) {
  *width = 2 * M_PI * eta / N;
  double q = RB / R * sin(*width / 2), s = sin(*width / 4);
  *depth = R * q * q / (1 + sqrt(1 - q * q)) + 2 * RB * s * s;
}

static inline double shape(double angle, double width, double depth) {
  double pitch = 2 * M_PI / N, into = angle - pitch * floor(angle / pitch);
  return into < width ? -depth * sin(2 * M_PI / width * into) : 0;
}

static inline void rate(const double *y, double r, const double *d, double *out) {
  double K = d[1], k = d[2], C = d[3], v = (y[2] + C * r) / M, w = (y[3] - C * r) / MW;
  double tension = K * (y[0] - y[1] - r) + C * (v - w);
  out[0] = v, out[1] = w, out[2] = -tension - KP * y[0], out[3] = tension - CM * w - k * y[1];
}

void runge_kutta(int designs, const double *values, int samples, double step, int substeps, double *figures) {
  for (int b = 0; b < designs; b++) {
    const double *d = values + 4 * b;
    double width, depth, y[3][4] = {{0}}, h = step / substeps, sum = 0, top = 0, before[3] = {0};
    gap(d[0], &width, &depth);
    for (int j = 0; j < samples; j++) {
      for (int s = 0; s < substeps; s++) {
        double t = (j * substeps + s) * h;
        for (int i = 0; i < 3; i++) {
          double mid = shape(W[i] * (t + h / 2), width, depth), end = shape(W[i] * (t + h), width, depth);
          double k1[4], k2[4], k3[4], k4[4], z[4];
          rate(y[i], before[i], d, k1);
          for (int a = 0; a < 4; a++) z[a] = y[i][a] + h / 2 * k1[a];
          rate(z, mid, d, k2);
          for (int a = 0; a < 4; a++) z[a] = y[i][a] + h / 2 * k2[a];
          rate(z, mid, d, k3);
          for (int a = 0; a < 4; a++) z[a] = y[i][a] + h * k3[a];
          rate(z, end, d, k4);
          for (int a = 0; a < 4; a++) y[i][a] += h / 6 * (k1[a] + 2 * k2[a] + 2 * k3[a] + k4[a]);
          before[i] = end;
        }
      }
      double n = y[0][0] * y[0][0] + y[1][0] * y[1][0] + y[2][0] * y[2][0];
      sum += n;
      if (n > top) top = n;
    }
    figures[2 * b] = sqrt(sum / samples), figures[2 * b + 1] = sqrt(top);
  }
}

/* Two poles as one number u + v e with e e = s: s = -1 a conjugate pair, s = +1 two real ones. */
typedef struct { double u, v, s; } pair;
static inline pair mul(pair a, pair b) { return (pair){a.u * b.u + a.s * a.v * b.v, a.u * b.v + a.v * b.u, a.s}; }
static inline pair inverse(pair a) { double n = 1 / (a.u * a.u - a.s * a.v * a.v); return (pair){a.u * n, -a.v * n, a.s}; }
static inline pair power(pair l, double t) {
  if (l.s < 0) { double e = exp(l.u * t); return (pair){e * cos(l.v * t), e * sin(l.v * t), -1}; }
  double p = exp((l.u + l.v) * t), q = exp((l.u - l.v) * t);
  return (pair){(p + q) / 2, (p - q) / 2, 1};
}
static inline pair quadratic(pair l, double c2, double c1, double c0) {
  pair q = mul(l, l);
  return (pair){c2 * q.u + c1 * l.u + c0, c2 * q.v + c1 * l.v, l.s};
}

/* x / r = K-C line times the wheel's own impedance over the quartic; poles by two real quadratics. */
static void modes(const double *d, pair pole[2], pair residue[2]) {
  double K = d[1], k = d[2], C = d[3], a4 = M * MW;
  double a3 = (M * (C + CM) + MW * C) / a4, a2 = (M * (K + k) + C * CM + MW * (K + KP)) / a4;
  double a1 = (C * k + K * CM + KP * (C + CM)) / a4, a0 = (K * k + KP * (K + k)) / a4;
  /* Newton on the resolvent cubic of y = sum of the quadratics' constants, from above */
  double p1 = a1 * a3 - 4 * a0, p0 = 4 * a0 * a2 - a1 * a1 - a0 * a3 * a3;
  double y = 2 * fmax(a2, fmax(sqrt(fabs(p1)), cbrt(fabs(p0))));
  for (int i = 0; i < 80; i++) {
    double f = ((y - a2) * y + p1) * y + p0, g = (3 * y - 2 * a2) * y + p1, change = f / g;
    y -= change;
    if (fabs(change) < 1e-14 * y) break;
  }
  double c0 = y / 2 + sqrt(fmax(y * y / 4 - a0, 0)), c1 = a0 / c0;
  double b0 = a3 / 2 + sqrt(fmax(a3 * a3 / 4 - a2 + y, 0)), b1 = (a2 - y) / b0;
  if (fabs(b0 * c1 + b1 * c0 - a1) > fabs(b0 * c0 + b1 * c1 - a1)) { double t = b0; b0 = b1; b1 = t; }
  for (int i = 0; i < 2; i++) {
    double b = i ? b1 : b0, c = i ? c1 : c0, disc = b * b / 4 - c;
    pair l = {-b / 2, sqrt(fabs(disc)), disc > 0 ? 1 : -1};
    pair top = mul((pair){C * l.u + K, C * l.v, l.s}, quadratic(l, MW, CM, k));
    pair slope = mul(l, quadratic(l, 4, 3 * a3, 2 * a2));
    slope.u += a1;
    top.u /= a4, top.v /= a4;
    pole[i] = l, residue[i] = mul(top, inverse(slope));
  }
}

void exact(int designs, const double *values, int samples, double h, double *figures) {
  static vec square[100000];
  for (int b = 0; b < designs; b += LANES) {
    pair pole[LANES][2], residue[LANES][2];
    double width[LANES], depth[LANES];
    vec ea[2], eb[2], es[2];
    for (int j = 0; j < samples; j++) square[j] = (vec){0};
    for (int l = 0; l < LANES; l++) {
      gap(values[4 * (b + l)], &width[l], &depth[l]);
      modes(values + 4 * (b + l), pole[l], residue[l]);
      for (int m = 0; m < 2; m++) {
        pair e = power(pole[l][m], h);
        ea[m][l] = e.u, eb[m][l] = e.v, es[m][l] = e.s * e.v;
      }
    }
    for (int i = 0; i < 3; i++) { /* state: free part of two pole pairs, forced part */
      vec u[2] = {{0}}, v[2] = {{0}}, f = {0}, g = {0}, c, s;
      pair jump[LANES][2];
      double fs[LANES], fc[LANES], nu[LANES], edge[LANES], pitch = 2 * M_PI / N / W[i];
      int inside[LANES], next[LANES];
      for (int l = 0; l < LANES; l++) {
        nu[l] = 2 * M_PI / width[l] * W[i];
        c[l] = cos(nu[l] * h), s[l] = sin(nu[l] * h), fs[l] = fc[l] = edge[l] = 0, inside[l] = next[l] = 0;
        for (int m = 0; m < 2; m++) {
          pair q = mul(residue[l][m], inverse(quadratic(pole[l][m], 1, 0, nu[l] * nu[l])));
          q.u *= 2 * depth[l], q.v *= 2 * depth[l];
          jump[l][m] = (pair){-q.u * nu[l], -q.v * nu[l], q.s};
          fs[l] += mul(q, pole[l][m]).u, fc[l] += q.u * nu[l];
        }
      }
      for (int j = 0; j < samples;) {
        int stop = samples;
        for (int l = 0; l < LANES; l++) if (next[l] < stop) stop = next[l];
#define ADVANCE                                                        \
  vec x = f * c + g * s;                                               \
  g = g * c - f * s, f = x;                                            \
  for (int m = 0; m < 2; m++) {                                        \
    vec t = ea[m] * u[m] + es[m] * v[m];                               \
    v[m] = ea[m] * v[m] + eb[m] * u[m], u[m] = t, x += t;              \
  }
        for (; j < stop; j++) { ADVANCE square[j] += x * x; }
        if (j >= samples) break;
        ADVANCE
        for (int l = 0; l < LANES; l++)
          while (next[l] <= j) { /* an edge in this step: the forced part begins or ends */
            double since = (j + 1) * h - edge[l], sign = inside[l] ? -1 : 1;
            for (int m = 0; m < 2; m++) {
              pair e = mul(jump[l][m], power(pole[l][m], since));
              u[m][l] += sign * e.u, v[m][l] += sign * e.v;
            }
            if (inside[l]) f[l] = g[l] = 0, edge[l] += pitch - width[l] / W[i];
            else {
              double a = sin(nu[l] * since), z = cos(nu[l] * since);
              f[l] = fs[l] * a + fc[l] * z, g[l] = fs[l] * z - fc[l] * a, edge[l] += width[l] / W[i];
            }
            inside[l] = !inside[l], next[l] = (int)(edge[l] / h);
          }
        x = u[0] + u[1] + f;
        square[j++] += x * x;
      }
    }
    for (int l = 0; l < LANES; l++) {
      double sum = 0, top = 0;
      for (int j = 0; j < samples; j++) { double q = square[j][l]; sum += q; if (q > top) top = q; }
      figures[2 * (b + l)] = sqrt(sum / samples), figures[2 * (b + l) + 1] = sqrt(top);
    }
  }
}

/* Long-run RMS and supremum: periodic solution of each passage in closed form; RMS and peak on a
 * fine grid of each piece (Simpson; parabola through the largest three). */
void steady(int designs, const double *values, int points, double *figures) {
  for (int b = 0; b < designs; b++) {
    pair pole[2], residue[2];
    double width, depth, total = 0, tops = 0;
    gap(values[4 * b], &width, &depth);
    modes(values + 4 * b, pole, residue);
    for (int i = 0; i < 3; i++) {
      double period = 2 * M_PI / N / W[i], tau = width / W[i], nu = 2 * M_PI / tau, fs = 0, fc = 0, top = 0, area = 0;
      pair start[2][2];
      for (int m = 0; m < 2; m++) {
        pair q = mul(residue[m], inverse(quadratic(pole[m], 1, 0, nu * nu)));
        q.u *= 2 * depth, q.v *= 2 * depth, fs += mul(q, pole[m]).u, fc += q.u * nu;
        pair e = power(pole[m], period), rest = power(pole[m], period - tau), into = power(pole[m], tau);
        pair less = {1 - e.u, -e.v, e.s}, j = {q.u * nu, q.v * nu, q.s};
        j = mul(j, inverse(less));
        start[0][m] = mul(j, (pair){rest.u - 1, rest.v, e.s}), start[1][m] = mul(j, (pair){1 - into.u, -into.v, e.s});
      }
      for (int piece = 0; piece < 2; piece++) {
        double length = piece ? period - tau : tau, h = length / points, x0 = 0, x1 = 0, c = cos(nu * h), s = sin(nu * h);
        double f = piece ? 0 : fc, g = piece ? 0 : fs;
        pair z0 = start[piece][0], z1 = start[piece][1], e0 = power(pole[0], h), e1 = power(pole[1], h);
        for (int j = 0; j <= points; j++) {
          double x = z0.u + z1.u + f, weight = j == 0 || j == points ? 1 : j % 2 ? 4 : 2;
          area += weight * x * x * h / 3;
          if (fabs(x) > top) top = fabs(x);
          if (j > 1 && fabs(x1) >= fabs(x0) && fabs(x1) >= fabs(x)) {
            double d = (x0 - x) / 2, q = x0 - 2 * x1 + x, peak = q ? fabs(x1 - d * d / (2 * q)) : 0;
            if (peak > top) top = peak;
          }
          x0 = x1, x1 = x, z0 = mul(z0, e0), z1 = mul(z1, e1);
          double t = f * c + g * s;
          g = g * c - f * s, f = t;
        }
      }
      total += area / period, tops += top * top;
    }
    figures[2 * b] = sqrt(total), figures[2 * b + 1] = sqrt(tops);
  }
}
