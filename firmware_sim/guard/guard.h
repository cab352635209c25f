/* Guard of a pump drive: may the drive's power stay on?
 *
 * Freestanding C99 for a microcontroller between controller and drive, or beside the drive on its
 * safe torque off. It hears the frames that the controller hears, by its own CAN controller, and is
 * called every 10 ms by its own clock. It allocates nothing and calls no library. Numbers are those
 * of the frames: pressure in 8 Pa, roll in 1e-4 rad, roll rate in 3.125e-5 rad/s, level in mm; times
 * are in ticks of 10 ms. The table of parameters is written by `python -m firmware_sim.guard`.
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

/* Reasons to cut, as bits; none allows. */
#define GUARD_WAITING 1U   /* not every message was heard since power-up */
#define GUARD_STOP 2U      /* a station's stop, or the stop loop */
#define GUARD_DISARMED 4U  /* pressure commanded that no operator has armed */
#define GUARD_SILENT 8U    /* a message too old under pressure */
#define GUARD_COMMANDED 16U /* a command beyond its limit of pressure or rate */
#define GUARD_PRESSURE 32U /* the pump presses otherwise than commanded */
#define GUARD_LEVEL 64U    /* a high-level switch, or a level at its limit */
#define GUARD_ROLL 128U    /* roll, heel or roll rate beyond its limit */

struct guard_message {
    uint32_t can_id;
    uint16_t patience; /* greatest age under pressure; 0: its silence is not judged */
    uint8_t data_ids[16];
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
};

struct guard_stream {
    uint16_t age;      /* since the last frame that counts, held at its end */
    uint8_t expected;  /* next counter; 16: none was heard */
    uint8_t candidate; /* counter after the last rejected one */
    uint8_t run;       /* rejected ones in sequence */
};

struct guard {
    const struct guard_parameters *parameters;
    struct guard_stream streams[GUARD_STREAMS];
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
    uint16_t unarmed; /* how long each condition has lasted */
    uint16_t off_command;
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

#endif
