/* See guard.h. `reference.py` is the same logic in Python, equal bit for bit. */
#include "guard.h"

#define OLDEST 65535U
#define UNKNOWN 2U       /* a bit of which no frame has told */
#define ZERO 32768       /* raw pressure of 0 Pa */
#define MIDDLE 32000     /* raw roll, rate and level of 0 */
#define COMMAND_AGE 15U  /* three of the drive's own timeouts */
#define FRESH 10U
#define RELEASE 120U     /* from a disarm to zero pressure, 1 s by the controller's ramp */
#define FOLLOW 60U       /* a pump that presses otherwise; the controller ends it after 500 ms */
#define WINDOW 30U       /* half the time in which a pump follows its command */
#define PERSIST 10U      /* of level and roll, so that no spike cuts */
#define HEEL_TICKS 6000  /* a minute */
#define HEEL_SCALE 4096

/* CiA 402 states in which a drive gives no torque. */
#define NOT_READY 0x00U
#define DISABLED 0x40U
#define READY 0x21U
#define SWITCHED_ON 0x23U
#define FAULT 0x08U
#define ENABLE 0x0FU /* control word by which it may press */

#define ACTIVE 3U   /* request of the mode in which the law presses */
#define ASKS 0x08U  /* beside arm, stop and reset: whether it is asked for */

static int32_t word(const uint8_t *data, uint32_t place)
{
    return (int32_t)data[place] + (int32_t)data[place + 1U] * 256;
}

static int32_t magnitude(int32_t value)
{
    return (value < 0) ? -value : value; /* no mutate: of 0 either way is 0 */
}

static int32_t lesser(int32_t one, int32_t other)
{
    return (other < one) ? other : one; /* no mutate: of two equal ones either */
}

static int32_t greater(int32_t one, int32_t other)
{
    return (other > one) ? other : one; /* no mutate: of two equal ones either */
}

static uint16_t longer(uint16_t lasted, bool holds)
{
    uint16_t next = 0U;
    if (holds) {
        next = (lasted < OLDEST) ? (uint16_t)(lasted + 1U) : lasted;
    }
    return next;
}

void guard_start(struct guard *guard, const struct guard_parameters *parameters)
{
    uint32_t index;
    uint8_t *byte = (uint8_t *)guard;
    /* no mutate `1U`: the first byte is of the pointer, set below */
    for (index = 0U; index < (uint32_t)sizeof *guard; index++) {
        byte[index] = 0U;
    }
    guard->parameters = parameters;
    for (index = 0U; index < GUARD_STREAMS; index++) {
        guard->streams[index].age = OLDEST;
        guard->streams[index].expected = GUARD_NO_COUNTER;
        guard->streams[index].candidate = GUARD_NO_COUNTER;
    }
    for (index = 0U; index < GUARD_PARTS; index++) {
        guard->part_age[index] = OLDEST;
    }
    for (index = 0U; index < 2U; index++) {
        guard->arm_bit[index] = UNKNOWN;
        guard->reset_bit[index] = UNKNOWN;
    }
    guard->reasons = GUARD_WAITING;
}

static void take_command(struct guard *guard, const uint8_t *data, uint8_t cycles)
{
    const struct guard_parameters *limits = guard->parameters;
    const int32_t asked = word(data, 2U) - ZERO;
    const int32_t last = guard->command;
    /* no mutate `<`: two equal ones are no step */
    const bool nearer = (magnitude(asked) <= magnitude(last)) && ((asked * last) >= 0);
    if ((magnitude(asked) > limits->pressure)
        || ((!nearer) && (magnitude(asked - last) > (limits->step * (int32_t)cycles)))) {
        guard->bad_command = true;
    }
    guard->command = asked;
    guard->streams[GUARD_COMMAND].age = 0U;
}

