#include "bounds/counter.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

static const volatile uint64_t *count;

bool counter_open(void)
{
    const char *path = getenv("FOVEA_COUNT_FILE");
    const int file = path != NULL ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    if (file < 0) {
        fprintf(stderr, "FOVEA_COUNT_FILE: found '%s', expected a file: run tools/bounds.sh\n",
                path != NULL ? path : "");
        return false;
    }
    void *shared = mmap(NULL, sizeof *count, PROT_READ, MAP_SHARED, file, 0);
    close(file);
    if (shared == MAP_FAILED) return false;
    count = shared;
    const uint64_t before = counter_now();
    if (counter_now() > before) return true;
    fprintf(stderr, "%s: nothing counts there: expected qemu with tools/count/count.c\n", path);
    return false;
}

__attribute__((noinline)) uint64_t counter_now(void)
{
    __asm__ volatile("" ::: "memory");
    const uint64_t now = *count;
    __asm__ volatile("" ::: "memory");
    return now;
}

void counter_clock(void *context, int64_t *wall_ns, int64_t *cpu_ns)
{
    (void)context;
    *wall_ns = *cpu_ns = (int64_t)counter_now();
}

static void nothing(void *context)
{
    (void)context;
}

static uint64_t between(counter_work *work, void *context)
{
    const uint64_t before = counter_now();
    work(context);
    return counter_now() - before;
}

uint64_t counter_of(counter_work *work, void *context)
{
    static uint64_t least;
    if (least == 0) least = between(nothing, NULL);
    const uint64_t took = between(work, context);
    return took > least ? took - least : 0;
}
