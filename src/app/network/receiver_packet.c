#include "app/network/receiver_packet.h"

#include <string.h>

#include "message/fields.h"

const char *fv_drop_name(enum fv_drop reason)
{
    static const char *const names[FV_DROP_COUNT] = {
        [FV_DROP_KERNEL] = "kernel",       [FV_DROP_FRAGMENT] = "fragment",
        [FV_DROP_CHANNEL] = "channel",     [FV_DROP_LONG] = "long",
        [FV_DROP_MALFORMED] = "malformed", [FV_DROP_TYPE] = "type",
        [FV_DROP_INTERFACE] = "interface",
    };
    return names[reason];
}

/* A star that does not fit takes one more byte, and only the last star is tried again: what stands
 * before it fits for good. */
static bool pattern_fits(const char *pattern, const char *name, size_t length)
{
    const char *star = NULL;
    size_t at = 0, from = 0;
    while (at < length) {
        if (*pattern == '*') {
            star = pattern++;
            from = at;
        } else if (*pattern != '\0' && (*pattern == '?' || *pattern == name[at])) {
            pattern++;
            at++;
        } else if (star != NULL) {
            pattern = star + 1;
            at = ++from;
        } else {
            return false;
        }
    }
    while (*pattern == '*')
        pattern++;
    return *pattern == '\0';
}

static bool fits(const struct fv_receiver_channel *row, const char *name, size_t length)
{
    if (row->pattern) return pattern_fits(row->name, name, length);
    return strlen(row->name) == length && memcmp(row->name, name, length) == 0;
}

const struct fv_receiver_channel *fv_table_find(const struct fv_receiver_table *table,
                                                const char *name, size_t length)
{
    for (uint32_t i = 0; i < table->count; i++)
        if (fits(&table->rows[i], name, length)) return &table->rows[i];
    return NULL;
}

size_t fv_table_packet_bytes_max(const struct fv_receiver_table *table)
{
    size_t most = 0;
    for (uint32_t i = 0; i < table->count; i++) {
        const struct fv_receiver_channel *row = &table->rows[i];
        const size_t name = row->pattern ? FV_MESSAGE_CHANNEL_BYTES : strlen(row->name) + 1;
        const size_t bytes = FV_PACKET_HEADER_BYTES + name + row->bytes_max;
        most = bytes > most ? bytes : most;
    }
    return most;
}

void fv_table_drop(struct fv_receiver_table *table, enum fv_drop reason)
{
    atomic_fetch_add_explicit(&table->dropped[reason], 1, memory_order_relaxed);
}

uint32_t fv_table_deliver(struct fv_receiver_table *table, const struct fv_receiver_channel *row,
                          const struct fv_received *received)
{
    const char *problem;
    size_t at;
    if (received->bytes > row->bytes_max) {
        fv_table_drop(table, FV_DROP_LONG);
        return 0;
    }
    if (row->type != NULL &&
        !fv_message_check(row->type, received->data, received->bytes, &problem, &at)) {
        fv_table_drop(table, FV_DROP_TYPE);
        return 0;
    }
    atomic_fetch_add_explicit(&table->taken, 1, memory_order_relaxed);
    row->take(row->context, received);
    return 1;
}

uint32_t fv_packet_take(struct fv_receiver_table *table, const uint8_t *packet, size_t bytes,
                        bool cut, bool from_host)
{
    uint32_t magic = 0;
    for (size_t i = 0; i < 4 && bytes >= FV_PACKET_HEADER_BYTES; i++)
        magic = magic << 8 | packet[i];
    if (magic != FV_PACKET_MAGIC) {
        fv_table_drop(table, magic == FV_PACKET_FRAGMENT ? FV_DROP_FRAGMENT : FV_DROP_MALFORMED);
        return 0;
    }
    const char *name = (const char *)packet + FV_PACKET_HEADER_BYTES;
    const size_t room = bytes - FV_PACKET_HEADER_BYTES;
    const size_t length =
        strnlen(name, room < FV_MESSAGE_CHANNEL_BYTES ? room : FV_MESSAGE_CHANNEL_BYTES);
    if (length == room || length == FV_MESSAGE_CHANNEL_BYTES) { /* no zero where one must be */
        fv_table_drop(table, FV_DROP_MALFORMED);
        return 0;
    }
    const struct fv_receiver_channel *row = fv_table_find(table, name, length);
    if (row == NULL || cut) {
        fv_table_drop(table, row == NULL ? FV_DROP_CHANNEL : FV_DROP_LONG);
        return 0;
    }
    const struct fv_received received = {name, packet + FV_PACKET_HEADER_BYTES + length + 1,
                                         (uint32_t)(room - length - 1), from_host};
    return fv_table_deliver(table, row, &received);
}
