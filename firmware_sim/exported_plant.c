/* Ship, tank and pump of a scenario in its waves: an FMU for co-simulation, FMI 2.
 *
 * The equations, and the order of their terms, are those of plant_kernel.py, dynamics/kernels.py,
 * dynamics/pump.py and base/elementary.py of utank-hil; plant_data.h holds a scenario's numbers.
 * Compile without contraction of products and sums (-ffp-contract=off) for the same digits.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "plant_data.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD, ERROR };
enum { STRIKES_PER_STEP = 8 };
static const double PI = 3.141592653589793, TICK_S = 1e-2, STEP_S = 1e-3;

typedef struct {
    double speed, reference, integral, pressure, power;
} Pump;

typedef struct {
    double real[REALS];
    int enabled;
    double x[4]; /* roll, its rate, level, its rate */
    Pump pump;
    double ahead[2][4]; /* moment, acceleration over g: at t - 1, t, t + 1, t + 2 ticks */
    double phasors[FORCES][WAVES][2];
    double start_s;
    long long ticks;
    int capsized;
} Plant;

static double exponential(double x) {
    if (!(-745.1332191019412 < x && x < 709.782712893384)) return x < 0 ? 0.0 : x + INFINITY;
    double exponent = floor(x * 1.4426950408889634 + 0.5);
    double high = x - exponent * 6.93147180369123816490e-01;
    double low = exponent * 1.90821492927058770002e-10;
    double r = high - low, z = r * r;
    double c = -1.65339022054652515390e-06 + z * 4.13813679705723846e-08;
    c = 6.61375632143793436117e-05 + z * c;
    c = r - z * (1.66666666666666019037e-01 + z * (-2.77777777770155933842e-03 + z * c));
    return ldexp(1.0 - ((low - r * c / (2.0 - c)) - high), (int)exponent);
}

static void sine_cosine(double angle, double *sine, double *cosine) {
    if (!(fabs(angle) < 1e9)) {
        if (!(fabs(angle) < INFINITY)) {
            *sine = *cosine = NAN;
            return;
        }
        angle = copysign(fmod(fabs(angle), 2 * PI), angle);
    }
    double quarter = floor(angle * (2 / PI) + 0.5);
    double r = (angle - quarter * 1.57079632673412561417) - quarter * 6.07710050650619224932e-11;
    double z = r * r;
    double s = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10;
    s = -1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * s);
    s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * s));
    double c = 2.08757232129817482790e-09 - z * 1.13596475577881948265e-11;
    c = 2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * c);
    c = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * c);
    c = 1 - 0.5 * z + z * z * c;
    int turn = (int)((long long)quarter & 3);
    *sine = turn & 1 ? c : s;
    *cosine = turn & 1 ? s : c;
    if (turn == 2 || turn == 3) *sine = -*sine;
    if (turn == 1 || turn == 2) *cosine = -*cosine;
}

static double within_limits(double x, double limit) {
    return fmin(fmax(x, -limit), limit);
}

static double length(double x, double y) { return sqrt(x * x + y * y); }

static double pump_pressure(double speed, double flow) {
    double u = flow / P.area;
    return P.half_rho_lift * length(P.radius * speed, u) * (P.pitch * speed - u);
}

static double pump_load(double speed, double flow, double *slope) {
    double u = flow / P.area, rn = P.radius * speed, w = length(rn, u) + 1e-9;
    double slip = P.pitch * speed - u;
    double drag = P.pitch * P.half_rho_lift * slip + P.half_rho_friction * P.radius * rn;
    double drag_slope = P.half_rho_lift * P.pitch * P.pitch
        + P.half_rho_friction * P.radius * P.radius;
    *slope = fmax(P.area * (P.radius * rn / w * drag + w * drag_slope), 0.0);
    return P.area * w * drag;
}

static double pump_speed(double pressure, double flow) {
    double u = flow / P.area, wanted = pressure / P.half_rho_lift;
    double a = P.radius / P.pitch, b = sqrt(1.0 + a * a) * fabs(u);
    double slip = 2.0 * wanted / (b + sqrt(b * b + 4.0 * a * fabs(wanted)) + 1e-12);
    double speed = (u + slip) / P.pitch;
    for (int k = 0; k < 8; k++) {
        double w = length(P.radius * speed, u);
        slip = P.pitch * speed - u;
        double slope = w * P.pitch + P.radius * P.radius * speed * slip / (w + 1e-12);
        if (slope < 1e-9) break;
        double change = (w * slip - wanted) / slope;
        speed -= change;
        if (fabs(change) < 1e-12 * fabs(speed)) break;
    }
    return speed;
}

