/* Offsets count from the UDP header, where the kernel starts a UDP socket's filter. A load beyond
 * the packet drops it, so a channel is compared only where its name and zero fit. */
#include "app/network/receiver_filter.h"

#include <errno.h>
#include <linux/if_packet.h>
#include <string.h>
#include <sys/socket.h>

enum { UDP_HEADER_BYTES = 8, PASS_ALL = 0x7fffffff };

static void emit(struct fv_filter *filter, uint16_t code, uint8_t yes, uint8_t no, uint32_t k)
{
    filter->code[filter->length++] = (struct sock_filter){code, yes, no, k};
}

static uint32_t big_endian(const uint8_t *at, size_t bytes)
{
    uint32_t value = 0;
    for (size_t i = 0; i < bytes; i++)
        value = value << 8 | at[i];
    return value;
}

/* Go on where the packet is of the wanted origin; 5 instructions. */
static void emit_origin(struct fv_filter *filter, bool from_host, unsigned lo)
{
    emit(filter, BPF_LD | BPF_W | BPF_ABS, 0, 0, (uint32_t)(SKF_AD_OFF + SKF_AD_PKTTYPE));
    emit(filter, BPF_JMP | BPF_JEQ | BPF_K, from_host ? 3 : 2, 0, PACKET_LOOPBACK);
    emit(filter, BPF_LD | BPF_W | BPF_ABS, 0, 0, (uint32_t)(SKF_AD_OFF + SKF_AD_IFINDEX));
    emit(filter, BPF_JMP | BPF_JEQ | BPF_K, from_host ? 1 : 0, from_host ? 0 : 1, lo);
    emit(filter, BPF_RET | BPF_K, 0, 0, 0);
}

/* Pass where the packet's channel is that of `row`, else go on behind. Of a pattern what stands
 * before its first star is compared; the rest is for fv_table_find. */
static void emit_channel(struct fv_filter *filter, const struct fv_receiver_channel *row)
{
    const char *name = row->name;
    const uint32_t from = UDP_HEADER_BYTES + FV_PACKET_HEADER_BYTES;
    const size_t bytes = row->pattern ? strcspn(name, "*?") : strlen(name) + 1; /* with the zero */
    const unsigned start = filter->length;
    emit(filter, BPF_LD | BPF_W | BPF_LEN, 0, 0, 0);
    emit(filter, BPF_JMP | BPF_JGE | BPF_K, 0, 0, from + (uint32_t)bytes);
    for (size_t at = 0; at < bytes;) {
        const size_t step = bytes - at >= 4 ? 4 : bytes - at >= 2 ? 2 : 1;
        const uint16_t size = step == 4 ? BPF_W : step == 2 ? BPF_H : BPF_B;
        emit(filter, BPF_LD | size | BPF_ABS, 0, 0, from + (uint32_t)at);
        emit(filter, BPF_JMP | BPF_JEQ | BPF_K, 0, 0, big_endian((const uint8_t *)name + at, step));
        at += step;
    }
    emit(filter, BPF_RET | BPF_K, 0, 0, PASS_ALL);
    for (unsigned i = start; i < filter->length; i++)
        if (BPF_CLASS(filter->code[i].code) == BPF_JMP)
            filter->code[i].jf = (uint8_t)(filter->length - i - 1);
}

void fv_filter_build(struct fv_filter *filter, const struct fv_receiver_table *table,
                     bool from_host, unsigned lo)
{
    filter->length = 0;
    emit_origin(filter, from_host, lo);
    emit(filter, BPF_LD | BPF_W | BPF_ABS, 0, 0, UDP_HEADER_BYTES);
    emit(filter, BPF_JMP | BPF_JEQ | BPF_K, 1, 0, FV_PACKET_MAGIC);
    emit(filter, BPF_RET | BPF_K, 0, 0, 0);
    for (uint32_t i = 0; i < table->count; i++)
        emit_channel(filter, &table->rows[i]);
    emit(filter, BPF_RET | BPF_K, 0, 0, 0);
}

int fv_filter_attach(const struct fv_filter *filter, int udp)
{
    const int on = 1;
    struct fv_filter copy = *filter;
    const struct sock_fprog program = {copy.length, copy.code};
    if (setsockopt(udp, SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program) != 0 ||
        setsockopt(udp, SOL_SOCKET, SO_LOCK_FILTER, &on, sizeof on) != 0)
        return errno;
    return 0;
}
