/* Torque-driven rig of any layout with unlike wheels, Hertz contacts and mounts with play, coupled variant,
 * in shifted momenta (the shape enters only as itself), isotropic sphere, classical Runge-Kutta.
 * A design: eta, then K, C and k of every wheel. */
#include <math.h>
#define MOST 8
static const double R = 1.22, RB = 0.0758, M = 5, ML = 5, MW = 0.25, KP = 1e4, CM = 50, ROLLERS = 14, IW = 7.2e-4;
static const double IS = 4.96;

typedef struct {
  const double *normal, *drive; /* (n, 3) */
  double axes[MOST][3], heavy[3][3]; /* spin axes; inverse of the platform's mass with the wheels across */
  double preload, play; /* N; m, half of it */
} Layout;

#define INLINE static inline __attribute__((always_inline))
INLINE double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* y: dR 3, mounts n, p 3, pi n, platform's velocity 3, angles n, Omega 3 */
INLINE void rate(const int n, const Layout *l, const double *y, double *out, const double *d, const double *torque) {
  const double *x = y, *D = y + 3, *p = D + n, *pi = p + 3, *V = pi + n, *angle = V + 3, *turning = angle + n;
  const double *K = d + 1, *C = K + n, *k = C + n;
  double *vx = out, *vD = vx + 3, *fp = vD + n, *fpi = fp + 3, *a = fpi + n, *speed = a + 3, *turn = speed + n;
  double pitch = 2 * M_PI / ROLLERS, width = d[0] * pitch, q = RB / R * sin(width / 2), s = sin(width / 4);
  double depth = R * q * q / (1 + sqrt(1 - q * q)) + 2 * RB * s * s;
  double rho[MOST], r[MOST], f[MOST], push[3] = {0}, A[MOST][MOST + 1];
  for (int j = 0; j < 3; j++) vx[j] = p[j] / M, fp[j] = 0, turn[j] = 0;
  for (int i = 0; i < n; i++) {
    double into = angle[i] - pitch * floor(angle[i] / pitch);
    rho[i] = into < width ? -depth * sin(2 * M_PI / width * into) : 0, r[i] = RB + rho[i];
    for (int j = 0; j < 3; j++) vx[j] += C[i] * rho[i] * l->normal[3 * i + j] / M;
  }
  for (int j = 0; j < 3; j++) vx[j] -= V[j];
  for (int i = 0; i < n; i++) {
    const double *e = l->normal + 3 * i;
    double along = dot(e, x), delta = along - D[i] - rho[i], reach = 1.5 * l->preload / K[i], left = fmax(1 - delta / reach, 0);
    vD[i] = (pi[i] - C[i] * rho[i]) / MW - dot(e, V);
    double tension = l->preload * (1 - left * sqrt(left)) + C[i] * (dot(e, vx) - vD[i]);
    double mount = k[i] * (D[i] - fmin(fmax(D[i], -l->play), l->play)) + CM * vD[i];
    fpi[i] = tension - mount, speed[i] = R * dot(l->axes[i], turning) / r[i];
    for (int j = 0; j < 3; j++) fp[j] -= e[j] * (tension + KP * along), push[j] += e[j] * (mount + KP * along);
  }
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < n; j++) A[i][j] = R * R / IS * dot(l->axes[i], l->axes[j]) + (i == j ? r[i] * r[i] / IW : 0);
    A[i][n] = r[i] / IW * torque[i];
  }
  for (int i = 0; i < n; i++)
    for (int m = i + 1; m < n; m++) {
      double z = A[m][i] / A[i][i];
      for (int j = i; j <= n; j++) A[m][j] -= z * A[i][j];
    }
  for (int i = n - 1; i >= 0; i--) {
    f[i] = A[i][n];
    for (int j = i + 1; j < n; j++) f[i] -= A[i][j] * f[j];
    f[i] /= A[i][i];
    for (int j = 0; j < 3; j++) {
      turn[j] += R / IS * f[i] * l->axes[i][j];
      fp[j] += f[i] * l->drive[3 * i + j], push[j] -= f[i] * l->drive[3 * i + j];
    }
  }
  for (int j = 0; j < 3; j++) a[j] = dot(l->heavy[j], push);
}