static void drive(Pump *pump, double setpoint, double flow) {
    double target = within_limits(setpoint, P.max_pressure);
    double change = (target - pump->reference) * (1.0 - exponential(-STEP_S / P.reference_lag));
    double reference = pump->reference + within_limits(change, P.max_pressure_rate * STEP_S);
    double error = reference - pump_pressure(pump->speed, flow);
    double demanded_speed = pump_speed(reference + P.gain * error + pump->integral, flow);
    double command = within_limits(demanded_speed, P.max_speed);
    double slope, load = pump_load(pump->speed, flow, &slope);
    double stiffness = P.inertia / STEP_S + slope;
    double share = 1.0 - exponential(-STEP_S * P.speed_bandwidth);
    double demanded = load + stiffness * ((command - pump->speed) * share);
    double torque = 0.0, speed = pump->speed;
    for (int k = 0; k < 2; k++) {
        double fastest = fmax(fmax(fabs(pump->speed), fabs(speed)), 1e-9);
        torque = within_limits(demanded, fmin(P.max_torque, P.max_power / fastest));
        speed = pump->speed + (torque - load) / stiffness;
    }
    if (command == demanded_speed && torque == demanded)
        pump->integral += error * STEP_S / P.integral_time;
    pump->power = torque * (pump->speed + speed) / 2.0;
    pump->speed = speed;
    pump->reference = reference;
    pump->pressure = pump_pressure(speed, flow);
}

static void coast(Pump *pump, double flow) {
    double slope, load = pump_load(pump->speed, flow, &slope);
    double speed = pump->speed - load / (P.inertia / STEP_S + slope);
    *pump = (Pump){speed, 0.0, 0.0, pump_pressure(speed, flow), 0.0};
}

static double righting_moment(double phi) {
    double heel = fabs(phi), righting = 0.0;
    int piece = (int)fmin(heel * PIECES_PER_RAD, PIECES - 1);
    if (piece > 0) heel -= piece / PIECES_PER_RAD;
    for (int k = POWERS - 1; k >= 0; k--) righting = righting * heel + RIGHTING[piece][k];
    return phi < 0 ? -righting : righting;
}

static void accelerations(const double x[4], double moment, double sway, double pump, double valve,
                          double *roll, double *level) {
    double phi = x[0], phi_dot = x[1], h = x[2], h_dot = x[3], sine, cosine;
    sine_cosine(phi, &sine, &cosine);
    double roll_inertia = C.inertia + C.inertia_h2 * h * h;
    double roll_moment = moment + C.wind_moment + (C.offset_moment + C.weight_h * h) * cosine
        - (C.damping + C.quadratic_damping * fabs(phi_dot)) * phi_dot - righting_moment(phi)
        - 2 * C.inertia_h2 * h * h_dot * phi_dot - (C.weight_lever - C.weight_h2 * h * h) * sine
        + sway * (C.weight_h * h * sine + (C.weight_lever - C.weight_h2 * h * h) * cosine);
    double level_force = pump - (C.loss + (C.quadratic_loss + valve) * fabs(h_dot)) * h_dot
        + C.inertia_h2 * h * phi_dot * phi_dot + C.weight_h * sine - 2 * C.weight_h2 * h * cosine
        - sway * (C.weight_h * cosine + 2 * C.weight_h2 * h * sine);
    double scale = 1 / (roll_inertia * C.level_inertia - C.coupling * C.coupling);
    *level = (roll_inertia * level_force - C.coupling * roll_moment) * scale;
    *roll = (C.level_inertia * roll_moment - C.coupling * level_force) * scale;
    if (fabs(h) >= C.level_limit && h * h_dot >= 0 && h * *level > 0) {
        *roll = roll_moment / roll_inertia;
        *level = 0.0;
    }
}

