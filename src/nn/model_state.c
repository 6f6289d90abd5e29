/* Checks of states: that each keeps its bytes from run to run whatever else the file says. */
#include <stdbool.h>
#include <string.h>

#include "nn/model_check.h"

static enum fovea_status fail(const struct fv_model *m, uint32_t state, const char *name,
                              const char *expected, struct fovea_error *error)
{
    return fovea_error_set(
        error, FOVEA_ERROR_INPUT, "%s: byte %zu: state %u is tensor %d, expected %s", name,
        (size_t)m->header->states + 4 * (size_t)state, state, m->states[state], expected);
}

enum fovea_status fv_model_check_state_list(const struct fv_model *m, const char *name,
                                            struct fovea_error *error)
{
    for (uint32_t i = 0; i < m->header->state_count; i++) {
        const int32_t t = m->states[i];
        if (t < 0 || (uint32_t)t >= m->header->tensor_count ||
            (m->tensors[t].flags & FV_TENSOR_CONST) != 0)
            return fail(m, i, name, "one that exists and is no constant", error);
        for (uint32_t k = 0; k < i; k++) {
            if (m->tensors[m->states[k]].storage == m->tensors[t].storage)
                return fail(m, i, name, "one that shares no bytes with another state", error);
        }
    }
    return FOVEA_OK;
}

/* The operators that read and write a storage; how often each of both is done. */
struct use {
    int32_t reader, writer, reads, writes;
};

static struct use use_of(const struct fv_model *m, int32_t storage)
{
    struct use use = {-1, -1, 0, 0};
    for (uint32_t i = 0; i < m->header->op_count; i++) {
        const struct fv_model_op *op = &m->ops[i];
        for (int32_t k = 0; k < op->input_count; k++) {
            if (m->tensors[op->inputs[k]].storage != storage) continue;
            use.reader = (int32_t)i;
            use.reads++;
        }
        for (int32_t k = 0; k < op->output_count; k++) {
            if (m->tensors[op->outputs[k]].storage != storage) continue;
            use.writer = (int32_t)i;
            use.writes++;
        }
        if (op->scratch >= 0 && m->tensors[op->scratch].storage == storage) use.writes++;
    }
    return use;
}

static bool is_listed(const struct fv_model *m, int32_t storage)
{
    for (uint32_t i = 0; i < m->header->input_count; i++) {
        if (m->tensors[m->inputs[i]].storage == storage) return true;
    }
    for (uint32_t i = 0; i < m->header->output_count; i++) {
        if (m->tensors[m->outputs[i]].storage == storage) return true;
    }
    return false;
}

/* Another tensor of the arena has bytes of this storage. */
static bool is_shared(const struct fv_model *m, int32_t storage)
{
    const struct fv_model_tensor *s = &m->tensors[storage];
    for (uint32_t i = 0; i < m->header->tensor_count; i++) {
        const struct fv_model_tensor *t = &m->tensors[i];
        if ((t->flags & FV_TENSOR_CONST) != 0 || t->storage == storage) continue;
        if (t->offset < (int64_t)s->offset + s->bytes && s->offset < (int64_t)t->offset + t->bytes)
            return true;
    }
    return false;
}

static int64_t elements_of(const int32_t *dims, int32_t axes)
{
    int64_t count = 1;
    for (int32_t i = 0; i < axes; i++)
        count *= dims[i];
    return count;
}

/* The operator moves all elements of `from` to `to`, which have one type and one shape. */
static bool moves_all(const struct fv_model *m, int32_t op, int32_t from, int32_t to)
{
    const struct fv_model_op *o = &m->ops[op];
    const struct fv_model_tensor *a = &m->tensors[from], *b = &m->tensors[to];
    return o->kind == FV_OP_COPY && o->inputs[0] == from && o->outputs[0] == to &&
           a->type == b->type && a->rank == b->rank &&
           memcmp(a->dims, b->dims, (size_t)a->rank * sizeof a->dims[0]) == 0 &&
           elements_of(o->u.copy.dims, 6) == elements_of(a->dims, a->rank);
}

enum fovea_status fv_model_check_state_use(const struct fv_model *m, const char *name,
                                           struct fovea_error *error)
{
    for (uint32_t i = 0; i < m->header->state_count; i++) {
        const int32_t t = m->states[i], storage = m->tensors[t].storage;
        const struct use use = use_of(m, storage);
        if (use.reads != 1 || use.writes != 1 || use.reader >= use.writer)
            return fail(m, i, name, "one that one operator reads and a later one writes", error);
        if (!moves_all(m, use.reader, t, m->ops[use.reader].outputs[0]) ||
            !moves_all(m, use.writer, m->ops[use.writer].inputs[0], t))
            return fail(m, i, name, "copies from and to tensors of its type and shape", error);
        if (is_listed(m, storage))
            return fail(m, i, name, "one that is neither input nor output", error);
        if (is_shared(m, storage))
            return fail(m, i, name, "one that shares no bytes of the arena", error);
    }
    return FOVEA_OK;
}
