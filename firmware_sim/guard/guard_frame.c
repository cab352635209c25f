/* Which frames count: see guard.h. */
#include "guard.h"

#define MOST_LOST 3U /* frames that may be missing between two that count */
#define RESYNC 3U    /* frames in sequence after which another counter counts */

static uint32_t crc_with(uint32_t crc, uint8_t byte, uint8_t polynomial)
{
    uint32_t next = crc ^ byte;
    uint32_t bit;
    for (bit = 0U; bit < 8U; bit++) {
        next = ((next & 0x80U) != 0U) ? (((next << 1) ^ polynomial) & 0xFFU) : (next << 1);
    }
    return next;
}

uint8_t guard_crc8(const uint8_t *data, uint8_t length, const struct guard_crc *how)
{
    uint32_t crc = how->start;
    uint32_t place;
    for (place = 0U; place < length; place++) {
        if (place != how->at) {
            crc = crc_with(crc, data[place], how->polynomial);
        }
    }
    return (uint8_t)(crc ^ how->final);
}

/* Whether a native frame is whole: CRC-8 over its bytes and its data ID. */
bool guard_intact(const uint8_t *data, uint8_t data_id)
{
    uint32_t crc = 0xFFU;
    uint32_t place;
    for (place = 1U; place < 8U; place++) {
        crc = crc_with(crc, data[place], 0x2FU);
    }
    crc = crc_with(crc, data_id, 0x2FU);
    return data[0] == (crc ^ 0xFFU);
}

/* Cycles since the last frame that counted, 0 if this one does not. */
uint8_t guard_accepted(struct guard_stream *stream, uint8_t counter)
{
    uint8_t cycles = GUARD_NO_COUNTER;
    if (stream->expected != GUARD_NO_COUNTER) {
        const uint8_t missing = (uint8_t)(((uint32_t)counter - stream->expected) & 15U);
        if (missing <= MOST_LOST) {
            cycles = (uint8_t)(missing + 1U);
        } else {
            if (counter != stream->candidate) {
                stream->run = 0U;
            }
            stream->run++;
            stream->candidate = (uint8_t)((counter + 1U) & 15U);
            cycles = (stream->run < RESYNC) ? 0U : GUARD_NO_COUNTER;
        }
    }
    if (cycles != 0U) {
        stream->expected = (uint8_t)((counter + 1U) & 15U);
        stream->run = 0U;
    }
    return cycles;
}
