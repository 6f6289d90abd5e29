#include "map/turns.h"

#include <string.h>

void fv_turns_forget(struct fv_turns *turns)
{
    memset(turns, 0, sizeof *turns);
}

void fv_turns_follow(struct fv_turns *turns, const struct fv_turn *since_last,
                     const struct fv_gyro_known *gyro)
{
    if (since_last == NULL) {
        turns->joined = false;
        turns->gyro.bias_sigma = 0;
        return;
    }
    if (gyro->moved_ns != turns->gyro.moved_ns) fv_turns_forget(turns);
    turns->gyro = *gyro;
    if (turns->joined) fv_turn_join(&turns->since, since_last);
}

void fv_turns_keyframe(struct fv_turns *turns, uint64_t number)
{
    if (turns->joined) {
        struct fv_turn_link *link = &turns->links[(turns->first + turns->count) % FV_TURNS_MAX];
        link->from = turns->number;
        link->to = number;
        link->turn = turns->since;
        if (turns->count < FV_TURNS_MAX)
            turns->count++;
        else
            turns->first = (turns->first + 1) % FV_TURNS_MAX;
    }
    turns->joined = true;
    turns->number = number;
    fv_turn_begin(&turns->since, turns->gyro.bias);
}

bool fv_turns_between(const struct fv_turns *turns, uint64_t from, uint64_t to,
                      struct fv_turn *turn)
{
    uint64_t reached = from;
    for (uint64_t i = 0; i < turns->count && reached != to; i++) {
        const struct fv_turn_link *link = &turns->links[(turns->first + i) % FV_TURNS_MAX];
        if (link->from != reached || link->to > to) continue;
        if (reached == from)
            *turn = link->turn;
        else
            fv_turn_join(turn, &link->turn);
        reached = link->to;
    }
    return reached == to && from != to;
}