/* Stop and disarm act from any whole frame, arm and reset from one that counts. */
static void take_order(struct guard *guard, uint8_t bits, uint32_t station, bool counts)
{
    const uint8_t arm = (uint8_t)(bits & 1U);
    const bool stop = (bits & 2U) != 0U;
    const bool asks = (bits & ASKS) != 0U;
    const uint8_t reset = (uint8_t)((bits >> 2) & 1U);
    if (stop) {
        guard->stop_heard = true;
    }
    if (stop || (((arm == 0U) || (!asks)) && (guard->arm_bit[station] == 1U))) {
        guard->armed = false;
    }
    if (counts) {
        const bool may = (station == 0U) || guard->parameters->second_station;
        if (may) {
            if ((arm == 1U) && (guard->arm_bit[station] == 0U) && asks && (!stop)) {
                guard->armed = true;
            }
            if ((reset == 1U) && (guard->reset_bit[station] == 0U)) {
                guard->reset = true;
            }
        }
        guard->arm_bit[station] = arm;
        guard->reset_bit[station] = reset;
        guard->stop_bit[station] = stop;
        guard->streams[GUARD_ORDER + station].age = 0U;
    }
}

static void take_hardwired(struct guard *guard, const uint8_t *data, uint8_t counts)
{
    const bool open = (data[2] & 3U) != 0U;
    if (open) {
        guard->loop_open = true;
        guard->stop_heard = true;
    }
    if (counts != 0U) {
        guard->hardwired_high = (data[1] & 0xF0U) != 0U;
        if ((data[2] >> 4) <= 1U) {
            guard->loop_open = open;
            guard->streams[GUARD_HARDWIRED].age = 0U;
        }
    }
}

/* The values of a stream; `whole` if they are good and of now. */
static void take_values(struct guard *guard, uint32_t stream, bool whole)
{
    const int32_t *values = guard->values[stream];
    switch (stream) {
    case GUARD_TANK:
        guard->tank_high = (values[2] != 0) || (values[3] != 0);
        guard->level = whole ? (values[1] - values[0]) : guard->level;
        break;
    case GUARD_PUMP:
        guard->pump_pressure = whole ? values[0] : guard->pump_pressure;
        break;
    default:
        guard->roll = whole ? values[0] : guard->roll;
        guard->roll_rate = whole ? values[1] : guard->roll_rate;
        break;
    }
    if (whole) {
        guard->streams[stream].age = 0U;
    }
}

static void take(struct guard *guard, uint32_t stream, const uint8_t *data, uint8_t cycles)
{
    const int32_t first = word(data, 2U);
    const int32_t second = word(data, 4U);
    const bool known = magnitude(first - ZERO) <= 31250;
    const bool good = (data[1] >> 4) <= 1U;
    int32_t *values = guard->values[stream];
    switch (stream) {
    case GUARD_COMMAND:
        take_command(guard, data, cycles);
        break;
    case GUARD_DRIVE:
        guard->drive_state = data[6];
        if (known) {
            guard->drive_pressure = first - ZERO;
            guard->streams[stream].age = 0U;
        }
        break;
    case GUARD_TANK:
        values[0] = first;
        values[1] = second;
        values[2] = (int32_t)data[1] & 0xF0; /* no mutate: [3] counts alike */
        take_values(guard, stream,
                    ((data[6] & 15U) <= 1U) && (first >= 2000) && (first <= 62000)
                        && (second >= 2000) && (second <= 62000));
        break;
    case GUARD_PUMP:
        values[0] = first - ZERO;
        take_values(guard, stream, known && good);
        break;
    default:
        values[0] = first - MIDDLE;
        values[1] = second - MIDDLE;
        take_values(guard, stream, good && (first <= (2 * MIDDLE)) && (second <= (2 * MIDDLE)));
        break;
    }
}

/* What a device of another maker says. */
static void take_device(struct guard *guard, uint32_t stream)
{
    const bool whole = guard_device_whole(guard, stream);
    const int32_t *values = guard->values[stream];
    const uint32_t word_402 = (uint32_t)values[0];
    uint32_t bits = ASKS; /* its arm is that of ACTIVE */
    uint32_t place;
    switch (stream) {
    case GUARD_COMMAND:
        guard->command = ((word_402 & 0x8FU) == ENABLE) ? guard->parameters->pressure : 0;
        guard->streams[stream].age = 0U;
        break;
    case GUARD_DRIVE: /* in some states the bit of quick stop does not count */
        guard->drive_state = (uint8_t)(word_402 & (((word_402 & 7U) == 0U) ? 0x4FU : 0x6FU));
        guard->streams[stream].age = 0U;
        break;
    case GUARD_ORDER:
        for (place = 0U; place < 3U; place++) { /* no mutate: there is no fourth */
            bits |= (values[place] != 0) ? ((uint32_t)1U << place) : 0U;
        }
        take_order(guard, (uint8_t)bits, 0U, whole);
        break;
    default:
        take_values(guard, stream, whole);
        break;
    }
}