static void rk4(const double x[4], const double moment[3], const double sway[3], double pump,
                double valve, double dt, double after[4]) {
    double v1 = x[1], w1 = x[3], half = 0.5 * dt, sixth = dt / 6, a1, a2, a3, a4, b1, b2, b3, b4;
    accelerations(x, moment[0], sway[0], pump, valve, &a1, &b1);
    double v2 = v1 + half * a1, w2 = w1 + half * b1;
    const double x2[4] = {x[0] + half * v1, v2, x[2] + half * w1, w2};
    accelerations(x2, moment[1], sway[1], pump, valve, &a2, &b2);
    double v3 = v1 + half * a2, w3 = w1 + half * b2;
    const double x3[4] = {x[0] + half * v2, v3, x[2] + half * w2, w3};
    accelerations(x3, moment[1], sway[1], pump, valve, &a3, &b3);
    double v4 = v1 + dt * a3, w4 = w1 + dt * b3;
    const double x4[4] = {x[0] + dt * v3, v4, x[2] + dt * w3, w4};
    accelerations(x4, moment[2], sway[2], pump, valve, &a4, &b4);
    after[0] = x[0] + sixth * (v1 + 2 * (v2 + v3) + v4);
    after[1] = v1 + sixth * (a1 + 2 * (a2 + a3) + a4);
    after[2] = x[2] + sixth * (w1 + 2 * (w2 + w3) + w4);
    after[3] = w1 + sixth * (b1 + 2 * (b2 + b3) + b4);
}

static void part(const double values[3], double begin, double end, double found[3]) {
    double a = values[0], b = values[1], c = values[2], mid = 0.5 * (begin + end);
    double slope = 4 * b - 3 * a - c, curvature = 2 * (a + c - 2 * b);
    found[0] = a + begin * (slope + begin * curvature);
    found[1] = a + mid * (slope + mid * curvature);
    found[2] = a + end * (slope + end * curvature);
}

static void part_of_step(double x[4], const double moments[3], const double sways[3], double pump,
                         double valve, double begin, double end, double time, double after[4]) {
    double moment[3], sway[3];
    part(moments, begin, end, moment);
    part(sways, begin, end, sway);
    rk4(x, moment, sway, pump, valve, time, after);
}

/* Step in which the water strikes a limit of its level. */
static void step_with_impacts(double x[4], const double moments[3], const double sways[3],
                              double pump, double valve, double after[4]) {
    double done = 0.0, limit = C.level_limit, candidate[4];
    for (int strike = 0; strike <= STRIKES_PER_STEP; strike++) {
        double left = 1.0 - done;
        part_of_step(x, moments, sways, pump, valve, done, 1.0, left * STEP_S, after);
        if (fabs(after[2]) <= limit) return;
        double side = copysign(1.0, after[2]), low = 0.0, high = left;
        double g_low = side * x[2] - limit, g_high = side * after[2] - limit;
        for (int k = 0; k < 60; k++) {
            if (g_high < 1e-13 || high - low < 1e-15 || g_low >= 0) break;
            double s = high - g_high * (high - low) / (g_high - g_low);
            part_of_step(x, moments, sways, pump, valve, done, done + s, s * STEP_S, candidate);
            double g = side * candidate[2] - limit;
            if (g > 0) {
                high = s;
                g_high = g;
                memcpy(after, candidate, sizeof candidate);
                g_low *= 0.5;
            } else {
                low = s;
                g_low = g;
                g_high *= 0.5;
            }
        }
        done += high;
        double w = after[3], roll_inertia = C.inertia + C.inertia_h2 * limit * limit;
        double rebound = -C.restitution * w;
        if ((C.restitution < 1 && fabs(rebound) < REST_M_S) || strike == STRIKES_PER_STEP)
            rebound = 0.0;
        x[0] = after[0];
        x[1] = after[1] + -C.coupling / roll_inertia * (rebound - w);
        x[2] = side * (rebound == 0.0 ? limit : limit - INSIDE_M);
        x[3] = rebound;
    }
    part_of_step(x, moments, sways, pump, valve, done, 1.0, (1.0 - done) * STEP_S, after);
    after[2] = copysign(fmin(fabs(after[2]), limit), after[2]);
}

static double interpolated(int row, const double at[4]) {
    const double *w = WEIGHTS[row];
    return w[0] * at[0] + w[1] * at[1] + w[2] * at[2] + w[3] * at[3];
}

