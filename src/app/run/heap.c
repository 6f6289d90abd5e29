#include "app/run/heap.h"

#include <errno.h>
#include <stddef.h>
#include <stdlib.h>

/* Initial-exec: a thread's first look at these must not itself allocate. */
static _Thread_local bool armed __attribute__((tls_model("initial-exec")));
static _Thread_local uint64_t calls __attribute__((tls_model("initial-exec")));

void fv_heap_arm(void)
{
    calls = 0;
    armed = true;
}

void fv_heap_disarm(void)
{
    armed = false;
}

uint64_t fv_heap_calls(void)
{
    return calls;
}

#if defined(FOVEA_SANITIZED) || !defined(__GLIBC__)

bool fv_heap_counted(void)
{
    return false;
}

#else

bool fv_heap_counted(void)
{
    return true;
}

/* glibc's own names for what stands behind the public ones. */
void *__libc_malloc(size_t bytes);
void *__libc_calloc(size_t count, size_t bytes);
void *__libc_realloc(void *memory, size_t bytes);
void __libc_free(void *memory);
void *__libc_memalign(size_t alignment, size_t bytes);
void *
memalign(size_t alignment,
         size_t bytes); /* declared in malloc.h with attributes that differ between versions */

void *malloc(size_t bytes)
{
    calls += armed;
    return __libc_malloc(bytes);
}

void *calloc(size_t count, size_t bytes)
{
    calls += armed;
    return __libc_calloc(count, bytes);
}

void *realloc(void *memory, size_t bytes)
{
    calls += armed;
    return __libc_realloc(memory, bytes);
}

void free(void *memory)
{
    calls += armed;
    __libc_free(memory);
}

void *memalign(size_t alignment, size_t bytes)
{
    calls += armed;
    return __libc_memalign(alignment, bytes);
}

void *aligned_alloc(size_t alignment, size_t bytes)
{
    calls += armed;
    return __libc_memalign(alignment, bytes);
}

int posix_memalign(void **memory, size_t alignment, size_t bytes)
{
    calls += armed;
    if (alignment % sizeof(void *) != 0 || (alignment & (alignment - 1)) != 0 || alignment == 0)
        return EINVAL;
    void *taken = __libc_memalign(alignment, bytes);
    if (taken == NULL) return ENOMEM;
    *memory = taken;
    return 0;
}

#endif