void guard_receive(struct guard *guard, uint32_t can_id, const uint8_t *data, uint8_t length)
{
    uint32_t devices;
    uint32_t stream = 0U;
    while ((stream < GUARD_STREAMS)
           && (guard->parameters->messages[stream].can_id != can_id)) {
        stream++;
    }
    if ((stream < GUARD_STREAMS) && (length == 8U)) {
        const uint8_t counter = (uint8_t)(data[1] & 15U);
        if (guard_intact(data, guard->parameters->messages[stream].data_ids[counter])) {
            const uint8_t cycles = guard_accepted(&guard->streams[stream], counter);
            if ((stream == GUARD_ORDER) || (stream == GUARD_ORDER_2)) {
                const uint8_t asks = ((data[1] >> 4) == ACTIVE) ? ASKS : 0U;
                take_order(guard, (uint8_t)((data[2] & 7U) | asks), stream - GUARD_ORDER,
                           cycles != 0U);
            } else if (stream == GUARD_HARDWIRED) {
                take_hardwired(guard, data, cycles);
            } else if (cycles != 0U) {
                take(guard, stream, data, cycles);
            } else {
                /* a frame out of sequence says nothing */
            }
        }
    }
    devices = guard_device_heard(guard, can_id, data, length);
    for (stream = 0U; stream < GUARD_STREAMS; stream++) { /* no mutate: no bit is beyond */
        if (((devices >> stream) & 1U) != 0U) {
            take_device(guard, stream);
        }
    }
}

static uint16_t younger(const struct guard *guard, uint32_t first, uint32_t second)
{
    const uint16_t age = guard->streams[first].age;
    const uint16_t other = guard->streams[second].age;
    return (other < age) ? other : age; /* no mutate: of two equal ones either */
}

/* Whether a message that is awaited is older than its patience. */
static bool old(const struct guard *guard, uint32_t index)
{
    const uint16_t patience = guard->parameters->messages[index].patience;
    return (patience != 0U) && (guard->streams[index].age > patience);
}

/* Of two that stand for each other, whether both are, or the first where no second is awaited. */
static bool both_old(const struct guard *guard, uint32_t first, uint32_t second)
{
    const bool waits = guard->parameters->messages[second].patience != 0U;
    return old(guard, first) && ((!waits) || old(guard, second));
}

static bool silent(const struct guard *guard)
{
    return old(guard, GUARD_COMMAND) || old(guard, GUARD_DRIVE)
           || both_old(guard, GUARD_MOTION, GUARD_MOTION_2) || old(guard, GUARD_TANK)
           || old(guard, GUARD_PUMP) || both_old(guard, GUARD_ORDER, GUARD_ORDER_2)
           || old(guard, GUARD_HARDWIRED);
}

static int32_t commanded(const struct guard *guard)
{
    return (guard->streams[GUARD_COMMAND].age <= COMMAND_AGE) ? guard->command : 0;
}

/* Keep the least and the most of the commands, and zero, of this window and the last. */
static void note_command(struct guard *guard, int32_t command)
{
    guard->window++;
    if (guard->window >= WINDOW) {
        guard->window = 0U;
        guard->least[1] = guard->least[0];
        guard->most[1] = guard->most[0];
        guard->least[0] = 0;
        guard->most[0] = 0;
    }
    guard->least[0] = lesser(guard->least[0], command);
    guard->most[0] = greater(guard->most[0], command);
}

