/* The loop of utank_hil/analysis/loop/loop_ticks.py with a predictive law that measures the roll,
   for comparison of speed: linear ship, waves by phasors, level observer, limiter, delay. */
#include <math.h>
#include <stdlib.h>

typedef struct {
  double pressure, rate_step, level, power, brake, sharpness, lookahead, stiffness, frequency, area;
  double period, pole, inertia, loss;
} parameters;

static double limited(const parameters *p, double desired, double level, double rate,
                      double *command) {
  double most = p->pressure, flow = p->area * fabs(rate), target;
  if (flow == 0) {
    target = fmin(fmax(desired, -most), most);
  } else {
    double way = copysign(1.0, rate), speed = fabs(rate);
    double ahead = way * level + speed * p->lookahead, room = p->level - ahead, barrier = -most;
    if (room > 1e-3) {
      double swing = speed / p->frequency;
      double touch = (p->level * p->level - ahead * ahead - swing * swing) / (2 * room);
      double brake = p->brake * most;
      barrier = fmin(fmax(-brake + p->sharpness * (p->stiffness * touch + brake), -most), most);
    }
    target = way * fmax(fmin(way * desired, fmin(fmin(most, barrier), p->power / flow)), -most);
  }
  *command = fmin(fmax(target, *command - p->rate_step), *command + p->rate_step);
  return *command;
}

/* Sum of the squares of the roll; step is 5 by 7: of the state, the command and the wave moment. */
double run(const parameters *p, const double *step, int waves, const double *amplitude,
           const double *frequency, const double *phase, int order, const double *input_gains,
           const double *output_gains, double keep, int delay, int sample, int ticks, double tick) {
  double *memory = malloc((4 * (size_t)waves + 2 * (size_t)order) * sizeof(double));
  double *restrict re = memory, *restrict im = re + waves, *restrict c = im + waves,
         *restrict s = c + waves, *past_u = s + waves, *past_y = past_u + order;
  for (int j = 0; j < waves; j++) {
    re[j] = amplitude[j] * cos(phase[j]), im[j] = amplitude[j] * sin(phase[j]);
    c[j] = cos(frequency[j] * tick), s[j] = sin(frequency[j] * tick);
  }
  for (int j = 0; j < 2 * order; j++) past_u[j] = 0;
  double state[5] = {0}, late[64] = {0}, level = 0, rate = 0, wish = 0, command = 0, squares = 0,
         sum = 0, washed = 0, before = 0;
  double alpha = 1 - p->pole * p->pole, beta = (1 - p->pole) * (1 - p->pole);
  for (int k = 0; k < ticks; k++) {
    squares += state[0] * state[0];
    if (k % 2 == 0) {
      double gain = (state[4] - p->stiffness * level - p->loss * rate) / p->inertia * p->period;
      level += (rate + gain / 2) * p->period, rate += gain;
      double surprise = state[2] - level;
      level += alpha * surprise, rate += beta / p->period * surprise;
    }
    if (k % sample == 0) {
      if (k) past_u[0] = sum / sample;
      sum = 0;
      for (int j = order - 1; j > 0; j--) past_y[j] = past_y[j - 1];
      washed = keep * (washed + state[0] - before), before = state[0];
      past_y[0] = washed, wish = 0;
      for (int j = 0; j < order; j++) wish += input_gains[j] * past_u[j] + output_gains[j] * past_y[j];
      for (int j = order - 1; j > 0; j--) past_u[j] = past_u[j - 1];
      past_u[0] = wish;
    }
    sum += late[k % (delay + 1)] = limited(p, wish, level, rate, &command);
    double moment = 0, next[5], now = late[(k + 1) % (delay + 1)];
    for (int j = 0; j < waves; j++) {
      double turned = re[j] * c[j] - im[j] * s[j];
      im[j] = re[j] * s[j] + im[j] * c[j], re[j] = turned, moment += turned;
    }
    for (int i = 0; i < 5; i++) {
      const double *row = step + 7 * i;
      next[i] = row[5] * now + row[6] * moment;
      for (int j = 0; j < 5; j++) next[i] += row[j] * state[j];
    }
    for (int i = 0; i < 5; i++) state[i] = next[i];
  }
  free(memory);
  return squares;
}
