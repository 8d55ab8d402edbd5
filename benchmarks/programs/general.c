/* Exact propagation of any linear rig at constant wheel speeds, gated sine, from rest: RMS and peak of |dR|
   over samples + 1 samples, the start among them.

   The poles come from outside.  A pair of poles is complex (kind 1: z = z0 + i z1 moves by
   exp((l0 + i l1) t)) or two real ones (kind 0).  dR = sum_p c0 z0 + c1 z1 + the forced sinusoids of the
   wheels that are in a gap.  LANES designs go side by side; every array of a group has its lanes last.  */
#include <math.h>

#ifdef __AVX512F__
#define LANES 8
#else
#define LANES 4
#endif
typedef double lane __attribute__((vector_size(8 * LANES)));

int lanes(void) { return LANES; }

/* (re, im) of d (b0 + i b1) / ((l0 + i l1)^2 + nu^2), or of both real poles one by one */
static inline void coefficient(int complex_, double l0, double l1, double b0, double b1, double d,
                               double nu2, double *r0, double *r1) {
    if (complex_) {
        double re = l0 * l0 - l1 * l1 + nu2, im = 2 * l0 * l1, n = d / (re * re + im * im);
        *r0 = n * (b0 * re + b1 * im);
        *r1 = n * (b1 * re - b0 * im);
    } else {
        *r0 = d * b0 / (l0 * l0 + nu2);
        *r1 = d * b1 / (l1 * l1 + nu2);
    }
}

