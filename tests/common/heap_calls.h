/* The C library's heap, where each call calls on_heap_call() first, and free() on_heap_free();
 * whoever includes this defines them. For one file of a program, or of a preloaded object. */
#ifndef FOVEA_TESTS_HEAP_CALLS_H
#define FOVEA_TESTS_HEAP_CALLS_H

#include <errno.h>
#include <stddef.h>
#include <stdlib.h>

static void on_heap_call(void);
static void on_heap_free(void);

void *__libc_malloc(size_t bytes);
void *__libc_calloc(size_t count, size_t bytes);
void *__libc_realloc(void *old, size_t bytes);
void *__libc_memalign(size_t alignment, size_t bytes);
void __libc_free(void *memory);

void *malloc(size_t bytes)
{
    on_heap_call();
    return __libc_malloc(bytes);
}

void *calloc(size_t count, size_t bytes)
{
    on_heap_call();
    return __libc_calloc(count, bytes);
}

void *realloc(void *old, size_t bytes)
{
    on_heap_call();
    return __libc_realloc(old, bytes);
}

void free(void *memory)
{
    on_heap_free();
    __libc_free(memory);
}

int posix_memalign(void **piece, size_t alignment, size_t bytes)
{
    on_heap_call();
    *piece = __libc_memalign(alignment, bytes);
    return *piece == NULL ? ENOMEM : 0;
}

void *aligned_alloc(size_t alignment, size_t bytes)
{
    on_heap_call();
    return __libc_memalign(alignment, bytes);
}

#endif