static bool is_off(const struct guard *guard, int32_t pressure, int32_t error)
{
    int32_t least = lesser(guard->least[0], guard->least[1]);
    int32_t most = greater(guard->most[0], guard->most[1]);
    if (guard->parameters->torque_drive) {
        most = (guard->unarmed > RELEASE) ? 0 : commanded(guard);
        least = -most;
    }
    return (pressure < (least - error)) || (pressure > (most + error));
}

uint8_t guard_tick(struct guard *guard)
{
    const struct guard_parameters *limits = guard->parameters;
    uint32_t index;
    uint32_t reasons = 0U;
    int32_t error = limits->error;
    bool off = false;
    bool drive_heard;
    bool live;
    bool pressing;
    for (index = 0U; index < GUARD_STREAMS; index++) {
        guard->streams[index].age = longer(guard->streams[index].age, true);
        guard->same[index] = longer(guard->same[index], true);
    }
    for (index = 0U; index < GUARD_PARTS; index++) {
        guard->part_age[index] = longer(guard->part_age[index], true);
    }
    note_command(guard, commanded(guard));
    if (younger(guard, GUARD_MOTION, GUARD_MOTION_2) <= FRESH) {
        guard->heel += ((guard->roll * HEEL_SCALE) - guard->heel) / HEEL_TICKS;
    }
    drive_heard = guard->streams[GUARD_DRIVE].age <= limits->messages[GUARD_DRIVE].patience;
    live = (!drive_heard)
           || ((guard->drive_state != NOT_READY) && (guard->drive_state != DISABLED)
               && (guard->drive_state != READY) && (guard->drive_state != SWITCHED_ON)
               && (guard->drive_state != FAULT));
    guard->unarmed = longer(guard->unarmed, !guard->armed);
    pressing = live && (guard->command != 0);
    if (limits->torque_drive && (guard->unarmed > RELEASE)) {
        pressing = false; /* enabled without pressure, as in PASSIVE; what it presses tells */
    }
    /* A drive may say that it is off and press: what it does counts. Off, its rotor turns freely. */
    if ((!drive_heard) || (!live)) {
        error += (magnitude(guard->level) * limits->free_rotor) / 2000;
    }
    if (drive_heard && is_off(guard, guard->drive_pressure, error)) {
        off = true;
    }
    if ((guard->streams[GUARD_PUMP].age <= FRESH) && is_off(guard, guard->pump_pressure, error)) {
        off = true;
    }
    guard->off_command = longer(guard->off_command, off);
    guard->high = longer(guard->high, guard->tank_high || guard->hardwired_high
                                          || (magnitude(guard->level) > limits->level));
    guard->rolled = longer(guard->rolled, (magnitude(guard->roll) > limits->roll)
                                              || (magnitude(guard->roll_rate) > limits->roll_rate));
    if (guard->stop_heard || guard->loop_open || guard->stop_bit[0] || guard->stop_bit[1]) {
        reasons |= GUARD_STOP;
    }
    reasons |= (pressing && (guard->unarmed > RELEASE)) ? GUARD_DISARMED : 0U;
    reasons |= (pressing && silent(guard)) ? GUARD_SILENT : 0U;
    reasons |= (live && guard->bad_command) ? GUARD_COMMANDED : 0U;
    reasons |= (guard->off_command > FOLLOW) ? GUARD_PRESSURE : 0U;
    reasons |= (guard->high > PERSIST) ? GUARD_LEVEL : 0U;
    reasons |= ((guard->rolled > PERSIST)
                || (magnitude(guard->heel) > (limits->heel * HEEL_SCALE)))
                   ? GUARD_ROLL
                   : 0U;
    if ((guard->reasons == GUARD_WAITING) && (!silent(guard))) {
        guard->reasons = 0U;
    }
    if (!drive_heard) { /* nobody knows what it does; it is waited for again */
        guard->reasons |= GUARD_WAITING;
    }
    if (guard->reset && (reasons == 0U)) {
        guard->reasons &= GUARD_WAITING;
    }
    guard->reasons |= (uint8_t)reasons;
    if (guard->reasons != 0U) {
        guard->armed = false;
    }
    guard->reset = false;
    guard->stop_heard = false;
    guard->bad_command = false;
    return guard->reasons;
}