/* per group: kind, l0, l1 (P); c0, c1 (3, P); b0, b1 (G, P); width, depth, pitch, speed (G) */
#define PROGRAM(P, G)                                                                                                  \
    void general_##P##_##G(int groups, int samples, double h, const lane *kind, const lane *l0,                        \
                           const lane *l1, const lane *c0, const lane *c1, const lane *b0, const lane *b1,             \
                           const lane *width, const lane *depth, const lane *pitch, const lane *speed,                 \
                           double *out) {                                                                              \
        for (int q = 0; q < groups; q++) {                                                                             \
            lane ea[P], eb[P], ec[P], ed[P], z0[P], z1[P], k0[G][P], k1[G][P];                                         \
            lane fa[3][G], fb[3][G], f0[3][G], f1[3][G], cs[G], sn[G], square = {0}, top = {0};                        \
            double edge[G][LANES];                                                                                     \
            int due[G][LANES], on[G][LANES], next[G];                                                                  \
            for (int p = 0; p < P; p++) {                                                                              \
                z0[p] = z1[p] = (lane){0};                                                                             \
                for (int l = 0; l < LANES; l++) {                                                                      \
                    double a = exp(l0[p][l] * h);                                                                      \
                    if (kind[p][l]) {                                                                                  \
                        ea[p][l] = ed[p][l] = a * cos(l1[p][l] * h);                                                   \
                        ec[p][l] = a * sin(l1[p][l] * h);                                                              \
                        eb[p][l] = -ec[p][l];                                                                          \
                    } else {                                                                                           \
                        ea[p][l] = a;                                                                                  \
                        ed[p][l] = exp(l1[p][l] * h);                                                                  \
                        eb[p][l] = ec[p][l] = 0;                                                                       \
                    }                                                                                                  \
                }                                                                                                      \
            }                                                                                                          \
            for (int g = 0; g < G; g++) {                                                                              \
                next[g] = 0;                                                                                           \
                for (int o = 0; o < 3; o++) fa[o][g] = fb[o][g] = f0[o][g] = f1[o][g] = (lane){0};                     \
                for (int l = 0; l < LANES; l++) {                                                                      \
                    double nu = 2 * M_PI / width[g][l] * speed[g][l], r0, r1;                                          \
                    edge[g][l] = due[g][l] = on[g][l] = 0;                                                             \
                    cs[g][l] = cos(nu * h);                                                                            \
                    sn[g][l] = sin(nu * h);                                                                            \
                    for (int p = 0; p < P; p++) {                                                                      \
                        double x = l0[p][l], y = l1[p][l], s0, s1;                                                     \
                        coefficient(kind[p][l] != 0, x, y, b0[g * P + p][l], b1[g * P + p][l],                         \
                                    depth[g][l], nu * nu, &r0, &r1);                                                   \
                        s0 = kind[p][l] ? r0 * x - r1 * y : r0 * x;                                                    \
                        s1 = kind[p][l] ? r0 * y + r1 * x : r1 * y;                                                    \
                        k0[g][p][l] = nu * r0;                                                                         \
                        k1[g][p][l] = nu * r1;                                                                         \
                        for (int o = 0; o < 3; o++) {                                                                  \
                            fa[o][g][l] += c0[o * P + p][l] * s0 + c1[o * P + p][l] * s1;                              \
                            fb[o][g][l] += nu * (c0[o * P + p][l] * r0 + c1[o * P + p][l] * r1);                       \
                        }                                                                                              \
                    }                                                                                                  \
                }                                                                                                      \
            }                                                                                                          \
            for (int j = 0; j < samples;) {                                                                            \
                int stop = samples, active[G], count = 0;                                                              \
                for (int g = 0; g < G; g++) {                                                                          \
                    int any = 0;                                                                                       \
                    if (next[g] < stop) stop = next[g];                                                                \
                    for (int l = 0; l < LANES; l++) any |= on[g][l];                                                   \
                    if (any) active[count++] = g;                                                                      \
                }                                                                                                      \
                for (int last = 0; !last && j < samples; j++) {                                                        \
                    lane x[3] = {{0}}, n;                                                                              \
                    last = j >= stop;                                                                                  \
                    for (int a = 0; a < count; a++) {                                                                  \
                        int g = active[a];                                                                             \
                        for (int o = 0; o < 3; o++) {                                                                  \
                            lane t = f0[o][g] * cs[g] + f1[o][g] * sn[g];                                              \
                            f1[o][g] = f1[o][g] * cs[g] - f0[o][g] * sn[g];                                            \
                            f0[o][g] = t;                                                                              \
                        }                                                                                              \
                    }                                                                                                  \
                    for (int p = 0; p < P; p++) {                                                                      \
                        lane t = ea[p] * z0[p] + eb[p] * z1[p];                                                        \
                        z1[p] = ec[p] * z0[p] + ed[p] * z1[p];                                                         \
                        z0[p] = t;                                                                                     \
                    }                                                                                                  \
                    for (int g = 0; last && g < G; g++) {                                                              \
                        if (next[g] > j) continue;                                                                     \
                        next[g] = samples;                                                                             \
                        for (int l = 0; l < LANES; l++) {                                                              \
                            for (; due[g][l] <= j; on[g][l] ^= 1) {                                                    \
                                double since = (j + 1) * h - edge[g][l], sign = on[g][l] ? 1 : -1;                     \
                                double inside = width[g][l] / speed[g][l], whole = pitch[g][l] / speed[g][l];          \
                                for (int p = 0; p < P; p++) {                                                          \
                                    double e = sign * exp(l0[p][l] * since), r = k0[g][p][l], i = k1[g][p][l];         \
                                    if (kind[p][l]) {                                                                  \
                                        double c = cos(l1[p][l] * since), s = sin(l1[p][l] * since);                   \
                                        z0[p][l] += e * (r * c - i * s);                                               \
                                        z1[p][l] += e * (r * s + i * c);                                               \
                                    } else {                                                                           \
                                        z0[p][l] += e * r;                                                             \
                                        z1[p][l] += sign * exp(l1[p][l] * since) * i;                                  \
                                    }                                                                                  \
                                }                                                                                      \
                                double s = sin(2 * M_PI / inside * since), c = cos(2 * M_PI / inside * since);         \
                                for (int o = 0; o < 3; o++) {                                                          \
                                    f0[o][g][l] = on[g][l] ? 0 : fa[o][g][l] * s + fb[o][g][l] * c;                    \
                                    f1[o][g][l] = on[g][l] ? 0 : fa[o][g][l] * c - fb[o][g][l] * s;                    \
                                }                                                                                      \
                                edge[g][l] += on[g][l] ? whole - inside : inside;                                      \
                                due[g][l] = (int)(edge[g][l] / h);                                                     \
                            }                                                                                          \
                            if (due[g][l] < next[g]) next[g] = due[g][l];                                              \
                        }                                                                                              \
                    }                                                                                                  \
                    for (int o = 0; o < 3; o++) {                                                                      \
                        for (int p = 0; p < P; p++) x[o] += c0[o * P + p] * z0[p] + c1[o * P + p] * z1[p];             \
                        for (int g = 0; g < G; g++) x[o] += f0[o][g];                                                  \
                    }                                                                                                  \
                    n = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];                                                       \
                    square += n;                                                                                       \
                    for (int l = 0; l < LANES; l++) top[l] = n[l] > top[l] ? n[l] : top[l];                            \
                }                                                                                                      \
            }                                                                                                          \
            for (int l = 0; l < LANES; l++) {                                                                          \
                out[2 * (q * LANES + l)] = sqrt(square[l] / (samples + 1));                                            \
                out[2 * (q * LANES + l) + 1] = sqrt(top[l]);                                                           \
            }                                                                                                          \
            kind += P, l0 += P, l1 += P, c0 += 3 * P, c1 += 3 * P, b0 += G * P, b1 += G * P;                           \
            width += G, depth += G, pitch += G, speed += G;                                                            \
        }                                                                                                              \
    }

PROGRAM(6, 3)
PROGRAM(7, 4)
PROGRAM(9, 6)
