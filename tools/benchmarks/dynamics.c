/* The nonlinear coupled model of utank_hil/dynamics/kernels.py, for comparison of speed.
   Same equations, same steps, same phasors; a strike at a level limit ends the run with code 1. */
#include <math.h>
#include <stdlib.h>

typedef struct {
  double inertia, inertia_h2, coupling, level_inertia, weight_lever, weight_h, weight_h2, damping,
      quadratic_damping, offset_moment, wind_moment, area, loss, quadratic_loss, level_limit,
      restitution, ship_inertia;
} coefficients;

static inline void accelerations(const coefficients *c, double per_piece, int pieces, int powers,
                                 const double *table, double phi, double phi_dot, double h,
                                 double h_dot, double moment, double pump, double valve,
                                 double *phi_ddot, double *h_ddot) {
  double sine = sin(phi), cosine = cos(phi), heel = fabs(phi), righting = 0;
  int piece = (int)(heel * per_piece);
  if (piece > pieces - 1) piece = pieces - 1;
  if (piece > 0) heel -= piece / per_piece;
  for (int k = powers - 1; k >= 0; k--) righting = righting * heel + table[piece * powers + k];
  if (phi < 0) righting = -righting;
  double roll_inertia = c->inertia + c->inertia_h2 * h * h;
  double roll_moment = moment + c->wind_moment + (c->offset_moment + c->weight_h * h) * cosine -
                       (c->damping + c->quadratic_damping * fabs(phi_dot)) * phi_dot - righting -
                       2 * c->inertia_h2 * h * h_dot * phi_dot -
                       (c->weight_lever - c->weight_h2 * h * h) * sine;
  double level_force = pump - (c->loss + (c->quadratic_loss + valve) * fabs(h_dot)) * h_dot +
                       c->inertia_h2 * h * phi_dot * phi_dot + c->weight_h * sine -
                       2 * c->weight_h2 * h * cosine;
  double scale = 1 / (roll_inertia * c->level_inertia - c->coupling * c->coupling);
  *h_ddot = (roll_inertia * level_force - c->coupling * roll_moment) * scale;
  if (fabs(h) >= c->level_limit && h * h_dot >= 0 && h * *h_ddot > 0) {
    *phi_ddot = roll_moment / roll_inertia;
    *h_ddot = 0;
  } else {
    *phi_ddot = (c->level_inertia * roll_moment - c->coupling * level_force) * scale;
  }
}

int run(const double *row, double per_piece, int pieces, int powers, const double *table, int waves,
        const double *amplitude, const double *frequency, const double *phase, double pressure,
        double valve_loss, int steps, double dt, int refresh, double *state, double *max_roll) {
  const coefficients c = *(const coefficients *)row;
  double *memory = malloc(6 * (size_t)waves * sizeof(double));
  double *restrict re = memory, *restrict im = re + waves, *restrict hc = im + waves,
         *restrict hs = hc + waves, *restrict fc = hs + waves, *restrict fs = fc + waves;
  for (int j = 0; j < waves; j++) {
    hc[j] = cos(frequency[j] * dt / 2), hs[j] = sin(frequency[j] * dt / 2);
    fc[j] = cos(frequency[j] * dt), fs[j] = sin(frequency[j] * dt);
  }
  double x = state[0], v1 = state[1], h = state[2], w1 = state[3], start = 0, biggest = 0;
  double pump = c.area * pressure, valve = c.area * valve_loss, half = dt / 2, sixth = dt / 6;
  int code = 0;
  for (int i = 0; i < steps; i++) {
    if (i % refresh == 0) {
      start = 0;
      for (int j = 0; j < waves; j++) {
        double angle = frequency[j] * (i * dt) + phase[j];
        re[j] = amplitude[j] * cos(angle), im[j] = amplitude[j] * sin(angle);
        start += re[j];
      }
    }
    double middle = 0, end = 0;
    for (int j = 0; j < waves; j++) {
      middle += re[j] * hc[j] - im[j] * hs[j];
      double turned = re[j] * fc[j] - im[j] * fs[j];
      im[j] = re[j] * fs[j] + im[j] * fc[j];
      re[j] = turned;
      end += turned;
    }
    double a1, b1, a2, b2, a3, b3, a4, b4;
#define RATES(x, v, h, w, moment, a, b) \
  accelerations(&c, per_piece, pieces, powers, table, x, v, h, w, moment, pump, valve, a, b)
    RATES(x, v1, h, w1, start, &a1, &b1);
    double v2 = v1 + half * a1, w2 = w1 + half * b1;
    RATES(x + half * v1, v2, h + half * w1, w2, middle, &a2, &b2);
    double v3 = v1 + half * a2, w3 = w1 + half * b2;
    RATES(x + half * v2, v3, h + half * w2, w3, middle, &a3, &b3);
    double v4 = v1 + dt * a3, w4 = w1 + dt * b3;
    RATES(x + dt * v3, v4, h + dt * w3, w4, end, &a4, &b4);
    x += sixth * (v1 + 2 * (v2 + v3) + v4);
    h += sixth * (w1 + 2 * (w2 + w3) + w4);
    v1 += sixth * (a1 + 2 * (a2 + a3) + a4);
    w1 += sixth * (b1 + 2 * (b2 + b3) + b4);
    start = end;
    biggest = fmax(biggest, fabs(x));
    if (fabs(h) > c.level_limit) {
      code = 1;
      break;
    }
  }
  state[0] = x, state[1] = v1, state[2] = h, state[3] = w1;
  *max_roll = biggest;
  free(memory);
  return code;
}
