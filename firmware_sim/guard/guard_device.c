/* What devices of other makers say, by the parts of the table: see guard.h. */
#include "guard.h"

#define OLDEST 65535U
#define MOST_VALUE 32000 /* a greater one counts as this: it is beyond every limit */

static uint32_t raw_of(const struct guard_part *part, const uint8_t *data)
{
    uint64_t word = 0U; /* no mutate: what is above the message is masked off */
    uint32_t place;
    for (place = 0U; place < part->length; place++) {
        word = (word << 8) | data[part->most_first ? place : (part->length - 1U - place)];
    }
    return (uint32_t)(word >> part->shift) & part->mask;
}

static int32_t value_of(const struct guard_part *part, int64_t counts)
{
    int64_t value = ((counts * part->times) + part->plus) / part->by;
    value = (value > MOST_VALUE) ? MOST_VALUE : value; /* no mutate: it is its bound, or beyond */
    value = (value < -MOST_VALUE) ? -MOST_VALUE : value; /* no mutate: likewise */
    return (int32_t)value;
}

static void take_part(struct guard *guard, uint32_t index, const uint8_t *data)
{
    const struct guard_part *part = &guard->parameters->parts[index];
    const uint32_t raw = raw_of(part, data);
    const bool moved = raw != guard->part_raw[index];
    int64_t counts = (int64_t)raw;
    bool good;
    counts -= ((raw & part->sign_bit) != 0U) ? (2 * (int64_t)part->sign_bit) : 0;
    good = (counts >= part->least) && (counts <= part->most);
    guard->part_raw[index] = raw;
    if (part->place == GUARD_MOVES) {
        guard->part_age[index] = moved ? 0U : guard->part_age[index];
    } else {
        guard->part_age[index] = good ? 0U : OLDEST;
    }
    if (part->place < GUARD_PLACES) {
        guard->same[part->stream] = moved ? 0U : guard->same[part->stream];
        guard->values[part->stream][part->place] = good ? value_of(part, counts) : part->otherwise;
    }
}

uint32_t guard_device_heard(struct guard *guard, uint32_t can_id, const uint8_t *data,
                            uint8_t length)
{
    uint32_t streams = 0U;
    uint32_t index;
    for (index = 0U; index < guard->parameters->part_count; index++) {
        const struct guard_part *part = &guard->parameters->parts[index];
        if (((can_id & part->id_bits) == part->can_id) && (length == part->length)
            && ((part->crc.at >= length) /* no mutate: 255 is none */
                || (data[part->crc.at] == guard_crc8(data, length, &part->crc)))) {
            take_part(guard, index, data);
            streams |= (part->place < GUARD_PLACES) ? ((uint32_t)1U << part->stream) : 0U;
        }
    }
    return streams;
}

bool guard_device_whole(const struct guard *guard, uint32_t stream)
{
    const uint16_t unchanged = guard->parameters->messages[stream].unchanged;
    bool whole = (unchanged == 0U) || (guard->same[stream] <= unchanged);
    uint32_t index;
    for (index = 0U; index < guard->parameters->part_count; index++) {
        const struct guard_part *part = &guard->parameters->parts[index];
        if ((part->stream == stream) && (guard->part_age[index] > part->old)) {
            whole = false;
        }
    }
    return whole;
}
