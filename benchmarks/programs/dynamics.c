/* Torque-driven rig with three orthogonal wheels, coupled variant, in shifted momenta (the shape
 * enters only as itself), classical Runge-Kutta.  design: eta, K, k, C. */
#include <math.h>
#include <string.h>
#define STATES 22 /* angle 3, Omega 3, quaternion 4, dR 3, mount 3, p 3, pi 3 */
static const double R = 1.22, RB = 0.0758, M = 5, ML = 5, MW = 0.25, KP = 1e4, CM = 50, N = 14, IW = 7.2e-4;
static const double MU = 0.9, N0 = 20, WIDTH = 0.01, LEVER = 4e-5, IB[3] = {4.96, 4.5, 5.4};

static void rate(const double *y, double *out, const double *d, const double *torque, double width, double depth) {
  double K = d[1], k = d[2], C = d[3], pitch = 2 * M_PI / N, rho[3], slope[3], speed[3], spin[3];
  const double *O = y + 3, *q = y + 6, *x = y + 10, *D = y + 13, *p = y + 16, *pi = y + 19;
  double norm = 1 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  double a = q[0] * norm, b = q[1] * norm, c = q[2] * norm, e = q[3] * norm;
  double Q[3][3] = {{1 - 2 * (c * c + e * e), 2 * (b * c - a * e), 2 * (b * e + a * c)},
                    {2 * (b * c + a * e), 1 - 2 * (b * b + e * e), 2 * (c * e - a * b)},
                    {2 * (b * e - a * c), 2 * (c * e + a * b), 1 - 2 * (b * b + c * c)}};
  double I[3][3], J[3][3], L[3], g[3], f[3], turn[3], A[3][4];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      I[i][j] = J[i][j] = 0;
      for (int m = 0; m < 3; m++) I[i][j] += Q[i][m] * Q[j][m] * IB[m], J[i][j] += Q[i][m] * Q[j][m] / IB[m];
    }
  for (int i = 0; i < 3; i++) {
    double into = y[i] - pitch * floor(y[i] / pitch), z = 2 * M_PI / width;
    int in = into < width;
    rho[i] = in ? -depth * sin(z * into) : 0, slope[i] = in ? -depth * z * cos(z * into) : 0;
    speed[i] = -R * O[(i + 2) % 3] / (RB + rho[i]); /* axis of wheel i: minus e of i + 2 */
    L[i] = I[i][0] * O[0] + I[i][1] * O[1] + I[i][2] * O[2];
    double w = -(p[i] + pi[i]) / (ML + 2 * MW), v = (p[i] + C * rho[i]) / M - w, u = (pi[i] - C * rho[i]) / MW - w;
    double tension = K * (x[i] - D[i] - rho[i]) + C * (v - u);
    double normal = fmax(N0 - tension + C * slope[i] * speed[i], 0);
    spin[i] = LEVER * MU * normal * tanh(O[i] / WIDTH);
    out[10 + i] = v, out[13 + i] = u, out[16 + i] = -tension - KP * x[i], out[19 + i] = tension - k * D[i] - CM * u;
  }
  for (int i = 0; i < 3; i++) g[i] = O[(i + 1) % 3] * L[(i + 2) % 3] - O[(i + 2) % 3] * L[(i + 1) % 3] + spin[i];
  for (int i = 0; i < 3; i++) {
    int o = (i + 2) % 3;
    double r = RB + rho[i];
    A[i][3] = r / IW * torque[i] - R * (J[o][0] * g[0] + J[o][1] * g[1] + J[o][2] * g[2]);
    for (int j = 0; j < 3; j++) A[i][j] = R * R * J[o][(j + 2) % 3] + (i == j ? r * r / IW : 0);
  }
  for (int i = 0; i < 3; i++)
    for (int m = i + 1; m < 3; m++) {
      double z = A[m][i] / A[i][i];
      for (int j = i; j < 4; j++) A[m][j] -= z * A[i][j];
    }
  for (int i = 2; i >= 0; i--) {
    f[i] = A[i][3];
    for (int j = i + 1; j < 3; j++) f[i] -= A[i][j] * f[j];
    f[i] /= A[i][i];
  }
  for (int i = 0; i < 3; i++) turn[(i + 2) % 3] = -R * f[i] - g[(i + 2) % 3];
  for (int i = 0; i < 3; i++) {
    out[i] = speed[i], out[3 + i] = J[i][0] * turn[0] + J[i][1] * turn[1] + J[i][2] * turn[2];
    out[16 + i] += f[(i + 2) % 3]; /* wheel i + 2 drives along e of i */
  }
  out[6] = -(O[0] * q[1] + O[1] * q[2] + O[2] * q[3]) / 2;
  out[7] = (q[0] * O[0] + O[1] * q[3] - O[2] * q[2]) / 2;
  out[8] = (q[0] * O[1] + O[2] * q[1] - O[0] * q[3]) / 2;
  out[9] = (q[0] * O[2] + O[0] * q[2] - O[1] * q[1]) / 2;
}

void single_rate(const double *y, double *out, const double *d, const double *torque) {
  double width = 2 * M_PI * d[0] / N, q = RB / R * sin(width / 2), s = sin(width / 4);
  rate(y, out, d, torque, width, R * q * q / (1 + sqrt(1 - q * q)) + 2 * RB * s * s);
}

void dynamics(int designs, const double *values, const double *torque, int samples, double step, int substeps, double *figures) {
  for (int b = 0; b < designs; b++) {
    const double *d = values + 4 * b;
    double y[STATES] = {0}, k1[STATES], k2[STATES], k3[STATES], k4[STATES], z[STATES], h = step / substeps, sum = 0, top = 0;
    double width = 2 * M_PI * d[0] / N, q = RB / R * sin(width / 2), s = sin(width / 4);
    double depth = R * q * q / (1 + sqrt(1 - q * q)) + 2 * RB * s * s;
    y[6] = 1;
    for (int j = 0; j < samples; j++) {
      for (int n = 0; n < substeps; n++) {
        rate(y, k1, d, torque, width, depth);
        for (int a = 0; a < STATES; a++) z[a] = y[a] + h / 2 * k1[a];
        rate(z, k2, d, torque, width, depth);
        for (int a = 0; a < STATES; a++) z[a] = y[a] + h / 2 * k2[a];
        rate(z, k3, d, torque, width, depth);
        for (int a = 0; a < STATES; a++) z[a] = y[a] + h * k3[a];
        rate(z, k4, d, torque, width, depth);
        for (int a = 0; a < STATES; a++) y[a] += h / 6 * (k1[a] + 2 * k2[a] + 2 * k3[a] + k4[a]);
      }
      double n = y[10] * y[10] + y[11] * y[11] + y[12] * y[12];
      sum += n;
      if (n > top) top = n;
    }
    figures[2 * b] = sqrt(sum / samples), figures[2 * b + 1] = sqrt(top);
  }
}
