/* Which frames count: see guard.h. */
#include "guard.h"

#define MOST_LOST 3U /* frames that may be missing between two that count */
#define RESYNC 3U    /* frames in sequence after which another counter counts */

uint8_t guard_crc8(const uint8_t *data, uint8_t length, const struct guard_crc *how)
{
    uint32_t crc = how->start;
    uint32_t place;
    uint32_t bit;
    for (place = 0U; place < length; place++) {
        if (place != how->at) {
            crc ^= data[place];
            for (bit = 0U; bit < 8U; bit++) {
                crc = ((crc & 0x80U) != 0U) ? (((crc << 1) ^ how->polynomial) & 0xFFU) : (crc << 1);
            }
        }
    }
    return (uint8_t)(crc ^ how->final);
}

/* Whether a native frame is whole: CRC-8 over its bytes and its data ID. */
bool guard_intact(const uint8_t *data, uint8_t data_id)
{
    static const struct guard_crc how = {0U, 0x2FU, 0xFFU, 0xFFU};
    uint8_t bytes[9];
    uint32_t place;
    for (place = 0U; place < 8U; place++) {
        bytes[place] = data[place];
    }
    bytes[8] = data_id;
    return data[0] == guard_crc8(bytes, 9U, &how);
}

/* Cycles since the last frame that counted, 0 if this one does not. */
uint8_t guard_accepted(struct guard_stream *stream, uint8_t counter)
{
    uint8_t cycles = GUARD_NO_COUNTER;
    if (stream->expected != GUARD_NO_COUNTER) {
        const uint8_t missing = (uint8_t)((counter + 16U - stream->expected) & 15U);
        if (missing <= MOST_LOST) {
            cycles = (uint8_t)(missing + 1U);
        } else {
            stream->run = (counter == stream->candidate) ? (uint8_t)(stream->run + 1U) : 1U;
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