static void tick(Plant *plant) {
    double *x = plant->x, external = plant->real[external_moment_nm], after[4];
    double valve = C.area * plant->real[valve_loss_pa_s2_m2];
    double moment[3] = {0, 0, plant->ahead[0][1]}, sway[3] = {0, 0, plant->ahead[1][1]};
    for (int step = 0; step < STEPS && !plant->capsized; step++) {
        double flow = C.area * x[3];
        if (HAS_PUMP && plant->enabled) drive(&plant->pump, plant->real[setpoint_pa], flow);
        else if (HAS_PUMP) coast(&plant->pump, flow);
        moment[0] = moment[2];
        sway[0] = sway[2];
        for (int k = 1; k < 3; k++) {
            moment[k] = interpolated(2 * step + k, plant->ahead[0]);
            sway[k] = interpolated(2 * step + k, plant->ahead[1]);
        }
        double all[3] = {moment[0] + external, moment[1] + external, moment[2] + external};
        double force = C.area * plant->pump.pressure;
        rk4(x, all, sway, force, valve, STEP_S, after);
        if (fabs(after[2]) > C.level_limit) step_with_impacts(x, all, sway, force, valve, after);
        memcpy(x, after, sizeof after);
        plant->capsized = fabs(x[0]) >= PI / 2;
    }
    if (plant->capsized) x[1] = x[3] = 0.0;
    for (int k = 0; k < 2; k++) memmove(plant->ahead[k], plant->ahead[k] + 1, 3 * sizeof(double));
    for (int k = 0; k < FORCES; k++) {
        double total = 0.0;
        for (int n = 0; n < WAVES; n++) {
            double *at = plant->phasors[k][n], re = at[0], c = ROTATIONS[n][0], s = ROTATIONS[n][1];
            at[0] = re * c - at[1] * s;
            at[1] = re * s + at[1] * c;
            total += at[0];
        }
        plant->ahead[k][3] = total;
    }
    plant->ticks++;
}

static void show(Plant *plant) {
    double *real = plant->real;
    real[roll_rad] = plant->x[0];
    real[roll_rate_rad_s] = plant->x[1];
    real[level_m] = plant->x[2];
    real[flow_m3_s] = plant->x[3] * C.area;
    real[pressure_pa] = plant->pump.pressure;
    real[pump_speed_rad_s] = plant->pump.speed;
    real[pump_power_w] = plant->pump.power;
    real[wave_moment_nm] = plant->ahead[0][1];
    real[lateral_m_s2] = GRAVITY_M_S2 * plant->ahead[1][1];
}

/* The interface of FMI 2. */
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger; /* allocation and what else follows is not used */
} Callbacks;

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2SetDebugLogging(void *plant, int on, size_t count, const char *const names[]) {
    return OK;
}

EXPORT int fmi2Reset(void *component) {
    Plant *plant = component;
    memset(plant, 0, sizeof *plant);
    plant->enabled = 1;
    memcpy(plant->ahead, AHEAD, sizeof AHEAD);
    memcpy(plant->phasors, PHASORS, sizeof PHASORS);
    show(plant);
    return OK;
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const Callbacks *callbacks, int visible, int logging) {
    Plant *plant = NULL;
    const char *reason = NULL;
    if (type != 1) reason = "it is for co-simulation only";
    else if (strcmp(guid, GUID)) reason = "its description is of another FMU: the guid differs";
    else if (!(plant = malloc(sizeof *plant))) reason = "no memory is left";
    if (plant) fmi2Reset(plant);
    else if (callbacks && callbacks->logger) callbacks->logger(NULL, name, ERROR, "error", reason);
    return plant;
}

EXPORT void fmi2FreeInstance(void *plant) { free(plant); }

EXPORT int fmi2SetupExperiment(void *plant, int has_tolerance, double tolerance, double start_s,
                               int has_stop, double stop_s) {
    ((Plant *)plant)->start_s = start_s;
    return OK;
}

EXPORT int fmi2EnterInitializationMode(void *plant) { return OK; }
EXPORT int fmi2ExitInitializationMode(void *plant) { return OK; }
EXPORT int fmi2Terminate(void *plant) { return OK; }

