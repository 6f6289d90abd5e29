#include "due.h"

#include <stdbool.h>
#include <stdlib.h>

static int64_t stamp_of(const struct fv_due *due, size_t index)
{
    return fovea_sample_stamp(&due->list[index]);
}

static bool never_falls(const struct fv_due *due)
{
    for (size_t i = 1; i < due->count; i++)
        if (stamp_of(due, i) < stamp_of(due, i - 1)) return false;
    return true;
}

/* The longest row of samples whose stamps never fall, as indices in `row`, by patience sorting:
 * ends[k] is the sample with the least stamp that ends such a row of k + 1, before[i] the one
 * before sample i in the longest row that ends in it. Returns its length. */
static size_t longest_row(const struct fv_due *due, uint32_t *ends, uint32_t *before)
{
    size_t length = 0;
    for (size_t i = 0; i < due->count; i++) {
        size_t low = 0, high = length;
        while (low < high) {
            const size_t middle = low + (high - low) / 2;
            if (stamp_of(due, ends[middle]) > stamp_of(due, i))
                high = middle;
            else
                low = middle + 1;
        }
        if (low > 0) before[i] = ends[low - 1];
        ends[low] = (uint32_t)i;
        if (low == length) length++;
    }
    for (size_t k = length; k-- > 1;) /* now the row itself */
        ends[k - 1] = before[ends[k]];
    return length;
}

/* Within the stamps beside it that are in order, and never falling. */
static void set_due(struct fv_due *due, const uint32_t *row, size_t length)
{
    int64_t before_ns = stamp_of(due, row[0]);
    size_t k = 0;
    for (size_t i = 0; i < due->count; i++) {
        const int64_t stamp_ns = stamp_of(due, i),
                      next_ns = stamp_of(due, row[k < length ? k : length - 1]);
        const int64_t at_ns = stamp_ns < next_ns ? stamp_ns : next_ns;
        if (at_ns > before_ns) before_ns = at_ns;
        due->due_ns[i] = before_ns;
        if (k < length && i == row[k]) k++;
    }
}

enum fovea_status fv_due_open(struct fv_due *due, const struct fovea_sample *list, size_t count,
                              const char *name, struct fovea_error *error)
{
    *due = (struct fv_due){.list = list, .count = count};
    if (never_falls(due)) return FOVEA_OK;
    uint32_t *ends = malloc(count * sizeof *ends), *before = malloc(count * sizeof *before);
    due->due_ns = malloc(count * sizeof *due->due_ns);
    const bool enough = ends != NULL && before != NULL && due->due_ns != NULL;
    if (enough) set_due(due, ends, longest_row(due, ends, before));
    free(ends);
    free(before);
    if (enough) return FOVEA_OK;
    fv_due_close(due);
    return fovea_error_set(error, FOVEA_ERROR_SYSTEM,
                           "%.256s: no memory for the order of %zu samples", name, count);
}

void fv_due_close(struct fv_due *due)
{
    free(due->due_ns);
    *due = (struct fv_due){.list = NULL};
}

int64_t fv_due_at(const struct fv_due *due, size_t index)
{
    return due->due_ns != NULL ? due->due_ns[index] : stamp_of(due, index);
}

void fv_due_start_after(struct fv_due *due, int64_t after_ns)
{
    size_t low = 0, high = due->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (fv_due_at(due, middle) > after_ns)
            high = middle;
        else
            low = middle + 1;
    }
    due->next = low;
}

uint32_t fv_due_take(struct fv_due *due, int64_t until_ns, struct fovea_sample *samples,
                     uint32_t count_max)
{
    uint32_t taken = 0;
    while (taken < count_max && due->next < due->count && fv_due_at(due, due->next) <= until_ns)
        samples[taken++] = due->list[due->next++];
    return taken;
}
