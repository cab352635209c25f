/* Guard of a pump drive: may the drive's power stay on?
 *
 * Freestanding C99 for a microcontroller between controller and drive, or beside the drive on its
 * safe torque off. It hears the frames that the controller hears, by its own CAN controller, and is
 * called every 10 ms by its own clock. It allocates nothing and calls no library. Numbers are those
 * of the frames: pressure in 8 Pa, roll in 1e-4 rad, roll rate in 3.125e-5 rad/s, level in mm; times
 * are in ticks of 10 ms. The table of parameters is written by `python -m firmware_sim.guard`.
 *
 * An identifier has 29 bits, or 11 bits and bit 29; bits 30 and 31 are the number of the bus. Of a
 * device of another maker the table has parts: where a value, a status or a counter stands in its
 * frames, and how the value follows from the counts.
 */
#ifndef GUARD_H
#define GUARD_H

#include <stdbool.h>
#include <stdint.h>

/* Streams: the messages that are heard, and their number. */
#define GUARD_COMMAND 0U
#define GUARD_DRIVE 1U
#define GUARD_MOTION 2U
#define GUARD_MOTION_2 3U
#define GUARD_TANK 4U
#define GUARD_PUMP 5U
#define GUARD_ORDER 6U
#define GUARD_ORDER_2 7U
#define GUARD_HARDWIRED 8U
#define GUARD_STREAMS 9U

/* Places of a stream: motion roll and rate; tank port, starboard and their switches; pump pressure;
 * order arm, stop and reset; drive status word; command control word. Else a part is a condition
 * (4), or a counter or stamp that must move. */
#define GUARD_PLACES 4U
#define GUARD_MOVES 5U
#define GUARD_PARTS 32U /* at most */

/* Reasons to cut, as bits; none allows. */
#define GUARD_WAITING 1U   /* not every message was heard since power-up */
#define GUARD_STOP 2U      /* a station's stop, or the stop loop */
#define GUARD_DISARMED 4U  /* pressure commanded long after a disarm, or never armed */
#define GUARD_SILENT 8U    /* a message too old under pressure */
#define GUARD_COMMANDED 16U /* a command beyond its limit of pressure or rate */
#define GUARD_PRESSURE 32U /* the pump presses otherwise than commanded */
#define GUARD_LEVEL 64U    /* a high-level switch, or a level at its limit */
#define GUARD_ROLL 128U    /* roll, heel or roll rate beyond its limit */

struct guard_message {
    uint32_t can_id;    /* of a device of another maker nobody's */
    uint16_t patience;  /* greatest age under pressure; 0: its silence is not judged */
    uint16_t unchanged; /* time after which values that stand are none; 0: they may */
    uint8_t data_ids[16];
};

struct guard_crc {
    uint8_t at; /* its place; beyond the frame's length there is none */
    uint8_t polynomial;
    uint8_t start;
    uint8_t final;
};

struct guard_part {
    uint32_t can_id;
    uint32_t id_bits; /* those of the identifier that count */
    uint8_t length;   /* of the frame */
    struct guard_crc crc;
    uint8_t stream;
    uint8_t place;
    uint16_t old;      /* age from which it says nothing */
    bool most_first;   /* order of the bytes */
    uint8_t shift;     /* from the least bit of the frame as one number */
    uint32_t mask;     /* bits that count */
    uint32_t sign_bit; /* 0: there is none */
    int64_t least;     /* counts that are a value, or a status that is good */
    int64_t most;
    int64_t times; /* value = (counts * times + plus) / by */
    int64_t plus;
    int64_t by;
    int32_t otherwise; /* where the counts are no value */
};

struct guard_parameters {
    struct guard_message messages[GUARD_STREAMS];
    int32_t pressure;   /* greatest command */
    int32_t step;       /* greatest step of it away from zero, a cycle */
    int32_t error;      /* of the pump against its commands */
    int32_t free_rotor; /* of a pump that may be off besides, per m of level */
    int32_t level;      /* greatest difference of both levels */
    int32_t roll;
    int32_t roll_rate;
    int32_t heel;
    bool second_station; /* whether a second station may arm */
    bool torque_drive;   /* told torque or speed: may press up to the limit, or not at all */
    uint8_t part_count;
    struct guard_part parts[GUARD_PARTS];
};

#define GUARD_NO_COUNTER 16U

struct guard_stream {
    uint16_t age;      /* since the last frame that counts, held at its end */
    uint8_t expected;  /* next counter */
    uint8_t candidate; /* counter after the last rejected one */
    uint8_t run;       /* rejected ones in sequence */
};

struct guard {
    const struct guard_parameters *parameters;
    struct guard_stream streams[GUARD_STREAMS];
    int32_t values[GUARD_STREAMS][GUARD_PLACES];
    uint16_t same[GUARD_STREAMS]; /* since a value of it changed */
    uint16_t part_age[GUARD_PARTS];
    uint32_t part_raw[GUARD_PARTS];
    int32_t command;
    int32_t drive_pressure;
    int32_t pump_pressure;
    int32_t roll;
    int32_t roll_rate;
    int32_t heel; /* mean of the roll over a minute, times 4096 */
    int32_t level;
    int32_t least[2]; /* of the commands in this window and the last, and zero */
    int32_t most[2];
    uint16_t window;
    uint16_t unarmed; /* since a disarm */
    uint16_t off_command; /* how long each condition has lasted */
    uint16_t high;
    uint16_t rolled;
    uint8_t drive_state;
    bool tank_high;
    bool hardwired_high;
    bool loop_open;
    uint8_t arm_bit[2];   /* as accepted last; 2: none was */
    uint8_t reset_bit[2]; /* the same */
    bool stop_bit[2];
    bool armed;
    bool reset;
    bool stop_heard;
    bool bad_command;
    uint8_t reasons; /* latched */
};

void guard_start(struct guard *guard, const struct guard_parameters *parameters);
void guard_receive(struct guard *guard, uint32_t can_id, const uint8_t *data, uint8_t length);
/* Called every 10 ms; returns the reasons to cut, 0 if the drive's power may stay on. */
uint8_t guard_tick(struct guard *guard);

/* guard_frame.c: checksum over all bytes but its own; whether a native frame is whole; cycles since
 * the last frame that counted, 0 if this one does not. */
uint8_t guard_crc8(const uint8_t *data, uint8_t length, const struct guard_crc *how);
bool guard_intact(const uint8_t *data, uint8_t data_id);
uint8_t guard_accepted(struct guard_stream *stream, uint8_t counter);

/* guard_device.c: takes a frame as what devices of other makers say; returns the streams that it has
 * a value of, as bits. */
uint32_t guard_device_heard(struct guard *guard, uint32_t can_id, const uint8_t *data,
                            uint8_t length);
/* Whether all parts of a stream are good and of now. */
bool guard_device_whole(const struct guard *guard, uint32_t stream);

#endif