EXPORT int fmi2GetReal(void *plant, const unsigned reference[], size_t count, double value[]) {
    for (size_t k = 0; k < count; k++) {
        if (reference[k] >= REALS) return ERROR;
        value[k] = ((Plant *)plant)->real[reference[k]];
    }
    return OK;
}

EXPORT int fmi2SetReal(void *plant, const unsigned reference[], size_t count,
                       const double value[]) {
    for (size_t k = 0; k < count; k++) {
        if (reference[k] >= roll_rad || !isfinite(value[k])) return ERROR;
        ((Plant *)plant)->real[reference[k]] = value[k];
    }
    return OK;
}

EXPORT int fmi2GetBoolean(void *plant, const unsigned reference[], size_t count, int value[]) {
    for (size_t k = 0; k < count; k++) {
        if (reference[k] != 0) return ERROR;
        value[k] = ((Plant *)plant)->enabled;
    }
    return OK;
}

EXPORT int fmi2SetBoolean(void *plant, const unsigned reference[], size_t count,
                          const int value[]) {
    for (size_t k = 0; k < count; k++) {
        if (reference[k] != 0) return ERROR;
        ((Plant *)plant)->enabled = value[k] != 0;
    }
    return OK;
}

/* The ship moves in ticks of 10 ms: outputs are those of the last whole tick. */
EXPORT int fmi2DoStep(void *component, double time_s, double step_s, int no_set_state) {
    Plant *plant = component;
    double ticks = floor((time_s + step_s - plant->start_s) / TICK_S + 1e-6);
    if (!(step_s >= 0 && ticks >= (double)plant->ticks && ticks < 1e15)) return ERROR;
    while ((double)plant->ticks < ticks) tick(plant);
    show(plant);
    return OK;
}

EXPORT int fmi2GetFMUstate(void *plant, void **state) {
    if (!*state && !(*state = malloc(sizeof(Plant)))) return ERROR;
    memcpy(*state, plant, sizeof(Plant));
    return OK;
}

EXPORT int fmi2SetFMUstate(void *plant, void *state) {
    memcpy(plant, state, sizeof(Plant));
    return OK;
}

EXPORT int fmi2FreeFMUstate(void *plant, void **state) {
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT int fmi2SerializedFMUstateSize(void *plant, void *state, size_t *size) {
    *size = sizeof(Plant);
    return OK;
}

EXPORT int fmi2SerializeFMUstate(void *plant, void *state, char bytes[], size_t size) {
    if (size < sizeof(Plant)) return ERROR;
    memcpy(bytes, state, sizeof(Plant));
    return OK;
}

EXPORT int fmi2DeSerializeFMUstate(void *plant, const char bytes[], size_t size, void **state) {
    return size == sizeof(Plant) ? fmi2GetFMUstate((void *)bytes, state) : ERROR;
}

/* What this FMU has not: variables of other types, derivatives, steps that are still under way. */
#define VARIABLES void *plant, const unsigned reference[], size_t count
#define NONE { return count ? ERROR : OK; }
EXPORT int fmi2GetInteger(VARIABLES, int value[]) NONE
EXPORT int fmi2SetInteger(VARIABLES, const int value[]) NONE
EXPORT int fmi2GetString(VARIABLES, const char *value[]) NONE
EXPORT int fmi2SetString(VARIABLES, const char *const value[]) NONE
EXPORT int fmi2SetRealInputDerivatives(VARIABLES, const int order[], const double value[]) NONE
EXPORT int fmi2GetRealOutputDerivatives(VARIABLES, const int order[], double value[]) NONE
EXPORT int fmi2GetDirectionalDerivative(VARIABLES, const unsigned known[], size_t known_count,
                                        const double by[], double value[]) NONE
EXPORT int fmi2CancelStep(void *plant) { return ERROR; }
EXPORT int fmi2GetStatus(void *plant, int kind, int *value) { return DISCARD; }
EXPORT int fmi2GetRealStatus(void *plant, int kind, double *value) { return DISCARD; }
EXPORT int fmi2GetIntegerStatus(void *plant, int kind, int *value) { return DISCARD; }
EXPORT int fmi2GetBooleanStatus(void *plant, int kind, int *value) { return DISCARD; }
EXPORT int fmi2GetStringStatus(void *plant, int kind, const char **value) { return DISCARD; }
