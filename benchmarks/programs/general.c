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
typedef long long mask __attribute__((vector_size(8 * LANES)));

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

/* a where m is set, else b */
static inline lane pick(mask m, lane a, lane b) { return (lane)(((mask)a & m) | ((mask)b & ~m)); }

/* The long run, all at once: RMS and supremum of |dR| over all phases of wheels whose speeds have no common multiple.
   Each wheel's curve stands on 2 (points + 1) places of its pitch; from `starts` directions in turn every wheel takes
   the place that lies farthest along, and their sum is the next direction, to the end; then parabolas beside the
   places.  `room` holds 6 G (points + 1) lanes, `from` 3 numbers a start.  */
#define STEADY(P, G)                                                                                                   \
    void steady_##P##_##G(int groups, int points, int starts, const double *from, lane *room, const lane *kind,        \
                          const lane *l0, const lane *l1, const lane *c0, const lane *c1, const lane *b0,              \
                          const lane *b1, const lane *width, const lane *depth, const lane *pitch,                     \
                          const lane *speed, double *out) {                                                            \
        int count = 2 * (points + 1);                                                                                  \
        for (int q = 0; q < groups; q++) {                                                                             \
            lane mean[3] = {{0}}, spread = {0}, best = {0}, aim[3] = {{0}};                                            \
            for (int g = 0; g < G; g++) {                                                                              \
                lane ea[P], eb[P], ec[P], ed[P], z0[P], z1[P], f0[3], f1[3], cs, sn, fa[3], fb[3], first[2][2][P];     \
                lane area[3] = {{0}}, square = {0}, period = pitch[g] / speed[g], inside = width[g] / speed[g];        \
                for (int o = 0; o < 3; o++) fa[o] = fb[o] = (lane){0};                                                 \
                for (int l = 0; l < LANES; l++) {                                                                      \
                    double nu = 2 * M_PI / inside[l], T = period[l], t = inside[l], r0, r1;                            \
                    for (int p = 0; p < P; p++) {                                                                      \
                        double x = l0[p][l], y = l1[p][l], s0, s1;                                                     \
                        int turns = kind[p][l] != 0;                                                                   \
                        coefficient(turns, x, y, b0[g * P + p][l], b1[g * P + p][l], depth[g][l], nu * nu, &r0, &r1);  \
                        s0 = turns ? r0 * x - r1 * y : r0 * x;                                                         \
                        s1 = turns ? r0 * y + r1 * x : r1 * y;                                                         \
                        for (int o = 0; o < 3; o++) {                                                                  \
                            fa[o][l] += c0[o * P + p][l] * s0 + c1[o * P + p][l] * s1;                                 \
                            fb[o][l] += nu * (c0[o * P + p][l] * r0 + c1[o * P + p][l] * r1);                          \
                        }                                                                                              \
                        /* what all edges before have left: nu r (e^(l rest) - 1) / (1 - e^(l T)) */                   \
                        for (int piece = 0; piece < 2; piece++) {                                                      \
                            double rest = piece ? t : T - t, sign = piece ? -1 : 1;                                    \
                            if (turns) {                                                                               \
                                double e = exp(x * T), d = 1 - e * cos(y * T), i = -e * sin(y * T), a = exp(x * rest); \
                                double u = sign * (a * cos(y * rest) - 1), v = sign * a * sin(y * rest);               \
                                double n = nu / (d * d + i * i), re = n * (u * d + v * i), im = n * (v * d - u * i);   \
                                first[piece][0][p][l] = re * r0 - im * r1;                                             \
                                first[piece][1][p][l] = re * r1 + im * r0;                                             \
                            } else {                                                                                   \
                                first[piece][0][p][l] = sign * nu * r0 * expm1(x * rest) / -expm1(x * T);              \
                                first[piece][1][p][l] = sign * nu * r1 * expm1(y * rest) / -expm1(y * T);              \
                            }                                                                                          \
                        }                                                                                              \
                    }                                                                                                  \
                }                                                                                                      \
                for (int piece = 0; piece < 2; piece++) {                                                              \
                    lane h = (piece ? period - inside : inside) / points;                                              \
                    lane *x = room + 3 * (g * count + piece * (points + 1));                                           \
                    for (int l = 0; l < LANES; l++) {                                                                  \
                        cs[l] = cos(2 * M_PI / points);                                                                \
                        sn[l] = sin(2 * M_PI / points);                                                                \
                        for (int p = 0; p < P; p++) {                                                                  \
                            double a = exp(l0[p][l] * h[l]);                                                           \
                            int turns = kind[p][l] != 0;                                                               \
                            ea[p][l] = turns ? a * cos(l1[p][l] * h[l]) : a;                                           \
                            ec[p][l] = turns ? a * sin(l1[p][l] * h[l]) : 0;                                           \
                            ed[p][l] = turns ? ea[p][l] : exp(l1[p][l] * h[l]);                                        \
                            eb[p][l] = -ec[p][l];                                                                      \
                        }                                                                                              \
                    }                                                                                                  \
                    for (int p = 0; p < P; p++) z0[p] = first[piece][0][p], z1[p] = first[piece][1][p];                \
                    for (int o = 0; o < 3; o++) f0[o] = piece ? (lane){0} : fb[o], f1[o] = piece ? (lane){0} : fa[o];  \
                    for (int j = 0; j <= points; j++, x += 3) {                                                        \
                        lane n = {0}, weight = h * (j == 0 || j == points ? 1.0 / 3 : j % 2 ? 4.0 / 3 : 2.0 / 3);      \
                        for (int o = 0; o < 3; o++) {                                                                  \
                            lane y = f0[o], t = f0[o] * cs + f1[o] * sn;                                               \
                            for (int p = 0; p < P; p++) y += c0[o * P + p] * z0[p] + c1[o * P + p] * z1[p];            \
                            f1[o] = f1[o] * cs - f0[o] * sn;                                                           \
                            f0[o] = t;                                                                                 \
                            x[o] = y;                                                                                  \
                            n += y * y;                                                                                \
                            area[o] += weight * y;                                                                     \
                        }                                                                                              \
                        square += weight * n;                                                                          \
                        for (int p = 0; p < P; p++) {                                                                  \
                            lane t = ea[p] * z0[p] + eb[p] * z1[p];                                                    \
                            z1[p] = ec[p] * z0[p] + ed[p] * z1[p];                                                     \
                            z0[p] = t;                                                                                 \
                        }                                                                                              \
                    }                                                                                                  \
                }                                                                                                      \
                spread += square / period;                                                                             \
                for (int o = 0; o < 3; o++) {                                                                          \
                    lane m = area[o] / period;                                                                         \
                    spread -= m * m;                                                                                   \
                    mean[o] += m;                                                                                      \
                }                                                                                                      \
            }                                                                                                          \
            for (int s = 0; s < starts; s++) {                                                                         \
                lane u[3], before = {0};                                                                               \
                for (int o = 0; o < 3; o++) u[o] = (lane){0} + from[3 * s + o];                                        \
                for (int more = 1; more;) {                                                                            \
                    lane sum[3] = {{0}}, n, size;                                                                      \
                    const lane *x = room;                                                                              \
                    for (int g = 0; g < G; g++) {                                                                      \
                        lane top = (lane){0} - 1e300, at[3] = {{0}};                                                   \
                        for (int j = 0; j < count; j++, x += 3) {                                                      \
                            lane v = u[0] * x[0] + u[1] * x[1] + u[2] * x[2];                                          \
                            for (int o = 0; o < 3; o++) at[o] = pick(v > top, x[o], at[o]);                            \
                            top = pick(v > top, v, top);                                                               \
                        }                                                                                              \
                        for (int o = 0; o < 3; o++) sum[o] += at[o];                                                   \
                    }                                                                                                  \
                    n = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];                                           \
                    more = 0;                                                                                          \
                    for (int l = 0; l < LANES; l++) more |= n[l] > before[l] * (1 + 1e-14), size[l] = sqrt(n[l]);      \
                    before = n;                                                                                        \
                    for (int o = 0; o < 3; o++) u[o] = sum[o] / size;                                                  \
                }                                                                                                      \
                for (int o = 0; o < 3; o++) aim[o] = pick(before > best, u[o], aim[o]);                                \
                best = pick(before > best, before, best);                                                              \
            }                                                                                                          \
            for (int more = 0; more < 4; more++) {                                                                     \
                lane sum[3] = {{0}}, size, top[G], at[G];                                                              \
                const lane *x = room;                                                                                  \
                for (int g = 0; g < G; g++) {                                                                          \
                    top[g] = (lane){0} - 1e300;                                                                        \
                    for (int j = 0; j < count; j++, x += 3) {                                                          \
                        lane v = aim[0] * x[0] + aim[1] * x[1] + aim[2] * x[2];                                        \
                        at[g] = pick(v > top[g], (lane){0} + j, at[g]);                                                \
                        top[g] = pick(v > top[g], v, top[g]);                                                          \
                    }                                                                                                  \
                }                                                                                                      \
                for (int l = 0; l < LANES; l++) {                                                                      \
                    for (int g = 0; g < G; g++) {                                                                      \
                        int j = at[g][l], ends = j % (points + 1) == 0 || j % (points + 1) == points;                  \
                        const lane *y = room + 3 * (g * count + j);                                                    \
                        double slope = 0, bend = 0, t;                                                                 \
                        for (int o = 0; o < 3 && !ends; o++) {                                                         \
                            slope += aim[o][l] * (y[o + 3][l] - y[o - 3][l]) / 2;                                      \
                            bend += aim[o][l] * (y[o + 3][l] - 2 * y[o][l] + y[o - 3][l]);                             \
                        }                                                                                              \
                        t = bend < 0 ? -slope / bend : 0;                                                              \
                        for (int o = 0; o < 3; o++) {                                                                  \
                            sum[o][l] += y[o][l];                                                                      \
                            if (!ends)                                                                                 \
                                sum[o][l] += t * (y[o + 3][l] - y[o - 3][l]) / 2 +                                     \
                                             t * t * (y[o + 3][l] - 2 * y[o][l] + y[o - 3][l]) / 2;                    \
                        }                                                                                              \
                    }                                                                                                  \
                    size[l] = sqrt(sum[0][l] * sum[0][l] + sum[1][l] * sum[1][l] + sum[2][l] * sum[2][l]);             \
                }                                                                                                      \
                for (int o = 0; o < 3; o++) aim[o] = sum[o] / size;                                                    \
                best = size;                                                                                           \
            }                                                                                                          \
            for (int l = 0; l < LANES; l++) {                                                                          \
                double m = mean[0][l] * mean[0][l] + mean[1][l] * mean[1][l] + mean[2][l] * mean[2][l];                \
                out[2 * (q * LANES + l)] = sqrt(spread[l] + m);                                                        \
                out[2 * (q * LANES + l) + 1] = best[l];                                                                \
            }                                                                                                          \
            kind += P, l0 += P, l1 += P, c0 += 3 * P, c1 += 3 * P, b0 += G * P, b1 += G * P;                           \
            width += G, depth += G, pitch += G, speed += G;                                                            \
        }                                                                                                              \
    }

STEADY(6, 3)
STEADY(7, 4)
STEADY(9, 6)