static void prepare(Layout *l, int n, const double *normal, const double *drive, double preload, double play) {
  double m[3][3] = {{0}}, *h = &l->heavy[0][0], det;
  l->normal = normal, l->drive = drive, l->preload = preload, l->play = play;
  for (int j = 0; j < 3; j++) m[j][j] = ML;
  for (int i = 0; i < n; i++) {
    const double *e = normal + 3 * i, *v = drive + 3 * i;
    for (int j = 0; j < 3; j++) {
      l->axes[i][j] = v[(j + 1) % 3] * e[(j + 2) % 3] - v[(j + 2) % 3] * e[(j + 1) % 3];
      for (int o = 0; o < 3; o++) m[j][o] += MW * ((j == o) - e[j] * e[o]);
    }
  }
  for (int j = 0; j < 3; j++)
    for (int o = 0; o < 3; o++) {
      int a = (j + 1) % 3, b = (j + 2) % 3, c = (o + 1) % 3, e = (o + 2) % 3;
      h[3 * o + j] = m[a][c] * m[b][e] - m[a][e] * m[b][c];
    }
  det = m[0][0] * h[0] + m[0][1] * h[3] + m[0][2] * h[6];
  for (int j = 0; j < 9; j++) h[j] /= det;
}

INLINE void run(const int n, int designs, const double *values, const double *normal, const double *drive,
                double preload, double play, const double *torque, int samples, double step, int substeps, double *figures) {
  const int size = 12 + 3 * n;
  Layout l;
  prepare(&l, n, normal, drive, preload, play);
  for (int b = 0; b < designs; b++) {
    const double *d = values + (1 + 3 * n) * b;
    double y[12 + 3 * MOST] = {0}, k1[12 + 3 * MOST], k2[12 + 3 * MOST], k3[12 + 3 * MOST], k4[12 + 3 * MOST];
    double z[12 + 3 * MOST], h = step / substeps, sum = 0, top = 0;
    for (int j = 0; j < samples; j++) {
      for (int m = 0; m < substeps; m++) {
        rate(n, &l, y, k1, d, torque);
        for (int a = 0; a < size; a++) z[a] = y[a] + h / 2 * k1[a];
        rate(n, &l, z, k2, d, torque);
        for (int a = 0; a < size; a++) z[a] = y[a] + h / 2 * k2[a];
        rate(n, &l, z, k3, d, torque);
        for (int a = 0; a < size; a++) z[a] = y[a] + h * k3[a];
        rate(n, &l, z, k4, d, torque);
        for (int a = 0; a < size; a++) y[a] += h / 6 * (k1[a] + 2 * k2[a] + 2 * k3[a] + k4[a]);
      }
      double square = dot(y, y);
      sum += square;
      if (square > top) top = square;
    }
    figures[2 * b] = sqrt(sum / samples), figures[2 * b + 1] = sqrt(top);
  }
}

#define PROGRAM(N)                                                                                                     \
  void machine_##N(int designs, const double *values, const double *normal, const double *drive, double preload,       \
                   double play, const double *torque, int samples, double step, int substeps, double *figures) {       \
    run(N, designs, values, normal, drive, preload, play, torque, samples, step, substeps, figures);                   \
  }                                                                                                                    \
  void rate_##N(const double *y, double *out, const double *values, const double *normal, const double *drive,         \
                double preload, double play, const double *torque) {                                                   \
    Layout l;                                                                                                          \
    prepare(&l, N, normal, drive, preload, play);                                                                      \
    rate(N, &l, y, out, values, torque);                                                                               \
  }
PROGRAM(3)
PROGRAM(4)
